"""Drawing kernels: polygons, walls and footprints onto a grid (conventions as in `kernels`).

Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.kernels.compiling import compiled
from gavel_env.house.kernels.routes import Bools, Floats

__all__ = [
    "close_links",
    "fill_polygon",
    "stamp_points",
    "stamp_rectangle",
]


@compiled
def fill_polygon(corners: Floats, value: int, grid: NDArray[np.int16]) -> None:
    """Write `value` into the still unowned (-1) cells whose centre lies inside the polygon.

    Args:
        corners: (n, 2) x, y in cells from the grid's corner.
        value: what to write.
        grid: (height, width) int16, changed in place.
    """
    height, width = grid.shape
    n = corners.shape[0]
    crossings = np.empty(n)
    for row in range(height):
        y = row + 0.5
        count = 0
        for i in range(n):
            x0, y0 = corners[i]
            x1, y1 = corners[(i + 1) % n]
            if (y0 <= y) != (y1 <= y):
                crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
                k = count  # np.sort would take longer to compile than all of this file
                while k > 0 and crossings[k - 1] > crossing:
                    crossings[k] = crossings[k - 1]
                    k -= 1
                crossings[k] = crossing
                count += 1
        for k in range(0, count - 1, 2):
            first = max(0, int(np.ceil(crossings[k] - 0.5)))
            last = min(width, int(np.ceil(crossings[k + 1] - 0.5)))
            for column in range(first, last):
                if grid[row, column] < 0:
                    grid[row, column] = value


@compiled
def stamp_points(points: Floats, reach: float, clearance: Floats) -> None:
    """Lower `clearance` to the squared distance of each cell centre to the nearest point, as far as `reach`.

    Args:
        points: (n, 2) x, y in cells.
        reach: distances beyond are left alone.
        clearance: (height, width), in square cells, changed in place.
    """
    height, width = clearance.shape
    span = int(np.ceil(reach)) + 1
    for i in range(points.shape[0]):
        x, y = points[i]
        column0, row0 = int(np.floor(x)), int(np.floor(y))
        for row in range(max(0, row0 - span), min(height, row0 + span + 1)):
            for column in range(max(0, column0 - span), min(width, column0 + span + 1)):
                dx, dy = column + 0.5 - x, row + 0.5 - y
                squared = dx * dx + dy * dy
                if squared <= reach * reach and squared < clearance[row, column]:
                    clearance[row, column] = squared


@compiled
def stamp_rectangle(rectangle: Floats, reach: float, distance: Floats) -> None:
    """Lower `distance` to that between each cell centre and a rectangle (0 inside), as far as `reach`.

    Args:
        rectangle: (6,) centre x, centre y, cos, sin of its front direction, half depth along it, half width across.
        reach: distances beyond are left alone.
        distance: (height, width), in cells, changed in place.
    """
    height, width = distance.shape
    x, y, cosine, sine, half_depth, half_width = rectangle
    span_x = abs(cosine) * half_depth + abs(sine) * half_width + reach + 1.0
    span_y = abs(sine) * half_depth + abs(cosine) * half_width + reach + 1.0
    for row in range(max(0, int(y - span_y)), min(height, int(y + span_y) + 1)):
        for column in range(max(0, int(x - span_x)), min(width, int(x + span_x) + 1)):
            dx, dy = column + 0.5 - x, row + 0.5 - y
            along = max(0.0, abs(dx * cosine + dy * sine) - half_depth)
            across = max(0.0, abs(dy * cosine - dx * sine) - half_width)
            d = np.hypot(along, across)
            if d <= reach and d < distance[row, column]:
                distance[row, column] = d


@compiled
def close_links(rooms: NDArray[np.int16], openings: Floats, tolerance: float, wall: Bools) -> None:
    """Mark a wall cell wherever two cells of different rooms touch and no opening joins them there.

    The cell with the larger row or column becomes the wall, so that no 8-connected step and no sight line crosses.

    Args:
        rooms: (height, width) room index, -1 outside.
        openings: (n, 6) room index a, room index b, x0, y0, x1, y1 in cells.
        tolerance: how far from the opening's segment the touching point may lie.
        wall: (height, width), changed in place.
    """
    height, width = rooms.shape
    for row in range(height):
        for column in range(width):
            a = rooms[row, column]
            if a < 0 or wall[row, column]:
                continue
            for step in range(4):
                row1 = row + (1 if step else 0)
                column1 = column + (1, -1, 0, 1)[step]
                if row1 >= height or column1 < 0 or column1 >= width:
                    continue
                b = rooms[row1, column1]
                if b < 0 or b == a or wall[row1, column1]:
                    continue
                x, y = 0.5 * (column + column1) + 0.5, 0.5 * (row + row1) + 0.5
                joined = False
                for k in range(openings.shape[0]):
                    first, second = openings[k, 0], openings[k, 1]
                    if not ((first == a and second == b) or (first == b and second == a)):
                        continue
                    x0, y0, x1, y1 = openings[k, 2], openings[k, 3], openings[k, 4], openings[k, 5]
                    length2 = (x1 - x0) ** 2 + (y1 - y0) ** 2
                    t = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / max(length2, 1e-12)
                    t = min(1.0, max(0.0, t))
                    if np.hypot(x - x0 - t * (x1 - x0), y - y0 - t * (y1 - y0)) <= tolerance:
                        joined = True
                        break
                if not joined:
                    wall[row1, column1] = True
