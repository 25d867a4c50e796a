"""A report as one HTML file: the tables, why episodes failed, and every episode replayed on the floor plan.

Everything in it comes from record files and the shipped scenes; the file needs no server and no network.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import msgspec

from eval.records.journal import RecordFile
from eval.records.schema import EpisodeRecord
from eval.report.grid import Grid, grids, short_spec
from eval.report.tables import results
from gavel_env.errors import GavelError
from gavel_env.house.scenes import Furniture, Scene, load_scene
from gavel_env.render.style import KIND_COLOURS, Rgb, floor_of, kind_of, room_title

__all__ = ["html_report"]


def html_report(
    files: RecordFile, compare: Sequence[str] | None = None, title: str = "GAVEL results", *, tables: bool = True
) -> str:
    """Return the report of record files.

    Args:
        files: as read.
        compare: agents whose metres are matched, as in `eval.report.tables.results`.
        title: heading of the page.
        tables: with result tables; a single episode without them is shown alone, without what chooses among several.

    Raises:
        UnknownAgent: `compare` names an agent that is in none of the files.
    """
    order = {one.config: i for header in files.headers for i, one in enumerate(header.contestants)}
    records = sorted(
        files.records.values(), key=lambda r: (r.kind, r.instruction, r.seed, order.get(r.contestant.config, 99))
    )
    data = {
        "title": title,
        "tables": [_grid(grid) for grid in grids(results(files, compare), failures=True)] if tables else [],
        "scenes": _scenes(records),
        "episodes": [_episode(record) for record in records],
    }
    # In a script element "<" could end the element; as an escape it is the same JSON.
    text = msgspec.json.encode(data).decode().replace("<", "\\u003c")
    page = _asset("report.html").replace("/*STYLE*/", _asset("report.css")).replace("/*SCRIPT*/", _asset("report.js"))
    return page.replace("/*DATA*/", text)


def _asset(name: str) -> str:
    return (resources.files("eval.report") / "assets" / name).read_text("utf-8")


def _grid(grid: Grid) -> dict[str, Any]:
    return grid._asdict()


def _episode(record: EpisodeRecord) -> dict[str, Any]:
    trace = record.trace
    return {
        "agent": record.contestant.agent,
        "planner": short_spec(record.contestant.planner),
        "kind": record.kind,
        "id": record.instruction,
        "seed": record.seed,
        "scene": record.scene,
        "text": record.text,
        "outcome": record.outcome,
        "failure": record.failure,
        "metres": record.metres,
        "planning": round(record.planning_s, 4),
        "attempts": trace.attempts,
        "order": trace.order,
        "stopped": trace.stopped,
        "tasks": [msgspec.to_builtins(task) for task in trace.tasks],
        "steps": [[s.action, s.outcome, s.metres, s.reached, s.route, s.detail] for s in record.steps],
        "unmet": record.unmet,
        "unsafe": record.unsafe,
        "error": record.error,
    }


# --- floor plans ---------------------------------------------------------------------------------------------------


def _scenes(records: Sequence[EpisodeRecord]) -> Mapping[str, Any]:
    """Return the floor plans of the scenes that can be read here; an episode elsewhere is shown without one."""
    plans = {}
    for name in sorted({record.scene for record in records} - {""}):
        try:
            plans[name] = _plan(load_scene(name))
        except GavelError:
            continue
    return plans


def _plan(scene: Scene) -> dict[str, Any]:
    shown = [piece for piece in scene.furniture if piece.mount in ("floor", "carpet") or piece.on is not None]
    types = Counter(room.type for room in scene.rooms)
    shown.sort(key=lambda piece: (piece.mount != "carpet", piece.z, piece.id))
    return {
        "rooms": [
            {
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
    }


def _corners(piece: Furniture) -> list[tuple[float, float]]:
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


def _rounded(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(round(x, 2), round(y, 2)) for x, y in points]


def _css(colour: Rgb) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in colour)
