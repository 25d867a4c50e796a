"""How each role finds its place: beds at walls, chairs at tables, coffee tables before sofas.

Each role proposes poses with a score; they are tried best first until one keeps the room reachable. Everything is
deterministic: ties go by position.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_poses import (
    Poses,
    RoomLayout,
    door_distance,
    facing_cost,
    floor_poses,
    front_of,
    gap_score,
    join_poses,
    make_poses,
    near_score,
    open_score,
    wall_poses,
)
from envs_data.build.layout_space import Rect

__all__ = [
    "place_aisle",
    "place_bed",
    "place_before",
    "place_chair",
    "place_corner",
    "place_counter",
    "place_facing",
    "place_free",
    "place_lounge",
    "place_run",
    "place_sofa",
    "place_table",
    "place_table_at_wall",
    "place_wall",
]

Floats = NDArray[np.float64]

CHAIR_TUCK = 0.45
AISLE_M = 1.2


def _try(layout: RoomLayout, piece: Piece, poses: Poses, score: Floats, access: str) -> bool:
    return layout.put(piece, poses, score, access) or layout.put(piece, poses, score, "any", soft=False)


def _fallback(layout: RoomLayout, piece: Piece) -> bool:
    """Stand a piece wherever it still fits: against any bit of wall, then free on the floor."""
    poses = wall_poses(layout, piece, 0.25)
    if layout.put(piece, poses, gap_score(layout, poses) - poses.back, "any", soft=False):
        return True
    poses = floor_poses(layout, piece)
    score = gap_score(layout, poses)
    return layout.put(piece, poses, score, "any", soft=False)


def place_wall(layout: RoomLayout, piece: Piece) -> bool:
    """Back to the wall, flush with a corner or a neighbour, near its companions."""
    poses = wall_poses(layout, piece, 0.75)
    score = gap_score(layout, poses)
    companions = layout.of_category(rules().near.get(piece.category, ()))
    if companions:
        score = score * 0.3 + near_score(layout, poses, companions)
    return _try(layout, piece, poses, score, "front") or _fallback(layout, piece)


def place_run(layout: RoomLayout, piece: Piece) -> bool:
    """In a row along the kitchen walls: next to the row if it has begun, else in a corner."""
    poses = wall_poses(layout, piece, 0.75)
    row = layout.indices("run", "sink")
    gap = gap_score(layout, poses)
    score = gap + (near_score(layout, poses, row) if row else 0.0)
    return _try(layout, piece, poses, score, "front") or _fallback(layout, piece)


def place_counter(layout: RoomLayout, piece: Piece) -> bool:
    """A free-standing counter: along a wall, else an island, next to the other counters; nobody's front is closed."""
    others = layout.indices("slab", "run", "sink")
    walls = wall_poses(layout, piece, 0.75)
    score = gap_score(layout, walls) + (near_score(layout, walls, others) if others else 0.0)
    if layout.put(piece, walls, score, "front"):
        return True
    islands = floor_poses(layout, piece)
    counters = layout.indices("slab")
    score = open_score(layout, islands)
    if counters:
        score = score + 2.0 * np.minimum(near_score(layout, islands, counters), 1.0)
    return layout.put(piece, islands, score, "any") or place_run(layout, piece)


def place_bed(layout: RoomLayout, piece: Piece) -> bool:
    """Head to the wall, away from the doors, with floor on its sides where the room allows it."""
    poses = wall_poses(layout, piece, 0.8)
    beds = layout.indices("bed")
    gap = gap_score(layout, poses)
    doors = door_distance(layout, poses)
    score = -np.minimum(gap, 0.6) - 0.3 * np.minimum(doors, 3.0)
    if beds:
        score = score + 0.1 * near_score(layout, poses, beds)
    return (
        layout.put(piece, poses, score, "any")
        or layout.put(piece, poses, gap, "any", soft=False)
        or _fallback(layout, piece)
    )


def place_sofa(layout: RoomLayout, piece: Piece) -> bool:
    """Back to the middle of a wall with open floor before it."""
    poses = wall_poses(layout, piece, 0.75)
    distance = layout.space.distance()
    radians = np.deg2rad(poses.yaw)
    ahead = piece.size_m[0] / 2 + 1.0
    room = layout.space.at(distance, poses.x + ahead * np.cos(radians), poses.y + ahead * np.sin(radians))
    score = -np.minimum(room.astype(float), 1.6) - 0.2 * np.minimum(gap_score(layout, poses), 0.5)
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
        poses = make_poses(x, y, np.full(len(x), sofa.yaw + turn), piece)
        if layout.put(piece, poses, np.abs(side) + np.abs(gaps.ravel() - 0.4), "any", soft=False):
            return True
    poses = floor_poses(layout, piece)
    return layout.put(piece, poses, open_score(layout, poses), "any") or _fallback(layout, piece)


def _overlap(a: Rect, b: Rect) -> bool:
    return a[0] < b[2] and a[2] > b[0] and a[1] < b[3] and a[3] > b[1]


def place_table(layout: RoomLayout, piece: Piece) -> bool:
    """On the most open floor."""
    poses = floor_poses(layout, piece, 0.1 if layout.space.polygon.area < 40 else None)
    score = open_score(layout, poses)
    return (
        layout.put(piece, poses, score, "any")
        or layout.put(piece, poses, score, "any", soft=False)
        or _fallback(layout, piece)
    )


