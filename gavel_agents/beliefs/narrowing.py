"""What the concepts of an instruction come to, by the house's rooms and by what is asked of the things.

"The office" of a house with one private office is that. "Put it in the bin" is about bins that things go into: a
category that cannot be what the goal asks cannot be meant. Where one category or room type is left, the designator
names it; where several are, each will do and the search settles which (`believed_graph`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec

from gavel_agents.understanding import TaskUnderstanding
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.conditions import (
    ON_FLOOR,
    WITHIN,
    And,
    Atom,
    Formula,
    ForPairs,
    Imply,
    Not,
    Or,
)
from gavel_env.world_model.goals import Condition, Designator, Goal, Literal, Predicate
from gavel_env.world_model.graph import Room
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["Narrowed", "narrow"]

Able = Callable[[Category], bool]

_SUBJECT_NEEDS: Mapping[Predicate, Able] = {
    Predicate.ON_TOP: lambda c: c.liftable,
    Predicate.INSIDE: lambda c: c.liftable,
    Predicate.UNDER: lambda c: c.liftable,
    Predicate.OPEN: lambda c: c.openable,
    Predicate.TOGGLED: lambda c: c.toggleable,
    Predicate.COOKED: lambda c: c.cookable,
    Predicate.HOT: lambda c: c.heatable,
    Predicate.FROZEN: lambda c: c.freezable,
}
_HOLDER_NEEDS: Mapping[Predicate, Able] = {
    Predicate.ON_TOP: lambda c: c.surface,
    Predicate.INSIDE: lambda c: c.interior,
    Predicate.UNDER: lambda c: c.clearance,
}
_PLACES = (Predicate.IN_ROOM.value, ON_FLOOR)


class Narrowed(NamedTuple):
    """The tasks with their concepts narrowed.

    Attributes:
        tasks: as understood, with narrower designators.
        kinds: designator that names several categories still -> those that can be what is asked of it, the one that
            people think of first in front.
    """

    tasks: tuple[TaskUnderstanding, ...]
    kinds: Mapping[str, tuple[Category, ...]]


class _Said(NamedTuple):
    """An atom over designators: what a goal or a stated relation says of things."""

    predicate: str
    places: tuple[str, ...]
    asked: bool


def narrow(tasks: Iterable[TaskUnderstanding], rooms: Mapping[str, Room], ontology: Ontology) -> Narrowed:
    """Return the tasks with every concept narrowed to what the house and the goals leave of it.

    Args:
        tasks: as understood; they share their designators.
        rooms: of the house.
        ontology: says what categories can do, and which belong to a concept.

    Raises:
        UnknownConcept: a designator names a concept that the ontology does not have.
    """
    tasks = tuple(tasks)
    said = [atom for task in tasks for atom in _atoms(task)]
    things = {str(d) for task in tasks for d in task.objects}
    things |= {place for atom in said for index, place in enumerate(atom.places) if not _is_place(atom, index)}
    places = {place for atom in said for index, place in enumerate(atom.places) if _is_place(atom, index)}
    if not any(map(is_concept, places)) and not any(map(_has_concept, things)):
        return Narrowed(tasks, {})
    present = {room.type for room in rooms.values()}
    new: dict[str, str] = {
        place: ontology.concepts.narrow_room(place, present) for place in places if is_concept(place)
    }
    kinds: dict[str, tuple[Category, ...]] = {}
    for thing in sorted(filter(_has_concept, things)):
        name, room = Designator.parse(thing)
        needs = [need for atom in said for need in _needs(atom, thing)]
        if room is not None and is_concept(room):
            room = ontology.concepts.narrow_room(room, present)
        if is_concept(name):
            members = ontology.kinds(name)
            able = tuple(c for c in members if all(need(c) for need in needs))
            name = ontology.concepts.narrow_thing(name, _capable(needs, ontology))
            new[thing] = str(Designator(name, room))
            if is_concept(name):
                kinds[new[thing]] = able or members
        else:
            new[thing] = str(Designator(name, room))
    return Narrowed(tuple(_renamed(task, new) for task in tasks), kinds)


def _capable(needs: Sequence[Able], ontology: Ontology) -> Callable[[str], bool]:
    return lambda category: category in ontology and all(need(ontology[category]) for need in needs)


def _has_concept(designator: str) -> bool:
    return any(map(is_concept, designator.split("@")))


def _is_place(atom: _Said, index: int) -> bool:
    return index == 1 and atom.predicate in _PLACES


def _atoms(task: TaskUnderstanding) -> Iterator[_Said]:
    """Yield what a task says of things: its goal, and where it says that they are."""
    for asked, literals in ((True, task.goal.literals), (False, task.relations)):
        for literal in literals:
            places = (str(literal.subject),) if literal.object is None else (str(literal.subject), str(literal.object))
            yield _Said(literal.predicate.value, places, asked and not literal.negated)
    for condition in task.goal.conditions:
        for atom, positive, domains in condition.asked() if isinstance(condition, Formula) else ():
            members = [domains.get(place, (place,)) for place in atom.args]
            for subject in members[0]:
                for other in members[1] if len(members) > 1 else ("",):
                    yield _Said(atom.predicate, (subject, other) if other else (subject,), positive)


def _needs(atom: _Said, thing: str) -> Iterator[Able]:
    """Yield what a category must be able to do, so that `thing` can be of it."""
    predicate = Predicate.INSIDE if atom.predicate == WITHIN else None
    if predicate is None and atom.predicate != ON_FLOOR:
        predicate = Predicate(atom.predicate)
    if predicate is None:
        return
    if atom.places[0] == thing and predicate in _SUBJECT_NEEDS and atom.asked:
        yield _SUBJECT_NEEDS[predicate]
    if len(atom.places) > 1 and atom.places[1] == thing and predicate in _HOLDER_NEEDS:
        yield _HOLDER_NEEDS[predicate]


# --- renaming ------------------------------------------------------------------------------------------------------


def _renamed(task: TaskUnderstanding, new: Mapping[str, str]) -> TaskUnderstanding:
    def literal(old: Literal) -> Literal:
        return old._replace(subject=named(old.subject), object=None if old.object is None else named(old.object))

    def named(old: Designator) -> Designator:
        return Designator.parse(new.get(str(old), str(old)))

    return msgspec.structs.replace(
        task,
        objects=tuple(dict.fromkeys(map(named, task.objects))),
        relations=tuple(map(literal, task.relations)),
        goal=Goal(
            tuple(dict.fromkeys(map(literal, task.goal.literals))),
            tuple(_condition(condition, new) for condition in task.goal.conditions),
        ),
    )


def _condition(condition: Condition, new: Mapping[str, str]) -> Condition:
    return _formula(condition, new) if isinstance(condition, Formula) else condition


def _formula(formula: Formula, new: Mapping[str, str]) -> Formula:
    def names(old: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(new.get(name, name) for name in old)

    if isinstance(formula, Atom):
        return Atom(formula.predicate, names(formula.args))
    if isinstance(formula, And | Or):
        return msgspec.structs.replace(formula, parts=tuple(_formula(part, new) for part in formula.parts))
    body = _formula(formula.body, new)
    if isinstance(formula, Not):
        return Not(body)
    if isinstance(formula, Imply):
        return Imply(_formula(formula.premise, new), body)
    if isinstance(formula, ForPairs):
        return msgspec.structs.replace(
            formula, domain=names(formula.domain), other_domain=names(formula.other_domain), body=body
        )
    return msgspec.structs.replace(formula, domain=names(formula.domain), body=body)
