"""The empty house: floors with their patterns, walls, doorways."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from gavel_env.house.scenes import Furniture, Opening, RoomOutline, Scene
from gavel_env.render.canvas import Canvas, Mask, Place, softened
from gavel_env.render.style import INK_SOFT, SILL, WALL, Floor, floor_of

__all__ = ["door_leaf", "draw_house"]

Point = tuple[float, float]

_OUTER_WALL_M = 0.11
_WALL_GAP_M = 0.34  # rooms nearer to each other than this have a wall between them, not outdoors
_DOORWAY_REACH_M = 0.26  # how far a doorway's cut reaches across the wall to both sides of its segment
_SHARED_WALL_M = 0.07  # thickness of the wall between rooms that share an edge
_LARGEST_LEAF_M = 1.25  # wider doorways are drawn without a door leaf

_PLANK_M, _PLANK_LENGTH_M, _TILE_M, _SMALL_TILE_M, _SLAB_M = 0.17, 1.45, 0.33, 0.165, 0.62


def draw_house(canvas: Canvas, scene: Scene) -> None:
    """Draw floors, walls and doorways."""
    floors = [np.minimum(canvas.mask(room.polygon), 255 - canvas.mask(*room.holes)) for room in scene.rooms]
    for room, mask in zip(scene.rooms, floors, strict=True):
        _draw_floor(canvas, room, mask)
    rooms = np.bitwise_or.reduce(np.stack(floors)) if floors else canvas.mask()
    walls = _walls(canvas, floors, rooms)
    canvas.blend(np.minimum(softened(walls, 0.09 * canvas.view.pixels_per_m), rooms), WALL, 0.38)
    canvas.blend(np.minimum(softened(walls, 0.16 * canvas.view.pixels_per_m), 255 - rooms), WALL, 0.22)
    canvas.blend(walls, WALL, 1.0)
    for opening in scene.openings:
        _draw_opening(canvas, opening, scene, walls)


def _square(side_px: float) -> Mask:
    side = max(1, round(side_px)) | 1
    return cv2.getStructuringElement(cv2.MORPH_RECT, (side, side)).astype(np.uint8)


def _gap_px(canvas: Canvas) -> float:
    return _WALL_GAP_M * canvas.view.pixels_per_m


def _walls(canvas: Canvas, floors: list[Mask], rooms: Mask) -> Mask:
    """Return the mask of walls: what lies between rooms, and a rim around the house."""
    scale = canvas.view.pixels_per_m
    filled = cv2.morphologyEx(rooms, cv2.MORPH_CLOSE, _square(_gap_px(canvas)))
    house = cv2.dilate(filled, _square(2 * _OUTER_WALL_M * scale))
    walls = np.minimum(house, 255 - rooms)
    # Rooms that share an edge have no gap to fill: there, a wall stands where both, grown a little, overlap.
    covered = np.zeros_like(rooms)
    for floor in floors:
        grown = np.asarray(cv2.dilate(floor, _square(_SHARED_WALL_M * scale)), np.uint8)
        walls = np.maximum(walls, np.minimum(covered, grown))
        covered = np.maximum(covered, grown)
    return np.asarray(walls, np.uint8)


def _draw_floor(canvas: Canvas, room: RoomOutline, mask: Mask) -> None:
    columns = np.flatnonzero(mask.any(axis=0))
    rows = np.flatnonzero(mask.any(axis=1))
    if not len(columns) or not len(rows):
        return
    region = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    view = canvas.view
    x = ((np.arange(columns[0], columns[-1] + 1) + 0.5 - view.offset[0]) / view.pixels_per_m + view.origin[0])[None, :]
    y = ((np.arange(rows[0], rows[-1] + 1) + 0.5 - view.offset[1]) / view.pixels_per_m + view.origin[1])[:, None]
    floor = floor_of(room.type)
    tone = _tone(floor, x, y, 1.2 / view.pixels_per_m, along_x=len(columns) >= len(rows))
    weight = mask[region].astype(np.float32) / 255
    for channel, value in enumerate(floor.colour):
        plane = canvas.image[region][..., channel]
        plane[:] = np.round(plane + (np.minimum(value * tone, 255) - plane) * weight).astype(np.uint8)


def _noise(i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return a fixed pseudo-random value in [-1, 1] for each pair of integers (broadcast)."""
    mixed = (i * 73856093) ^ (j * 19349663)
    mixed = (mixed ^ (mixed >> 13)) * 1274126177
    return ((((mixed ^ (mixed >> 16)) & 1023) - 511.5) / 511.5).astype(np.float32)


