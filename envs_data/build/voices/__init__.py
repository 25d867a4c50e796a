"""Build `envs_data/instructions/voices.jsonl`: people's own words, written and read blind."""
