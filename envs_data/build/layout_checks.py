"""Independent checks of a finished scene: exact geometry with shapely, none of the code that laid it out.

A robot of radius `ROBOT_M` stands on the cells of a 0.1 m grid whose centres keep that distance from every wall and
every blocking footprint; it moves between the four neighbours, and diagonally where both cells beside it are free.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely import BufferCapStyle
from shapely.geometry import LineString, Polygon, box
from shapely.ops import unary_union

from gavel_env.house.scenes import Furniture, Scene
from gavel_env.world_model.ontology import default_ontology

__all__ = ["Problem", "blocking_overlaps", "check_layout", "footprint", "free_map"]

ROBOT_M = 0.25
CELL_M = 0.1
REACH_M = 1.5
DOOR_DEPTH_M = 0.3
TOLERANCE_M = 0.012
TUCKED_SHARE = 0.6

SEATS = ("chair", "taboret", "stool")


class Problem(NamedTuple):
    """Something wrong with a layout."""

    kind: str
    subject: str
    detail: str


class FreeMap(NamedTuple):
    """Where the robot's centre can be.

    Attributes:
        origin: x, y of the grid's corner, metres.
        label: (height, width) connected region of each free cell, 0 where the robot cannot be.
        room: (height, width) index of the room, -1 outside.
        walls: the walls as lines.
    """

    origin: tuple[float, float]
    label: NDArray[np.int32]
    room: NDArray[np.int32]
    walls: Any


def footprint(piece: Furniture) -> Any:
    """Return the footprint of a piece as a polygon."""
    depth, width, _ = piece.size_m
    if piece.yaw % 180 == 90:
        depth, width = width, depth
    return box(piece.x - depth / 2, piece.y - width / 2, piece.x + depth / 2, piece.y + width / 2)


def _polygons(scene: Scene) -> dict[str, Any]:
    return {r.id: Polygon(r.polygon, [list(h) for h in r.holes]).buffer(0) for r in scene.rooms}


def free_map(scene: Scene) -> FreeMap:
    """Return where the robot can be, and what is connected."""
    polygons = _polygons(scene)
    floor = unary_union([p.buffer(0.002) for _, p in sorted(polygons.items())])
    passages = unary_union(
        [LineString(o.segment).buffer(0.16, cap_style=BufferCapStyle.flat) for o in scene.openings] or [Polygon()]
    )
    walls = unary_union([p.boundary for _, p in sorted(polygons.items())]).difference(passages)
    blocked = unary_union([footprint(f) for f in scene.furniture if f.blocks] or [Polygon()])
    free = (
        floor.difference(blocked)
        .buffer(-ROBOT_M + 1e-6, quad_segs=16)
        .difference(walls.buffer(ROBOT_M - 1e-6, quad_segs=16))
    )
    x0, y0, x1, y1 = floor.bounds
    x0, y0 = np.floor(x0 / CELL_M) * CELL_M, np.floor(y0 / CELL_M) * CELL_M
    xs = x0 + (np.arange(int((x1 - x0) / CELL_M) + 1) + 0.5) * CELL_M
    ys = y0 + (np.arange(int((y1 - y0) / CELL_M) + 1) + 0.5) * CELL_M
    gx, gy = np.meshgrid(xs, ys)
    shapely.prepare(free)
    cells = shapely.contains_xy(free, gx.ravel(), gy.ravel()).reshape(gx.shape)
    # A diagonal step needs both cells beside it, so regions are those of the four neighbours.
    label, _ = ndimage.label(cells)
    room = np.full(gx.shape, -1, np.int32)
    for i, name in enumerate(r.id for r in scene.rooms):
        polygon = polygons[name]
        shapely.prepare(polygon)
        room[shapely.contains_xy(polygon, gx.ravel(), gy.ravel()).reshape(gx.shape)] = i
    shapely.prepare(walls)
    return FreeMap((float(x0), float(y0)), label.astype(np.int32), room, walls)


def blocking_overlaps(scene: Scene) -> list[Problem]:
    """Return pairs of blocking footprints that overlap, other than a seat tucked under a table."""
    found = []
    pieces = [f for f in scene.furniture if f.blocks]
    shapes = [footprint(f).buffer(-0.001) for f in pieces]
    tree = shapely.STRtree(shapes)
    for i, shape in enumerate(shapes):
        for j in sorted(tree.query(shape, predicate="intersects").tolist()):
            if j <= i:
                continue
            seat = next((k for k in (i, j) if any(word in pieces[k].category for word in SEATS)), None)
            other = j if seat == i else i
            shared = shape.intersection(shapes[j]).area
            if seat is None or shared > TUCKED_SHARE * shapes[seat].area or _is_seat(pieces[other]):
                found.append(Problem("overlap", pieces[i].id, f"{pieces[j].id} {shared:.3f} m2"))
    return found


def _collisions(scene: Scene) -> list[Problem]:
    """Return pieces on others (countertops, lamps) that run into something beside what they stand on."""
    found = []
    pieces = [f for f in scene.furniture if f.mount == "floor"]
    shapes = [footprint(f).buffer(-0.002) for f in pieces]
    tree = shapely.STRtree(shapes)
    for i, piece in enumerate(pieces):
        if piece.on is None:
            continue
        for j in sorted(tree.query(shapes[i], predicate="intersects").tolist()):
            other = pieces[j]
            low, high = max(piece.z, other.z), min(piece.z + piece.size_m[2], other.z + other.size_m[2])
            if j != i and (other.on is None or j < i) and high - low > 0.02 and not _is_seat(other):
                found.append(Problem("collision", piece.id, other.id))
    return found


def _is_seat(piece: Furniture) -> bool:
    return any(word in piece.category for word in SEATS)


def check_layout(scene: Scene) -> list[Problem]:
    """Return everything that is wrong with a layout; empty if nothing is."""
    polygons = {name: p.buffer(TOLERANCE_M, join_style="mitre") for name, p in _polygons(scene).items()}
    found = blocking_overlaps(scene) + _collisions(scene)
    for piece in scene.furniture:
        if not polygons[piece.room].covers(footprint(piece)):
            outside = footprint(piece).difference(polygons[piece.room]).area
            found.append(Problem("outside", piece.id, f"{outside:.3f} m2 beyond {piece.room}"))
    for opening in scene.openings:
        if opening.kind != "doorway":
            continue
        line = LineString(opening.segment)
        gate = line.interpolate(0.05).buffer(0) if line.length < 0.2 else line
        zone = gate.buffer(DOOR_DEPTH_M, cap_style=BufferCapStyle.flat)
        for piece in scene.furniture:
            if piece.blocks and piece.room in opening.rooms and footprint(piece).buffer(-0.01).intersects(zone):
                found.append(Problem("doorway", piece.id, f"stands in the doorway {'-'.join(opening.rooms)}"))
    return found + _unreached(scene)


def _unreached(scene: Scene) -> list[Problem]:
    """Return rooms and interactable pieces that cannot be reached from the largest free region."""
    free = free_map(scene)
    sizes = np.bincount(free.label.ravel())
    sizes[0] = 0
    if not sizes.any():
        return [Problem("no floor", scene.scene, "no free cell")]
    main = free.label == int(np.argmax(sizes))
    found = []
    index = {r.id: i for i, r in enumerate(scene.rooms)}
    for name, i in index.items():
        if not (main & (free.room == i)).any():
            found.append(Problem("room unreached", name, "no free cell of the connected floor"))
    ontology = default_ontology()
    for piece in scene.furniture:
        category = ontology[piece.category]
        acts = category.openable or category.toggleable or category.surface or category.interior
        if not acts and (piece.mount != "floor" or piece.on is not None):
            continue
        if not _within_reach(piece, main & (free.room == index[piece.room]), free):
            found.append(Problem("piece unreached", piece.id, f"{piece.room}, {piece.mount}"))
    return found


def _within_reach(piece: Furniture, cells: NDArray[np.bool_], free: FreeMap) -> bool:
    shape = footprint(piece)
    x0, y0, x1, y1 = shape.bounds
    ox, oy = free.origin
    left, right = max(0, int((x0 - REACH_M - ox) / CELL_M)), int((x1 + REACH_M - ox) / CELL_M) + 1
    top, bottom = max(0, int((y0 - REACH_M - oy) / CELL_M)), int((y1 + REACH_M - oy) / CELL_M) + 1
    rows, columns = np.nonzero(cells[top:bottom, left:right])
    x, y = ox + (columns + left + 0.5) * CELL_M, oy + (rows + top + 0.5) * CELL_M
    nx, ny = np.clip(x, x0, x1), np.clip(y, y0, y1)
    away = np.hypot(x - nx, y - ny)
    order = np.argsort(away, kind="stable")
    for k in order[:: max(1, len(order) // 60)].tolist():
        if away[k] > REACH_M:
            break
        # towards the piece, up to a hand's breadth before the wall that it may hang on
        share = max(0.0, 1.0 - 0.08 / max(float(away[k]), 0.08))
        line = LineString([(x[k], y[k]), (x[k] + share * (nx[k] - x[k]), y[k] + share * (ny[k] - y[k]))])
        if not free.walls.intersects(line):
            return True
    return False
