"""What does not block the floor: things on tables, walls and ceilings, carpets, plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_poses import Placed, Poses, RoomLayout, facing_cost, floor_poses, wall_poses
from envs_data.build.layout_tops import hits, in_reach, place_top
from gavel_env.world_model.ontology import default_ontology

__all__ = ["mount_all"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CEILING_M = 2.4


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
        if reach and not in_reach(layout, poses.rects[i]):
            continue
        layout.placed.append(Placed(piece, float(poses.x[i]), float(poses.y[i]), int(poses.yaw[i]), z))
        layout.rects.append(rect)
        return True
    return False


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
            ok &= ~hits(poses.rects, hung, margin)
        if use_tall:
            ok &= ~hits(poses.rects, tall)
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
    if piece.category == "wall_mounted_tv":
        return facing_cost(layout, poses.x, poses.y, poses.yaw) - 0.3 * np.minimum(spread, 3.0)
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
            poses = Poses(every.x[:count], every.y[:count], every.yaw[:count], every.rects[:count], every.back[:count])
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
    free = ok & ~hits(poses.rects, others)
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
    clear = ok & ~hits(poses.rects, others)
    if _choose(layout, piece, poses, score, clear & ~hits(poses.rects, plants), 0.0, False):
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
