"""Runs as data sets for training: fine-tuning pairs, preference pairs, trajectories."""
