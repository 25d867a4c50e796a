"""Build `envs_data/instructions/voices.jsonl`: instructions in people's own words, written and read blind (docs/voices.md)."""
