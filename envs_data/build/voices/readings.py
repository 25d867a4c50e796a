"""The notation of blind readings, and what it denotes in a house: sets of instances, for movables and for furniture."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec

from gavel_env.errors import InstructionError
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting, unmet
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Claim", "Reading", "ReadTask", "claim", "denotation", "parse_claim", "read_readings", "satisfied"]

_FORM = re.compile(r"^\s*(not\s+)?([a-z_]+)\s*\(\s*([^(),]+?)\s*(?:,\s*([^(),]+?)\s*)?\)\s*$")
_PLACES = frozenset({Predicate.ON_TOP, Predicate.INSIDE})
_PREDICATES: dict[str, frozenset[Predicate]] = {p.value: frozenset({p}) for p in Predicate} | {"at": _PLACES}


class ReadTask(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An errand as a reader understood it."""

    literals: tuple[str, ...]
    stated: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    text: str | None = None


class Reading(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A reader's answer to one text."""

    id: str
    tasks: tuple[ReadTask, ...] = ()
    unclear: str | None = None


class Written(NamedTuple):
    """A literal of a reading as it stands: alternatives for predicate, subject and object."""

    predicates: frozenset[Predicate]
    subjects: tuple[str, ...]
    objects: tuple[str, ...]
    negated: bool


class Claim(NamedTuple):
    """What a literal denotes in a house: alternatives for its predicate, its subject and its object."""

    predicates: frozenset[Predicate]
    subjects: frozenset[str]
    objects: frozenset[str]
    negated: bool

    def __str__(self) -> str:
        names = "/".join(sorted(p.value for p in self.predicates))
        arguments = ", ".join("|".join(sorted(part)) or "nothing" for part in (self.subjects, self.objects) if part)
        return f"{'not ' if self.negated else ''}{names}({arguments})"


def parse_claim(text: str) -> Written:
    """Read a literal of a reading, such as `inside(mug#1, top_cabinet@kitchen|bottom_cabinet@kitchen)`.

    Raises:
        InstructionError: it is no such literal; says what is wrong.
    """
    match = _FORM.match(text)
    if match is None or match[2] not in _PREDICATES:
        raise InstructionError(f"{text!r} is no literal of the reading notation; forms: {', '.join(_PREDICATES)}")
    predicates = _PREDICATES[match[2]]
    if (match[4] is None) != all(p.arity == 1 for p in predicates):
        raise InstructionError(f"{text!r} has the wrong number of arguments")
    return Written(predicates, _alternatives(match[3]), _alternatives(match[4] or ""), match[1] is not None)


def _alternatives(text: str) -> tuple[str, ...]:
    return tuple(part.strip().partition("#")[0] for part in text.split("|") if part.strip())


def denotation(graph: SceneGraph, alternatives: Iterable[str]) -> frozenset[str]:
    """Return the instances that any of the designators fits."""
    return frozenset(obj for text in alternatives for obj in fitting(graph, Designator.parse(text)))


def claim(graph: SceneGraph, text: str) -> Claim:
    """Return what a literal of a reading or a goal denotes.

    Raises:
        InstructionError: it is no literal, or nothing in the house fits one of its sides.
    """
    written = parse_claim(text)
    subjects = denotation(graph, written.subjects)
    if not subjects:
        raise InstructionError(f"{text!r}: nothing in the house is {'|'.join(written.subjects)}")
    if Predicate.IN_ROOM in written.predicates:
        rooms = frozenset(r.id for r in graph.world.rooms.values() if {r.id, r.type} & set(written.objects))
        return Claim(written.predicates, subjects, rooms, written.negated)
    objects = denotation(graph, written.objects)
    if written.objects and not objects:
        raise InstructionError(f"{text!r}: nothing in the house is {'|'.join(written.objects)}")
    return Claim(written.predicates, subjects, objects, written.negated)


def satisfied(graph: SceneGraph, claims: Sequence[Claim]) -> list[Claim]:
    """Return the claims that do not hold; of equal claims each needs a subject of its own."""
    missing = []
    for distinct in dict.fromkeys(claims):
        holding = [subject for subject in sorted(distinct.subjects) if _holds(graph, distinct, subject)]
        wanted = len(distinct.subjects) if distinct.negated else claims.count(distinct)
        missing += [distinct] * (len(holding) < wanted)
    return missing


def _holds(graph: SceneGraph, found: Claim, subject: str) -> bool:
    if Predicate.IN_ROOM in found.predicates:
        return graph.room_of(subject) in found.objects
    objects: list[str | None] = [*sorted(found.objects)] if found.objects else [None]
    for predicate in found.predicates:
        for obj in objects:
            literal = Literal(predicate, Designator(subject), None if obj is None else Designator(obj), found.negated)
            if not unmet(Goal((literal,)), graph):
                return True
    return False


def read_readings(lines: Iterable[bytes], place: str) -> dict[str, Reading]:
    """Return readings by id.

    Raises:
        InstructionError: a line is malformed or an id stands twice; names the place and the line.
    """
    found: dict[str, Reading] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            reading = msgspec.json.decode(line, type=Reading)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise InstructionError(f"{place}:{number}: malformed reading: {error}") from error
        if reading.id in found:
            raise InstructionError(f"{place}:{number}: the id {reading.id!r} stands twice")
        found[reading.id] = reading
    return found
