"""What an instruction must be to be carried out at all: names, placements and goals that its world can have.

Whatever brings a record into a world (files, records given to `reset`, generators) comes through here, so that what
cannot be done is said before an agent is blamed for it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from gavel_env.errors import InstructionError, nearest_names
from gavel_env.instructions.record import Instruction, Placement
from gavel_env.world_model.concepts import OR
from gavel_env.world_model.goals import Designator, Literal, Predicate, fitting
from gavel_env.world_model.graph import ROBOT, Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["check_goals", "check_id", "check_placement", "check_supports"]

_NAME = re.compile(r"\w[\w.-]{0,99}")
_LIFTED_KG = 23.0
"""What a person lifts who sets up a house, a toaster oven say (the load constant of NIOSH's lifting equation)."""
_FOLDED = 3.0
"""How many times its holder's a thing's sizes may be, as annotated: sheets and cloths are annotated spread out."""

_AFFORDANCE = {
    Flag.WASHED: "washable",
    Flag.DRIED: "washable",
    Flag.OPEN: "openable",
    Flag.TOGGLED: "toggleable",
    Flag.COOKED: "cookable",
    Flag.HOT: "heatable",
    Flag.FROZEN: "freezable",
}


def check_id(name: str, graph: SceneGraph, ontology: Ontology, place: str) -> None:
    """Check that an id can be a new object's.

    Raises:
        InstructionError: it cannot be written in goals and actions, or means something else.
    """
    if not _NAME.fullmatch(name):
        wanted = "letters, digits, '_', '-' and '.', at most 100 of them"
        raise InstructionError(f"{place}: the id {name[:80]!r} cannot be used; expected {wanted}")
    if name == ROBOT or name in ontology:
        meant = "the robot" if name == ROBOT else "a category"
        raise InstructionError(f"{place}: the id {name!r} means {meant}; number it, such as {name + '_0'!r}")
    if name in graph.world.rooms or any(name == room.type for room in graph.world.rooms.values()):
        raise InstructionError(f"{place}: the id {name!r} is that of a room")


def check_placement(placement: Placement, category: Category, holder: Category | None, place: str) -> None:
    """Check that a thing can be where it is put.

    Args:
        placement: of the record.
        category: of the thing.
        holder: category of what it is on or in; None on a floor.
        place: for errors.

    Raises:
        InstructionError: it cannot be lifted, or is too large.
    """
    if holder is None:
        return
    heavy = category.mass_kg is None or category.mass_kg > _LIFTED_KG
    if heavy and not category.liftable:
        raise InstructionError(
            f"{place}: {category.name!r} cannot be lifted, so nothing has put it {placement.relation} "
            f"{placement.target!r}; things of that kind stand on floors"
        )
    if placement.relation == "in" and category.size_m is not None and holder.size_m is not None:
        wide = [a > _FOLDED * b for a, b in zip(sorted(category.size_m), sorted(holder.size_m), strict=True)]
        if all(wide):
            raise InstructionError(
                f"{place}: {category.name!r} ({_metres(category)}) is too large for {holder.name!r} ({_metres(holder)})"
            )


def _metres(category: Category) -> str:
    assert category.size_m is not None
    return " x ".join(f"{size:.2g}" for size in category.size_m) + " m"


def check_supports(graph: SceneGraph, names: Iterable[str], place: str) -> None:
    """Check that nothing stands on itself, by way of whatever it stands on.

    Raises:
        InstructionError: with the things in a circle.
    """
    sound: set[str] = set()
    for name in names:
        path: dict[str, None] = {}
        at = name
        while at not in sound:
            if at in path:
                raise InstructionError(f"{place}, placements: in a circle: {' on '.join([*path, at])[:300]}")
            path[at] = None
            support = graph.supports.get(at)
            if support is None or support.relation > Relation.INSIDE:
                break
            at = support.holder
        sound.update(path)


def check_goals(instruction: Instruction, graph: SceneGraph, ontology: Ontology, place: str) -> None:
    """Check that goals speak of what there can be, and ask for nothing that cannot be.

    Raises:
        InstructionError: an unknown category or room, a state or relation that the thing cannot have, two places at
            once, or something and its contrary.
    """
    for index, task in enumerate(instruction.tasks):
        where = f"{place}, tasks[{index}]"
        literals = task.parsed_goal().literals
        for literal in literals:
            _check_literal(literal, graph, ontology, f"{where}, goal {str(literal)!r}")
        _check_together(literals, graph, where)


def _check_literal(literal: Literal, graph: SceneGraph, ontology: Ontology, place: str) -> None:
    subjects = _kinds(literal.subject, graph, ontology, place)
    flag = literal.predicate.flag
    if literal.object is not None and literal.predicate is Predicate.IN_ROOM:
        _check_room(str(literal.object), graph, place)
    objects = () if literal.object is None else _objects(literal, graph, ontology, place)
    if literal.negated:
        return
    need = _AFFORDANCE.get(flag) if flag is not None else None
    if need is not None and not any(getattr(kind, need) for kind in subjects):
        raise InstructionError(f"{place}: {literal.subject.name!r} is not {need}, so it is never so")
    need = {Predicate.ON_TOP: "surface", Predicate.INSIDE: "interior"}.get(literal.predicate)
    if need is not None and objects and not any(getattr(kind, need) for kind in objects):
        raise InstructionError(f"{place}: {str(literal.object)!r} has no {need}, so it is never so")


def _objects(literal: Literal, graph: SceneGraph, ontology: Ontology, place: str) -> tuple[Category, ...]:
    assert literal.object is not None
    if literal.predicate is Predicate.IN_ROOM or literal.object.name in graph.world.rooms:
        return ()
    return _kinds(literal.object, graph, ontology, place)


def _kinds(designator: Designator, graph: SceneGraph, ontology: Ontology, place: str) -> tuple[Category, ...]:
    """Return the categories that a designator may be of."""
    name, room = designator
    if room is not None:
        _check_room(room, graph, place)
    if name in graph.world.nodes:
        return (graph.category(name),)
    if not ontology.knows(name):
        known = {*ontology, *graph.world.nodes}
        near = nearest_names(name, known)
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else "expected a category, or an id of the scene"
        raise InstructionError(f"{place}: nothing is called {name[:80]!r}; {hint}")
    return ontology.kinds(name)


def _check_room(name: str, graph: SceneGraph, place: str) -> None:
    for part in name.split(OR):
        if not any(room.fits(part) for room in graph.world.rooms.values()):
            raise InstructionError(f"{place}: no room {part[:80]!r}; rooms: {', '.join(graph.world.rooms)}")


def _check_together(literals: tuple[Literal, ...], graph: SceneGraph, place: str) -> None:
    said = set(literals)
    holders: dict[str, Literal] = {}
    for literal in literals:
        if literal._replace(negated=not literal.negated) in said:
            raise InstructionError(f"{place}: the goal asks for {str(literal)!r} and for its contrary")
        if literal.negated or literal.predicate not in (Predicate.ON_TOP, Predicate.INSIDE) or literal.object is None:
            continue
        there = fitting(graph, literal.subject)
        if len(there) != 1:
            continue
        before = holders.setdefault(there[0], literal)
        assert before.object is not None
        places, others = fitting(graph, before.object), fitting(graph, literal.object)
        if places and others and set(places).isdisjoint(others):
            raise InstructionError(f"{place}: nothing is in two places: {str(before)!r} and {str(literal)!r}")
