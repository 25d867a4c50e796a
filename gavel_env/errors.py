"""Errors that a user can cause, each with the value, the place and the alternatives."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "AgentNameTaken",
    "BadOption",
    "DataError",
    "GavelError",
    "InstructionError",
    "MalformedAction",
    "MalformedGoal",
    "SceneError",
    "UnknownAgent",
    "UnknownCategory",
    "UnknownConcept",
    "UnknownInstruction",
    "UnknownObject",
    "UnknownOption",
    "UnknownScene",
    "nearest_names",
]


class GavelError(Exception):
    """Base of every error that this project raises about a user's input."""


class DataError(GavelError):
    """A data file is missing, corrupt or of another format version."""


class SceneError(DataError):
    """A scene file or folder is malformed or inconsistent."""


class InstructionError(DataError):
    """An instruction record is malformed, or does not fit its scene."""


class MalformedAction(GavelError):
    """A text that is no action of the nine primitives."""


class MalformedGoal(GavelError):
    """A text that is no goal literal."""


def nearest_names(name: str, known: Iterable[str], count: int = 3) -> tuple[str, ...]:
    """Return up to `count` known names that look like `name`, best first."""
    return tuple(difflib.get_close_matches(name, sorted(known), n=count, cutoff=0.5))


class _UnknownName(GavelError):
    """A name that is not in a closed set; the message offers the nearest ones."""

    what = "name"

    def __init__(self, name: str, known: Iterable[str], place: str = "") -> None:
        known = sorted(known)
        self.name = name
        self.nearest = nearest_names(name, known)
        where = f" in {place}" if place else ""
        if self.nearest:
            hint = "did you mean " + " or ".join(repr(n) for n in self.nearest) + "?"
        elif len(known) <= 20:
            hint = "known: " + ", ".join(known)
        else:
            hint = f"{len(known)} names are known, e.g. {', '.join(known[:5])}"
        super().__init__(f"unknown {self.what} {name!r}{where}; {hint}")


class UnknownScene(_UnknownName):
    """No scene of this name is shipped."""

    what = "scene"


class UnknownCategory(_UnknownName):
    """The ontology has no such category."""

    what = "category"


class UnknownConcept(_UnknownName):
    """The table of concepts has none of this name."""

    what = "concept"


class UnknownObject(_UnknownName):
    """The graph has no such object."""

    what = "object"


class UnknownInstruction(_UnknownName):
    """The instruction file has no such id."""

    what = "instruction"


class UnknownAgent(_UnknownName):
    """No agent of this name is registered."""

    what = "agent"


class UnknownOption(_UnknownName):
    """Nothing takes an option of this name."""

    what = "option"


class BadOption(GavelError):
    """An option has a value that it cannot have, or one that is needed is missing."""


class AgentNameTaken(GavelError):
    """Another agent is registered under this name."""
