"""Graphs of one's own as JSON, format `gavel-graph/1` (docs/howto/worlds.md; docs/reference/schemas/graph.schema.json).

Everything that can be wrong with a file is said with its path inside it: `lab.json: $.nodes[3].on_top: …`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from gavel_env.data import read_bytes
from gavel_env.errors import GraphError, UndeclaredCategory, nearest_names
from gavel_env.world_model.actions import normalise_name
from gavel_env.world_model.graph import ROBOT, Flag, Node, Relation, Room, SceneGraph, Support, World, all_flags
from gavel_env.world_model.layout import Layout, Point
from gavel_env.world_model.ontology import Category, Ontology, default_ontology
from gavel_env.world_model.own_categories import OwnCategory

__all__ = ["FORMAT", "GraphFile", "graph_from", "graph_from_json", "graph_to_json"]

FORMAT = "gavel-graph/1"
_HIGHEST = 100
"""Things that stand in or on one another, at most."""

_ID = re.compile(r"[^\W\d_][\w.']*")


class RoomEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A room: `type` is what it is called in goals (`kitchen`); default the id without its index."""

    id: str
    type: str = ""
    position: Point | None = None
    footprint: tuple[tuple[float, float], ...] | None = None


class ConnectionEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A way between two rooms, and how long it is."""

    rooms: tuple[str, str]
    distance_m: float | None = None


class NodeEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A thing. One of `on_top`, `inside`, `held` and (on the floor) `room` says where it is; none: unknown.

    Beside `on_top` and `inside`, `room` may say where that is.
    """

    id: str
    category: str
    room: str | None = None
    on_top: str | None = None
    inside: str | None = None
    held: bool = False
    fixed: bool | None = None
    flags: tuple[str, ...] = ()
    position: Point | None = None
    footprint: tuple[tuple[float, float], ...] | None = None


class RobotEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The robot: its room, what is in reach, where it stands."""

    room: str | None = None
    near: tuple[str, ...] = ()
    position: Point | None = None


class GraphFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A whole file; `categories` are one's own, as `Ontology.extend` takes them."""

    format: str
    nodes: tuple[NodeEntry, ...]
    rooms: tuple[RoomEntry, ...] = ()
    connections: tuple[ConnectionEntry | tuple[str, str], ...] = ()
    robot: RobotEntry = RobotEntry()
    next_to: tuple[tuple[str, str], ...] = ()
    categories: dict[str, OwnCategory] = {}


def graph_from_json(source: str | bytes | Path | Mapping[str, Any], ontology: Ontology | None = None) -> SceneGraph:
    """Read a graph; `SceneGraph.from_json` is the same.

    Args:
        source: path of a `.json` (or `.json.gz`) file, the JSON itself, or what it says as a mapping.
        ontology: the categories known; default the shipped ones. A file may add its own.

    Raises:
        GraphError: unreadable or malformed, with the path inside the file.
        UndeclaredCategory: a category is not known; with the lines that would add it.
    """
    if isinstance(source, Mapping):
        return graph_from(_decoded(source, "graph"), ontology, "graph")
    if isinstance(source, str) and source.lstrip()[:1] != "{":
        source = Path(source)
    place = f"graph file {source}" if isinstance(source, Path) else "graph"
    content = read_bytes(source, "graph file", GraphError) if isinstance(source, Path) else source
    try:
        file = msgspec.json.decode(content, type=GraphFile)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as problem:
        raise GraphError(f"{place} is malformed: {problem}") from problem
    return graph_from(file, ontology, place)


def _decoded(source: Mapping[str, Any], place: str) -> GraphFile:
    try:
        return msgspec.convert(dict(source), GraphFile)
    except (msgspec.ValidationError, RecursionError, UnicodeError) as problem:
        raise GraphError(f"{place} is malformed: {problem}") from problem


