"""Understandings by name, for command lines and records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from gavel_agents.understanding.base import Understanding
from gavel_agents.understanding.reference import ReferenceUnderstanding
from gavel_agents.understanding.rules import RulesUnderstanding
from gavel_env.errors import GavelError, nearest_names
from gavel_env.instructions import Instruction

__all__ = ["UNDERSTANDINGS", "UnknownUnderstanding", "load_understanding"]


class UnknownUnderstanding(GavelError):
    """No task understanding of this name is there."""


UNDERSTANDINGS: Mapping[str, Callable[[Iterable[Instruction]], Understanding]] = {
    "reference": ReferenceUnderstanding,
    "rules": lambda _instructions: RulesUnderstanding(),
}
"""Name -> how it is made for the instructions of a run, which only the reference looks into."""


def load_understanding(name: str, instructions: Iterable[Instruction] = ()) -> Understanding:
    """Return an understanding by name.

    Raises:
        UnknownUnderstanding: with the alternatives.
    """
    if name not in UNDERSTANDINGS:
        near = nearest_names(name, UNDERSTANDINGS) or tuple(UNDERSTANDINGS)
        raise UnknownUnderstanding(f"unknown understanding {name!r}; known: {', '.join(near)}")
    return UNDERSTANDINGS[name](instructions)
