"""The observed graph of an episode as arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import GraphInstance
from numpy.typing import NDArray

from gavel_env.envs.spaces import (
    AFFORDANCES,
    MAX_ROOMS,
    NO_ROOM,
    NODE_COLUMNS,
    OUTCOMES,
    ROOM_TYPES,
    EdgeType,
    NodeKind,
    TooManyNodes,
)
from gavel_env.exchange import Observed
from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.graph import Flag, Relation, Room, SceneGraph
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["GraphEncoder"]

_COLUMN = {name: i for i, name in enumerate(NODE_COLUMNS)}
_FIRST_FLAG = _COLUMN[next(iter(Flag)).name.lower()]
_X, _Y, _ROOM, _SEARCHED, _NEAR, _HELD = (_COLUMN[c] for c in ("x_m", "y_m", "room", "searched", "near", "held"))
_EDGES = {Relation.ON_TOP: EdgeType.ON_TOP, Relation.INSIDE: EdgeType.OBJECT_INSIDE}
_OUTCOME_INDEX: Mapping[str, int] = {outcome: i for i, outcome in enumerate(OUTCOMES)}


class GraphEncoder:
    """Turns the observed graph of one episode into arrays; what did not change since the last call is reused.

    Args:
        layout: the known map: rooms and their geometry.
        ontology: the category vocabulary.
        max_nodes: most nodes that the spaces hold.
    """

    def __init__(self, layout: FloorMap, ontology: Ontology, max_nodes: int) -> None:
        self._ontology = ontology
        self._max_nodes = max_nodes
        self.rooms = layout.room_ids
        self.node: dict[str, int] = {room: 1 + i for i, room in enumerate(self.rooms)}
        self._scene = layout.scene.scene
        self._room_types = {room.id: room.type for room in layout.scene.rooms}
        if len(self.rooms) > MAX_ROOMS:
            raise TooManyNodes(f"scene {self._scene!r} has {len(self.rooms)} rooms; the spaces hold {MAX_ROOMS}")
        first_object = 1 + len(self.rooms)
        self.objects: list[str] = []
        self._rows = np.zeros((first_object, len(NODE_COLUMNS)), np.float32)
        self._rows[0, _ROOM] = -1
        for row, room in enumerate(layout.scene.rooms, start=1):
            corners = np.array(room.polygon)
            low, high = corners.min(axis=0), corners.max(axis=0)
            kind = ROOM_TYPES.index(room.type) if room.type in ROOM_TYPES else -1
            self._rows[row, :7] = (NodeKind.ROOM, kind, *(low + high) / 2, *(high - low), row)
        self._graph: SceneGraph | None = None
        self._searched: frozenset[str] = frozenset()  # as marked in the rows of the graph, and in `searched`
        self._searched_rooms: frozenset[str] = frozenset()
        self._searched_row = np.zeros(MAX_ROOMS, np.int8)
        self._edges = np.zeros((0, 2, 3), np.int64)  # of an object: to what it is on or in, and to its room
        self._has = np.zeros((0, 2), np.bool_)  # which of the two there are
        self._links: NDArray[np.int32] = np.zeros((0, 2), np.int32)
        self._types: NDArray[np.int64] = np.zeros(0, np.int64)

    def check_size(self, objects: int) -> None:
        """Check that the spaces can hold a scene of so many objects.

        Raises:
            TooManyNodes: they cannot.
        """
        if 1 + len(self.rooms) + objects > self._max_nodes:
            raise TooManyNodes(
                f"scene {self._scene!r} may show more nodes than max_nodes={self._max_nodes}; make the environment "
                "with a larger max_nodes"
            )

    def fits_room(self, designator: Designator) -> NDArray[np.bool_]:
        """Return (rooms,) bool: whether a designator's room is this one, by id, type or concept."""
        stated = designator.room
        return np.array([stated is None or Room(room, self._room_types[room]).fits(stated) for room in self.rooms])

    def common_name(self, rooms: Sequence[str]) -> str | None:
        """Return the room id or type that means exactly these rooms, or None if there is none."""
        if len(rooms) == 1:
            return rooms[0]
        types = {self._room_types[room] for room in rooms}
        if len(types) == 1 and all((room in rooms) == (kind in types) for room, kind in self._room_types.items()):
            return types.pop()
        return None

    def name(self, node: int) -> str | None:
        """Return the id of a room's or an object's node; None for the robot and for unused indices."""
        if 1 <= node <= len(self.rooms):
            return self.rooms[node - 1]
        index = node - 1 - len(self.rooms)
        return self.objects[index] if 0 <= index < len(self.objects) else None

    def update(self, graph: SceneGraph) -> None:
        """Give every newly observed object its node."""
        if len(graph.world.nodes) == len(self.objects):
            return
        fresh = list(graph.world.nodes)[len(self.objects) :]
        rows = np.zeros((len(fresh), len(NODE_COLUMNS)), np.float32)
        for row, obj in zip(rows, fresh, strict=True):
            node = graph.world.nodes[obj]
            self.node[obj] = 1 + len(self.rooms) + len(self.objects)
            self.objects.append(obj)
            row[0] = NodeKind.OBJECT
            row[1] = self._ontology.index.get(node.category.name, -1)
            row[_COLUMN["fixed"]] = node.fixed
            row[-len(AFFORDANCES) - 2 :] = _affordances(node.category)
        self._rows = np.concatenate([self._rows, rows])

    def encode(self, observed: Observed, robot: tuple[float, float]) -> GraphInstance:
        """Return the observed graph: nodes (n, columns) float32, edges (m,) relation, edge_links (m, 2) node indices.

        Args:
            observed: the agent's view.
            robot: x, y of the robot, metres.
        """
        graph = observed.graph
        self.update(graph)
        last = self._graph
        if last is None or graph.supports is not last.supports or graph.next_to is not last.next_to:
            self._follow(observed)
        if observed.searched != self._searched:
            self._searched = observed.searched
            self._rows[[self.node[r] for r in sorted(observed.searched)], _SEARCHED] = 1
        self._graph = graph
        nodes = self._rows.copy()
        node = self.node
        room = -1 if graph.robot_room is None else node[graph.robot_room]
        nodes[0, _X], nodes[0, _Y], nodes[0, _ROOM] = robot[0], robot[1], room
        for flag, flagged in enumerate(graph.flags, start=_FIRST_FLAG):
            for obj in flagged:
                nodes[node[obj], flag] = 1
        near = sorted(node[obj] for obj in graph.near)
        nodes[near, _NEAR] = 1
        with_robot = [0]
        if graph.holding is not None:
            nodes[node[graph.holding], _HELD] = 1
            with_robot += [node[o] for o in (graph.holding, *graph.descendants(graph.holding))]
            nodes[with_robot, _X], nodes[with_robot, _Y], nodes[with_robot, _ROOM] = robot[0], robot[1], room
        if room < 0:
            with_robot = []
        still, here = len(self._links), len(self._links) + len(near)
        links = np.zeros((here + len(with_robot), 2), np.int32)
        types = np.empty(len(links), np.int64)
        links[:still], types[:still] = self._links, self._types
        links[still:here, 1], types[still:here] = near, EdgeType.NEAR
        links[here:, 0], links[here:, 1], types[here:] = with_robot, room, EdgeType.ROOM_INSIDE
        return GraphInstance(nodes=nodes, edges=types, edge_links=links)

    def _follow(self, observed: Observed) -> None:
        """Bring places and edges up to date of what is new, or was taken up or put down, with what is on or in it."""
        graph = observed.graph
        known = len(self._has)
        fresh = len(self.objects) - known
        self._edges = np.concatenate([self._edges, np.zeros((fresh, 2, 3), np.int64)])
        self._has = np.concatenate([self._has, np.zeros((fresh, 2), np.bool_)])
        handled = {graph.holding, None if self._graph is None else self._graph.holding}
        moved = [obj for obj in handled if obj is not None]
        changed = {*moved, *(below for obj in moved for below in graph.descendants(obj)), *self.objects[known:]}
        held = graph.holding
        carried = set() if held is None else {held, *graph.descendants(held)}
        for obj in changed:
            node = self.node[obj]
            index = node - 1 - len(self.rooms)
            room, support = graph.room_of(obj), graph.supports.get(obj)
            in_room = -1 if room is None else self.node[room]
            self._rows[node, _ROOM] = in_room
            self._rows[node, [_X, _Y]] = observed.positions[obj]
            self._has[index] = False
            if support is None:
                continue
            if support.relation is Relation.HELD:
                self._edges[index, 0] = EdgeType.HOLDING, 0, node
                self._has[index, 0] = True
            elif support.relation in _EDGES:
                self._edges[index, 0] = _EDGES[support.relation], node, self.node[support.holder]
                self._has[index, 0] = True
            if in_room >= 0 and obj not in carried:
                self._edges[index, 1] = EdgeType.ROOM_INSIDE, node, in_room
                self._has[index, 1] = True
        self._join(graph)

    def _join(self, graph: SceneGraph) -> None:
        """Put together the edges that do not change while the robot drives."""
        node = self.node
        rooms = [(EdgeType.ROOM_CONNECT, node[a], node[b]) for a, b in sorted(graph.world.connections)]
        beside = []
        for a, b in sorted(graph.next_to):
            beside.append((EdgeType.NEXT_TO, node[a], node[b]))
            beside.extend((EdgeType.UNDER, node[x], node[y]) for x, y in ((a, b), (b, a)) if graph.beneath(x, y))
        parts = [np.array(edges, np.int64).reshape(-1, 3) for edges in (rooms, beside)]
        table = np.concatenate([parts[0], self._edges[self._has], parts[1]])
        self._types = table[:, 0]
        self._links = table[:, 1:].astype(np.int32)

    def small(self, observed: Observed, robot: tuple[float, float]) -> dict[str, Any]:
        """Return the observation without the graph; `robot`: its x, y in metres."""
        self.update(observed.graph)
        graph = observed.graph
        for room in observed.searched - self._searched_rooms:
            self._searched_row[self.node[room] - 1] = 1
        self._searched_rooms = observed.searched
        heading = math.radians(observed.heading_deg)
        return {
            "holding": 0 if graph.holding is None else self.node[graph.holding],
            "instruction": observed.instruction,
            "metres": np.array([observed.metres], np.float32),
            "outcome": _OUTCOME_INDEX[observed.outcome],
            "pose": np.array((robot[0], robot[1], math.cos(heading), math.sin(heading)), np.float32),
            "room": NO_ROOM if graph.robot_room is None else self.node[graph.robot_room] - 1,
            "searched": self._searched_row.copy(),
        }


def _affordances(category: Category) -> list[bool]:
    values = [bool(getattr(category, name)) for name in AFFORDANCES]
    return [*values, category.heat is not None, category.cold is not None]
