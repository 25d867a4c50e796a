"""What understanding an instruction yields: per task its objects O_i, stated relations E_i and goal g_i."""

from __future__ import annotations

from typing import Protocol

import msgspec

from gavel_env.goals import Designator, Goal, Literal

__all__ = ["Decomposition", "TaskUnderstanding", "Understanding"]


class TaskUnderstanding(msgspec.Struct, frozen=True):
    """One task I_i as understood.

    Attributes:
        text: the task's own sentence.
        objects: O_i, every designator the task speaks of.
        relations: E_i, locations that the sentence states, as positive literals (`inside(potato, fridge)`).
        goal: g_i.
    """

    text: str
    objects: tuple[Designator, ...]
    relations: tuple[Literal, ...]
    goal: Goal


class Decomposition(msgspec.Struct, frozen=True):
    """An instruction's tasks, or why none were understood.

    Attributes:
        tasks: in the order written.
        refused: empty, or the typed reason of the abstention (`unknown_word: frobnicator`).
    """

    tasks: tuple[TaskUnderstanding, ...]
    refused: str = ""


class Understanding(Protocol):
    """Maps a sentence to its tasks; abstains with a reason instead of inventing."""

    name: str

    def understand(self, text: str, instruction_id: str = "") -> Decomposition:
        """Return the tasks of an instruction's text; the id is for implementations that look answers up."""
        ...
