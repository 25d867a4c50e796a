"""What understanding an instruction yields: per task its objects O_i, stated relations E_i and goal g_i."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

import msgspec

from gavel_agents.llm.interface import Completion
from gavel_env.errors import GavelError
from gavel_env.world_model.goals import Designator, Goal, Literal
from gavel_env.world_model.graph import Room

__all__ = [
    "Abstention",
    "BatchedUnderstanding",
    "Decomposition",
    "Question",
    "Rooms",
    "TaskUnderstanding",
    "Understanding",
]

Rooms: TypeAlias = Mapping[str, Room]
"""The rooms of a house by id, as `graph.world.rooms` has them: what is known of it before anything is seen."""


class Question(msgspec.Struct, frozen=True):
    """What an understanding needs to know to go on.

    Attributes:
        key: under which `understand(text, answers={key: answer})` takes the answer.
        asks: the question, in words.
        about: the words of the text that it is about.
        choices: answers that would do, if they can be listed; any other words may do as well.
    """

    key: str
    asks: str
    about: str = ""
    choices: tuple[str, ...] = ()


class Abstention(GavelError):
    """A text is not understood; the message is the typed reason, `kind: detail`.

    Attributes:
        kind: the reason.
        question: what would have to be known to go on, if one fact would do.
    """

    def __init__(self, kind: str, detail: str, question: Question | None = None) -> None:
        self.kind = kind
        self.question = question
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
        question: what would have to be known to go on, if one fact would do.
        passed_over: words and phrases that say nothing about what shall be, in the order written.
        notes: what was said and is not used, with why: stated relations that the house's data cannot tell.
        asked: what a language model was asked for it and took for it; None without one.
    """

    tasks: tuple[TaskUnderstanding, ...]
    refused: str = ""
    question: Question | None = None
    passed_over: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    asked: Completion | None = None

    @classmethod
    def refusal(cls, why: Abstention) -> Decomposition:
        """Return the decomposition that an abstention leaves."""
        return cls((), str(why), why.question)


class Understanding(Protocol):
    """Maps a sentence to its tasks; abstains with a reason instead of inventing."""

    name: str

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of an instruction's text.

        Args:
            text: what was said.
            rooms: of the house, if it is known: they settle what "the office" is.
            answers: to questions that it asked before, by their keys.
        """
        ...


@runtime_checkable
class BatchedUnderstanding(Understanding, Protocol):
    """An understanding that is faster with many texts at once."""

    def understand_all(self, texts: Sequence[str], *, rooms: Sequence[Rooms | None] = ()) -> list[Decomposition]:
        """Return the tasks of every text, in order; `rooms` are those of each text's house, or none at all."""
        ...
