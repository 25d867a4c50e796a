"""The nine grounded primitives a = (alpha, xi) of the paper, with one canonical text form and a tolerant parser."""

from __future__ import annotations

import enum
import re
from collections.abc import Sequence
from typing import NamedTuple

from gavel_env.errors import MalformedAction, nearest_names

__all__ = [
    "Action",
    "Primitive",
    "add_primitive",
    "nearest_primitives",
    "own_step",
    "parameters_of",
    "primitive_of",
    "remove_primitive",
    "normalise_name",
    "parse_action",
]


class Primitive(enum.IntEnum):
    """Action types; the value indexes the environments' `primitive` space."""

    NAVIGATE_TO = 0
    GRASP = 1
    RELEASE = 2
    PLACE_ON_TOP = 3
    PLACE_INSIDE = 4
    OPEN = 5
    CLOSE = 6
    TOGGLE_ON = 7
    TOGGLE_OFF = 8

    @property
    def takes_target(self) -> bool:
        """False for `RELEASE` alone (and for actions of one's own without parameters)."""
        return self is not Primitive.RELEASE and _PARAMETERS.get(self) != ()


class Action(NamedTuple):
    """A primitive and its argument; `str(action)` is the canonical text, `NAVIGATE_TO(fridge_0)`.

    Attributes:
        primitive: alpha.
        target: xi; None for `RELEASE`.
        others: further arguments; only actions of one's own have any (`POUR(jug, cup)`).
    """

    primitive: Primitive
    target: str | None = None
    others: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """Every argument."""
        return self.others if self.target is None else (self.target, *self.others)

    @property
    def words(self) -> str:
        """The action as planners are asked to write it: `NAVIGATE_TO fridge_0`."""
        return f"{self.primitive.name} {', '.join(self.arguments)}".rstrip()

    def __str__(self) -> str:
        if self.others:
            return f"{self.primitive.name}({', '.join(self.arguments)})"
        return f"{self.primitive.name}({self.target or ''})"


# Other words for the primitives that models and people write, without spaces, underscores or capitals.
_ALIASES = {
    "navigate": Primitive.NAVIGATE_TO,
    "goto": Primitive.NAVIGATE_TO,
    "moveto": Primitive.NAVIGATE_TO,
    "walkto": Primitive.NAVIGATE_TO,
    "find": Primitive.NAVIGATE_TO,
    "pick": Primitive.GRASP,
    "pickup": Primitive.GRASP,
    "grab": Primitive.GRASP,
    "take": Primitive.GRASP,
    "drop": Primitive.RELEASE,
    "letgo": Primitive.RELEASE,
    "placeon": Primitive.PLACE_ON_TOP,
    "placeontopof": Primitive.PLACE_ON_TOP,
    "puton": Primitive.PLACE_ON_TOP,
    "putontop": Primitive.PLACE_ON_TOP,
    "putontopof": Primitive.PLACE_ON_TOP,
    "placein": Primitive.PLACE_INSIDE,
    "placeinto": Primitive.PLACE_INSIDE,
    "putin": Primitive.PLACE_INSIDE,
    "putinside": Primitive.PLACE_INSIDE,
    "shut": Primitive.CLOSE,
    "turnon": Primitive.TOGGLE_ON,
    "switchon": Primitive.TOGGLE_ON,
    "turnoff": Primitive.TOGGLE_OFF,
    "switchoff": Primitive.TOGGLE_OFF,
}
_NAMES = {p.name.replace("_", "").lower(): p for p in Primitive} | _ALIASES
_CALL = re.compile(r"\s*+([A-Za-z][A-Za-z_ -]*+)\s*+[(\[:]")
_ARTICLE = re.compile(r"^(?:the|a|an)[\s_]+", re.IGNORECASE)
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def normalise_name(text: str) -> str:
    """Return an object name as the graphs write it: `the Bottom Cabinet 3` -> `bottom_cabinet_3`."""
    text = _ARTICLE.sub("", text.strip().strip("\"'`<>").strip())
    text = _CAMEL.sub("_", text).lower()
    if "@" in text:
        first, *rest = text.split("@")
        text = "@".join([first.rstrip(), *(part.strip() for part in rest[:-1]), rest[-1].lstrip()])
    return re.sub(r"[\s\-]+", "_", text).strip("_")


