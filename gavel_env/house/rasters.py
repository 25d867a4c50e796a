"""From the polygons of a scene to grids: whose floor each cell is, where walls close it, how far the walls are.

Walls are the outlines of the rooms less the openings. Passages between measured outlines lie on a shared edge; where a
scene draws its opening in the middle of a thick wall, the cells of the gap become floor too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.scenes import Furniture, Opening, RoomOutline, Scene

__all__ = ["Rasters", "footprint", "rasterise"]

_MARGIN_CELLS = 2
_WALL_SPACING_M = 0.02
_OPENING_DEPTH_M = 0.15  # half the thickest wall that an opening cuts through


class Rasters(NamedTuple):
    """Grids of one scene at one cell size.

    Attributes:
        origin_m: x, y of the grid's corner.
        rooms: (height, width) int16 index into `scene.rooms`, -1 outside.
        wall: (height, width) bool, closed to sight and travel between rooms that touch without an opening.
        clearance_m: (height, width) distance from the cell centre to the nearest wall, inf beyond 1 m.
    """

    origin_m: tuple[float, float]
    rooms: NDArray[np.int16]
    wall: NDArray[np.bool_]
    clearance_m: NDArray[np.float64]


def footprint(piece: Furniture, origin_m: tuple[float, float], cell_m: float) -> NDArray[np.float64]:
    """Return a piece's footprint in cells: (6,) centre x, y, cos and sin of yaw, half depth, half width."""
    yaw = math.radians(piece.yaw)
    depth, width, _ = piece.size_m
    x, y = (piece.x - origin_m[0]) / cell_m, (piece.y - origin_m[1]) / cell_m
    return np.array([x, y, math.cos(yaw), math.sin(yaw), 0.5 * depth / cell_m, 0.5 * width / cell_m])


def rasterise(scene: Scene, cell_m: float) -> Rasters:
    """Draw rooms and walls of a scene on a grid."""
    from gavel_env.house.kernels import drawing as kernels

    corners = np.array([p for room in scene.rooms for p in room.polygon], dtype=float)
    low = np.floor(corners.min(axis=0) / cell_m - _MARGIN_CELLS) * cell_m
    width, height = (int(n) for n in np.ceil((corners.max(axis=0) - low) / cell_m) + _MARGIN_CELLS)
    origin_m = (round(float(low[0]), 9), round(float(low[1]), 9))
    index = {room.id: i for i, room in enumerate(scene.rooms)}

    rooms = np.full((height, width), -1, np.int16)
    for i, room in enumerate(scene.rooms):
        kernels.fill_polygon((np.array(room.polygon, dtype=float) - low) / cell_m, i, rooms)
        for hole in room.holes:
            pillar = np.full_like(rooms, -1)
            kernels.fill_polygon((np.array(hole, dtype=float) - low) / cell_m, 0, pillar)
            rooms[pillar == 0] = -1
    _bridge_openings(scene.openings, index, low, cell_m, rooms)

    wall = np.zeros((height, width), np.bool_)
    openings = np.array(
        [[index[o.rooms[0]], index[o.rooms[1]], *_in_cells(o, low, cell_m)] for o in scene.openings], dtype=float
    ).reshape(-1, 6)
    kernels.close_links(rooms, openings, _OPENING_DEPTH_M / cell_m + 0.5, wall)

    points = np.concatenate([_wall_points(room, scene.openings) for room in scene.rooms])
    clearance = np.full((height, width), np.inf)
    kernels.stamp_points((points - low) / cell_m, 1.0 / cell_m, clearance)
    return Rasters(origin_m, rooms, wall, np.sqrt(clearance) * cell_m)


def _in_cells(opening: Opening, low: NDArray[np.float64], cell_m: float) -> list[float]:
    (x0, y0), (x1, y1) = opening.segment
    return [(x0 - low[0]) / cell_m, (y0 - low[1]) / cell_m, (x1 - low[0]) / cell_m, (y1 - low[1]) / cell_m]


def _along_opening(points: NDArray[np.float64], opening: Opening) -> NDArray[np.bool_]:
    """Tell which of (n, 2) points lie strictly between the jambs of an opening, within half a thick wall of it."""
    start, end = np.array(opening.segment, dtype=float)
    length = max(float(np.hypot(*(end - start))), 1e-9)
    direction = (end - start) / length
    offset = points - start
    along = offset @ direction
    across = np.abs(offset[:, 0] * direction[1] - offset[:, 1] * direction[0])
    inside: NDArray[np.bool_] = (along > 1e-6) & (along < length - 1e-6) & (across <= _OPENING_DEPTH_M)
    return inside


def _wall_points(room: RoomOutline, openings: tuple[Opening, ...]) -> NDArray[np.float64]:
    """Return (n, 2) points along the room's outline and holes, spaced 2 cm, without the parts that are open."""
    pieces = []
    for ring in (room.polygon, *room.holes):
        corners = np.array(ring, dtype=float)
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            steps = max(1, math.ceil(float(np.hypot(*(end - start))) / _WALL_SPACING_M))
            pieces.append(start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start))
    points = np.concatenate(pieces)
    closed = np.ones(len(points), np.bool_)
    for opening in openings:
        if room.id in opening.rooms:
            closed &= ~_along_opening(points, opening)
    return points[closed]


def _bridge_openings(
    openings: tuple[Opening, ...],
    index: dict[str, int],
    low: NDArray[np.float64],
    cell_m: float,
    rooms: NDArray[np.int16],
) -> None:
    """Give the unowned cells inside an opening to its first room."""
    rows, columns = np.nonzero(rooms < 0)
    centres = np.stack([columns + 0.5, rows + 0.5], axis=1) * cell_m + low
    for opening in openings:
        (x0, y0), (x1, y1) = opening.segment
        near = (
            (centres[:, 0] > min(x0, x1) - _OPENING_DEPTH_M)
            & (centres[:, 0] < max(x0, x1) + _OPENING_DEPTH_M)
            & (centres[:, 1] > min(y0, y1) - _OPENING_DEPTH_M)
            & (centres[:, 1] < max(y0, y1) + _OPENING_DEPTH_M)
        )
        chosen = np.nonzero(near)[0]
        chosen = chosen[_along_opening(centres[chosen], opening)]
        rooms[rows[chosen], columns[chosen]] = index[opening.rooms[0]]
