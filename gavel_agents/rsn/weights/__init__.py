"""Weights of the location priors, as safetensors."""
