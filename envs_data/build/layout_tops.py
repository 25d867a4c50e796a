"""Countertops on base units, and what stands on other pieces: lamps, microwaves, monitors, televisions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_place import place_corner, place_facing
from envs_data.build.layout_poses import Placed, RoomLayout, facing_cost, grown, rect_of
from envs_data.build.layout_space import Rect
from gavel_env.world_model.ontology import default_ontology

__all__ = ["hits", "in_reach", "place_top", "slab_over_bases"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

REACH_M = 1.1
TOP_SHARE = 0.65
OVERHANG_M = 0.1


def slab_over_bases(layout: RoomLayout, piece: Piece) -> bool:
    """Lay a countertop over a row of base units of about its height; return False if no row is free for it."""
    taken = [layout.rects[i] for i in layout.indices("slab")]
    bases = [
        i
        for i in layout.indices("run", "wall_piece")
        if layout.placed[i].piece.size_m[2] <= 0.98
        and layout.placed[i].piece.size_m[0] >= 0.35
        and layout.placed[i].piece.category in rules().bases
    ]
    best: tuple[tuple[float, float, float], Placed, Rect] | None = None
    for i in bases:
        base = layout.placed[i]
        along_x = base.yaw in (90, 270)
        row = [layout.rects[j] for j in bases if _in_line(layout, i, j)]
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
            if covered < 0.5 or strange > 1e-4 or _overlap_area(rect, layout.rects[i]) <= 0:
                continue
            key = (round(-covered, 3), round(abs(t - (base.x if along_x else base.y)), 3), round(t, 3))
            if best is None or key < best[0]:
                x, y = (rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2
                best = (key, Placed(piece, round(x, 3), round(y, 3), base.yaw, round(base.piece.size_m[2], 3), i), rect)
    if best is None:
        return False
    layout.placed.append(best[1])
    layout.rects.append(best[2])
    layout.space.rects.append(best[2])  # what juts out over the floor is taken too
    return True


def _in_line(layout: RoomLayout, i: int, j: int) -> bool:
    """Return whether base unit `j` stands in a row with `i` and is no taller."""
    if layout.placed[j].yaw != layout.placed[i].yaw:
        return False
    if layout.placed[j].piece.size_m[2] > layout.placed[i].piece.size_m[2] + 0.01:
        return False
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


def hits(rects: Floats, others: Sequence[Rect], margin: float = 0.0) -> Bools:
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


def in_reach(layout: RoomLayout, row: Floats) -> bool:
    """Return whether the robot can work on a footprint (4,) from somewhere in the room."""
    return layout.space.reachable((float(row[0]), float(row[1]), float(row[2]), float(row[3])), REACH_M)


def place_top(layout: RoomLayout, piece: Piece) -> bool:
    """On a piece with a surface and room left on top; on the floor if there is none.

    What belongs on certain pieces (`stands_on` of the rules) goes there first, then anywhere; if the floor is among
    them, it goes to the wall that the sofa looks at instead.
    """
    wanted = rules().stands_on.get(piece.category, ())
    passes = ((True, False), (True, True)) if wanted else ()
    anywhere = ((False, False), (False, True)) if "floor" not in wanted else ()
    if any(_on_some_host(layout, piece, wanted, only, over) for only, over in (*passes, *anywhere)):
        return True
    return place_facing(layout, piece) if "floor" in wanted else place_corner(layout, piece)


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
        order = float(wanted.index(host.piece.category) if host.piece.category in wanted else len(wanted) + 1)
        if host.piece.role in ("sofa", "bed", "sink"):
            order += 10
        if "floor" in wanted:  # something to look at
            order = 0.1 * order + float(
                facing_cost(layout, np.array([host.x]), np.array([host.y]), np.array([host.yaw]))[0]
            )
        hosts.append(((round(order, 3), round(used, 3), -round(host.piece.area_m2, 3), i), i, top))
    for _, i, top in sorted(hosts, key=lambda h: h[0]):
        host = layout.placed[i]
        rect = grown(layout.rects[i], over)
        others = [
            layout.rects[j]
            for j, p in enumerate(layout.placed)
            if j != i and p.z < top + piece.size_m[2] - 0.01 and p.z + p.piece.size_m[2] > top + 0.01
        ]
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
            ok = ~hits(rects, others, 0.01)
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
            near = (k for k in ordered[:: max(1, len(ordered) // 40)].tolist() if in_reach(layout, rects[k]))
            k = next(near, -1)
            if k < 0:
                continue
            layout.placed.append(Placed(piece, float(mx[k]), float(my[k]), yaw, round(top, 3), i))
            layout.rects.append(rect_of(float(mx[k]), float(my[k]), yaw, piece.size_m))
            return True
    return False
