"""The typed scene graph G = (V, E, Phi), V = rooms + objects + robot (Sec. "Problem Statement" of the paper).

One class serves the hidden world G* and the agents' believed graph. A graph is frozen; `dynamics.apply` returns a new
one that shares what did not change. What never changes within an episode (rooms, categories) stands in `World`.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import msgspec
import networkx as nx

from gavel_env.frozen import frozen
from gavel_env.world_model.concepts import OR, default_concepts, is_concept
from gavel_env.world_model.layout import NO_LAYOUT, Layout
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["Flag", "Node", "Relation", "Room", "SceneGraph", "Support", "World", "all_flags"]


V = TypeVar("V")


class Relation(enum.IntEnum):
    """How a movable is held up: every movable has exactly one support."""

    ON_TOP = 0
    INSIDE = 1
    FLOOR = 2
    HELD = 3


class Flag(enum.IntEnum):
    """Unary states Phi. The first five are the paper's; the others serve BEHAVIOR activities."""

    OPEN = 0
    TOGGLED = 1
    COOKED = 2
    WASHED = 3
    DRIED = 4
    HOT = 5
    FROZEN = 6
    DIRTY = 7


OWN_FLAGS: list[Flag] = []
"""States of one's own (`own_actions.own_state`), in the order of their values behind those of `Flag`."""


def all_flags() -> tuple[Flag, ...]:
    """Return every state that there is: those of `Flag`, then those of one's own."""
    return (*Flag, *OWN_FLAGS)


class Room(NamedTuple):
    """A room instance r and its type tau(r)."""

    id: str
    type: str

    def fits(self, stated: str) -> bool:
        """Return whether a stated room is this one: by its id, its type or a concept of that (`any_office`).

        Of several (`bedroom|kitchen_0`) one must be.
        """
        if stated in (self.id, self.type):
            return True
        if OR in stated:
            return any(self.fits(part) for part in stated.split(OR))
        return is_concept(stated) and stated in default_concepts().of_room_type(self.type)


class Support(NamedTuple):
    """What holds an object: an object id (`ON_TOP`, `INSIDE`), a room id (`FLOOR`), or the robot (`HELD`)."""

    relation: Relation
    holder: str