def graph_from(file: GraphFile, ontology: Ontology | None = None, place: str = "graph") -> SceneGraph:
    """Return the graph that a decoded file says; errors as `graph_from_json`."""
    return _Reader(file, ontology or default_ontology(), place).graph()


class _Reader:
    """Turns a file into a graph, and says of each fault where it stands."""

    def __init__(self, file: GraphFile, ontology: Ontology, place: str) -> None:
        self.file, self.place = file, place
        if file.format != FORMAT:
            raise self.error("format", f"{file.format!r}; this version reads {FORMAT!r}")
        self.ontology = ontology.extend(file.categories, place) if file.categories else ontology
        self.node_ids: dict[str, int] = {}
        self.positions: dict[str, Point] = {}
        self.footprints: dict[str, tuple[tuple[float, float], ...]] = {}

    def error(self, path: str, message: str) -> GraphError:
        return GraphError(f"{self.place}: $.{path}: {message}")

    def graph(self) -> SceneGraph:
        rooms = self._rooms()
        nodes = self._nodes(rooms)
        connections, distances = self._connections(rooms)
        supports, contents = self._supports(rooms)
        robot = self.file.robot
        if robot.room is not None:
            self._known(robot.room, rooms, "robot.room", "room")
        for i, name in enumerate(robot.near):
            self._known(name, nodes, f"robot.near[{i}]", "node")
        self._place(ROBOT, robot.position, None, "robot")
        holding = next((o for o, s in supports.items() if s.relation is Relation.HELD), None)
        layout = Layout(self.positions, self.footprints, distances)
        return SceneGraph(
            world=World.of(rooms, connections, nodes, layout),
            supports=supports,
            contents=contents,
            flags=self._flags(),
            near=frozenset(robot.near),
            holding=holding,
            robot_room=robot.room,
            next_to=self._next_to(nodes),
        )

    # --- parts -------------------------------------------------------------------------------------------------------

    def _id(self, name: str, path: str) -> str:
        normal = normalise_name(name)
        if name == ROBOT:
            raise self.error(path, f"{ROBOT!r} is the robot's own id")
        if name != normal or not _ID.fullmatch(name):
            better = normalise_name(re.sub(r"(?:[^\w.']|_)+", "_", normal).strip("_.'"))
            better = better if _ID.fullmatch(better) else f"x_{better}".rstrip("_")
            raise self.error(path, f"id {name[:80]!r} cannot be written in plans; write {better[:80]!r}")
        return name

    def _rooms(self) -> dict[str, Room]:
        rooms: dict[str, Room] = {}
        for i, entry in enumerate(self.file.rooms):
            name = self._id(entry.id, f"rooms[{i}].id")
            if name in rooms:
                raise self.error(f"rooms[{i}].id", f"duplicate room id {name!r}")
            rooms[name] = Room(name, entry.type or re.sub(r"_\d+$", "", name))
            self._place(name, entry.position, entry.footprint, f"rooms[{i}]")
        return rooms

    def _connections(
        self, rooms: Mapping[str, Room]
    ) -> tuple[frozenset[tuple[str, str]], dict[tuple[str, str], float]]:
        distances: dict[tuple[str, str], float] = {}
        pairs: set[tuple[str, str]] = set()
        for i, entry in enumerate(self.file.connections):
            path = f"connections[{i}]"
            a, b = entry.rooms if isinstance(entry, ConnectionEntry) else entry
            for room in (a, b):
                self._known(room, rooms, path, "room")
            if a == b:
                raise self.error(path, f"{a!r} is connected to itself")
            pair = (a, b) if a < b else (b, a)
            pairs.add(pair)
            metres = entry.distance_m if isinstance(entry, ConnectionEntry) else None
            if metres is not None:
                if not (math.isfinite(metres) and metres >= 0.0):
                    raise self.error(f"{path}.distance_m", f"{metres} is not a length in metres")
                distances[pair] = metres
        return frozenset(pairs), distances

    def _nodes(self, rooms: Mapping[str, Room]) -> dict[str, Node]:
        nodes: dict[str, Node] = {}
        for i, entry in enumerate(self.file.nodes):
            name = self._id(entry.id, f"nodes[{i}].id")
            if name in nodes or name in rooms:
                raise self.error(f"nodes[{i}].id", f"duplicate id {name!r}")
            category = self._category(entry.category, f"nodes[{i}].category")
            nodes[name] = Node(name, category, not category.liftable if entry.fixed is None else entry.fixed)
            self.node_ids[name] = i
            self._place(name, entry.position, entry.footprint, f"nodes[{i}]")
        return nodes

    def _category(self, name: str, path: str) -> Category:
        if name in self.ontology:
            return self.ontology[name]
        raise UndeclaredCategory(name, self.ontology, f"{self.place}: $.{path}")

    def _place(self, name: str, at: Point | None, outline: Any, path: str) -> None:
        if at is not None:
            if not all(map(math.isfinite, at)):
                raise self.error(f"{path}.position", f"{list(at)} is not a point in metres")
            self.positions[name] = at
        if outline is not None:
            if len(outline) < 3 or not all(math.isfinite(v) for corner in outline for v in corner):
                raise self.error(f"{path}.footprint", "an outline has at least three corners [x, y] in metres")
            self.footprints[name] = outline

    def _known(self, name: str, known: Mapping[str, object], path: str, what: str) -> None:
        if name not in known:
            near = nearest_names(name, known)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise self.error(path, f"unknown {what} {name!r}{hint}")

    def _supports(self, rooms: Mapping[str, Room]) -> tuple[dict[str, Support], dict[str, tuple[str, ...]]]:
        supports: dict[str, Support] = {}
        contents: dict[str, list[str]] = {}
        held: str | None = None
        for i, entry in enumerate(self.file.nodes):
            path = f"nodes[{i}]"
            said = [name for name in ("on_top", "inside", "held") if getattr(entry, name)]
            if len(said) > 1:
                raise self.error(path, f"{entry.id!r} has two supports, {said[0]} and {said[1]}")
            if entry.room is not None:
                self._known(entry.room, rooms, f"{path}.room", "room")
            if entry.held:
                if held is not None:
                    raise self.error(f"{path}.held", f"the robot holds {held!r} already")
                held = entry.id
                supports[entry.id] = Support(Relation.HELD, ROBOT)
            elif said:
                holder = entry.on_top or entry.inside or ""
                self._known(holder, self.node_ids, f"{path}.{said[0]}", "node")
                supports[entry.id] = Support(Relation.ON_TOP if entry.on_top else Relation.INSIDE, holder)
                contents.setdefault(holder, []).append(entry.id)
            elif entry.room is not None:
                supports[entry.id] = Support(Relation.FLOOR, entry.room)
        self._check_cycles(supports)
        self._check_rooms(supports)
        return supports, {holder: tuple(sorted(items)) for holder, items in contents.items()}

    def _check_cycles(self, supports: Mapping[str, Support]) -> None:
        height: dict[str, int] = {}
        for start in supports:
            chain: dict[str, None] = {}
            obj = start
            while obj in supports and supports[obj].relation <= Relation.INSIDE and obj not in height:
                if obj in chain:
                    ring = [*list(chain)[list(chain).index(obj) :], obj]
                    raise self.error(f"nodes[{self.node_ids[obj]}]", f"cycle of supports: {' in or on '.join(ring)}")
                chain[obj] = None
                obj = supports[obj].holder
            for above in reversed(chain):
                height[above] = height.get(supports[above].holder, 0) + 1
                if height[above] > _HIGHEST:
                    path = f"nodes[{self.node_ids[above]}]"
                    raise self.error(path, f"{above!r} stands on {height[above]} others; at most {_HIGHEST}")

    def _check_rooms(self, supports: Mapping[str, Support]) -> None:
        for i, entry in enumerate(self.file.nodes):
            if entry.room is None or supports[entry.id].relation is Relation.FLOOR:
                continue
            obj = entry.id
            while obj in supports and supports[obj].relation <= Relation.INSIDE:
                obj = supports[obj].holder
            support = supports.get(obj)
            if support is None or support.relation is not Relation.FLOOR:
                where = "is nowhere" if support is None else "is held by the robot"
                raise self.error(f"nodes[{i}].room", f"{entry.room!r}, but {obj!r}, which holds {entry.id!r}, {where}")
            if support.holder != entry.room:
                raise self.error(f"nodes[{i}].room", f"{entry.room!r}, but {obj!r} is in {support.holder!r}")

    def _flags(self) -> tuple[frozenset[str], ...]:
        known = {flag.name.lower(): flag for flag in all_flags()}
        holds: dict[Flag, set[str]] = {}
        for i, entry in enumerate(self.file.nodes):
            for k, name in enumerate(entry.flags):
                self._known(name, known, f"nodes[{i}].flags[{k}]", "flag")
                holds.setdefault(known[name], set()).add(entry.id)
        last = max(holds, default=Flag.OPEN)
        return tuple(frozenset(holds.get(flag, ())) for flag in all_flags() if flag < len(Flag) or flag <= last)

    def _next_to(self, nodes: Mapping[str, Node]) -> frozenset[tuple[str, str]]:
        pairs: set[tuple[str, str]] = set()
        for i, (a, b) in enumerate(self.file.next_to):
            for name in (a, b):
                self._known(name, nodes, f"next_to[{i}]", "node")
            if a == b:
                raise self.error(f"next_to[{i}]", f"{a!r} is next to itself")
            pairs.add((a, b) if a < b else (b, a))
        return frozenset(pairs)


