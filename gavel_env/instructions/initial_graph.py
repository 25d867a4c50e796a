"""From files to graphs: the initial hidden graph G*_0 of a scene with an instruction's movables placed in it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

import msgspec

from gavel_env.errors import GavelError, InstructionError, UnknownConcept
from gavel_env.frozen import frozen
from gavel_env.house.scenes import Scene
from gavel_env.instructions.checks import check_goals, check_id, check_placement, check_supports
from gavel_env.instructions.record import Instruction, Placement
from gavel_env.world_model.concepts import PREFIX
from gavel_env.world_model.goals import Designator, Literal, Predicate, fitting, parse_literal, unmet
from gavel_env.world_model.graph import Flag, Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import Ontology, category_of, default_ontology

__all__ = ["instruction_graph", "scene_graph"]

_RELATIONS = {"on": Relation.ON_TOP, "in": Relation.INSIDE, "floor": Relation.FLOOR}
_BESIDE = (Predicate.NEXT_TO, Predicate.UNDER)
_CONCEPT = re.compile(rf"\b{PREFIX}\w+")


def scene_graph(scene: Scene, ontology: Ontology | None = None) -> SceneGraph:
    """Return the graph of a scene as it stands: rooms, connections, furniture, own contents; all doors shut, all off.

    Raises:
        UnknownCategory: a piece's category is not in the ontology.
    """
    return _scene_graph(_ById(scene), ontology or default_ontology())


class _ById:
    """Wraps a scene for the cache: scenes are read once per path and compared by identity."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ById) and other.scene is self.scene

    def __hash__(self) -> int:
        return id(self.scene)


@lru_cache(maxsize=64)
def _scene_graph(key: _ById, ontology: Ontology) -> SceneGraph:
    scene = key.scene
    rooms = {r.id: Room(r.id, r.type) for r in scene.rooms}
    connections = frozenset((min(o.rooms), max(o.rooms)) for o in scene.openings)
    nodes: dict[str, Node] = {}
    supports: dict[str, Support] = {}
    contents: dict[str, list[str]] = {}
    for piece in scene.furniture:
        nodes[piece.id] = Node(piece.id, ontology[piece.category], True)
        supports[piece.id] = (
            Support(Relation.FLOOR, piece.room) if piece.on is None else Support(Relation.ON_TOP, piece.on)
        )
    for item in scene.items:
        nodes[item.id] = Node(item.id, ontology[item.category], False)
        supports[item.id] = Support(_RELATIONS[item.relation], item.holder)
    for obj, (relation, holder) in supports.items():
        if relation != Relation.FLOOR:
            contents.setdefault(holder, []).append(obj)
    world = World.of(rooms, connections, nodes)
    held_by = {holder: tuple(sorted(held)) for holder, held in contents.items()}
    return SceneGraph(world, frozen(supports), frozen(held_by))


@lru_cache(maxsize=64)
def _free_indices(key: _ById, ontology: Ontology) -> Mapping[str, int]:
    """Return category -> the first index that no object of a scene has."""
    counts: dict[str, int] = {}
    for obj in _scene_graph(key, ontology).world.nodes:
        name = category_of(obj)
        counts[name] = max(counts.get(name, 0), int(obj.rsplit("_", 1)[1]) + 1 if obj != name else 0)
    return counts


