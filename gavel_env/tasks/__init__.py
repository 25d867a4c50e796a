"""Certified instructions: errands by construction, their words, their checks, and a generator of fresh ones."""