def place_table_at_wall(layout: RoomLayout, piece: Piece) -> bool:
    """Against a wall, where the room is too full for a free table."""
    poses = wall_poses(layout, piece, 0.7)
    score = -np.minimum(gap_score(layout, poses), 0.8)
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

    for i in sorted(tables, key=crowd)[:8]:
        poses, score = chair_poses(layout, piece, i)
        allow = [layout.rects[i]]
        if layout.put(piece, poses, score, "any", allow, soft=False):
            layout.chairs_at[i] = layout.chairs_at.get(i, 0) + 1
            return True
    return place_wall(layout, piece)


def chair_poses(layout: RoomLayout, piece: Piece, table: int) -> tuple[Poses, Floats]:
    """Return poses around a table, facing it, and their scores (middle of the long sides first)."""
    x0, y0, x1, y1 = layout.rects[table]
    depth, width, _ = piece.size_m
    host = layout.placed[table]
    parts, scores = [], []
    for tuck in (0.3, 0.0, -0.12, CHAIR_TUCK) if piece.role == "chair" else (-0.12,):
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
            poses = make_poses(t if along_x else at, at if along_x else t, np.full(len(t), yaw), piece)
            parts.append(poses)
            middle = (low + high) / 2
            score = 0.2 * np.abs(t - middle) + 2.0 * abs(tuck - 0.3) - 0.3 * (high - low)
            score[len(slots) :] += 0.35
            if host.piece.role == "desk" and (yaw + 180) % 360 != host.yaw:
                score = score + 1.5
            scores.append(score)
    poses = join_poses([make_poses(np.zeros(0), np.zeros(0), np.zeros(0), piece), *parts])
    score = np.concatenate([np.zeros(0), *scores])
    # keep chairs apart from those on the same side
    others = [layout.rects[i] for i in layout.indices("chair")]
    for rect in others:
        near = (np.abs((rect[0] + rect[2]) / 2 - poses.x) < width + 0.02) & (
            np.abs((rect[1] + rect[3]) / 2 - poses.y) < width + 0.02
        )
        score = score + np.where(near, 0.3, 0.0)
    return poses, score


def place_lounge(layout: RoomLayout, piece: Piece) -> bool:
    """An armchair or ottoman near the sofa group, facing it; in a corner without one."""
    anchors = layout.indices("coffee_table") or layout.indices("sofa")
    if not anchors and "chair" in piece.category and layout.indices("table"):
        return place_chair(layout, piece)
    if anchors:
        walls = wall_poses(layout, piece, 0.5)
        free = floor_poses(layout, piece)
        poses = join_poses([walls, free])
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
    score = gap_score(layout, poses) - 0.1 * np.minimum(door_distance(layout, poses), 2.0)
    score = score - 0.4 * np.minimum(near_score(layout, poses, layout.of_category([piece.category])), 2.0)
    return layout.put(piece, poses, score, "any") or _fallback(layout, piece)


def place_facing(layout: RoomLayout, piece: Piece) -> bool:
    """At the wall that the sofa looks at."""
    poses = wall_poses(layout, piece, 0.6)
    score = facing_cost(layout, poses.x, poses.y, poses.yaw) + 0.2 * gap_score(layout, poses)
    return layout.put(piece, poses, score, "front", soft=False) or place_corner(layout, piece)


def place_free(layout: RoomLayout, piece: Piece) -> bool:
    """On open floor."""
    poses = floor_poses(layout, piece)
    return layout.put(piece, poses, open_score(layout, poses), "any") or _fallback(layout, piece)


def place_aisle(layout: RoomLayout, piece: Piece) -> bool:
    """Shop shelves: along the walls first, then in rows with aisles."""
    poses = wall_poses(layout, piece, 0.75)
    if layout.put(piece, poses, gap_score(layout, poses), "front"):
        return True
    free = floor_poses(layout, piece)
    snaps, costs = row_poses(layout, piece)
    poses = join_poses([snaps, free])
    others = np.minimum(near_score(layout, free, range(len(layout.rects))), 3.0)
    score = np.concatenate([costs, 5.0 + np.abs(others - AISLE_M) + np.where(free.yaw % 180 == 0, 0.0, 2.0)])
    return layout.put(piece, poses, score, "front") or _fallback(layout, piece)


def row_poses(layout: RoomLayout, piece: Piece) -> tuple[Poses, Floats]:
    """Return poses that carry on a row of shelves, end to end or back to back, and their scores."""
    depth, width, _ = piece.size_m
    x, y, yaw, cost = [], [], [], []
    for i in layout.indices("aisle"):
        host = layout.placed[i]
        deep, wide, _ = host.piece.size_m
        fx, fy = round(np.cos(np.deg2rad(host.yaw))), round(np.sin(np.deg2rad(host.yaw)))
        for side in (1, -1):
            along, across = side * (wide + width) / 2, (depth - deep) / 2
            x.append(host.x - fy * along + fx * across)
            y.append(host.y + fx * along + fy * across)
            yaw.append(host.yaw)
            cost.append(0.0)
        x.append(host.x - fx * (deep + depth) / 2)
        y.append(host.y - fy * (deep + depth) / 2)
        yaw.append(host.yaw + 180)
        cost.append(0.5)
    return make_poses(np.array(x), np.array(y), np.array(yaw), piece), np.array(cost)
