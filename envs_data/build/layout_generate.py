"""Outlines of the 36 scenes without a floor plan: rectangles of the real room extents, packed wall to wall.

The first room is the one that others hang on (a corridor, else the largest). Each further room goes to the side of a
placed room where the whole stays compact, 0.1 m of wall between them and a doorway of 0.9 m in it. The `*_garden`
scenes take the measured outline of their `*_int` twin; the garden is laid along the outside of the house.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from shapely.geometry import Polygon, box
from shapely.ops import unary_union

from envs_data.build.layout_outline import Outline, measured_outline, measured_scenes, outline_room, polygon_of
from envs_data.build.layout_pieces import Contents, rules
from gavel_env.house.scenes import Opening

__all__ = ["generated_outline", "room_extent"]

WALL_M = 0.1
DOOR_M = 0.9
LEAST_SIDE_M = 1.2
FULLEST = 0.38
JAMB_M = 0.12

Box = tuple[float, float, float, float]


class _Spot(NamedTuple):
    """A place for a room: its rectangle, and the doorway to the room that it hangs on."""

    score: tuple[float, ...]
    rect: Box
    anchor: str
    door: tuple[tuple[float, float], tuple[float, float]]


def room_extent(room: Contents) -> tuple[tuple[float, float], str]:
    """Return the (x, y) extent of a room in metres, and what was done to the extent of the source ("" if nothing).

    Several floors are taken together at the largest one's proportions. No side is under 1.2 m. A room whose standing
    furniture would cover more than 38 % of its floor is enlarged.
    """
    standing = sum(p.area_m2 for p in room.pieces if p.group == "furniture" and p.mount == "floor" and p.role != "top")
    if not room.floors_m:
        side = max(4.0, standing / FULLEST) ** 0.5
        return (round(side * 1.1, 2), round(side / 1.1, 2)), "no floor in the source"
    width, height = room.floors_m[0]
    is_garden = room.room.startswith("garden")
    total = width * height if is_garden else sum(x * y for x, y in room.floors_m)
    grow = (total / (width * height)) ** 0.5
    width, height = width * grow, height * grow
    note = ""
    if min(width, height) < LEAST_SIDE_M:
        width, height = max(width, LEAST_SIDE_M), max(height, LEAST_SIDE_M)
        note = f"a side under {LEAST_SIDE_M} m"
    if standing > FULLEST * width * height:
        grow = (standing / (FULLEST * width * height)) ** 0.5
        width, height = width * grow, height * grow
        note = "its furniture does not fit"
    return (round(width, 2), round(height, 2)), note


class _Plan:
    """Rooms placed so far."""

    def __init__(self) -> None:
        self.rects: dict[str, Box] = {}
        self.polygons: dict[str, Any] = {}
        self.openings: list[Opening] = []
        self.doors: list[Box] = []

    def add(self, name: str, spot: _Spot) -> None:
        """Put a room down and cut its doorway through the wall, half of it for each of the two rooms."""
        self.rects[name] = spot.rect
        self.polygons[name] = box(*spot.rect)
        (ax, ay), (bx, by) = spot.door
        half = WALL_M / 2 + 0.03
        if abs(ay - by) < 1e-9:
            low, high = box(ax, ay - half, bx, ay), box(ax, ay, bx, ay + half)
            mine = low if spot.rect[3] <= ay else high
        else:
            low, high = box(ax - half, ay, ax, by), box(ax, ay, ax + half, by)
            mine = low if spot.rect[2] <= ax else high
        other = high if mine is low else low
        self.polygons[name] = unary_union([self.polygons[name], mine])
        self.polygons[spot.anchor] = unary_union([self.polygons[spot.anchor], other])
        self.doors.append((ax - 0.6, ay - 0.6, bx + 0.6, by + 0.6))
        rooms = (min(name, spot.anchor), max(name, spot.anchor))
        self.openings.append(Opening(rooms, spot.door, round(max(bx - ax, by - ay), 2), "doorway"))


def _type(room: str) -> str:
    return room.rsplit("_", 1)[0]


def _rank(room: str, extents: Mapping[str, tuple[float, float]]) -> tuple[float, float, str]:
    """Return the order of placing: through-rooms first, large before small, the garden last."""
    hubs = rules().hubs
    late = 2.0 if _type(room) == "garden" else 0.0
    width, height = extents[room]
    hub = 0.0 if _type(room) in hubs else 1.0
    return late + hub, -width * height, room


def generated_outline(scene: str, contents: Sequence[Contents], grown: Mapping[str, float] | None = None) -> Outline:
    """Return rooms and openings for a scene without a floor plan.

    Args:
        scene: its name.
        contents: its rooms.
        grown: room -> factor on its sides, for rooms whose pieces did not fit before.
    """
    grown = grown or {}
    extents, notes = {}, {}
    for room in contents:
        (width, height), note = room_extent(room)
        factor = grown.get(room.room, 1.0)
        if factor > 1.0:
            width, height, note = round(width * factor, 2), round(height * factor, 2), "its furniture does not fit"
        extents[room.room] = (width, height)
        if note:
            was = " + ".join(f"{x:.1f} x {y:.1f}" for x, y in room.floors_m[:3]) or "nothing"
            notes[room.room] = f"{room.room} {width:.1f} x {height:.1f} m instead of {was} ({note})"
    plan = _Plan()
    twin = scene.replace("_garden", "_int")
    words = "rectangles of the room extents in bddl 3.6.0 (MIT), packed wall to wall"
    if scene.endswith("_garden") and twin in measured_scenes():
        words = _take_twin(plan, twin)
    names = sorted((r for r in extents if r not in plan.polygons), key=lambda r: _rank(r, extents))
    for name in names:
        width, height = extents[name]
        if not plan.polygons:
            plan.rects[name] = (0.0, 0.0, width, height)
            plan.polygons[name] = box(0.0, 0.0, width, height)
            continue
        plan.add(name, _best_spot(plan, name, extents[name]))
    source = f"generated: {words}; contents from bddl 3.6.0 (MIT)"
    source += "".join(f"; {notes[name]}" for name in sorted(names) if name in notes)
    rooms = tuple(outline_room(name, plan.polygons[name]) for name in sorted(plan.polygons))
    openings = tuple(sorted(plan.openings, key=lambda o: (o.rooms, o.segment)))
    return Outline(rooms, openings, source)


def _take_twin(plan: _Plan, twin: str) -> str:
    measured = measured_outline(twin)
    for room in measured.rooms:
        polygon = polygon_of(room)
        plan.polygons[room.id] = polygon
        plan.rects[room.id] = tuple(float(v) for v in polygon.bounds)  # type: ignore[assignment]
    plan.openings = list(measured.openings)
    return f"house as {twin} ({measured.source}); garden and outbuildings from their extents, laid along the house"


def _best_spot(plan: _Plan, name: str, extent: tuple[float, float]) -> _Spot:
    """Return the most compact free place for a room next to one that it may hang on."""
    best: _Spot | None = None
    wanted = rules().hangs_on.get(_type(name), ())
    hubs = rules().hubs
    taken = unary_union([plan.polygons[r] for r in sorted(plan.polygons)]).buffer(WALL_M - 0.01, join_style="mitre")
    everything = taken.bounds
    for anchor in sorted(plan.rects):
        kind = _type(anchor)
        through = 4.0 + (hubs.index(kind) * 0.2 if kind in hubs else 6.0)
        fit = float(wanted.index(kind)) if kind in wanted else through
        for rect, door in _sides(plan, anchor, extent):
            if taken.intersects(box(*rect).buffer(-0.005)):
                continue
            x0, y0 = min(rect[0], everything[0]), min(rect[1], everything[1])
            x1, y1 = max(rect[2], everything[2]), max(rect[3], everything[3])
            area = (x1 - x0) * (y1 - y0)
            long = max(x1 - x0, y1 - y0) ** 2
            crowd = sum(1 for d in plan.doors if _near(d, door))
            spread = (area + 0.5 * long) / (extent[0] * extent[1] + 10.0)
            spot = _Spot((round(fit * 0.6 + spread + crowd, 4), rect[0], rect[1]), rect, anchor, door)
            if best is None or spot.score < best.score:
                best = spot
    if best is None:
        raise AssertionError(f"room {name} of {extent} m finds no side to hang on")
    return best


def _near(door: Box, other: tuple[tuple[float, float], tuple[float, float]]) -> bool:
    (ax, ay), (bx, by) = other
    return ax < door[2] and bx > door[0] and ay < door[3] and by > door[1]


def _sides(
    plan: _Plan, anchor: str, extent: tuple[float, float]
) -> list[tuple[Box, tuple[tuple[float, float], tuple[float, float]]]]:
    """Return rectangles along the sides of a room, each with its doorway."""
    found = []
    need = DOOR_M + 2 * JAMB_M
    ring = list(plan.polygons[anchor].exterior.coords)
    for (ax, ay), (bx, by) in itertools.pairwise(ring):
        horizontal = abs(ay - by) < 0.02
        if not horizontal and abs(ax - bx) >= 0.02:
            continue
        low, high = (min(ax, bx), max(ax, bx)) if horizontal else (min(ay, by), max(ay, by))
        if high - low < need:
            continue
        at = (ay + by) / 2 if horizontal else (ax + bx) / 2
        middle = (low + high) / 2
        probe = Polygon(_probe(horizontal, middle, at, 0.05))
        outward = -1 if plan.polygons[anchor].intersects(probe) else 1
        for width, height in sorted({extent, (extent[1], extent[0])}):
            along, across = (width, height) if horizontal else (height, width)
            starts = {low, high - along, low + need - along, high - need, (low + high - along) / 2}
            steps = int((high - low + along) / 0.8)
            starts |= {low + need - along + 0.8 * i for i in range(min(steps, 60))}
            for start in sorted(round(s, 3) for s in starts):
                first, last = max(low, start) + JAMB_M, min(high, start + along) - JAMB_M
                if last - first < DOOR_M - 1e-9:
                    continue
                centre = round((first + last) / 2, 3)
                edge = at + outward * WALL_M
                near, far = sorted((edge, edge + outward * across))
                wall = round(at + outward * WALL_M / 2, 3)
                a, b = round(centre - DOOR_M / 2, 3), round(centre + DOOR_M / 2, 3)
                near, far, end = round(near, 3), round(far, 3), round(start + along, 3)
                if horizontal:
                    found.append(((start, near, end, far), ((a, wall), (b, wall))))
                else:
                    found.append(((near, start, far, end), ((wall, a), (wall, b))))
    return found


def _probe(horizontal: bool, middle: float, at: float, step: float) -> list[tuple[float, float]]:
    """Return a small square just beyond a wall, on its positive side."""
    lo, hi = at + 0.02, at + 0.02 + step
    if horizontal:
        return [(middle - step, lo), (middle + step, lo), (middle + step, hi), (middle - step, hi)]
    return [(lo, middle - step), (hi, middle - step), (hi, middle + step), (lo, middle + step)]
