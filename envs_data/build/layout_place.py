"""Furnishing a room: candidates, scores and the order in which its floor pieces are put down.

Each role has a way of proposing poses (against a wall, around a table, in front of a sofa, free on the floor) and a score;
poses are tried best first until one keeps the room reachable. Everything is deterministic: ties go by position.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_space import WALL_GAP_M, Rect, RoomSpace

__all__ = ["Placed", "RoomLayout", "furnish", "rect_of"]

Floats = NDArray[np.float64]

TRIES = 60
ATTEMPTS = 12
ACCESS_M = 0.9
CHAIR_TUCK = 0.45


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
    """The pieces put into one room so far."""

    def __init__(self, space: RoomSpace) -> None:
        self.space = space
        self.lines = space.wall_lines()
        self.placed: list[Placed] = []
        self.rects: list[Rect] = []
        self.left: list[Piece] = []
        self.chairs_at: dict[int, int] = {}

    def indices(self, *roles: str) -> list[int]:
        """Return the indices of placed pieces with one of these roles."""
        return [i for i, p in enumerate(self.placed) if p.piece.role in roles]

    def of_category(self, categories: Sequence[str]) -> list[int]:
        """Return the indices of placed pieces of these categories."""
        return [i for i, p in enumerate(self.placed) if p.piece.category in categories]

    def put(self, piece: Piece, poses: Poses, score: Floats, access: str, allow: Sequence[Rect] = (), soft: bool = True) -> bool:
        """Put a piece at the best pose that fits and keeps everything reachable.

        Args:
            piece: what to put.
            poses: where it could go.
            score: (n,) lower is better; inf is never tried.
            access: "front" or "any": from where the robot must reach it.
            allow: footprints it may overlap.
            soft: whether to spare the floor in front of earlier pieces.
        """
        fits = self.space.fits(poses.rects, allow, soft) & np.isfinite(score)
        index = np.flatnonzero(fits)
        if not len(index):
            return False
        order = index[np.lexsort((index, np.round(poses.x[index], 3), np.round(poses.y[index], 3), np.round(score[index], 4)))]
        if len(order) > TRIES:
            head, tail = order[: TRIES // 3], order[TRIES // 3 :]
            picks = np.unique(np.linspace(0, len(tail) - 1, TRIES - len(head)).astype(int))
            order = np.concatenate([head, tail[picks]])
        for i in order.tolist():
            rect = _rect(poses.rects[i])
            yaw = int(poses.yaw[i])
            front = front_of(rect, yaw, 0.55)
            reach = front_of(rect, yaw, ACCESS_M, side_m=0.15) if access == "front" else grown(rect, ACCESS_M + 0.2 * self.space.tight)
            if self.space.add(rect, reach, front if access == "front" else None):
                self.placed.append(Placed(piece, round(float(poses.x[i]), 3), round(float(poses.y[i]), 3), yaw))
                self.rects.append(rect)
                return True
        return False


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


def _poses(x: Floats, y: Floats, yaw: Floats | NDArray[np.int64], piece: Piece, back: Floats | None = None) -> Poses:
    x, y = np.round(np.asarray(x, float), 3), np.round(np.asarray(y, float), 3)
    yaw = np.asarray(yaw, np.int64) % 360
    upright = (yaw == 90) | (yaw == 270)
    dx = np.where(upright, piece.size_m[1], piece.size_m[0]) / 2
    dy = np.where(upright, piece.size_m[0], piece.size_m[1]) / 2
    rects = np.stack([x - dx, y - dy, x + dx, y + dy], axis=1) if len(x) else np.zeros((0, 4))
    return Poses(x, y, yaw, rects, np.zeros(len(x)) if back is None else back)


def _join(parts: Sequence[Poses]) -> Poses:
    return Poses(
        np.concatenate([p.x for p in parts]),
        np.concatenate([p.y for p in parts]),
        np.concatenate([p.yaw for p in parts]),
        np.concatenate([p.rects for p in parts]),
        np.concatenate([p.back for p in parts]),
    )


def wall_poses(layout: RoomLayout, piece: Piece, least_wall: float, gap: float = WALL_GAP_M) -> Poses:
    """Return poses with the back (or, for pieces that may turn, a side) against a wall."""
    parts = [_poses(np.zeros(0), np.zeros(0), np.zeros(0), piece)]
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
            parts.append(_poses(x, y, np.full(len(t), line.yaw + turn), piece, back))
    return _join(parts)


def floor_poses(layout: RoomLayout, piece: Piece, step: float | None = None) -> Poses:
    """Return poses on a grid over the whole room, in both directions."""
    x0, y0, x1, y1 = layout.space.bounds
    if step is None:
        step = 0.15 if (x1 - x0) * (y1 - y0) < 60 else 0.3 if (x1 - x0) * (y1 - y0) < 400 else 0.6
    gx, gy = np.meshgrid(np.arange(x0 + 0.1, x1, step), np.arange(y0 + 0.1, y1, step))
    turns = (0, 90, 180, 270)
    return _join([_poses(gx.ravel(), gy.ravel(), np.full(gx.size, turn), piece) for turn in turns])


def _gap_score(layout: RoomLayout, poses: Poses) -> Floats:
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


def _near_score(layout: RoomLayout, poses: Poses, anchors: Sequence[int]) -> Floats:
    """Return the distance of each pose's footprint to the nearest anchor's footprint, metres."""
    best = np.full(len(poses.x), 50.0)
    for i in anchors:
        rect = layout.rects[i]
        dx = np.maximum(np.maximum(rect[0] - poses.rects[:, 2], poses.rects[:, 0] - rect[2]), 0)
        dy = np.maximum(np.maximum(rect[1] - poses.rects[:, 3], poses.rects[:, 1] - rect[3]), 0)
        best = np.minimum(best, np.hypot(dx, dy))
    return best


def _open_score(layout: RoomLayout, poses: Poses) -> Floats:
    """Return how crowded the floor around each pose is (lower = more room)."""
    distance = layout.space.distance()
    here = layout.space.at(distance, poses.x, poses.y).astype(float)
    x0, y0, x1, y1 = layout.space.bounds
    centre = np.hypot(poses.x - (x0 + x1) / 2, poses.y - (y0 + y1) / 2)
    return np.asarray(-np.minimum(here, 2.0) + 0.1 * centre)


def _try(layout: RoomLayout, piece: Piece, poses: Poses, score: Floats, access: str) -> bool:
    return layout.put(piece, poses, score, access) or layout.put(piece, poses, score, "any", soft=False)


def _fallback(layout: RoomLayout, piece: Piece) -> bool:
    """Stand a piece wherever it still fits: against any bit of wall, then free on the floor."""
    poses = wall_poses(layout, piece, 0.25)
    if layout.put(piece, poses, _gap_score(layout, poses) - poses.back, "any", soft=False):
        return True
    poses = floor_poses(layout, piece)
    score = _gap_score(layout, poses)
    return layout.put(piece, poses, score, "any", soft=False)


def place_wall(layout: RoomLayout, piece: Piece) -> bool:
    """Back to the wall, flush with a corner or a neighbour, near its companions."""
    poses = wall_poses(layout, piece, 0.75)
    score = _gap_score(layout, poses)
    companions = layout.of_category(rules().near.get(piece.category, ()))
    if companions:
        score = score * 0.3 + _near_score(layout, poses, companions)
    return _try(layout, piece, poses, score, "front") or _fallback(layout, piece)


def place_run(layout: RoomLayout, piece: Piece) -> bool:
    """In a row along the kitchen walls: next to the row if it has begun, else in a corner."""
    poses = wall_poses(layout, piece, 0.75)
    row = layout.indices("run", "sink")
    gap = _gap_score(layout, poses)
    score = gap + (_near_score(layout, poses, row) if row else 0.0)
    return _try(layout, piece, poses, score, "front") or _fallback(layout, piece)


def place_bed(layout: RoomLayout, piece: Piece) -> bool:
    """Head to the wall, away from the doors, with floor on its sides where the room allows it."""
    poses = wall_poses(layout, piece, 0.8)
    beds = layout.indices("bed")
    gap = _gap_score(layout, poses)
    doors = _door_distance(layout, poses)
    score = -np.minimum(gap, 0.6) - 0.3 * np.minimum(doors, 3.0)
    if beds:
        score = score + 0.1 * _near_score(layout, poses, beds)
    return (
        layout.put(piece, poses, score, "any")
        or layout.put(piece, poses, gap, "any", soft=False)
        or _fallback(layout, piece)
    )


def _door_distance(layout: RoomLayout, poses: Poses) -> Floats:
    keepout = layout.space.keepout
    if keepout.is_empty:
        return np.zeros(len(poses.x))
    parts = getattr(keepout, "geoms", [keepout])
    found = [np.hypot(poses.x - p.centroid.x, poses.y - p.centroid.y) for p in parts]
    return np.asarray(np.min(found, axis=0))


def place_sofa(layout: RoomLayout, piece: Piece) -> bool:
    """Back to the middle of a wall with open floor before it."""
    poses = wall_poses(layout, piece, 0.75)
    distance = layout.space.distance()
    radians = np.deg2rad(poses.yaw)
    ahead = piece.size_m[0] / 2 + 1.0
    room = layout.space.at(distance, poses.x + ahead * np.cos(radians), poses.y + ahead * np.sin(radians))
    score = -np.minimum(room.astype(float), 1.6) - 0.2 * np.minimum(_gap_score(layout, poses), 0.5)
    return _try(layout, piece, poses, score, "front") or _fallback(layout, piece)


def place_before(layout: RoomLayout, piece: Piece) -> bool:
    """A coffee table before a sofa, its long side along the sofa; on open floor without one."""
    taken = [layout.rects[i] for i in layout.indices("coffee_table")]
    for i in layout.indices("sofa"):
        sofa = layout.placed[i]
        front = front_of(layout.rects[i], sofa.yaw, 1.2)
        if any(_overlap(front, t) for t in taken):
            continue
        radians = np.deg2rad(sofa.yaw)
        turn = 0 if piece.size_m[0] <= piece.size_m[1] else 90
        deep = min(piece.size_m[0], piece.size_m[1])
        gaps, shifts = np.meshgrid(np.array([0.4, 0.35, 0.45, 0.5, 0.6]), np.arange(-0.6, 0.61, 0.1))
        ahead = (sofa.piece.size_m[0] + deep) / 2 + gaps.ravel()
        side = shifts.ravel()
        x = sofa.x + ahead * np.cos(radians) - side * np.sin(radians)
        y = sofa.y + ahead * np.sin(radians) + side * np.cos(radians)
        poses = _poses(x, y, np.full(len(x), sofa.yaw + turn), piece)
        if layout.put(piece, poses, np.abs(side) + np.abs(gaps.ravel() - 0.4), "any", soft=False):
            return True
    poses = floor_poses(layout, piece)
    return layout.put(piece, poses, _open_score(layout, poses), "any") or _fallback(layout, piece)


def _overlap(a: Rect, b: Rect) -> bool:
    return a[0] < b[2] and a[2] > b[0] and a[1] < b[3] and a[3] > b[1]


def place_table(layout: RoomLayout, piece: Piece) -> bool:
    """On the most open floor."""
    poses = floor_poses(layout, piece, 0.1 if layout.space.polygon.area < 40 else None)
    return layout.put(piece, poses, _open_score(layout, poses), "any") or _fallback(layout, piece)


def place_table_at_wall(layout: RoomLayout, piece: Piece) -> bool:
    """Against a wall, where the room is too full for a free table."""
    poses = wall_poses(layout, piece, 0.7)
    score = -np.minimum(_gap_score(layout, poses), 0.8)
    return layout.put(piece, poses, score, "any") or _fallback(layout, piece)


def place_chair(layout: RoomLayout, piece: Piece) -> bool:
    """At the table or desk with the most room per chair, facing it, tucked a little under it."""
    tables = layout.indices("table", "desk") or layout.indices("coffee_table")
    if piece.category == "swivel_chair":
        first = [i for i in tables if layout.placed[i].piece.role == "desk"]
        tables = first + [i for i in tables if i not in first] if first else tables

    def crowd(i: int) -> tuple[float, int]:
        depth, width, _ = layout.placed[i].piece.size_m
        role = layout.placed[i].piece.role
        around = width if role == "desk" else 2 * (depth + width)
        preferred = 0 if (role == "desk") == (piece.category == "swivel_chair") else 1
        return (layout.chairs_at.get(i, 0) / around + 0.5 * preferred, i)

    for i in sorted(tables, key=crowd)[:12]:
        poses, score = chair_poses(layout, piece, i)
        allow = [layout.rects[i]]
        if layout.put(piece, poses, score, "any", allow) or layout.put(piece, poses, score, "any", allow, soft=False):
            layout.chairs_at[i] = layout.chairs_at.get(i, 0) + 1
            return True
    return place_wall(layout, piece)


def chair_poses(layout: RoomLayout, piece: Piece, table: int) -> tuple[Poses, Floats]:
    """Return poses around a table, facing it, and their scores (middle of the long sides first)."""
    x0, y0, x1, y1 = layout.rects[table]
    depth, width, _ = piece.size_m
    host = layout.placed[table]
    parts, scores = [], []
    for tuck in (0.3, 0.0, -0.12, CHAIR_TUCK):
        off = depth / 2 - tuck * depth
        for yaw in (0, 90, 180, 270):
            along_x = yaw in (90, 270)
            low, high = (x0, x1) if along_x else (y0, y1)
            if width > (high - low) + 0.15:
                continue
            seats = max(1, int((high - low) / (width + 0.08)))
            slots = low + (np.arange(seats) + 0.5) * (high - low) / seats
            fine = np.arange(low + width / 2, high - width / 2 + 0.01, 0.1)
            t = np.concatenate([slots, fine])
            edge = {0: x0 - off, 180: x1 + off, 90: y0 - off, 270: y1 + off}[yaw]
            at = np.full(len(t), edge)
            poses = _poses(t if along_x else at, at if along_x else t, np.full(len(t), yaw), piece)
            parts.append(poses)
            middle = (low + high) / 2
            score = 0.2 * np.abs(t - middle) + 2.0 * abs(tuck - 0.3) - 0.3 * (high - low)
            score[len(slots) :] += 0.35
            if host.piece.role == "desk" and (yaw + 180) % 360 != host.yaw:
                score = score + 1.5
            scores.append(score)
    poses = _join([_poses(np.zeros(0), np.zeros(0), np.zeros(0), piece), *parts])
    score = np.concatenate([np.zeros(0), *scores])
    # keep chairs apart from those on the same side
    others = [layout.rects[i] for i in layout.indices("chair")]
    for rect in others:
        near = (
            (np.abs((rect[0] + rect[2]) / 2 - poses.x) < width + 0.02) & (np.abs((rect[1] + rect[3]) / 2 - poses.y) < width + 0.02)
        )
        score = score + np.where(near, 0.3, 0.0)
    return poses, score


def place_lounge(layout: RoomLayout, piece: Piece) -> bool:
    """An armchair or ottoman near the sofa group, facing it; in a corner without one."""
    anchors = layout.indices("coffee_table") or layout.indices("sofa")
    if not anchors and layout.indices("table"):
        return place_chair(layout, piece)
    if anchors:
        walls = wall_poses(layout, piece, 0.5)
        free = floor_poses(layout, piece)
        poses = _join([walls, free])
        score = np.full(len(poses.x), np.inf)
        for i in anchors:
            cx, cy = layout.placed[i].x, layout.placed[i].y
            radians = np.deg2rad(poses.yaw)
            away = np.hypot(cx - poses.x, cy - poses.y)
            facing = ((cx - poses.x) * np.cos(radians) + (cy - poses.y) * np.sin(radians)) / np.maximum(away, 0.1)
            rect = layout.rects[i]
            dx = np.maximum(np.maximum(rect[0] - poses.rects[:, 2], poses.rects[:, 0] - rect[2]), 0)
            dy = np.maximum(np.maximum(rect[1] - poses.rects[:, 3], poses.rects[:, 1] - rect[3]), 0)
            gap = np.hypot(dx, dy)
            score = np.minimum(score, np.abs(gap - 0.4) + 1.5 * (1 - facing))
        score = np.where(score > 3.0, np.inf, score - 0.3 * poses.back)
        if layout.put(piece, poses, score, "any"):
            return True
    return place_wall(layout, piece)


def place_corner(layout: RoomLayout, piece: Piece) -> bool:
    """In a corner, out of the way."""
    poses = wall_poses(layout, piece, 0.5)
    score = _gap_score(layout, poses) - 0.1 * np.minimum(_door_distance(layout, poses), 2.0)
    return layout.put(piece, poses, score, "any") or _fallback(layout, piece)


def place_free(layout: RoomLayout, piece: Piece) -> bool:
    """On open floor."""
    poses = floor_poses(layout, piece)
    return layout.put(piece, poses, _open_score(layout, poses), "any") or _fallback(layout, piece)


def place_aisle(layout: RoomLayout, piece: Piece) -> bool:
    """Shop shelves: along the walls first, then in rows with aisles."""
    poses = wall_poses(layout, piece, 0.75)
    if layout.put(piece, poses, _gap_score(layout, poses), "front"):
        return True
    poses = floor_poses(layout, piece)
    score = _gap_score(layout, poses) + np.where(poses.yaw % 180 == 0, 0.0, 2.0)
    return layout.put(piece, poses, score, "front") or _fallback(layout, piece)


def place_slab(layout: RoomLayout, piece: Piece) -> bool:
    """A countertop: over base units where it can, else on its own at the wall."""
    from envs_data.build.layout_mounts import slab_over_bases

    return slab_over_bases(layout, piece) or place_run(layout, piece)


Placer = Callable[[RoomLayout, Piece], bool]

PLACERS: dict[str, Placer] = {
    "aisle": place_aisle,
    "bath": place_wall,
    "bed": place_bed,
    "chair": place_chair,
    "coffee_table": place_before,
    "corner": place_corner,
    "desk": place_wall,
    "free": place_free,
    "lounge": place_lounge,
    "nightstand": place_wall,
    "run": place_run,
    "sink": place_run,
    "slab": place_slab,
    "sofa": place_sofa,
    "table": place_table,
    "top": place_corner,
    "wall_piece": place_wall,
}

ORDERS: tuple[tuple[str, ...], ...] = (
    ("bed", "bath", "sink", "run", "slab", "sofa", "desk", "aisle", "wall_piece", "free", "coffee_table", "table", "nightstand", "lounge", "chair", "corner", "top"),
    ("bed", "sofa", "bath", "sink", "run", "coffee_table", "table", "desk", "chair", "aisle", "wall_piece", "slab", "free", "nightstand", "lounge", "corner", "top"),
    ("free", "bed", "sofa", "desk", "table", "wall_piece", "aisle", "run", "sink", "bath", "slab", "coffee_table", "nightstand", "lounge", "chair", "corner", "top"),
)


def furnish(space: Callable[[bool], RoomSpace], pieces: Sequence[Piece], tight: bool) -> RoomLayout:
    """Put the floor pieces of a room down, in the order that leaves the fewest out.

    Args:
        space: makes the empty room afresh for each attempt, comfortable (False) or tight (True).
        pieces: what stands on the floor.
        tight: whether tight aisles may be tried where comfortable ones leave pieces out.
    """
    best: RoomLayout | None = None
    first: list[tuple[str, str]] = []
    for narrow in (False, True) if tight else (False,):
        for attempt in range(ATTEMPTS):
            order = ORDERS[attempt // 2 % len(ORDERS)]
            layout = _attempt(space(narrow), pieces, order, attempt % 2 == 1, first if attempt >= 2 * len(ORDERS) else [])
            if best is None or _loss(layout) < _loss(best):
                best = layout
            if not best.left or len(pieces) > 100:
                return best
            first = sorted({p.key for p in layout.left}) + [k for k in first if k not in {p.key for p in layout.left}]
    assert best is not None
    return best


def _loss(layout: RoomLayout) -> tuple[int, float]:
    return len(layout.left), round(sum(p.area_m2 for p in layout.left), 4)


def _attempt(
    space: RoomSpace, pieces: Sequence[Piece], order: Sequence[str], tables_at_wall: bool, first: Sequence[tuple[str, str]]
) -> RoomLayout:
    layout = RoomLayout(space)
    rank = {role: i for i, role in enumerate(order)}
    early = {key: i - len(first) for i, key in enumerate(first)}
    ordered = sorted(
        pieces, key=lambda p: (early.get(p.key, 0), rank[p.role], -round(p.area_m2, 3), p.category, p.model)
    )
    failed: set[tuple[str, str]] = set()
    for piece in ordered:
        placer = place_table_at_wall if piece.role == "table" and tables_at_wall else PLACERS[piece.role]
        if piece.key in failed or not placer(layout, piece):
            failed.add(piece.key)
            layout.left.append(piece)
    return layout