def instruction_graph(scene: Scene, instruction: Instruction, ontology: Ontology | None = None) -> SceneGraph:
    """Return G*_0: the scene's graph with the instruction's movables and initial states.

    Raises:
        InstructionError: a placement does not fit (unknown category or target, no surface or interior, ...), or the
            goal holds at the start or names a concept that is unknown; names the instruction, the place and the value.
    """
    ontology = ontology or default_ontology()
    graph = scene_graph(scene, ontology)
    place = f"instruction {instruction.id!r}"
    counts = dict(_free_indices(_ById(scene), ontology))
    nodes: dict[str, Node] = {}
    ids: list[str] = []
    for index, placement in enumerate(instruction.placements):
        if placement.category not in ontology:
            raise InstructionError(f"{place}, placements[{index}]: {_why_unknown(placement.category, ontology)}")
        name = placement.id if placement.id is not None else f"{placement.category}_{counts.get(placement.category, 0)}"
        counts[placement.category] = counts.get(placement.category, 0) + 1
        check_id(name, graph, ontology, f"{place}, placements[{index}]")
        if name in graph.world.nodes or name in nodes:
            raise InstructionError(f"{place}, placements[{index}]: the id {name!r} is taken")
        nodes[name] = Node(name, ontology[placement.category], False)
        ids.append(name)
    if nodes:
        graph = graph.with_nodes(nodes)
    supports = dict(graph.supports)
    contents = {holder: list(held) for holder, held in graph.contents.items()}
    graph = msgspec.structs.replace(graph, supports=supports)
    flags = list(graph.flags)
    for index, (name, placement) in enumerate(zip(ids, instruction.placements, strict=True)):
        support = _support(graph, placement, f"{place}, placements[{index}]")
        supports[name] = support
        holder = None if support.relation == Relation.FLOOR else graph.category(support.holder)
        check_placement(placement, graph.category(name), holder, f"{place}, placements[{index}]")
        if support.relation != Relation.FLOOR:
            contents.setdefault(support.holder, []).append(name)
        for state in placement.states:
            try:
                flag = Flag[state.upper()]
            except KeyError:
                known = ", ".join(f.name.lower() for f in Flag)
                raise InstructionError(
                    f"{place}, placements[{index}]: unknown state {state!r}; known: {known}"
                ) from None
            flags[flag] = flags[flag] | {name}
    check_supports(graph, ids, place)
    next_to = set(graph.next_to)
    for text in instruction.initial:
        literal = _initial_literal(text, place)
        found = fitting(graph, literal.subject)
        claimed = literal.predicate.flag
        others = fitting(graph, literal.object) if literal.object and literal.predicate in _BESIDE else ()
        if not found or literal.negated or (claimed is None and not others):
            raise InstructionError(
                f"{place}, initial: {text!r} must be a state of a piece of this scene, such as open(fridge_0), "
                "or say what lies beside or under what, such as next_to(ball_0, sofa_0)"
            )
        if claimed is None:
            next_to.add((min(found[0], others[0]), max(found[0], others[0])))
        else:
            flags[claimed] = flags[claimed] | {found[0]}
    graph = msgspec.structs.replace(
        graph,
        contents={holder: tuple(sorted(held)) for holder, held in contents.items()},
        flags=tuple(flags),
        next_to=frozenset(next_to),
    )
    for index, task in enumerate(instruction.tasks):
        for name in (name for text in task.goal for name in _CONCEPT.findall(text)):
            if name not in ontology.concepts.things and name not in ontology.concepts.places:
                unknown = UnknownConcept(name, [*ontology.concepts.things, *ontology.concepts.places])
                raise InstructionError(f"{place}, tasks[{index}]: {unknown}")
    check_goals(instruction, graph, ontology, place)
    for index, task in enumerate(instruction.tasks):
        if not unmet(task.parsed_goal(), graph):
            raise InstructionError(f"{place}, tasks[{index}]: the goal holds at the start: {', '.join(task.goal)}")
    return graph


def _why_unknown(category: str, ontology: Ontology) -> str:
    try:
        ontology[category]
    except GavelError as error:
        return str(error)
    raise AssertionError(category)


def _support(graph: SceneGraph, placement: Placement, place: str) -> Support:
    """Return the support that a placement asks for."""
    relation = _RELATIONS[placement.relation]
    if relation is Relation.FLOOR:
        for room in graph.world.rooms.values():
            if room.fits(placement.target):
                return Support(relation, room.id)
        raise InstructionError(f"{place}: no room {placement.target!r}; rooms: {', '.join(graph.world.rooms)}")
    try:
        found = fitting(graph, Designator.parse(placement.target))
    except GavelError as error:
        raise InstructionError(f"{place}: {error}") from error
    if not found:
        names = sorted({n.category.name for n in graph.world.nodes.values()})
        raise InstructionError(f"{place}: nothing fits {placement.target!r}; categories here: {', '.join(names)}")
    category = graph.category(found[0])
    if not (category.surface if relation is Relation.ON_TOP else category.interior):
        need = "surface" if relation is Relation.ON_TOP else "interior"
        raise InstructionError(
            f"{place}: {placement.target!r} has no {need} to put {placement.category!r} {placement.relation}"
        )
    return Support(relation, found[0])


def _initial_literal(text: str, place: str) -> Literal:
    try:
        return parse_literal(text)
    except GavelError as error:
        raise InstructionError(f"{place}, initial: {error}") from error
