"""What does not block the floor: countertops on base units, things on tables, walls and ceilings, carpets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_place import place_corner
from envs_data.build.layout_poses import Placed, Poses, RoomLayout, floor_poses, grown, rect_of, wall_poses
from envs_data.build.layout_space import Rect
from gavel_env.ontology import default_ontology

__all__ = ["mount_all", "slab_over_bases"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

REACH_M = 1.1
TOP_SHARE = 0.65
OVERHANG_M = 0.1
CEILING_M = 2.4


def slab_over_bases(layout: RoomLayout, piece: Piece) -> bool:
    """Lay a countertop over a row of base units of about its height; return False if no row is free for it."""
    taken = [layout.rects[i] for i in layout.indices("slab")]
    bases = [
        i
        for i in layout.indices("run", "wall_piece")
        if layout.placed[i].piece.size_m[2] <= 0.98
        and layout.placed[i].piece.size_m[0] >= 0.35
        and ("cabinet" in layout.placed[i].piece.category or layout.placed[i].piece.category == "dishwasher")
    ]
    best: tuple[tuple[float, float, float], Placed, Rect] | None = None
    for i in bases:
        base = layout.placed[i]
        along_x = base.yaw in (90, 270)
        row = [layout.rects[j] for j in bases if layout.placed[j].yaw == base.yaw and _in_line(layout, i, j)]
        low = min(r[0] if along_x else r[1] for r in row)
        high = max(r[2] if along_x else r[3] for r in row)
        depth, width, _ = piece.size_m
        for t in np.unique(np.round(np.arange(low + width / 2 - 0.15, high - width / 2 + 0.16, 0.05), 3)).tolist():
            rect = _against_back(layout.rects[i], base.yaw, depth, t, width)
            if any(_overlap_area(rect, other) > 1e-4 for other in taken) or not layout.space.polygon.covers(
                layout.space.shape(rect)
            ):
                continue
            if not layout.space.keepout.is_empty and layout.space.keepout.intersects(layout.space.shape(rect)):
                continue
            covered = sum(_overlap_area(rect, r) for r in row) / (piece.area_m2)
            strange = sum(
                _overlap_area(rect, layout.rects[j]) for j in range(len(layout.rects)) if layout.rects[j] not in row
            )
            if covered < 0.55 or strange > 1e-4 or _overlap_area(rect, layout.rects[i]) <= 0:
                continue
            key = (round(-covered, 3), round(abs(t - (base.x if along_x else base.y)), 3), round(t, 3))
            if best is None or key < best[0]:
                x, y = (rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2
                best = (key, Placed(piece, round(x, 3), round(y, 3), base.yaw, round(base.piece.size_m[2], 3), i), rect)
    if best is None:
        return False
    layout.placed.append(best[1])
    layout.rects.append(best[2])
    return True


def _in_line(layout: RoomLayout, i: int, j: int) -> bool:
    a, b = layout.rects[i], layout.rects[j]
    yaw = layout.placed[i].yaw
    side = {0: 0, 180: 2, 90: 1, 270: 3}[yaw]
    return abs(a[side] - b[side]) < 0.06


def _against_back(rect: Rect, yaw: int, depth: float, t: float, width: float) -> Rect:
    if yaw == 90:
        return t - width / 2, rect[1], t + width / 2, rect[1] + depth
    if yaw == 270:
        return t - width / 2, rect[3] - depth, t + width / 2, rect[3]
    if yaw == 0:
        return rect[0], t - width / 2, rect[0] + depth, t + width / 2
    return rect[2] - depth, t - width / 2, rect[2], t + width / 2


def _overlap_area(a: Rect, b: Rect) -> float:
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _hits(rects: Floats, others: Sequence[Rect], margin: float = 0.0) -> Bools:
    """Return which footprints overlap any of `others`."""
    if not len(others) or not len(rects):
        return np.zeros(len(rects), bool)
    o = np.array(others)
    return np.asarray(
        (
            (rects[:, None, 0] < o[None, :, 2] + margin)
            & (rects[:, None, 2] > o[None, :, 0] - margin)
            & (rects[:, None, 1] < o[None, :, 3] + margin)
            & (rects[:, None, 3] > o[None, :, 1] - margin)
        ).any(axis=1)
    )


def _covered(layout: RoomLayout, poses: Poses) -> Bools:
    if not len(poses.x):
        return np.zeros(0, bool)
    shapes = shapely.box(poses.rects[:, 0], poses.rects[:, 1], poses.rects[:, 2], poses.rects[:, 3])
    return np.asarray(shapely.covers(layout.space.polygon, shapes))


def _choose(layout: RoomLayout, piece: Piece, poses: Poses, score: Floats, ok: Bools, z: float, reach: bool) -> bool:
    """Take the best allowed pose that the robot can come near to (if it must)."""
    index = np.flatnonzero(ok & np.isfinite(score))
    if not len(index):
        return False
    order = index[
        np.lexsort((index, np.round(poses.x[index], 3), np.round(poses.y[index], 3), np.round(score[index], 4)))
    ]
    for i in order[:200].tolist():
        rect = (float(poses.rects[i][0]), float(poses.rects[i][1]), float(poses.rects[i][2]), float(poses.rects[i][3]))
        if reach and not _in_reach(layout, poses.rects[i]):
            continue
        layout.placed.append(Placed(piece, float(poses.x[i]), float(poses.y[i]), int(poses.yaw[i]), z))
        layout.rects.append(rect)
        return True
    return False


def place_top(layout: RoomLayout, piece: Piece) -> bool:
    """On a piece with a surface and room left on top; on the floor if there is none."""
    wanted = rules().stands_on.get(piece.category, ())
    passes = ((True, False), (True, True)) if wanted else ()
    return any(
        _on_some_host(layout, piece, wanted, only_wanted, overhang)
        for only_wanted, overhang in (*passes, (False, False), (False, True))
    ) or place_corner(layout, piece)


def _on_some_host(layout: RoomLayout, piece: Piece, wanted: Sequence[str], only_wanted: bool, overhang: bool) -> bool:
    """Stand a piece on the best host; with `overhang` it may fill the top and jut out by 10 cm on each side."""
    ontology = default_ontology()
    covered = {p.on for p in layout.placed if p.piece.role == "slab"}
    over = OVERHANG_M if overhang else 0.0
    share = 1.2 if overhang else TOP_SHARE
    hosts = []
    for i, host in enumerate(layout.placed):
        if (
            i in covered
            or not ontology[host.piece.category].surface
            or host.piece.role in ("top", "chair", "lounge", "bath", "corner")
        ):
            continue
        if host.piece.mount != "floor" or (host.on >= 0 and host.piece.role != "slab"):
            continue
        if (only_wanted and host.piece.category not in wanted) or (
            overhang and host.piece.role in ("sink", "bed", "sofa")
        ):
            continue
        top = host.z + host.piece.size_m[2]
        if not 0.25 <= top <= 1.35:
            continue
        guests = [layout.rects[j] for j, p in enumerate(layout.placed) if p.on == i]
        used = sum((g[2] - g[0]) * (g[3] - g[1]) for g in guests)
        if used + piece.area_m2 > share * host.piece.area_m2:
            continue
        order = wanted.index(host.piece.category) if host.piece.category in wanted else len(wanted) + 1
        if host.piece.role in ("sofa", "bed", "sink"):
            order += 10
        hosts.append(((order, round(used, 3), -round(host.piece.area_m2, 3), i), i, top, guests))
    for _, i, top, guests in sorted(hosts, key=lambda h: h[0]):
        host = layout.placed[i]
        rect = grown(layout.rects[i], over)
        for yaw in (host.yaw, (host.yaw + 90) % 360):
            dx, dy = (piece.size_m[0], piece.size_m[1]) if yaw in (0, 180) else (piece.size_m[1], piece.size_m[0])
            if dx > rect[2] - rect[0] or dy > rect[3] - rect[1]:
                continue
            gx = np.unique(
                np.round(np.concatenate([np.arange(rect[0] + dx / 2, rect[2] - dx / 2, 0.05), [rect[2] - dx / 2]]), 3)
            )
            gy = np.unique(
                np.round(np.concatenate([np.arange(rect[1] + dy / 2, rect[3] - dy / 2, 0.05), [rect[3] - dy / 2]]), 3)
            )
            mx, my = (a.ravel() for a in np.meshgrid(gx, gy))
            rects = np.stack([mx - dx / 2, my - dy / 2, mx + dx / 2, my + dy / 2], axis=1)
            ok = ~_hits(rects, guests, 0.01)
            if overhang:
                ok &= shapely.covers(layout.space.polygon, shapely.box(*rects.T))
            free = np.flatnonzero(ok)
            if not len(free):
                continue
            radians = np.deg2rad(host.yaw)
            forward = (mx - host.x) * np.cos(radians) + (my - host.y) * np.sin(radians)
            lateral = np.abs(-(mx - host.x) * np.sin(radians) + (my - host.y) * np.cos(radians))
            score = np.round(forward - lateral * (0.5 if host.piece.role != "desk" else -0.5), 4)
            ordered = free[np.lexsort((free, score[free]))]
            near = (k for k in ordered[:: max(1, len(ordered) // 40)].tolist() if _in_reach(layout, rects[k]))
            k = next(near, -1)
            if k < 0:
                continue
            layout.placed.append(Placed(piece, float(mx[k]), float(my[k]), yaw, round(top, 3), i))
            layout.rects.append(rect_of(float(mx[k]), float(my[k]), yaw, piece.size_m))
            return True
    return False


def _in_reach(layout: RoomLayout, row: Floats) -> bool:
    return layout.space.reachable((float(row[0]), float(row[1]), float(row[2]), float(row[3])), REACH_M)


def place_on_wall(layout: RoomLayout, piece: Piece) -> bool:
    """On a wall at the height of its kind, clear of doors, of tall furniture and of what hangs there."""
    z = rules().wall.get(piece.category, 1.4)
    z = max(0.0, min(z, CEILING_M - piece.size_m[2])) if piece.size_m[2] < CEILING_M else 0.0
    low, high = z, z + piece.size_m[2]
    hung, tall = [], []
    for p, rect in zip(layout.placed, layout.rects, strict=True):
        overlaps = p.z < high - 0.02 and p.z + p.piece.size_m[2] > low + 0.02
        if p.piece.role == "wall" and overlaps:
            hung.append(rect)
        elif p.piece.role not in ("carpet", "scenery", "ceiling") and overlaps:
            tall.append(rect)
    ontology = default_ontology()[piece.category]
    reach = ontology.openable or ontology.toggleable or ontology.surface or ontology.interior
    companions = layout.of_category(rules().near.get(piece.category, ()))
    for least, margin, use_tall, use_hung in (
        (0.97, 0.04, True, True),
        (0.9, 0.0, True, True),
        (0.9, 0.0, False, True),
        (0.4, 0.0, False, True),
        (0.4, 0.0, False, False),
    ):
        poses = wall_poses(layout, piece, least, gap=0.01)
        ok = _covered(layout, poses)
        if use_hung:
            ok &= ~_hits(poses.rects, hung, margin)
        if use_tall:
            ok &= ~_hits(poses.rects, tall)
        if _choose(layout, piece, poses, _wall_score(layout, piece, poses, companions), ok, round(z, 3), reach):
            return True
    return False


def _wall_score(layout: RoomLayout, piece: Piece, poses: Poses, companions: Sequence[int]) -> Floats:
    """Return lower scores for better places on the walls: near companions, at doors, on outer walls, spread out."""
    same = [layout.rects[i] for i in layout.of_category([piece.category])]
    spread = np.zeros(len(poses.x))
    if same:
        o = np.array(same)
        dx = (poses.x[:, None] - (o[None, :, 0] + o[None, :, 2]) / 2) ** 2
        dy = (poses.y[:, None] - (o[None, :, 1] + o[None, :, 3]) / 2) ** 2
        spread = np.sqrt((dx + dy).min(axis=1))
    if companions:
        best = np.full(len(poses.x), 20.0)
        for i in companions:
            centre = layout.placed[i]
            best = np.minimum(best, np.hypot(poses.x - centre.x, poses.y - centre.y))
        return np.asarray(best)
    if piece.category == "electric_switch" and not layout.space.keepout.is_empty:
        parts = getattr(layout.space.keepout, "geoms", [layout.space.keepout])
        return np.asarray(
            np.min([np.hypot(poses.x - p.centroid.x, poses.y - p.centroid.y) for p in parts], axis=0)
        ) - 0.2 * np.minimum(spread, 3.0)
    score = -np.minimum(spread, 3.0)
    if "window" in piece.category or "blind" in piece.category:
        radians = np.deg2rad(poses.yaw)
        behind = 0.45 + piece.size_m[0]
        inner = shapely.contains_xy(
            layout.space.house, poses.x - behind * np.cos(radians), poses.y - behind * np.sin(radians)
        )
        score = score + 5.0 * inner
    return np.asarray(score)


def hang_ceiling(layout: RoomLayout, pieces: Sequence[Piece]) -> None:
    """Under the ceiling, the first in the middle, each further one as far from the others as can be."""
    x0, y0, x1, y1 = layout.space.bounds
    away: Floats | None = None
    poses_of: dict[tuple[str, str], tuple[Poses, Bools]] = {}
    for piece in pieces:
        if piece.key not in poses_of:
            every = floor_poses(layout, piece)
            count = len(every.x) // 4
            poses = Poses(*(column[:count] for column in every))
            poses_of[piece.key] = (poses, _covered(layout, poses))
        poses, ok = poses_of[piece.key]
        if away is None:
            score = np.hypot(poses.x - (x0 + x1) / 2, poses.y - (y0 + y1) / 2)
        else:
            edge = np.minimum.reduce([poses.x - x0, x1 - poses.x, poses.y - y0, y1 - poses.y])
            score = -np.minimum(away, 1.5 * edge)
            ok = ok & (away > 0.05)
        z = round(max(0.0, CEILING_M - piece.size_m[2]), 3)
        if not _choose(layout, piece, poses, score, ok, z, default_ontology()[piece.category].toggleable):
            layout.left.append(piece)
            continue
        new = np.hypot(poses.x - layout.placed[-1].x, poses.y - layout.placed[-1].y)
        away = new if away is None else np.minimum(away, new)


def place_carpet(layout: RoomLayout, piece: Piece) -> bool:
    """On the floor before the sofa or bed, or in the middle; not over another carpet while there is room."""
    poses = floor_poses(layout, piece)
    if not len(poses.x):
        return False
    ok = _covered(layout, poses)
    others = [layout.rects[i] for i in layout.indices("carpet")]
    anchors = layout.indices("coffee_table") or layout.indices("bed") or layout.indices("table")
    x0, y0, x1, y1 = layout.space.bounds
    score = np.hypot(poses.x - (x0 + x1) / 2, poses.y - (y0 + y1) / 2)
    for i in anchors[:1]:
        score = np.hypot(poses.x - layout.placed[i].x, poses.y - layout.placed[i].y) + 0.05 * score
    free = ok & ~_hits(poses.rects, others)
    return _choose(layout, piece, poses, score, free, 0.0, False) or _choose(
        layout, piece, poses, score, ok, 0.0, False
    )


def place_scenery(layout: RoomLayout, piece: Piece) -> bool:
    """Plants and awnings: along the edge of the ground, clear of each other and of furniture while there is room."""
    poses = floor_poses(layout, piece)
    ok = _covered(layout, poses)
    plants = [layout.rects[i] for i in layout.indices("scenery")]
    others = [rect for p, rect in zip(layout.placed, layout.rects, strict=True) if p.piece.role != "scenery"]
    x0, y0, x1, y1 = layout.space.bounds
    score = np.minimum.reduce(
        [poses.rects[:, 0] - x0, x1 - poses.rects[:, 2], poses.rects[:, 1] - y0, y1 - poses.rects[:, 3]]
    )
    if plants:
        o = np.array(plants)
        away = np.hypot(poses.x[:, None] - (o[:, 0] + o[:, 2]) / 2, poses.y[:, None] - (o[:, 1] + o[:, 3]) / 2).min(
            axis=1
        )
        crowded = score - np.minimum(away, 4.0)
    else:
        crowded = score
    clear = ok & ~_hits(poses.rects, others)
    if _choose(layout, piece, poses, score, clear & ~_hits(poses.rects, plants), 0.0, False):
        return True
    return _choose(layout, piece, poses, crowded, clear, 0.0, False) or _choose(
        layout, piece, poses, crowded, ok, 0.0, False
    )


MOUNTERS: tuple[tuple[str, Callable[[RoomLayout, Piece], bool]], ...] = (
    ("top", place_top),
    ("wall", place_on_wall),
    ("carpet", place_carpet),
    ("scenery", place_scenery),
)


def _by_size(pieces: Sequence[Piece], role: str) -> list[Piece]:
    mine = [p for p in pieces if p.role == role]
    return sorted(mine, key=lambda p: (-round(p.size_m[1] * p.size_m[2], 3), p.category, p.model))


def mount_all(layout: RoomLayout, pieces: Sequence[Piece]) -> None:
    """Put up everything that does not block the floor; what finds no place goes to `layout.left`."""
    hang_ceiling(layout, _by_size(pieces, "ceiling"))
    for role, mounter in MOUNTERS:
        for piece in _by_size(pieces, role):
            if not mounter(layout, piece):
                layout.left.append(piece)
