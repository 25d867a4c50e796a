"""Where the robot can drive, and how far: rooms, walls, free floor, exact shortest routes, stances.

Two maps of the same scene: `known_layout` has rooms, walls and openings (what every agent knows: D(r, r') and
A_trav(r) of the paper's search cost come from it), `floor_map` adds the furniture (what the executor drives on).
Traversability is eroded by the robot's disc; routes are exact shortest paths on the 8-connected grid, straight steps
of one cell, diagonal ones of sqrt(2), corners never cut. What cannot be reached is `None`, never a number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_env.errors import SceneError, UnknownObject
from gavel_env.frozen import frozen
from gavel_env.house.rasters import footprint, rasterise
from gavel_env.house.robot_config import DEFAULT_ROBOT, RobotConfig
from gavel_env.house.scenes import Furniture, Scene

__all__ = ["Cell", "FloorMap", "Route", "floor_map", "known_layout"]

Indices = NDArray[np.int32]
_Array = TypeVar("_Array", bound=NDArray[Any])


class Cell(NamedTuple):
    """A map cell: row grows with y, column with x."""

    row: int
    column: int


class Route(NamedTuple):
    """A drive from cell to cell: (n,) flat cell indices, start and end included, and its length."""

    cells: Indices
    metres: float


@dataclass(frozen=True, eq=False)
class FloorMap:
    """A scene as a grid that can be driven on. Flat cell index = row * width + column.

    Attributes:
        scene: the scene it was drawn from.
        robot: the robot it was eroded for.
        origin_m: x, y of the grid's corner.
        rooms: (height, width) int16, index into `room_ids`, -1 outside.
        opaque: (height, width) bool, outside or wall: closed to sight, arm and travel.
        obstacle: (height, width) bool, cell centre on the footprint of a blocking piece.
        free: (height, width) bool, the robot's centre may be here.
        pieces: furniture by id; empty in the known layout.
    """

    scene: Scene
    robot: RobotConfig
    origin_m: tuple[float, float]
    rooms: NDArray[np.int16]
    opaque: NDArray[np.bool_]
    obstacle: NDArray[np.bool_]
    free: NDArray[np.bool_]
    pieces: Mapping[str, Furniture]
    _stances: dict[str, Indices] = field(default_factory=dict, repr=False)
    _fields: dict[str, NDArray[np.float64]] = field(default_factory=dict, repr=False)

    @property
    def shape(self) -> tuple[int, int]:
        """Return (height, width) in cells."""
        return self.rooms.shape[0], self.rooms.shape[1]

    @cached_property
    def room_ids(self) -> tuple[str, ...]:
        """Return the rooms in scene order; their positions are the values of `rooms`."""
        return tuple(room.id for room in self.scene.rooms)

    @cached_property
    def room_index(self) -> Mapping[str, int]:
        """Return the position of every room id in `room_ids`."""
        return frozen({room: i for i, room in enumerate(self.room_ids)})

    @cached_property
    def floor(self) -> NDArray[np.bool_]:
        """Return (height, width) bool: floor of some room, furniture or not."""
        return _frozen(~self.opaque)

    @cached_property
    def reachable(self) -> NDArray[np.bool_]:
        """Return (height, width) bool: the largest connected region of free floor; the robot never leaves it."""
        from gavel_env.house.kernels import routes as kernels

        label = kernels.components(self.free)
        if label.max() < 0:
            radius_m = self.robot.robot_radius_m
            raise SceneError(f"scene {self.scene.scene!r}: no floor is free for a robot of {radius_m} m")
        sizes = np.bincount(label[label >= 0])
        return _frozen(label == int(np.argmax(sizes)))

    @cached_property
    def start(self) -> int:
        """Return the reachable cell nearest to the middle of the reachable floor: where the robot begins."""
        return self._middle(self.reachable)

    @cached_property
    def room_cells(self) -> Mapping[str, Indices]:
        """Return the reachable cells of every room, (n,) flat, ascending; empty where the robot cannot enter."""
        inside = np.where(self.reachable, self.rooms, -1).ravel()
        return frozen(
            {room: _frozen(np.nonzero(inside == i)[0].astype(np.int32)) for i, room in enumerate(self.room_ids)}
        )

    @cached_property
    def room_points(self) -> Mapping[str, int | None]:
        """Return one reachable cell per room, nearest to the middle of its reachable floor; None if there is none."""
        points: dict[str, int | None] = {}
        for room, cells in self.room_cells.items():
            inside = np.zeros(self.shape, np.bool_)
            inside.ravel()[cells] = True
            points[room] = self._middle(inside) if cells.size else None
        return frozen(points)

    def _room_field(self, room: str) -> NDArray[np.float64] | None:
        """Return the distances in metres from a room's point, computed once; None if the room cannot be entered."""
        point = self.room_points[self._known_room(room)]
        if point is not None and room not in self._fields:
            self._fields[room] = self.distance_field(point)
        return self._fields.get(room)

    def _known_room(self, room: str) -> str:
        if room not in self.room_index:
            raise UnknownObject(room, self.room_index, f"the rooms of scene {self.scene.scene!r}")
        return room

    def _middle(self, inside: NDArray[np.bool_]) -> int:
        rows, columns = np.nonzero(inside)
        away = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
        nearest = int(np.argmin(away))
        return int(rows[nearest]) * self.shape[1] + int(columns[nearest])

    def cell(self, index: int) -> Cell:
        """Return row and column of a flat index."""
        return Cell(*divmod(int(index), self.shape[1]))

    def cell_at(self, x: float, y: float) -> int | None:
        """Return the flat index of the cell at a point in metres; None outside the grid."""
        column = int(np.floor((x - self.origin_m[0]) / self.robot.cell_m))
        row = int(np.floor((y - self.origin_m[1]) / self.robot.cell_m))
        height, width = self.shape
        return row * width + column if 0 <= row < height and 0 <= column < width else None

    def point(self, index: int) -> tuple[float, float]:
        """Return x, y in metres of a cell's centre."""
        row, column = self.cell(index)
        cell_m = self.robot.cell_m
        return self.origin_m[0] + (column + 0.5) * cell_m, self.origin_m[1] + (row + 0.5) * cell_m

    def points(self, cells: Indices) -> NDArray[np.float64]:
        """Return (n, 2) x, y in metres of the centres of (n,) cells."""
        rows, columns = np.divmod(cells, self.shape[1])
        corner = np.array(self.origin_m)
        centres: NDArray[np.float64] = np.stack([columns + 0.5, rows + 0.5], axis=1) * self.robot.cell_m + corner
        return centres

    def room_of(self, index: int) -> str | None:
        """Return the room that a cell is floor of; None outside."""
        room = int(self.rooms.flat[index])
        return self.room_ids[room] if room >= 0 else None

    def nearest_reachable(self, x: float, y: float, room: str | None = None) -> int | None:
        """Return the reachable cell (of a room) nearest to a point in a straight line; None if there is none."""
        cells = np.nonzero(self.reachable.ravel())[0] if room is None else self.room_cells[self._known_room(room)]
        if cells.size == 0:
            return None
        away = ((self.points(cells.astype(np.int32)) - (x, y)) ** 2).sum(axis=1)
        return int(cells[int(np.argmin(away))])

    def route(self, start: int, goals: Iterable[int] | Indices) -> Route | None:
        """Return the exact shortest route from a cell to the nearest of the goals; None if none can be reached."""
        from gavel_env.house.kernels import routes as kernels

        wanted = np.asarray(goals if isinstance(goals, np.ndarray) else list(goals), dtype=np.int32)
        cells = kernels.shortest_path(self.free, int(start), wanted)
        return Route(cells, self.length_m(cells)) if cells.size else None

    def length_m(self, cells: Indices) -> float:
        """Return the metres of a chain of touching cells."""
        rows, columns = np.divmod(cells, self.shape[1])
        diagonal = int(np.count_nonzero((np.diff(rows) != 0) & (np.diff(columns) != 0)))
        straight = len(cells) - 1 - diagonal
        return (straight + diagonal * float(np.sqrt(2.0))) * self.robot.cell_m

    def distance(self, start: int, goals: Iterable[int] | Indices) -> float | None:
        """Return the metres to the nearest of the goals; None if none can be reached."""
        route = self.route(start, goals)
        return None if route is None else route.metres

    def distance_field(self, source: int) -> NDArray[np.float64]:
        """Return (height, width) metres from a cell to every cell; inf marks what it cannot reach."""
        from gavel_env.house.kernels import routes as kernels

        return _frozen(kernels.distance_field(self.free, np.array([source], np.int32)) * self.robot.cell_m)

    def room_distance(self, a: str, b: str) -> float | None:
        """Return D(a, b): metres between the points of two rooms; None if one cannot be reached."""
        field_m, point = self._room_field(a), self.room_points[self._known_room(b)]
        return None if field_m is None or point is None else float(field_m.flat[point])

    def distance_to_room(self, start: int, room: str) -> float | None:
        """Return the metres from a reachable cell to the point of a room; None if the room cannot be entered."""
        field_m = self._room_field(room)
        metres = np.inf if field_m is None else float(field_m.flat[start])
        return float(metres) if np.isfinite(metres) else None

    def distance_to_piece(self, start: int, piece: str) -> float | None:
        """Return the metres from a cell to the nearest stance of a piece; None if it has none."""
        return self.distance(start, self.stances(piece))

    def traversable_m2(self, room: str) -> float:
        """Return A_trav(room): the area that the robot's centre can be in, as cells of reachable floor."""
        return float(self.room_cells[self._known_room(room)].size) * self.robot.cell_m**2

    def rectangle(self, piece: str) -> NDArray[np.float64]:
        """Return the footprint of a piece in cells, (6,) as `rasters.footprint`."""
        if piece not in self.pieces:
            raise UnknownObject(piece, self.pieces, f"the furniture of scene {self.scene.scene!r}")
        return footprint(self.pieces[piece], self.origin_m, self.robot.cell_m)

    def stances(self, piece: str) -> Indices:
        """Return the reachable cells to work on a piece from, (n,) flat: its room, within reach, not behind a wall.

        A piece that stands on others is worked on from where those are within reach too: the near set of the symbolic
        model stays a subset of what is measured.
        """
        if piece not in self._stances:
            cells = self._reach_cells(self.rectangle(piece), self.pieces[piece].room)
            base = self.pieces[piece].on
            while base is not None:
                cells = np.intersect1d(cells, self._reach_cells(self.rectangle(base), self.pieces[piece].room))
                base = self.pieces[base].on
            self._stances[piece] = _frozen(cells)
        return self._stances[piece]

    def stances_at(self, spot: int) -> Indices:
        """Return the reachable cells of the same room from which the floor at a cell is within reach."""
        row, column = self.cell(spot)
        room = self.room_of(spot)
        if room is None:
            return np.empty(0, np.int32)
        return self._reach_cells(np.array([column + 0.5, row + 0.5, 1.0, 0.0, 0.0, 0.0]), room)

    def _reach_cells(self, rectangle: NDArray[np.float64], room: str) -> Indices:
        from gavel_env.house.kernels import sight as sight_kernels

        reach = self.robot.reach_m / self.robot.cell_m
        index = self.room_index[room]
        return sight_kernels.reach_cells(self.reachable, self.rooms, self.opaque, index, rectangle, reach)