def parse_action(text: str) -> Action:
    """Read one action, tolerant of case, spacing, snake or camel case and common other verbs.

    Accepts `NAVIGATE_TO(fridge_0)`, `navigate to the fridge`, `PlaceInside(apple, fridge)` (the last argument is the
    target) and `Release`. `parse_action(str(a)) == a` for every action with a normal name.

    Raises:
        MalformedAction: no primitive is named, or its target is missing.
    """
    call = _CALL.match(text)
    if call:
        verb, arguments = call.group(1), _without_end(text[call.end() :])
    else:
        verb, arguments = _split_words(text)
    key = re.sub(r"[\s_\-]+", "", verb).lower()
    primitive = _NAMES.get(key)
    if primitive is None:
        near = nearest_names(key, _NAMES)
        hint = (
            f"did you mean {_NAMES[near[0]].name}?" if near else f"primitives: {', '.join(p.name for p in Primitive)}"
        )
        raise MalformedAction(f"no primitive in {text.strip()[:80]!r}; {hint}")
    if not primitive.takes_target:
        return Action(primitive)
    if primitive in _PARAMETERS:
        return _own(primitive, arguments, text)
    target = normalise_name(re.split(r"[,;]", arguments)[-1].split("=")[-1])
    if not target:
        raise MalformedAction(f"{primitive.name} in {text.strip()[:80]!r} names no target")
    return Action(primitive, target)


def _without_end(arguments: str) -> str:
    """Return the arguments of a call without its closing bracket and the mark behind it."""
    arguments = arguments.strip()
    if arguments.endswith((";", ".", ",")):
        arguments = arguments[:-1].rstrip()
    return arguments[:-1].rstrip() if arguments.endswith((")", "]")) else arguments


# --- actions of one's own (`own_actions`) ---------------------------------------------------------------------------

_PARAMETERS: dict[Primitive, tuple[str, ...]] = {}
_BETWEEN = re.compile(r"\s*[,;]\s*|\s+(?:into|onto|in|on|to|with|from|and)\s+", re.IGNORECASE)


def _own(primitive: Primitive, arguments: str, text: str) -> Action:
    parts = _BETWEEN.split(arguments) if len(_PARAMETERS[primitive]) > 1 else [arguments]
    names = [name for part in parts if (name := normalise_name(part.split("=")[-1]))]
    return own_step(primitive, names, text)


def own_step(primitive: Primitive, names: Sequence[str], text: str = "") -> Action:
    """Return a step of an action of one's own.

    Raises:
        MalformedAction: not as many arguments as it has parameters.
    """
    parameters = _PARAMETERS[primitive]
    if len(names) != len(parameters):
        wanted = f"{primitive.name}({', '.join(parameters)})"
        raise MalformedAction(f"{primitive.name} in {text.strip()[:80]!r} has {len(names)} arguments; write {wanted}")
    return Action(primitive, names[0] if names else None, tuple(names[1:]))


def parameters_of(primitive: Primitive) -> tuple[str, ...] | None:
    """Return the parameters of an action of one's own; None for the nine."""
    return _PARAMETERS.get(primitive)


def primitive_of(verb: str) -> Primitive | None:
    """Return the primitive that a verb names, in any spelling; None if none does."""
    return _NAMES.get(re.sub(r"[\s_\-]+", "", verb).lower())


def add_primitive(primitive: Primitive, parameters: tuple[str, ...], words: Sequence[str]) -> None:
    """Let the parser know an action of one's own; `own_actions.register_action` is what users call."""
    _PARAMETERS[primitive] = parameters
    for word in (primitive.name, *words):
        _NAMES[re.sub(r"[\s_\-]+", "", word).lower()] = primitive


def remove_primitive(primitive: Primitive) -> None:
    """Let the parser forget an action of one's own."""
    _PARAMETERS.pop(primitive, None)
    for word in [word for word, named in _NAMES.items() if named is primitive]:
        del _NAMES[word]


def nearest_primitives(verb: str, count: int = 3) -> tuple[Primitive, ...]:
    """Return the primitives whose names, or other words for them, look like a verb, best first."""
    found = nearest_names(re.sub(r"[\s_\-]+", "", verb).lower(), _NAMES, count)
    return tuple(dict.fromkeys(_NAMES[name] for name in found))


def _split_words(text: str) -> tuple[str, str]:
    """Split `navigate to the fridge` after the longest run of words that names a primitive."""
    words = text.strip().rstrip(".;,").replace("_", " ").split()
    words = [w for word in words for w in _CAMEL.sub(" ", word).split()]
    for count in (4, 3, 2, 1):
        if count <= len(words) and "".join(words[:count]).replace("-", "").lower() in _NAMES:
            return " ".join(words[:count]), " ".join(words[count:])
    return (words[0] if words else ""), ""