def _tone(
    floor: Floor, x: NDArray[np.float64], y: NDArray[np.float64], pixel_m: float, along_x: bool
) -> NDArray[np.float32]:
    """Return the brightness factor of a floor pattern.

    Args:
        floor: whose pattern.
        x: (1, width) metres.
        y: (height, 1) metres.
        pixel_m: width of the thinnest line.
        along_x: planks run along x.

    Returns:
        (height, width) float32 around 1.
    """
    ones = np.ones((y.shape[0], x.shape[1]), np.float32)
    if floor.pattern == "plain":
        return ones
    if floor.pattern == "grass":
        cell = 0.07
        blades = _noise(np.floor(x / cell).astype(np.int64), np.floor(y / cell).astype(np.int64))
        return ones + 0.035 * blades
    joint = max(0.007, pixel_m)
    if floor.pattern == "planks":
        across, along = (y, x) if along_x else (x, y)
        row = np.floor(across / _PLANK_M).astype(np.int64)
        shifted = along + _noise(row, row * 0 + 7) * _PLANK_LENGTH_M
        plank = np.floor(shifted / _PLANK_LENGTH_M).astype(np.int64)
        tone = ones + 0.022 * _noise(row, plank)
        lines = (np.mod(across, _PLANK_M) < joint) | (np.mod(shifted, _PLANK_LENGTH_M) < joint)
        return np.where(lines, tone * 0.945, tone).astype(np.float32)
    side = {"tiles": _TILE_M, "small_tiles": _SMALL_TILE_M, "slabs": _SLAB_M}[floor.pattern]
    tone = ones + 0.012 * _noise(np.floor(x / side).astype(np.int64), np.floor(y / side).astype(np.int64))
    lines = (np.mod(x, side) < joint) | (np.mod(y, side) < joint)
    return np.where(lines, tone * 0.95, tone).astype(np.float32)


def _draw_opening(canvas: Canvas, opening: Opening, scene: Scene, walls: Mask) -> None:
    """Cut an opening into the walls; a doorway gets a sill and a door leaf."""
    (ax, ay), (bx, by) = opening.segment
    length_m = math.hypot(bx - ax, by - ay)
    if length_m < 1e-6:
        return
    normal_x, normal_y = -(by - ay) / length_m, (bx - ax) / length_m
    first, second = (next(room for room in scene.rooms if room.id == name) for name in opening.rooms)
    cut = []
    for ends, side in ((((ax, ay), (bx, by)), 1), (((bx, by), (ax, ay)), -1)):
        reach_m = _reach_to_floor((first, second), ends, (side * normal_x, side * normal_y))
        cut += [(x + side * normal_x * reach_m, y + side * normal_y * reach_m) for x, y in ends]
    # Only the wall between the two rooms is cut, not a corner or an outer wall near by.
    region, (left, top) = canvas.window(cut, round(_WALL_GAP_M * canvas.view.pixels_per_m))
    small = Canvas(canvas.image[region], canvas.view.shifted(left, top))
    both = cv2.morphologyEx(small.mask(first.polygon, second.polygon), cv2.MORPH_CLOSE, _square(_gap_px(canvas)))
    gap = np.asarray(np.minimum(np.minimum(small.mask(cut), walls[region]), both), np.uint8)
    if opening.kind == "open":
        small.blend(gap, floor_of(first.type).colour, 1.0)
        return
    small.blend(gap, SILL, 1.0)
    leaf = door_leaf(opening, scene)
    if leaf:
        canvas.polygon(leaf, SILL, 0.32)
        canvas.line(leaf[1:], INK_SOFT, 0.012)
        canvas.line([leaf[0], leaf[-1]], WALL, 0.04)


