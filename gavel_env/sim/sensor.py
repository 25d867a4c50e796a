"""The sensor Xi: a wedge camera on the robot, and what it has shown so far.

Walls stop sight, furniture does not. A piece is seen once floor of its own room within `seen_within_m` of it was seen;
what stands on it or lies in it is seen with it, unless a shut door is between. Seeing never forgets.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.floor_map import FloorMap, Indices
from gavel_env.world_model.graph import Relation, SceneGraph, World

__all__ = ["Sensor", "Watch", "observed_part", "revealed", "watch"]

_WALL_DEPTH_M = 1.5  # a piece of a room may stand this far inside its walls and still be seen from its floor


class Watch(NamedTuple):
    """Which floor reveals which piece; one per map.

    Attributes:
        pieces: furniture ids; an entry of `watched` indexes them.
        starts: (cells + 1,) where each cell's entries in `watched` begin.
        watched: pieces that each cell reveals, all cells in a row.
        floor_cells: (n,) flat indices of each room's floor, ascending, in the map's room order.
        counts: (rooms,) the sizes of `floor_cells`.
    """

    pieces: tuple[str, ...]
    starts: Indices
    watched: Indices
    floor_cells: tuple[Indices, ...]
    counts: Indices


@lru_cache(maxsize=64)
def watch(floor: FloorMap) -> Watch:
    """Return the watch table of a map, computed once."""
    from gavel_env.house.kernels import sight as sight_kernels

    cell_m = floor.robot.cell_m
    pieces = tuple(floor.pieces)
    within, margin = floor.robot.seen_within_m / cell_m, _WALL_DEPTH_M / cell_m
    cells = [
        sight_kernels.watching_cells(
            floor.opaque, floor.rooms, floor.room_index[floor.pieces[p].room], floor.rectangle(p), within, margin
        )
        for p in pieces
    ]
    by_cell = np.concatenate([np.empty(0, np.int32), *cells])
    owners = np.repeat(np.arange(len(pieces), dtype=np.int32), [len(c) for c in cells])
    counts = np.bincount(by_cell, minlength=floor.rooms.size)
    inside = np.where(floor.opaque, -1, floor.rooms).ravel()
    room_cells = tuple(np.nonzero(inside == i)[0].astype(np.int32) for i in range(len(floor.room_ids)))
    return Watch(
        pieces,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        owners[np.argsort(by_cell, kind="stable")],
        room_cells,
        np.array([len(c) for c in room_cells], np.int32),
    )


class Sensor:
    """What the camera has seen of one house in one episode.

    Attributes:
        floor: the map it looks at.
        seen: (height, width) bool, floor seen so far.
        spotted: (pieces,) bool, by position in the watch table.
    """

    def __init__(self, floor: FloorMap) -> None:
        self.floor = floor
        self.seen: NDArray[np.bool_] = np.zeros(floor.shape, np.bool_)
        self._watch = watch(floor)
        self.spotted: NDArray[np.bool_] = np.zeros(len(self._watch.pieces), np.bool_)
        self._room_seen = np.zeros(len(floor.room_ids), np.int32)
        self._log = np.empty(floor.rooms.size, np.int32)  # seen cells in the order seen
        self._logged = 0
        self._frontiers: dict[int, tuple[Indices, int]] = {}  # per room, with how much of the log they know
        self._touched = np.zeros(floor.shape, np.bool_)
        self._hiding: dict[int, Indices] = {}  # per room; only shrinks, so the next call starts from the last
        self._fresh = np.empty(len(self._watch.pieces), np.int32)
        self._half_angle = math.radians(floor.robot.camera_fov_deg) / 2.0
        self._range_cells = floor.robot.camera_range_m / floor.robot.cell_m
        self._within_cells = floor.robot.seen_within_m / floor.robot.cell_m

    def look(self, cell: int, heading: float) -> list[str]:
        """Take a picture.

        Args:
            cell: flat index of the robot's cell.
            heading: radians, clockwise from x.

        Returns:
            The pieces seen for the first time.
        """
        return self._look(cell, heading, 1)

    def _look(self, cell: int, heading: float, turns: int) -> list[str]:
        from gavel_env.house.kernels import sight as sight_kernels

        count, self._logged = sight_kernels.look(
            self.floor.opaque,
            self.floor.rooms,
            cell,
            heading,
            turns,
            self._half_angle,
            self._range_cells,
            self.seen,
            self._room_seen,
            self._watch.starts,
            self._watch.watched,
            self.spotted,
            self._fresh,
            self._log,
            self._logged,
        )
        return [self._watch.pieces[i] for i in self._fresh[:count]]

    def scan(self, cell: int, heading: float) -> list[str]:
        """Turn on the spot and take pictures all around; return the pieces seen for the first time."""
        return self._look(cell, heading, self.floor.robot.scan_headings)

    def saw_floor_near(self, cells: Indices) -> NDArray[np.bool_]:
        """Tell for each of (n,) cells whether what lies on the floor there has been seen."""
        from gavel_env.house.kernels import sight as sight_kernels

        return sight_kernels.seen_near(cells, self.seen, self.floor.rooms, self._within_cells)

    def seen_share(self, room: str) -> float:
        """Return the share of a room's floor that was seen (1 for a room without floor)."""
        index = self.floor.room_index[room]
        total = int(self._watch.counts[index])
        return int(self._room_seen[index]) / total if total else 1.0

    def seen_shares(self) -> Mapping[str, float]:
        """Return the seen share of every room."""
        return {room: self.seen_share(room) for room in self.floor.room_ids}

    def is_complete(self, room: str) -> bool:
        """Tell whether nothing can have been missed: enough floor seen, and no spot left to hide an object."""
        return self.seen_share(room) >= self.floor.robot.searched_share and self.hiding_cells(room).size == 0

    def hiding_cells(self, room: str) -> Indices:
        """Return (n,) floor cells of a room around which nothing was seen within `seen_within_m`."""
        index = self.floor.room_index[room]
        cells = self._hiding.get(index, self._watch.floor_cells[index])
        self._hiding[index] = cells[~self.saw_floor_near(cells)]
        return self._hiding[index]

    def frontier(self, room: str, given_up: NDArray[np.bool_]) -> Indices:
        """Return (n,) unseen floor cells of a room that touch seen floor, without those given up."""
        from gavel_env.house.kernels import sight as sight_kernels

        index = self.floor.room_index[room]
        before, known = self._frontiers.get(index, (np.empty(0, np.int32), 0))
        if known < self._logged:
            fresh = self._log[known : self._logged]
            cells = sight_kernels.frontier_cells(
                before, fresh, self.seen, self.floor.opaque, self.floor.rooms, index, self._touched
            )
            before = np.sort(cells)
            self._frontiers[index] = before, self._logged
        return before[~given_up.ravel()[before]]


