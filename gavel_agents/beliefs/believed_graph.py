"""The believed graph G_0: nodes are designators until something is observed (Sec. "Task Understanding")."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import msgspec
import numpy as np

from gavel_agents.beliefs.mixture import category_weights
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.conditions import ON_FLOOR, WITHIN, Formula
from gavel_env.world_model.goals import Designator, Literal, Predicate
from gavel_env.world_model.graph import Flag, Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import Category, Ontology, category_of

__all__ = ["believed_graph", "presupposed", "uncertain"]

_OPERATED = (Predicate.OPEN, Predicate.TOGGLED)
_SUPPORTS = {Predicate.ON_TOP: Relation.ON_TOP, Predicate.INSIDE: Relation.INSIDE}


def believed_graph(
    rooms: Mapping[str, Room],
    connections: frozenset[tuple[str, str]],
    tasks: Iterable[TaskUnderstanding],
    ontology: Ontology,
    robot_room: str | None,
    kinds: Mapping[str, Sequence[Category]] = MappingProxyType({}),
) -> SceneGraph:
    """Return G_0 with the stated relations of all tasks inserted: G_0 <- Insert(G_0, E_i).

    A designator whose stated room is the only one of its type stands in that room; every other location is unknown. A
    node named by a concept is taken for its likeliest category, until one is seen.

    Args:
        rooms: of the house.
        connections: between them.
        tasks: as understood, their concepts narrowed.
        ontology: affordances.
        robot_room: where the robot is.
        kinds: designator named by a concept -> the categories that it may be of (`narrowing`); default: all of them.

    Raises:
        UnknownCategory, UnknownConcept: a designator's category or concept is not in the ontology.
    """
    tasks = tuple(tasks)
    designators = dict.fromkeys(d for task in tasks for d in task.objects)
    moved = _moved(tasks)
    nodes = {str(d): _node(d, kinds.get(str(d)) or _kinds(d, ontology), rooms, str(d) in moved) for d in designators}
    graph = SceneGraph(World.of(rooms, connections, nodes), {}, {}, robot_room=robot_room)
    for designator in designators:
        room = _only_room(rooms, designator.room)
        if room is not None:
            graph = graph.place(str(designator), Support(Relation.FLOOR, room))
    for task in tasks:
        for relation in task.relations:
            graph = _insert(graph, relation)
    for state in presupposed(tasks):
        graph = _insert(graph, state)
    return graph


def presupposed(tasks: Sequence[TaskUnderstanding]) -> tuple[Literal, ...]:
    """Return what goes without saying: a door that shall be shut is open, what shall be off is on.

    Only of tasks that are about doors and switches alone, and of what nothing is said to be or, up to there, to go in
    or on: "put the milk in the fridge and shut it" says how the fridge shall be left, not that it stands open.
    """
    holders = {literal.object for task in tasks for literal in task.relations}
    found: list[Literal] = []
    for task in tasks:
        holders |= {literal.object for literal in task.goal.literals}
        if not task.goal.conditions and all(lit.predicate in _OPERATED for lit in task.goal.literals):
            operated = (lit for lit in task.goal.literals if lit.negated and lit.subject not in holders)
            found += [literal._replace(negated=False) for literal in operated]
    return tuple(found)


def uncertain(graph: SceneGraph) -> tuple[str, ...]:
    """Return O^qry: the outermost nodes whose room the graph does not say (what stands on them follows them)."""
    return tuple(obj for obj in graph.world.nodes if obj not in graph.supports)


def _kinds(designator: Designator, ontology: Ontology) -> tuple[Category, ...]:
    name = designator.name
    return ontology.kinds(name if ontology.knows(name) or is_concept(name) else category_of(name))


def _node(designator: Designator, kinds: Sequence[Category], rooms: Mapping[str, Room], moved: bool) -> Node:
    name, stated = str(designator), designator.room
    if len(kinds) == 1:
        return Node(name, kinds[0], is_fixed(kinds[0], moved), stated)
    there = [room.type for room in rooms.values() if stated is None or room.fits(stated)]
    weights = category_weights([c.name for c in kinds], there or [room.type for room in rooms.values()])
    first, *others = np.argsort(-weights, kind="stable").tolist()
    return Node(
        name,
        kinds[first],
        is_fixed(kinds[first], moved),
        stated,
        tuple(kinds[i] for i in others),
        tuple(float(weights[i]) for i in (first, *others)),
    )


def is_fixed(category: Category, moved: bool) -> bool:
    """Return whether a thing of a category stays where it is; what takes both arms only if no goal wants it moved."""
    return not (category.graspable or (category.carryable and (moved or category.wipes)))


_MOVING = {p.value for p in Predicate if p.arity == 2} | {ON_FLOOR, WITHIN}


def _moved(tasks: Iterable[TaskUnderstanding]) -> frozenset[str]:
    """Return what goals want in, on or beside something else.

    What takes both arms is mostly furniture, which stays where it is; of these only what a goal wants moved is movable.
    """
    moved: set[str] = set()
    for task in tasks:
        moved.update(str(lit.subject) for lit in task.goal.literals if lit.object is not None)
        for condition in task.goal.conditions:
            for atom, _, domains in condition.asked() if isinstance(condition, Formula) else ():
                if atom.predicate in _MOVING:
                    moved.update(domains.get(atom.args[0], atom.args[:1]))
    return frozenset(moved)


def _only_room(rooms: Mapping[str, Room], stated: str | None) -> str | None:
    fitting = [] if stated is None else [r.id for r in rooms.values() if r.fits(stated)]
    return fitting[0] if len(fitting) == 1 else None


def _insert(graph: SceneGraph, relation: Literal) -> SceneGraph:
    """Insert one stated relation; relations that the graph does not carry are left to the belief."""
    subject = str(relation.subject)
    if relation.predicate in _SUPPORTS and relation.object is not None:
        return graph.place(subject, Support(_SUPPORTS[relation.predicate], str(relation.object)))
    if relation.predicate is Predicate.IN_ROOM and relation.object is not None:
        room = _only_room(graph.world.rooms, str(relation.object))
        if room is not None:
            return graph.place(subject, Support(Relation.FLOOR, room))
        node = graph.world.nodes[subject]._replace(stated_room=str(relation.object))
        return graph.with_nodes({subject: node})
    if relation.predicate in (Predicate.NEXT_TO, Predicate.UNDER) and relation.object is not None:
        a, b = sorted((subject, str(relation.object)))
        return msgspec.structs.replace(graph, next_to=graph.next_to | {(a, b)})
    flag = relation.predicate.flag
    if flag is not None:
        return graph.with_flag(flag, frozenset((subject,)), value=not relation.negated)
    return graph


def observe_flags(graph: SceneGraph, seen: SceneGraph, bound: Mapping[str, str]) -> SceneGraph:
    """Return the believed graph with the observed flags of every bound node."""
    flags = list(graph.flags)
    for flag in Flag:
        known = frozenset(node for node, instance in bound.items() if instance in seen.flags[flag])
        flags[flag] = (flags[flag] - frozenset(bound)) | known
    return msgspec.structs.replace(graph, flags=tuple(flags))
