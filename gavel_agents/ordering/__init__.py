"""Belief-aware task ordering: expected travel, and the order that minimises it."""