def revealed(graph: SceneGraph, obj: str) -> Iterator[str]:
    """Yield an object and the movables that are seen with it: on it, or in it while it is not shut; so on downwards."""
    yield obj
    shut = graph.is_shut(obj)
    for item in graph.contents.get(obj, ()):
        if not graph.world.nodes[item].fixed and not (shut and graph.supports[item].relation is Relation.INSIDE):
            yield from revealed(graph, item)


def observed_part(graph: SceneGraph, observed: Iterable[str]) -> SceneGraph:
    """Return a graph restricted to the observed ids, nodes in their order: z = Xi(x, G*) gathered over the episode."""
    nodes = {obj: graph.world.nodes[obj] for obj in observed}
    contents = {
        holder: kept
        for holder, held in graph.contents.items()
        if holder in nodes and (kept := tuple(o for o in held if o in nodes))
    }
    return SceneGraph(
        World.of(graph.world.rooms, graph.world.connections, nodes),
        {obj: graph.supports[obj] for obj in nodes},
        contents,
        tuple(frozenset(o for o in flagged if o in nodes) for flagged in graph.flags),
        frozenset(o for o in graph.near if o in nodes),
        graph.holding,
        graph.robot_room,
        frozenset(pair for pair in graph.next_to if pair[0] in nodes and pair[1] in nodes),
    )