def _frozen(array: _Array) -> _Array:
    array.flags.writeable = False
    return array


def known_layout(scene: Scene, robot: RobotConfig = DEFAULT_ROBOT) -> FloorMap:
    """Return the map of rooms, walls and openings alone, known before anything was seen; built once per scene.

    Its `scene` has no furniture and no items either.
    """
    return _build(msgspec.structs.replace(scene, furniture=(), items=(), not_placed=()), robot)


def floor_map(scene: Scene, robot: RobotConfig = DEFAULT_ROBOT) -> FloorMap:
    """Return the map with the furniture, which the executor drives on; built once per scene."""
    return _build(scene, robot)


@lru_cache(maxsize=64)
def _build(scene: Scene, robot: RobotConfig) -> FloorMap:
    from gavel_env.house.kernels import drawing as raster_kernels

    grid = rasterise(scene, robot.cell_m)
    radius_m = max(0.0, robot.robot_radius_m - robot.erosion_tolerance_m)
    away = np.full(grid.rooms.shape, np.inf)
    for piece in scene.furniture:
        if piece.blocks:
            raster_kernels.stamp_rectangle(
                footprint(piece, grid.origin_m, robot.cell_m), robot.robot_radius_m / robot.cell_m, away
            )
    opaque = (grid.rooms < 0) | grid.wall
    free = ~opaque & (grid.clearance_m >= radius_m - 1e-9) & (away * robot.cell_m >= radius_m - 1e-9)
    return FloorMap(
        scene=scene,
        robot=robot,
        origin_m=grid.origin_m,
        rooms=_frozen(grid.rooms),
        opaque=_frozen(opaque),
        obstacle=_frozen(away == 0.0),
        free=_frozen(free),
        pieces=frozen({piece.id: piece for piece in scene.furniture}),
    )
