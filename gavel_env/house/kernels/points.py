"""Point kernels: distances, ways and lines of sight between the sight points of a map (conventions as in `routes`).

Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.kernels.compiling import compiled
from gavel_env.house.kernels.routes import Bools, Ints, distance_field
from gavel_env.house.kernels.sight import line_clear

__all__ = ["sight_lines", "travel", "ways"]

Metres = NDArray[np.float32]


@compiled
def travel(free: Bools, cells: Ints, span: int) -> Metres:
    """Return the driving distances between cells, in cells; inf where none leads.

    Exact within a window of `span` cells about each of them, shortest over such drives beyond it.

    Args:
        free: (height, width) cells that may be entered.
        cells: (n,) flat indices.
        span: cells.

    Returns:
        (n, n) float32, symmetric.
    """
    count, width = cells.size, free.shape[1]
    rows, columns = cells // width, cells % width
    away = np.full((count, count), np.inf, np.float32)
    source = np.empty(1, np.int32)
    for i in range(count):
        top, left = max(0, rows[i] - span), max(0, columns[i] - span)
        window = np.ascontiguousarray(free[top : rows[i] + span + 1, left : columns[i] + span + 1])
        source[0] = (rows[i] - top) * window.shape[1] + columns[i] - left
        field = distance_field(window, source)
        for j in range(count):
            row, column = rows[j] - top, columns[j] - left
            if 0 <= row < window.shape[0] and 0 <= column < window.shape[1]:
                away[i, j] = min(away[i, j], field[row, column])
                away[j, i] = away[i, j]
    for k in range(count):
        for i in range(count):
            first = away[i, k]
            if first < np.inf:
                for j in range(count):
                    away[i, j] = min(away[i, j], first + away[k, j])
    return away


@compiled
def ways(away: Metres, step: float) -> NDArray[np.int16]:
    """Return the next point on the way from every point to every other: a neighbour that is nearer to the goal.

    Args:
        away: (n, n) driving distances.
        step: points no farther apart than this are neighbours.

    Returns:
        (n, n) int16: `ways[i, j]` is where to go from i on the way to j; j itself if no neighbour is nearer to it.
    """
    count = away.shape[0]
    onward = np.empty((count, count), np.int16)
    near = np.empty(count, np.int32)
    for i in range(count):
        neighbours = 0
        for k in range(count):
            if k != i and away[i, k] <= step:
                near[neighbours] = k
                neighbours += 1
        for j in range(count):
            best, shortest = j, np.inf
            for n in range(neighbours):
                k = near[n]
                if away[k, j] < away[i, j] - 1e-3:
                    length = away[i, k] + away[k, j]
                    if length < shortest - 1e-3:
                        best, shortest = k, length
            onward[i, j] = best
    return onward


@compiled
def sight_lines(opaque: Bools, cells: Ints, far: float) -> Bools:
    """Tell which cells see each other: within `far` cells, with no opaque cell between; (n, n) bool, symmetric.

    Args:
        opaque: (height, width).
        cells: (n,) flat indices.
        far: cells.
    """
    count, width = cells.size, opaque.shape[1]
    clear = np.zeros((count, count), np.bool_)
    nothing_spared = np.array([-1e6, -1e6, 1.0, 0.0, 0.0, 0.0])
    for i in range(count):
        clear[i, i] = True
        row, column = cells[i] // width, cells[i] % width
        for j in range(i):
            row1, column1 = cells[j] // width, cells[j] % width
            if (row - row1) ** 2 + (column - column1) ** 2 > far * far:
                continue
            clear[i, j] = line_clear(opaque, column + 0.5, row + 0.5, column1 + 0.5, row1 + 0.5, nothing_spared)
            clear[j, i] = clear[i, j]
    return clear