def graph_to_json(graph: SceneGraph) -> str:
    """Return a graph as JSON, so that `graph_from_json` gives an equal one; `SceneGraph.to_json` is the same.

    Categories that do not ship are written with it.
    """
    return msgspec.json.format(msgspec.json.encode(_file_of(graph)), indent=2).decode()


def _file_of(graph: SceneGraph) -> GraphFile:
    world, layout = graph.world, graph.world.layout
    shipped = default_ontology()
    own: dict[str, OwnCategory] = {}
    nodes = []
    for node in world.nodes.values():
        category = node.category
        if category.name not in shipped or shipped[category.name] != category:
            own[category.name] = OwnCategory.of(category)
        support = graph.supports.get(node.id)
        where = {Relation.ON_TOP: "on_top", Relation.INSIDE: "inside", Relation.FLOOR: "room", Relation.HELD: "held"}
        held = support is not None and support.relation is Relation.HELD
        at: dict[str, Any] = {} if support is None else {where[support.relation]: True if held else support.holder}
        nodes.append(
            NodeEntry(
                id=node.id,
                category=category.name,
                fixed=None if node.fixed == (not category.liftable) else node.fixed,
                flags=tuple(flag.name.lower() for flag in all_flags() if graph.has(flag, node.id)),
                position=layout.positions.get(node.id),
                footprint=layout.footprints.get(node.id),
                **at,
            )
        )
    return GraphFile(
        format=FORMAT,
        nodes=tuple(nodes),
        rooms=tuple(
            RoomEntry(r.id, r.type, layout.positions.get(r.id), layout.footprints.get(r.id))
            for r in world.rooms.values()
        ),
        connections=tuple(
            ConnectionEntry(pair, layout.distances_m[pair]) if pair in layout.distances_m else pair
            for pair in sorted(world.connections)
        ),
        robot=RobotEntry(graph.robot_room, tuple(sorted(graph.near)), layout.positions.get(ROBOT)),
        next_to=tuple(sorted(graph.next_to)),
        categories=own,
    )