def _reach_to_floor(rooms: tuple[RoomOutline, RoomOutline], ends: tuple[Point, Point], normal: Point) -> float:
    """Return how far from the segment, along the normal, the floor of a room begins (at most `_DOORWAY_REACH_M`)."""
    (ax, ay), (bx, by) = ends
    for step in range(1, round(_DOORWAY_REACH_M / 0.02)):
        reach_m = 0.02 * step
        spots = [
            (ax + (bx - ax) * t + normal[0] * reach_m, ay + (by - ay) * t + normal[1] * reach_m)
            for t in (0.2, 0.5, 0.8)
        ]
        if all(any(_holds(room, *spot) for room in rooms) for spot in spots):
            return reach_m + 0.02
    return _DOORWAY_REACH_M


def _holds(room: RoomOutline, x: float, y: float) -> bool:
    """True if a point lies on the room's floor."""
    outline = np.array(room.polygon, np.float32).reshape(-1, 1, 2)
    return bool(cv2.pointPolygonTest(outline, (float(x), float(y)), False) >= 0)


def door_leaf(opening: Opening, scene: Scene) -> list[tuple[float, float]]:
    """Return the sector that a doorway's leaf sweeps: hinge, then the arc from shut to open.

    The sources do not say how doors are hung: of the four ways, the first is taken that stays on the floor of one room
    and clear of its furniture. Empty if there is none, for open sides, and for doorways too wide for one leaf.
    """
    first_end, second_end = opening.segment
    length_m = math.dist(first_end, second_end)
    if opening.kind == "open" or not 1e-6 < length_m <= _LARGEST_LEAF_M:
        return []
    rooms = sorted((room for room in scene.rooms if room.id in opening.rooms), key=lambda r: (r.area_m2, r.id))
    for room in rooms:
        pieces = [piece for piece in scene.furniture if piece.room == room.id and piece.blocks]
        for hinge, latch in ((first_end, second_end), (second_end, first_end)):
            start = math.atan2(latch[1] - hinge[1], latch[0] - hinge[0])
            for turn in (math.pi / 2, -math.pi / 2):
                angles = [start + turn * step / 16 for step in range(17)]
                arc = [(hinge[0] + length_m * math.cos(a), hinge[1] + length_m * math.sin(a)) for a in angles]
                if _is_clear(room, pieces, hinge, arc):
                    return [hinge, *arc]
    return []


def _is_clear(
    room: RoomOutline, pieces: list[Furniture], hinge: tuple[float, float], arc: list[tuple[float, float]]
) -> bool:
    """True if a leaf can swing along the arc: past the wall's thickness it is on the room's floor, off its pieces."""
    outline = np.array(room.polygon, np.float32).reshape(-1, 1, 2)
    boxes = [
        np.array(Place(p.x, p.y, p.yaw).box(0, 0, p.size_m[0], p.size_m[1]), np.float32).reshape(-1, 1, 2)
        for p in pieces
    ]
    for step, (x, y) in enumerate(arc[3:], start=3):
        for share in (0.5, 1.0):
            spot = (float(hinge[0] + (x - hinge[0]) * share), float(hinge[1] + (y - hinge[1]) * share))
            # The fully open leaf may lie along a wall, whose face can be a little off the doorway's end.
            slack = 0.12 if step > 12 or share < 1 else 0.0
            if cv2.pointPolygonTest(outline, spot, True) < -slack:
                return False
            if any(cv2.pointPolygonTest(box, spot, False) >= 0 for box in boxes):
                return False
    return True
