"""Sight points: the known floor in steps of half a metre, with every drive and every line of sight between them.

A simulated robot stands on these points. What it sees is a set of points, kept as bits of 64-bit words, so that looking
is a few `or`s; how far a drive is, and over which points it leads, is a table. The tables depend on rooms, walls,
openings and the robot alone. They are computed once per map (0.1 to a few seconds), and kept on disk by the hash of
what they are computed from; where no folder can be written, they are computed in every process.
"""

from __future__ import annotations

import hashlib
import math
import os
import zipfile
from functools import lru_cache
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.floor_map import FloorMap

__all__ = ["HEADINGS", "SightPoints", "bits", "cache_folder", "sight_points"]

Words = NDArray[np.uint64]

HEADINGS = 8
"""Headings that a drive can have: the map's cells are 8-connected. Heading k is 45 k degrees clockwise from x."""

_VERSION = b"gavel-sight-points/1"
_SPACING_M = 0.5
_MOST_POINTS = 1200
"""In larger scenes the points are spaced wider: the tables grow with the square of their number."""
_WINDOW_M = 3.0  # drives within it are exact
_HALF_PIECE_M = 0.5
"""What is at a point stands on furniture of unknown size, whose edge is reached from so much farther away."""
_CLOSE_M = 1.0  # how close a search goes to the edge of what it has seen, as in gavel_env.sim.room_search


class SightPoints(NamedTuple):
    """The points of one map; `words` = ceil(points / 64), point p is bit p % 64 of word p // 64.

    Attributes:
        cells: (points,) int32 flat map cell.
        room: (points,) int16 index into the map's `room_ids`.
        stand: (points,) int16, the point itself, or where the robot stands instead if it cannot be there.
        metres: (points, points) float32 driving distance; for a point where the robot cannot be, that of its `stand`.
        onward: (points, points) int16 next point on the way.
        heading: (points, points) int8 heading of the straight line between two points.
        entry: (points, rooms) int16 nearest point of a room to drive to, -1 if it cannot be entered.
        around: (points, words) what a look around shows.
        ahead: (points, HEADINGS, words) what the camera shows while driving.
        reveals: (points, words) floor whose sight reveals what is at the point.
        reach: (points, words) where the robot can work on what is at the point.
        close: (points, words) from where a search looks at the point.
        floor: (rooms, words) the points of each room.
    """

    cells: NDArray[np.int32]
    room: NDArray[np.int16]
    stand: NDArray[np.int16]
    metres: NDArray[np.float32]
    onward: NDArray[np.int16]
    heading: NDArray[np.int8]
    entry: NDArray[np.int16]
    around: Words
    ahead: Words
    reveals: Words
    reach: Words
    close: Words
    floor: Words

    def nearest(self, layout: FloorMap, x: float, y: float, room: str | None = None) -> int:
        """Return the point (of a room, if it has any) nearest to x, y in metres."""
        away = ((layout.points(self.cells) - (x, y)) ** 2).sum(axis=1)
        if room is not None and (inside := self.room == layout.room_index[room]).any():
            away = np.where(inside, away, np.inf)
        return int(np.argmin(away))

    def standing(self, layout: FloorMap, cell: int) -> int:
        """Return the point for a robot on a reachable cell: the nearest where it can be, of the same room."""
        x, y = layout.point(cell)
        return int(self.stand[self.nearest(layout, x, y, layout.room_of(cell))])


