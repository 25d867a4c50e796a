"""Errors that a user can cause, each with the value, the place and the alternatives."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from gymnasium import error

__all__ = [
    "ResetNeeded",
    "AgentNameTaken",
    "BadAction",
    "BadObservation",
    "BadEnvironmentOption",
    "BadOption",
    "BadOwnAction",
    "BadPlacement",
    "BadPlannerSpec",
    "BadPlugin",
    "BadRobotConfig",
    "BadSearchPrior",
    "CategoryError",
    "DataError",
    "EndpointError",
    "GavelError",
    "GraphError",
    "InstructionError",
    "MalformedAction",
    "MalformedGoal",
    "ModelError",
    "NotExpressible",
    "NotInHouse",
    "NotInstalled",
    "NotRecorded",
    "PddlNameError",
    "RunStopped",
    "SceneError",
    "TooManyNodes",
    "UndeclaredCategory",
    "Unencodable",
    "Ungroundable",
    "UnknownActivity",
    "UnknownAgent",
    "UnknownCategory",
    "UnknownConcept",
    "UnknownInstruction",
    "UnknownLevel",
    "UnknownObject",
    "UnknownOption",
    "UnknownPrior",
    "UnknownScene",
    "UnknownUnderstanding",
    "WorkerFailed",
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


class GraphError(DataError):
    """A graph file is malformed or contradicts itself; the message says where in the file."""


class CategoryError(DataError):
    """A table of one's own categories is malformed; the message says where in it."""


class MalformedAction(GavelError):
    """A text that is not an action of the nine primitives."""


class MalformedGoal(GavelError):
    """A text that is not a goal literal."""


_LONGEST_NAME = 200


def nearest_names(name: str, known: Iterable[str], count: int = 3) -> tuple[str, ...]:
    """Return up to `count` known names that look like `name`, best first."""
    if len(name) > _LONGEST_NAME:
        return ()
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
        super().__init__(f"unknown {self.what} {name[:_LONGEST_NAME]!r}{where}; {hint}")


class UnknownScene(_UnknownName):
    """No scene of this name is shipped."""

    what = "scene"


class UnknownCategory(_UnknownName):
    """The ontology has no such category."""

    what = "category"


class UndeclaredCategory(UnknownCategory):
    """A graph of one's own names a category that is not known; the message shows the lines that add it."""

    def __init__(self, name: str, known: Iterable[str], place: str = "") -> None:
        super().__init__(name, known, place)
        alike = sorted((k for k in known if set(k.split("_")) & set(name.split("_"))), key=lambda k: (len(k), k))
        like = [*alike, *self.nearest, "bottle"][0]
        lines = (f"[categories.{name}]", f'like = "{like}"', f'words = ["{name.replace("_", " ")}"]')
        own = "\n".join(f"    {line}" for line in lines)
        self.args = (f"{self.args[0]}\nOr add it to a category file, with what it is like:\n{own}",)


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


class ResetNeeded(GavelError, error.ResetNeeded):
    """`step`, `act` or `render` came before `reset`."""


class BadOption(GavelError):
    """An option has a value that it cannot have, or one that is needed is missing."""


class BadOwnAction(GavelError):
    """An action or state of one's own cannot be added to the table; the message says why."""


class AgentNameTaken(GavelError):
    """Another agent is registered under this name."""


# --- what the world model, the house and the environments read ------------------------------------------------------


class BadEnvironmentOption(GavelError):
    """An argument of the environment, or an option of `reset`, has a value that it cannot have."""


class TooManyNodes(GavelError):
    """A scene has more rooms or objects than the spaces hold."""


class BadAction(GavelError):
    """An action that the action space cannot say, or that has not its form."""


class BadObservation(GavelError):
    """An agent was given something else than the environment's own observation."""


class BadSearchPrior(GavelError):
    """A search prior has a weight that is negative or not a number."""


class BadRobotConfig(GavelError):
    """A field of the robot configuration has a value that no robot can have."""


class PddlNameError(GavelError):
    """An object or room has a name that PDDL cannot write."""


class NotExpressible(GavelError):
    """A goal is too large, or of a kind that cannot be written in PDDL."""


class UnknownLevel(GavelError):
    """No level has this name."""


class UnknownActivity(GavelError):
    """BEHAVIOR has no activity of this name."""


class Ungroundable(GavelError):
    """An activity does not fit a scene; the message says what is missing."""


class BadPlacement(GavelError):
    """A place that is given for a thing cannot be read, or nothing can be put there."""


class NotInHouse(GavelError):
    """A sentence needs something that the house does not have; the message says what, and which houses have it."""


# --- what agents are made of ----------------------------------------------------------------------------------------


class UnknownUnderstanding(GavelError):
    """No task understanding of this name is there, or it lacks what it needs."""


class UnknownPrior(_UnknownName):
    """No location prior of this name exists."""

    what = "prior"


class BadPlannerSpec(GavelError):
    """A planner spec of unknown kind, or without what its kind needs."""


class ModelError(GavelError):
    """A model did not answer: not reachable, not known, not allowed, or nothing but nonsense."""


class EndpointError(ModelError):
    """The server does not answer, or not to this key or model: the next prompt will fare no better."""


class NotRecorded(GavelError):
    """A prompt is not in the recording."""


# --- how things are run ---------------------------------------------------------------------------------------------


class NotInstalled(GavelError):
    """An optional package, or what it needs, is not installed; the message says how to install it."""


class BadPlugin(GavelError):
    """A module that should register agents cannot be imported."""


class RunStopped(GavelError):
    """A run has stopped early; its records are kept, and it can be resumed."""


class Unencodable(GavelError):
    """A record holds something that JSON cannot say, or that its schema does not allow."""


class WorkerFailed(GavelError):
    """Worker processes cannot start."""
