"""BEHAVIOR activities: their definitions, and how they are grounded in scenes and worded."""