def bits(marked: NDArray[np.bool_]) -> Words:
    """Pack (..., points) bool into (..., words) uint64."""
    count = marked.shape[-1]
    padded = np.zeros((*marked.shape[:-1], -(-count // 64) * 64), np.bool_)
    padded[..., :count] = marked
    return np.packbits(padded, axis=-1, bitorder="little").view("<u8").astype(np.uint64)


def cache_folder() -> Path:
    """Return where tables are kept: `GAVEL_CACHE`, or `gavel` in the user's cache folder."""
    own = os.environ.get("GAVEL_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gavel"


@lru_cache(maxsize=64)
def sight_points(layout: FloorMap) -> SightPoints:
    """Return the sight points of a map, from the cache if it has them."""
    path = cache_folder() / "sight" / f"{_fingerprint(layout)}.npz"
    points = _read(path)
    if points is None:
        points = _compute(layout)
        _write(path, points)
    for table in points:
        table.flags.writeable = False
    return points


def _fingerprint(layout: FloorMap) -> str:
    robot = layout.robot
    body = (robot.cell_m, robot.reach_m, robot.camera_fov_deg, robot.camera_range_m, robot.seen_within_m)
    numbers = (layout.shape, body, _SPACING_M, _MOST_POINTS, _WINDOW_M, _HALF_PIECE_M, _CLOSE_M, HEADINGS)
    digest = hashlib.sha256(_VERSION + repr(numbers).encode())
    for grid in (layout.rooms, layout.opaque, layout.free):
        digest.update(np.ascontiguousarray(grid).tobytes())
    return digest.hexdigest()[:32]


def _read(path: Path) -> SightPoints | None:
    """Return the tables of a file; None if it is missing or spoilt."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return SightPoints(**{name: stored[name] for name in SightPoints._fields})
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _write(path: Path, points: SightPoints) -> None:
    """Keep the tables; a reader never meets half a file. Without a place to write, nothing is kept."""
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = Path(file.name)
            np.savez(file, **points._asdict())
        temporary.replace(path)
    except (OSError, RuntimeError):  # RuntimeError: there is no home folder
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _compute(layout: FloorMap) -> SightPoints:
    from gavel_env.house.kernels import points as kernels

    robot, cell_m = layout.robot, layout.robot.cell_m
    spacing = max(1, round(_SPACING_M / cell_m), math.ceil(math.sqrt(layout.floor.sum() / _MOST_POINTS)))
    cells = _lattice(layout, spacing)
    rooms = layout.rooms.ravel()[cells].astype(np.int16)
    enterable = layout.reachable.ravel()[cells]
    rows, columns = np.divmod(cells, layout.shape[1])
    right, down = columns[None, :] - columns[:, None], rows[None, :] - rows[:, None]
    apart_m = np.hypot(right, down) * cell_m
    same_room = rooms[:, None] == rooms[None, :]

    places = np.nonzero(enterable)[0]
    foreign = np.where(same_room[:, places], 0.0, 1e6)
    stand = places[np.argmin(apart_m[:, places] + foreign, axis=1)]
    among = np.full(len(cells), -1)
    among[places] = np.arange(len(places))
    span = max(round(_WINDOW_M / cell_m), 3 * spacing)
    between = kernels.travel(layout.reachable, cells[places], span)
    onward = places[kernels.ways(between, 2.0 * spacing)]
    rank = among[stand]
    metres = (between * cell_m).astype(np.float32)[np.ix_(rank, rank)]

    sees = kernels.sight_lines(layout.opaque, cells, robot.camera_range_m / cell_m)
    angle = np.arctan2(down, right)
    half = math.radians(robot.camera_fov_deg) / 2.0
    turned = np.abs(angle[:, None, :] - np.arange(HEADINGS)[None, :, None] * (2.0 * math.pi / HEADINGS))
    turned = np.minimum(turned, 2.0 * math.pi - turned)
    wedge = (turned <= half + 1e-9) | np.eye(len(cells), dtype=bool)[:, None, :]
    step_m = spacing * cell_m
    entry = np.full((len(cells), len(layout.room_ids)), -1, np.int16)
    for room in range(len(layout.room_ids)):
        members = np.nonzero(enterable & (rooms == room))[0]
        if members.size:
            entry[:, room] = members[np.argmin(metres[:, members], axis=1)]
    return SightPoints(
        cells=cells.astype(np.int32),
        room=rooms,
        stand=stand.astype(np.int16),
        metres=metres,
        onward=onward[np.ix_(rank, rank)].astype(np.int16),
        heading=(np.round(angle / (2.0 * math.pi / HEADINGS)).astype(int) % HEADINGS).astype(np.int8),
        entry=entry,
        around=bits(sees),
        ahead=bits(sees[:, None, :] & wedge),
        reveals=bits(same_room & (apart_m <= max(robot.seen_within_m, 0.8 * step_m))),
        reach=bits(same_room & sees & enterable & (apart_m <= robot.reach_m + _HALF_PIECE_M + step_m / 2.0)),
        close=bits(sees & enterable & (apart_m <= max(_CLOSE_M, step_m))),
        floor=bits(np.arange(len(layout.room_ids))[:, None] == rooms[None, :]),
    )


def _lattice(layout: FloorMap, spacing: int) -> NDArray[np.int32]:
    """Return a floor cell per room and square of the lattice: one that the robot can enter, nearest to the middle."""
    rows, columns = np.nonzero(layout.floor)
    square = (rows // spacing) * layout.shape[1] + columns // spacing
    room = layout.rooms[rows, columns]
    middle = (spacing - 1) / 2.0
    off = np.hypot(rows % spacing - middle, columns % spacing - middle)
    order = np.lexsort((off, ~layout.reachable[rows, columns], room, square))
    first = np.ones(len(order), np.bool_)
    first[1:] = (np.diff(square[order]) != 0) | (np.diff(room[order]) != 0)
    chosen = order[first]
    return np.sort(rows[chosen] * layout.shape[1] + columns[chosen]).astype(np.int32)
