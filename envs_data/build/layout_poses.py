"""Where a piece could stand: candidate poses in a room, what makes one better, and the record of what stands there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_space import WALL_GAP_M, Rect, RoomSpace

__all__ = [
    "Placed",
    "Poses",
    "RoomLayout",
    "door_distance",
    "facing_cost",
    "floor_poses",
    "front_of",
    "gap_score",
    "grown",
    "join_poses",
    "make_poses",
    "near_score",
    "open_score",
    "rect_of",
    "wall_poses",
]

Floats = NDArray[np.float64]

TRIES = 60
LARGE_CELLS = 60_000
TABLE_APRON_M = 0.7
ACCESS_M = 0.9
FRONT_ACCESS_M = 0.65
WALL_ROLES = ("bath", "bed", "run", "sink", "wall_piece")


class Placed(NamedTuple):
    """A piece with its pose; `on` indexes the piece of the same room that it stands on, or is -1."""

    piece: Piece
    x: float
    y: float
    yaw: int
    z: float = 0.0
    on: int = -1


class Poses(NamedTuple):
    """Candidate poses: centres, yaws and footprints; `back` is the share of wall behind each."""

    x: Floats
    y: Floats
    yaw: NDArray[np.int64]
    rects: Floats
    back: Floats


class RoomLayout:
    """The pieces put into one room so far.

    Attributes:
        astray: how many belong at a wall and stand free.
        any_side: whether a piece that may turn a side to the wall is reached from any side, not from its front alone.
    """

    def __init__(self, space: RoomSpace) -> None:
        self.space = space
        self.lines = space.wall_lines()
        self.placed: list[Placed] = []
        self.rects: list[Rect] = []
        self.left: list[Piece] = []
        self.astray = 0
        self.any_side = False
        self.chairs_at: dict[int, int] = {}

    def indices(self, *roles: str) -> list[int]:
        """Return the indices of placed pieces with one of these roles."""
        return [i for i, p in enumerate(self.placed) if p.piece.role in roles]

    def of_category(self, categories: Sequence[str]) -> list[int]:
        """Return the indices of placed pieces of these categories."""
        return [i for i, p in enumerate(self.placed) if p.piece.category in categories]

    def put(
        self, piece: Piece, poses: Poses, score: Floats, access: str, allow: Sequence[Rect] = (), soft: bool = True
    ) -> bool:
        """Put a piece at the best pose that fits and keeps everything reachable.

        Args:
            piece: what to put.
            poses: where it could go.
            score: (n,) lower is better; inf is never tried.
            access: "front" or "any": from where the robot must reach it.
            allow: footprints it may overlap.
            soft: whether to spare the floor in front of earlier pieces.
        """
        if self.any_side and piece.category in rules().spin:
            access = "any"
        fits = self.space.fits(poses.rects, allow, soft) & np.isfinite(score)
        index = np.flatnonzero(fits)
        if not len(index):
            return False
        order = index[
            np.lexsort((index, np.round(poses.x[index], 3), np.round(poses.y[index], 3), np.round(score[index], 4)))
        ]
        tries = TRIES if self.space.floor.size < LARGE_CELLS else TRIES // 6
        if len(order) > tries:
            head, tail = order[: tries // 3], order[tries // 3 :]
            picks = np.unique(np.linspace(0, len(tail) - 1, tries - len(head)).astype(int))
            order = np.concatenate([head, tail[picks]])
        for i in order.tolist():
            rect = _rect(poses.rects[i])
            yaw = int(poses.yaw[i])
            front = grown(rect, TABLE_APRON_M) if piece.role == "table" else front_of(rect, yaw, 0.55)
            reach = front_of(rect, yaw, FRONT_ACCESS_M, side_m=0.15) if access == "front" else self._around(rect)
            if self.space.add(rect, reach, front if access == "front" or piece.role == "table" else None):
                self.placed.append(Placed(piece, round(float(poses.x[i]), 3), round(float(poses.y[i]), 3), yaw))
                self.rects.append(rect)
                self.astray += piece.role in WALL_ROLES and float(poses.back[i]) < 0.6
                return True
        return False

    def reach_any_side(self) -> None:
        """From now on reach the pieces that may turn a side to the wall from any side."""
        self.any_side = True
        for p, rect in zip(self.placed, self.rects, strict=True):
            if p.piece.category in rules().spin:
                self.space.reach(rect, self._around(rect))

    def _around(self, rect: Rect) -> Rect:
        return grown(rect, ACCESS_M + 0.2 * self.space.tight)


def _rect(row: Floats) -> Rect:
    return float(row[0]), float(row[1]), float(row[2]), float(row[3])


def grown(rect: Rect, by: float) -> Rect:
    """Return a footprint grown on all sides."""
    return rect[0] - by, rect[1] - by, rect[2] + by, rect[3] + by


def front_of(rect: Rect, yaw: int, depth_m: float, side_m: float = 0.0) -> Rect:
    """Return the floor before the front of a footprint."""
    x0, y0, x1, y1 = rect
    if yaw == 0:
        return x1, y0 - side_m, x1 + depth_m, y1 + side_m
    if yaw == 180:
        return x0 - depth_m, y0 - side_m, x0, y1 + side_m
    if yaw == 90:
        return x0 - side_m, y1, x1 + side_m, y1 + depth_m
    return x0 - side_m, y0 - depth_m, x1 + side_m, y0


def rect_of(x: float, y: float, yaw: int, size: tuple[float, float, float]) -> Rect:
    """Return the footprint of a pose."""
    dx, dy = (size[0], size[1]) if yaw in (0, 180) else (size[1], size[0])
    return x - dx / 2, y - dy / 2, x + dx / 2, y + dy / 2


def make_poses(
    x: Floats, y: Floats, yaw: Floats | NDArray[np.int64], piece: Piece, back: Floats | None = None
) -> Poses:
    """Return poses of a piece from centres (metres) and yaws (degrees), rounded to 1 mm."""
    x, y = np.round(np.asarray(x, float), 3), np.round(np.asarray(y, float), 3)
    yaw = np.asarray(yaw, np.int64) % 360
    upright = (yaw == 90) | (yaw == 270)
    dx = np.where(upright, piece.size_m[1], piece.size_m[0]) / 2
    dy = np.where(upright, piece.size_m[0], piece.size_m[1]) / 2
    rects = np.stack([x - dx, y - dy, x + dx, y + dy], axis=1) if len(x) else np.zeros((0, 4))
    return Poses(x, y, yaw, rects, np.zeros(len(x)) if back is None else back)


def join_poses(parts: Sequence[Poses]) -> Poses:
    """Return several sets of poses as one."""
    return Poses(
        np.concatenate([p.x for p in parts]),
        np.concatenate([p.y for p in parts]),
        np.concatenate([p.yaw for p in parts]),
        np.concatenate([p.rects for p in parts]),
        np.concatenate([p.back for p in parts]),
    )


def wall_poses(layout: RoomLayout, piece: Piece, least_wall: float, gap: float = WALL_GAP_M) -> Poses:
    """Return poses with the back (or, for pieces that may turn, a side) against a wall."""
    parts = [make_poses(np.zeros(0), np.zeros(0), np.zeros(0), piece)]
    depth, width, _ = piece.size_m
    turns = (0, 90, 180, 270) if piece.category in rules().spin else (0,)
    for line in layout.lines:
        span = (len(line.wall) - 1) * 0.05
        for turn in turns:
            across, along = (depth, width) if turn in (0, 180) else (width, depth)
            stops = [e + side * (along / 2 + WALL_GAP_M) for e in line.ends for side in (1, -1)]
            for rect in layout.rects:
                low, high = (rect[0], rect[2]) if line.horizontal else (rect[1], rect[3])
                stops += [low - along / 2 - 0.01, high + along / 2 + 0.01]
            steps = np.arange(line.start + along / 2, line.start + span - along / 2 + 0.05, 0.1)
            t = np.unique(np.round(np.concatenate([np.array(stops), steps]), 3))
            first = np.clip(np.round((t - along / 2 - line.start) / 0.05).astype(int), 0, len(line.wall) - 1)
            last = np.clip(np.round((t + along / 2 - line.start) / 0.05).astype(int), 0, len(line.wall) - 1)
            back = (line.wall[last] - line.wall[first]) * 0.05 / max(along, 0.05)
            keep = back >= least_wall
            t, back = t[keep], np.minimum(back[keep], 1.0)
            at = np.full(len(t), line.at + line.inward * (across / 2 + gap))
            x, y = (t, at) if line.horizontal else (at, t)
            parts.append(make_poses(x, y, np.full(len(t), line.yaw + turn), piece, back))
    return join_poses(parts)


def floor_poses(layout: RoomLayout, piece: Piece, step: float | None = None) -> Poses:
    """Return poses on a grid over the whole room, in both directions."""
    x0, y0, x1, y1 = layout.space.bounds
    if step is None:
        step = 0.15 if (x1 - x0) * (y1 - y0) < 60 else 0.3 if (x1 - x0) * (y1 - y0) < 400 else 0.6
    gx, gy = np.meshgrid(np.arange(x0 + 0.1, x1, step), np.arange(y0 + 0.1, y1, step))
    turns = (0, 90, 180, 270)
    return join_poses([make_poses(gx.ravel(), gy.ravel(), np.full(gx.size, turn), piece) for turn in turns])


def gap_score(layout: RoomLayout, poses: Poses) -> Floats:
    """Return how far each pose is from touching a corner or a neighbour, metres (0 = flush)."""
    if not len(poses.x):
        return np.zeros(0)
    horizontal = (poses.yaw == 90) | (poses.yaw == 270)
    best = np.full(len(poses.x), 3.0)
    for line in layout.lines:
        # walls across the piece's own wall, on either side of it
        for end in (line.at,):
            low = np.where(horizontal, poses.rects[:, 0], poses.rects[:, 1])
            high = np.where(horizontal, poses.rects[:, 2], poses.rects[:, 3])
            crosses = horizontal != line.horizontal
            gap = np.minimum(np.abs(low - end), np.abs(high - end))
            best = np.where(crosses, np.minimum(best, gap), best)
    for rect in layout.rects:
        dx = np.maximum(np.maximum(rect[0] - poses.rects[:, 2], poses.rects[:, 0] - rect[2]), 0)
        dy = np.maximum(np.maximum(rect[1] - poses.rects[:, 3], poses.rects[:, 1] - rect[3]), 0)
        best = np.minimum(best, np.hypot(dx, dy))
    return np.asarray(best)


def near_score(layout: RoomLayout, poses: Poses, anchors: Sequence[int]) -> Floats:
    """Return the distance of each pose's footprint to the nearest anchor's footprint, metres."""
    best = np.full(len(poses.x), 50.0)
    for i in anchors:
        rect = layout.rects[i]
        dx = np.maximum(np.maximum(rect[0] - poses.rects[:, 2], poses.rects[:, 0] - rect[2]), 0)
        dy = np.maximum(np.maximum(rect[1] - poses.rects[:, 3], poses.rects[:, 1] - rect[3]), 0)
        best = np.minimum(best, np.hypot(dx, dy))
    return best


def open_score(layout: RoomLayout, poses: Poses) -> Floats:
    """Return how crowded the floor around each pose is (lower = more room)."""
    distance = layout.space.distance()
    here = layout.space.at(distance, poses.x, poses.y).astype(float)
    x0, y0, x1, y1 = layout.space.bounds
    centre = np.hypot(poses.x - (x0 + x1) / 2, poses.y - (y0 + y1) / 2)
    return np.asarray(-np.minimum(here, 2.0) + 0.1 * centre)


def door_distance(layout: RoomLayout, poses: Poses) -> Floats:
    """Return the distance of each pose to the nearest doorway, metres; 0 in a room without one."""
    keepout = layout.space.keepout
    if keepout.is_empty:
        return np.zeros(len(poses.x))
    parts = getattr(keepout, "geoms", [keepout])
    found = [np.hypot(poses.x - p.centroid.x, poses.y - p.centroid.y) for p in parts]
    return np.asarray(np.min(found, axis=0))


def facing_cost(layout: RoomLayout, x: Floats, y: Floats, yaw: NDArray[np.int64]) -> Floats:
    """Return how badly each pose faces the nearest sofa (or bed) that looks at it; 0 in a room without one."""
    seats = layout.indices("sofa") or layout.indices("bed")
    if not seats:
        return np.zeros(len(x))
    best = np.full(len(x), np.inf)
    for i in seats:
        seat = layout.placed[i]
        radians = np.deg2rad(seat.yaw)
        ahead = (x - seat.x) * np.cos(radians) + (y - seat.y) * np.sin(radians)
        aside = np.abs(-(x - seat.x) * np.sin(radians) + (y - seat.y) * np.cos(radians))
        turned = 1.0 + np.cos(np.deg2rad(np.asarray(yaw) - seat.yaw))
        cost = aside + 2.0 * turned + np.maximum(0.0, 1.8 - ahead) + 0.5 * np.maximum(0.0, ahead - 4.0)
        best = np.minimum(best, cost)
    return best
