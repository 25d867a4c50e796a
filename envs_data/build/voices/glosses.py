"""Things, furniture and rooms as a person sees them: what writers read instead of category names."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

__all__ = ["piece_gloss", "room_gloss", "thing_gloss"]


@cache
def _glosses() -> Mapping[str, Mapping[str, Any]]:
    loaded: dict[str, dict[str, Any]] = json.loads((Path(__file__).parent / "glosses.json").read_text())
    return loaded


def piece_gloss(category: str, *, several: bool = False) -> str:
    """Return a piece of furniture in words, without an article."""
    return str(_glosses()["furniture"][category][several])


def room_gloss(room_type: str, *, several: bool = False) -> str:
    """Return a type of room in words, without an article."""
    return str(_glosses()["rooms"][room_type][several])


def thing_gloss(category: str) -> str:
    """Return a movable thing in words, without an article."""
    return str(_glosses()["movables"].get(category, category.replace("_", " ")))