class Node(NamedTuple):
    """An object o.

    Attributes:
        id: instance id, or a designator in the believed graph.
        category: c(o); the likeliest one where it may be of several.
        fixed: whether it is a fixed piece.
        stated_room: the room (id, type or concept) that a designator states, if any.
        others: what else a node named by a concept may be, likeliest first.
        weights: probability of `category` and of each of the others; empty if there are none.
    """

    id: str
    category: Category
    fixed: bool
    stated_room: str | None = None
    others: tuple[Category, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def categories(self) -> tuple[Category, ...]:
        """Return every category that it may have, likeliest first."""
        return (self.category, *self.others)


ROBOT = "robot"


class World(msgspec.Struct, frozen=True):
    """The unchanging part: rooms, their connections, and the objects' categories."""

    rooms: Mapping[str, Room]
    connections: frozenset[tuple[str, str]]
    nodes: Mapping[str, Node]
    by_category: Mapping[str, tuple[str, ...]]
    layout: Layout = NO_LAYOUT

    @classmethod
    def of(
        cls,
        rooms: Mapping[str, Room],
        connections: frozenset[tuple[str, str]],
        nodes: Mapping[str, Node],
        layout: Layout = NO_LAYOUT,
    ) -> World:
        """Build a world and its category index."""
        index: dict[str, list[str]] = {}
        for node in nodes.values():
            index.setdefault(node.category.name, []).append(node.id)
        by_category = {name: tuple(ids) for name, ids in index.items()}
        return cls(frozen(rooms), connections, frozen(nodes), frozen(by_category), layout)

    def instances(self, name: str) -> tuple[str, ...]:
        """Return the objects of a category, of a concept (`any_cabinet`) or of several (`desk|bed`), in order."""
        if OR in name:
            found = {node for part in name.split(OR) for node in (part, *self.instances(part))}
            return tuple(node for node in self.nodes if node in found)
        if is_concept(name):
            return tuple(node.id for node in self.nodes.values() if name in node.category.concepts)
        return self.by_category.get(name, ())


_NO_FLAGS: tuple[frozenset[str], ...] = (frozenset(),) * len(Flag)


class SceneGraph(msgspec.Struct, frozen=True):
    """One state of the world.

    Attributes:
        world: rooms, connections and categories.
        supports: object id -> its support; absent = location unknown.
        contents: holder object id -> ids directly on or in it, sorted.
        flags: per `Flag`, the ids for which it holds; behind them, states of one's own as far as any were set.
        near: ids within reach of the robot.
        holding: id in the gripper, or None.
        robot_room: room of the robot, or None if the believed graph does not say.
        next_to: unordered pairs (a < b) of things put down beside each other on the floor.
    """

    world: World
    supports: Mapping[str, Support]
    contents: Mapping[str, tuple[str, ...]]
    flags: tuple[frozenset[str], ...] = _NO_FLAGS
    near: frozenset[str] = frozenset()
    holding: str | None = None
    robot_room: str | None = None
    next_to: frozenset[tuple[str, str]] = frozenset()

    def has(self, flag: Flag, obj: str) -> bool:
        """Return whether `flag` holds for `obj`."""
        flags = self.flags
        return flag < len(flags) and obj in flags[flag]

    def category(self, obj: str) -> Category:
        """Return c(obj)."""
        return self.world.nodes[obj].category

    def holders(self, obj: str) -> Iterator[tuple[Relation, str]]:
        """Yield (relation, holder) from the direct holder outwards; rooms and the robot are not holders."""
        support = self.supports.get(obj)
        while support is not None and support.relation <= Relation.INSIDE:
            yield support
            support = self.supports.get(support.holder)

    def closed_container(self, obj: str) -> str | None:
        """Return the innermost shut container around `obj`, or None if it is accessible."""
        support = self.supports.get(obj)
        while support is not None and support.relation <= Relation.INSIDE:
            relation, holder = support
            if relation == Relation.INSIDE and self.is_shut(holder):
                return holder
            support = self.supports.get(holder)
        return None

    def is_shut(self, obj: str) -> bool:
        """Return whether `obj` has a door that is not open."""
        return self.world.nodes[obj].category.openable and obj not in self.flags[Flag.OPEN]

    def room_of(self, obj: str) -> str | None:
        """Return the room of `obj` through its supports, or None if unknown."""
        support = self.supports.get(obj)
        while support is not None:
            relation, holder = support
            if relation == Relation.FLOOR:
                return holder
            if relation == Relation.HELD:
                return self.robot_room
            support = self.supports.get(holder)
        return None

    def descendants(self, obj: str) -> list[str]:
        """Return the movables on or in `obj`, and on or in those, depth first."""
        found: list[str] = []
        stack = list(self.contents.get(obj, ()))
        nodes = self.world.nodes
        while stack:
            item = stack.pop()
            if nodes[item].fixed:
                continue
            found.append(item)
            if item in self.contents:
                stack.extend(self.contents[item])
        return found

    def contains(self, outer: str, inner: str) -> bool:
        """Return whether `inner` is on or in `outer`, at any depth."""
        return any(holder == outer for _, holder in self.holders(inner))

    def beside(self, a: str, b: str) -> bool:
        """Return next_to(a, b): put down beside each other, or on or in the same piece."""
        if a == b:
            return False
        if ((a, b) if a < b else (b, a)) in self.next_to:
            return True
        support = self.supports.get(a)
        return support is not None and support.relation <= Relation.INSIDE and support == self.supports.get(b)

    def beneath(self, a: str, b: str) -> bool:
        """Return under(a, b): on the floor beside a piece that has room beneath it."""
        support = self.supports.get(a)
        if support is None or support.relation != Relation.FLOOR:
            return False
        return self.world.nodes[b].category.clearance and self.beside(a, b)

    def place(self, obj: str, support: Support | None) -> SceneGraph:
        """Return the graph with `obj` (and all on or in it) moved to `support`; None = location unknown."""
        supports = _merged(self.supports, {})
        contents = _merged(self.contents, {})
        old = supports.get(obj)
        if old is not None and old.relation <= Relation.INSIDE:
            rest = tuple(o for o in contents[old.holder] if o != obj)
            if rest:
                contents[old.holder] = rest
            else:
                del contents[old.holder]
        if support is None:
            supports.pop(obj, None)
        else:
            # Overwritten, never popped first: a dict without gaps is copied whole, one with a gap entry by entry.
            supports[obj] = support
            if support.relation <= Relation.INSIDE:
                contents[support.holder] = tuple(sorted((*contents.get(support.holder, ()), obj)))
        return msgspec.structs.replace(self, supports=supports, contents=contents)

    def with_flag(self, flag: Flag, objects: frozenset[str], *, value: bool = True) -> SceneGraph:
        """Return the graph with `flag` set (or cleared) for `objects`."""
        flags = list(self.flags)
        if flag >= len(flags):
            flags += [frozenset()] * (flag + 1 - len(flags))
        flags[flag] = flags[flag] | objects if value else flags[flag] - objects
        return msgspec.structs.replace(self, flags=tuple(flags))

    def with_nodes(self, nodes: Mapping[str, Node]) -> SceneGraph:
        """Return the graph with more objects known; their locations are unknown until placed."""
        nodes = _merged(self.world.nodes, nodes)
        world = World.of(self.world.rooms, self.world.connections, nodes, self.world.layout)
        return msgspec.structs.replace(self, world=world)

    def edges(self) -> Iterator[tuple[str, str, str]]:
        """Yield every relation of E as (relation, a, b), in a fixed order."""
        for a, b in sorted(self.world.connections):
            yield "room_connect", a, b
        for obj in sorted(self.world.nodes):
            support = self.supports.get(obj)
            if support is not None:
                if support.relation != Relation.FLOOR:
                    yield _EDGE_NAMES[support.relation], *_edge_ends(obj, support)
                if (room := self.room_of(obj)) is not None:
                    yield "room_inside", obj, room
        for a, b in sorted(self.next_to):
            yield "next_to", a, b
            for x, y in ((a, b), (b, a)):
                if self.beneath(x, y):
                    yield "under", x, y
        for obj in sorted(self.near):
            yield "near", ROBOT, obj
        if self.robot_room is not None:
            yield "room_inside", ROBOT, self.robot_room

    @classmethod
    def from_json(cls, source: str | bytes | Path | Mapping[str, Any], ontology: Ontology | None = None) -> SceneGraph:
        """Read a graph of one's own (format `gavel-graph/1`, docs/howto/worlds.md).

        Args:
            source: path of a file, the JSON itself, or what it says as a mapping.
            ontology: the categories known; default the shipped ones. A file may add its own.

        Raises:
            GraphError: unreadable or malformed, with the path inside the file.
            UndeclaredCategory: a category is not known; with the lines that would add it.
        """
        from gavel_env.world_model.graph_file import graph_from_json

        return graph_from_json(source, ontology)

    def to_json(self) -> str:
        """Return the graph as JSON that `from_json` reads, own categories and layout included."""
        from gavel_env.world_model.graph_file import graph_to_json

        return graph_to_json(self)

    @classmethod
    def from_networkx(cls, graph: nx.Graph[Any], ontology: Ontology | None = None) -> SceneGraph:
        """Read a graph in the form of `to_networkx`; what is optional there may be missing.

        Raises:
            GraphError, UndeclaredCategory: as `from_json`.
        """
        from gavel_env.world_model.networkx_graph import graph_from_networkx

        return graph_from_networkx(graph, ontology)

    def to_networkx(self) -> nx.MultiDiGraph[str]:
        """Return the graph as a networkx multigraph; nodes carry `kind`, `category` and `flags`, edges `relation`.

        What the layout knows is there too: nodes carry `position` and `footprint`, `room_connect` edges `distance_m`.
        `from_networkx` reads it back.
        """
        layout = self.world.layout
        out: nx.MultiDiGraph[str] = nx.MultiDiGraph()
        for room in self.world.rooms.values():
            out.add_node(room.id, kind="room", category=room.type, flags=())
        for node in self.world.nodes.values():
            held = tuple(flag.name.lower() for flag in all_flags() if self.has(flag, node.id))
            out.add_node(node.id, kind="object", category=node.category.name, flags=held, fixed=node.fixed)
        out.add_node(ROBOT, kind="robot", category=ROBOT, flags=())
        for name, known in (("position", layout.positions), ("footprint", layout.footprints)):
            nx.set_node_attributes(out, {node: value for node, value in known.items() if node in out}, name)
        for relation, a, b in self.edges():
            attributes: dict[str, Any] = {"relation": relation}
            if relation == "room_connect" and (a, b) in layout.distances_m:
                attributes["distance_m"] = layout.distances_m[(a, b)]
            out.add_edge(a, b, key=relation, **attributes)
        return out


def _merged(mapping: Mapping[str, V], more: Mapping[str, V]) -> dict[str, V]:
    """Return a new dict of both; `|` copies what lies under a frozen view at once, where `dict` asks for every key."""
    merged: dict[str, V] = cast("dict[str, V]", mapping) | more  # type: ignore[operator]
    return merged


_EDGE_NAMES = {
    Relation.ON_TOP: "on_top",
    Relation.INSIDE: "object_inside",
    Relation.HELD: "holding",
}


def _edge_ends(obj: str, support: Support) -> tuple[str, str]:
    return (ROBOT, obj) if support.relation == Relation.HELD else (obj, support.holder)
