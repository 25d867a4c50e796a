"""Outlines of the 15 measured houses, with narrow doorways widened to what a robot on the 0.1 m map can pass."""

from __future__ import annotations

from importlib import resources
from typing import Any, NamedTuple

import msgspec
from shapely import BufferCapStyle
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import unary_union

from gavel_env.house.scenes import Opening, RoomOutline

__all__ = ["Outline", "measured_outline", "measured_scenes", "outline_room", "polygon_of"]

DOORWAY_MIN_M = 0.65
WALL_MAX_M = 0.3


class Outline(NamedTuple):
    """Rooms and openings of a scene, with a sentence on where they come from."""

    rooms: tuple[RoomOutline, ...]
    openings: tuple[Opening, ...]
    source: str


class _Room(msgspec.Struct, frozen=True):
    id: str
    type: str
    polygon: list[tuple[float, float]]
    holes: list[list[tuple[float, float]]] = []


class _Opening(msgspec.Struct, frozen=True):
    rooms: tuple[str, str]
    segment: tuple[tuple[float, float], tuple[float, float]]
    width_m: float
    kind: str


class _Plan(msgspec.Struct, frozen=True):
    scene: str
    rooms: list[_Room]
    openings: list[_Opening]
    source: str


def measured_scenes() -> tuple[str, ...]:
    """Return the scenes with a measured floor plan, sorted."""
    folder = resources.files("envs_data") / "floorplans"
    return tuple(sorted(p.name.removesuffix(".json") for p in folder.iterdir() if p.name.endswith(".json")))


def polygon_of(room: RoomOutline) -> Any:
    """Return the room's floor as a shapely polygon."""
    return Polygon(room.polygon, [list(h) for h in room.holes])


def outline_room(room_id: str, polygon: Any) -> RoomOutline:
    """Return the outline of a room from a shapely polygon, rounded to 1 mm, clockwise on the picture."""
    ring = [(round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in polygon.exterior.coords[:-1]]
    holes = tuple(
        tuple((round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in hole.coords[:-1]) for hole in polygon.interiors
    )
    room_type = room_id.rsplit("_", 1)[0]
    return RoomOutline(room_id, room_type, tuple(ring), round(polygon.area, 2), holes)


def measured_outline(scene: str) -> Outline:
    """Read the floor plan of one of the 15 houses.

    Overlaps between rooms go to the room named first; doorways narrower than 0.65 m are widened to that, and the
    source says which.
    """
    path = resources.files("envs_data") / "floorplans" / f"{scene}.json"
    plan = msgspec.json.decode(path.read_bytes(), type=_Plan)
    polygons: dict[str, Any] = {}
    for room in sorted(plan.rooms, key=lambda r: r.id):
        polygon = Polygon(room.polygon, room.holes).buffer(0)
        for other in polygons.values():
            polygon = polygon.difference(other)
        polygons[room.id] = _largest(polygon)
    openings, widened = [], []
    for entry in sorted(plan.openings, key=lambda o: (o.rooms, o.segment)):
        segment = entry.segment
        if entry.width_m < DOORWAY_MIN_M - 1e-6:
            segment = _widen(polygons, entry)
            widened.append(f"{entry.rooms[0]}-{entry.rooms[1]} from {entry.width_m:.2f} m")
        width = max(entry.width_m, DOORWAY_MIN_M)
        kind = "open" if entry.kind == "open" else "doorway"
        openings.append(Opening(entry.rooms, segment, round(width, 2), kind))  # type: ignore[arg-type]
    rooms = tuple(outline_room(name, polygons[name]) for name in sorted(polygons))
    source = plan.source
    if widened:
        source += f"; doorways widened to {DOORWAY_MIN_M:.2f} m: " + ", ".join(widened)
    return Outline(rooms, tuple(openings), source)


def _largest(shape: Any) -> Any:
    parts = getattr(shape, "geoms", [shape])
    return max(parts, key=lambda p: p.area)


def _widen(polygons: dict[str, Any], entry: _Opening) -> tuple[tuple[float, float], tuple[float, float]]:
    """Cut a doorway of the least width through the wall around `entry`, half of it for each room."""
    (x0, y0), (x1, y1) = entry.segment
    length = max(entry.width_m, 1e-6)
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    mx, my = (x0 + x1) / 2, (y0 + y1) / 2
    options = []
    for shift in (0.0, -0.05, 0.05, -0.1, 0.1, -0.15, 0.15, -0.2, 0.2):
        cx, cy = mx + shift * ux, my + shift * uy
        half = DOORWAY_MIN_M / 2
        line = LineString([(cx - half * ux, cy - half * uy), (cx + half * ux, cy + half * uy)])
        cut = line.buffer(WALL_MAX_M, cap_style=BufferCapStyle.flat)
        taken = sum(cut.intersection(p).area for name, p in sorted(polygons.items()) if name not in entry.rooms)
        options.append((round(taken, 4), abs(shift), shift, line, cut))
    _, _, _, line, cut = min(options, key=lambda o: o[:3])
    others = unary_union([p for name, p in sorted(polygons.items()) if name not in entry.rooms])
    first, second = entry.rooms
    near = {name: polygons[name] for name in entry.rooms}
    fresh = cut.difference(others).difference(near[first]).difference(near[second])
    # The wall is shared out by the side of the doorway line that it lies on.
    (ax, ay), (bx, by) = line.coords
    side = _side(near[first], (ax, ay), (bx, by))
    nx, ny = -(by - ay) * side, (bx - ax) * side
    norm = (nx * nx + ny * ny) ** 0.5
    nx, ny = nx / norm, ny / norm
    half_plane = Polygon([(ax, ay), (bx, by), (bx + nx, by + ny), (ax + nx, ay + ny)])
    polygons[first] = _largest(unary_union([near[first], fresh.intersection(half_plane)]).buffer(0))
    polygons[second] = _largest(unary_union([near[second], fresh.difference(half_plane)]).buffer(0))
    return (round(ax, 3), round(ay, 3)), (round(bx, 3), round(by, 3))


def _side(polygon: Any, a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return +1 if the polygon lies to the left of a -> b near its middle (picture axes), else -1."""
    mx, my = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
    dx, dy = b[0] - a[0], b[1] - a[1]
    norm = (dx * dx + dy * dy) ** 0.5
    nx, ny = -dy / norm, dx / norm
    for reach in (0.05, 0.15, 0.3, 0.5):
        plus = polygon.contains(Point(mx + reach * nx, my + reach * ny))
        minus = polygon.contains(Point(mx - reach * nx, my - reach * ny))
        if plus != minus:
            return 1.0 if plus else -1.0
    centre = polygon.centroid
    return 1.0 if (centre.x - mx) * nx + (centre.y - my) * ny >= 0 else -1.0
