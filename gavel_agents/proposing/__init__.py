"""Plans proposed by a language model: prompts, parsing, complaints, and the loop of Algorithm 1."""
