"""Sight kernels: lines of sight, reach, camera pictures and frontiers (conventions as in `kernels`).

Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gavel_env.kernels import Bools, Floats, Ints, compiled

__all__ = [
    "line_clear",
    "reach_cells",
]


@compiled
def line_clear(opaque: Bools, x0: float, y0: float, x1: float, y1: float, spared: Floats) -> bool:
    """Tell whether a straight line between two points (in cells) meets no opaque cell.

    Opaque cells within one cell of the rectangle `spared` do not count: a piece may stand in its wall.
    The walk visits every cell that the line enters, one axis at a time, so nothing slips between two diagonal walls.

    Args:
        opaque: (height, width).
        x0: start of the line.
        y0: start of the line.
        x1: its end.
        y1: its end.
        spared: (6,) rectangle as in `stamp_rectangle`.
    """
    height, width = opaque.shape
    column, row = int(np.floor(x0)), int(np.floor(y0))
    end_column, end_row = int(np.floor(x1)), int(np.floor(y1))
    dx, dy = x1 - x0, y1 - y0
    step_column = 1 if dx > 0 else -1
    step_row = 1 if dy > 0 else -1
    per_column = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_row = abs(1.0 / dy) if dy != 0.0 else np.inf
    to_column = ((column + 1 - x0) if dx > 0 else (x0 - column)) * per_column if dx != 0.0 else np.inf
    to_row = ((row + 1 - y0) if dy > 0 else (y0 - row)) * per_row if dy != 0.0 else np.inf
    for _ in range(abs(end_column - column) + abs(end_row - row) + 1):
        if row < 0 or column < 0 or row >= height or column >= width:
            return False
        if opaque[row, column]:
            x, y = column + 0.5 - spared[0], row + 0.5 - spared[1]
            along = max(0.0, abs(x * spared[2] + y * spared[3]) - spared[4])
            across = max(0.0, abs(y * spared[2] - x * spared[3]) - spared[5])
            if np.hypot(along, across) > 1.0:
                return False
        if to_column < to_row:
            column += step_column
            to_column += per_column
        else:
            row += step_row
            to_row += per_row
    return True


@compiled
def reach_cells(
    floor: Bools, rooms: NDArray[np.int16], opaque: Bools, room: int, rectangle: Floats, reach: float
) -> Ints:
    """Return the floor cells of a room from which a rectangle is within reach and not behind a wall.

    Args:
        floor: (height, width) cells to choose from.
        rooms: (height, width) room index.
        opaque: (height, width) cells that stop arm and sight.
        room: index of the room to stand in.
        rectangle: (6,) as in `stamp_rectangle`; half sizes may be 0.
        reach: cells.

    Returns:
        (n,) flat indices, ascending.
    """
    height, width = floor.shape
    x, y, cosine, sine, half_depth, half_width = rectangle
    span_x = abs(cosine) * half_depth + abs(sine) * half_width + reach + 1.0
    span_y = abs(sine) * half_depth + abs(cosine) * half_width + reach + 1.0
    first_row, last_row = max(0, int(y - span_y)), min(height, int(y + span_y) + 1)
    first_column, last_column = max(0, int(x - span_x)), min(width, int(x + span_x) + 1)
    found = np.empty(max(0, last_row - first_row) * max(0, last_column - first_column), np.int32)
    count = 0
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            if not floor[row, column] or rooms[row, column] != room:
                continue
            dx, dy = column + 0.5 - x, row + 0.5 - y
            along, across = dx * cosine + dy * sine, dy * cosine - dx * sine
            near_along = min(half_depth, max(-half_depth, along))
            near_across = min(half_width, max(-half_width, across))
            if np.hypot(along - near_along, across - near_across) > reach:
                continue
            target_x = x + near_along * cosine - near_across * sine
            target_y = y + near_along * sine + near_across * cosine
            if line_clear(opaque, column + 0.5, row + 0.5, target_x, target_y, rectangle):
                found[count] = row * width + column
                count += 1
    return found[:count].copy()
