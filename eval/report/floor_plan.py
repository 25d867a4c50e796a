"""Floor plans for the report: rooms, doorways and furniture of a scene as polygons in metres."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from eval.report.houses import house_of
from gavel_env.errors import GavelError
from gavel_env.house.scenes import Furniture, Scene
from gavel_env.render.style import KIND_COLOURS, Rgb, floor_of, kind_of, room_title

__all__ = ["floor_plans"]

Points = list[tuple[float, float]]


def floor_plans(scenes: Iterable[str], folders: Sequence[Path]) -> Mapping[str, Any]:
    """Return scene -> floor plan, for the scenes of records that can be read here; `folders` as for `house_of`."""
    plans = {}
    for name in sorted(set(scenes) - {""}):
        try:
            plans[name] = _plan(house_of(name, folders))
        except GavelError:
            continue  # an episode there is shown without one
    return plans


def _plan(scene: Scene) -> dict[str, Any]:
    shown = [piece for piece in scene.furniture if piece.mount in ("floor", "carpet") or piece.on is not None]
    types = Counter(room.type for room in scene.rooms)
    shown.sort(key=lambda piece: (piece.mount != "carpet", piece.z, piece.id))
    return {
        "rooms": [
            {
                "id": room.id,
                "title": room_title(room.id, types[room.type] == 1),
                "points": _rounded(room.polygon),
                "fill": _css(floor_of(room.type).colour),
                "label": _middle(room.polygon),
            }
            for room in scene.rooms
        ],
        "pieces": [
            {"id": piece.id, "points": _corners(piece), "fill": _css(KIND_COLOURS[kind_of(piece.category)])}
            for piece in shown
        ],
        "openings": [_rounded(opening.segment) for opening in scene.openings],
        "places": {piece.id: _rounded([(piece.x, piece.y)])[0] for piece in scene.furniture},
    }


def _corners(piece: Furniture) -> Points:
    """Return the four corners of a footprint, in metres."""
    depth, width, _ = piece.size_m
    cos, sin = math.cos(math.radians(piece.yaw)), math.sin(math.radians(piece.yaw))
    corners = [(a * depth / 2, b * width / 2) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    return _rounded([(piece.x + a * cos - b * sin, piece.y + a * sin + b * cos) for a, b in corners])


def _middle(polygon: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the centroid of a polygon's area."""
    area = x = y = 0.0
    for (x0, y0), (x1, y1) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        cross = x0 * y1 - x1 * y0
        area, x, y = area + cross, x + (x0 + x1) * cross, y + (y0 + y1) * cross
    return round(x / (3 * area), 2), round(y / (3 * area), 2)


def _rounded(points: Sequence[tuple[float, float]]) -> Points:
    return [(round(x, 2), round(y, 2)) for x, y in points]


def _css(colour: Rgb) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in colour)
