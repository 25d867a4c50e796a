"""BEHAVIOR activities: definitions, how they are grounded in scenes and worded (docs/reference/behavior.md)."""

from __future__ import annotations

from gavel_env.activities.definitions import Activities, Activity, UnknownActivity, load_activities
from gavel_env.activities.english import title_of
from gavel_env.activities.grounding import Grounding, ground
from gavel_env.activities.scope import Ungroundable
from gavel_env.activities.wording import text_of

__all__ = [
    "Activities",
    "Activity",
    "Grounding",
    "Ungroundable",
    "UnknownActivity",
    "ground",
    "load_activities",
    "text_of",
    "title_of",
]
