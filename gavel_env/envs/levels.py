"""The levels of `Gavel-RL-v0`: from one errand in one room to the multi-task benchmark."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import msgspec

from gavel_env.errors import UnknownLevel, nearest_names
from gavel_env.instructions.record import Instruction, read_instructions, shipped

__all__ = ["LEVELS", "Level", "LevelSplit", "UnknownLevel", "level_instructions"]

LevelSplit = Literal["train", "test"]


class Level(msgspec.Struct, frozen=True, kw_only=True):
    """One level.

    Attributes:
        file: shipped instruction file.
        slots: K.
        literals: most goal literals.
        max_steps: an episode is truncated after so many steps.
        text: what it is, in words.
    """

    file: str
    slots: int
    literals: int
    max_steps: int
    text: str


LEVELS: Mapping[str, Level] = {
    "easy": Level(file="rl", slots=8, literals=4, max_steps=20, text="one errand in one room, nothing shut away"),
    "medium": Level(file="rl", slots=16, literals=4, max_steps=50, text="one errand in a house, doors and machines"),
    "hard": Level(file="rl", slots=24, literals=8, max_steps=150, text="two or three errands in a house"),
    "benchmark": Level(file="multi", slots=32, literals=8, max_steps=300, text="the 500 multi-task instructions"),
}


def find_level(name: str) -> Level:
    """Return a level by name.

    Raises:
        UnknownLevel: with the names there are.
    """
    if name not in LEVELS:
        near = nearest_names(name, LEVELS)
        hint = f"did you mean {near[0]!r}?" if near else f"levels: {', '.join(LEVELS)}"
        raise UnknownLevel(f"no level {name!r}; {hint}")
    return LEVELS[name]


def level_instructions(name: str, split: LevelSplit = "train") -> list[Instruction]:
    """Return the instructions of a level.

    Args:
        name: one of `LEVELS`.
        split: what to train on, or what to test on; the benchmark is for testing and has no other.

    Raises:
        UnknownLevel: no such level or split.
    """
    level = find_level(name)
    if split not in ("train", "test"):
        raise UnknownLevel(f"no split {split!r}; choose 'train' or 'test'")
    records = read_instructions(shipped(level.file)).values()
    if level.file != "rl":
        return list(records)
    return [record for record in records if record.id.startswith(f"{name}-{split}-")]
