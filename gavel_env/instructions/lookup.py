"""Finding the record of an instruction by what an agent knows of it: the text, and the rooms of the house.

The reference understanding and the planners that answer from files look records up in this way. An instruction's id
never reaches an agent's planner: an id could name what the agent is not told.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import Instruction

__all__ = ["About", "InstructionLookup"]


class About(NamedTuple):
    """What is asked about.

    Attributes:
        text: of the instruction.
        rooms: ids of the house's rooms, sorted; they tell houses apart in which the same sentence is said.
    """

    text: str
    rooms: tuple[str, ...] = ()

    @classmethod
    def of(cls, text: str, rooms: Iterable[str]) -> About:
        """Return what is asked about, with the rooms sorted."""
        return cls(text, tuple(sorted(rooms)))


class InstructionLookup:
    """Instruction records by text and rooms."""

    def __init__(self, instructions: Iterable[Instruction] = ()) -> None:
        self._by_text: dict[str, dict[str, Instruction]] = {}
        for instruction in instructions:
            self.add(instruction)

    def add(self, instruction: Instruction) -> None:
        """Take in a record; of two with the same text and scene, the later one counts."""
        self._by_text.setdefault(instruction.text, {})[instruction.scene] = instruction

    def find(self, about: About) -> Instruction | None:
        """Return the record, or None; where several houses share the text, the one whose rooms these are."""
        found = self._by_text.get(about.text, {})
        if len(found) > 1 and about.rooms:
            here = (i for i in found.values() if tuple(sorted(r.id for r in load_scene(i.scene).rooms)) == about.rooms)
            return next(here, None)
        return next(iter(found.values()), None)
