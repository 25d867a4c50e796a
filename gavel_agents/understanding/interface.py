"""What understanding an instruction yields: per task its objects O_i, stated relations E_i and goal g_i."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import msgspec

from gavel_agents.llm.interface import Completion
from gavel_env.errors import GavelError
from gavel_env.world_model.goals import Designator, Goal, Literal

__all__ = ["Abstention", "BatchedUnderstanding", "Decomposition", "TaskUnderstanding", "Understanding"]


class Abstention(GavelError):
    """A text is not understood; the message is the typed reason, `kind: detail`."""

    def __init__(self, kind: str, detail: str) -> None:
        self.kind = kind
        super().__init__(f"{kind}: {detail}")


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
        asked: what a language model was asked for it and took for it; None without one.
    """

    tasks: tuple[TaskUnderstanding, ...]
    refused: str = ""
    asked: Completion | None = None


class Understanding(Protocol):
    """Maps a sentence to its tasks; abstains with a reason instead of inventing."""

    name: str

    def understand(self, text: str, instruction_id: str = "") -> Decomposition:
        """Return the tasks of an instruction's text; the id is for implementations that look answers up."""
        ...


@runtime_checkable
class BatchedUnderstanding(Understanding, Protocol):
    """An understanding that is faster with many texts at once."""

    def understand_all(self, texts: Sequence[str], ids: Sequence[str]) -> list[Decomposition]:
        """Return the tasks of every text, in order."""
        ...
