"""Route kernels: regions, shortest paths, distance fields on the 8-connected grid, compiled by numba.

Grids are (height, width) arrays, flat index = row * width + column; x grows with the column, y with the row. Lengths
are in cells. Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.kernels.compiling import compiled, inner

__all__ = [
    "Bools",
    "Floats",
    "Ints",
    "components",
    "distance_field",
    "shortest_path",
]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_DIAGONAL = 2.0**0.5


@compiled
def components(free: Bools) -> Ints:
    """Label the connected regions of free cells: (height, width) int32, -1 where not free, else 0, 1, ...

    Steps are straight: a diagonal step needs both its straight neighbours, so it never joins more.
    """
    height, width = free.shape
    label = np.empty((height, width), np.int32)
    label[:] = -1
    queue = np.empty(height * width, np.int32)
    count = 0
    for start in range(height * width):
        if not free[start // width, start % width] or label[start // width, start % width] >= 0:
            continue
        label[start // width, start % width] = count
        queue[0] = start
        head, tail = 0, 1
        while head < tail:
            row, column = queue[head] // width, queue[head] % width
            head += 1
            for step in range(4):
                row1, column1 = row + (0, 1, 0, -1)[step], column + (1, 0, -1, 0)[step]
                if 0 <= row1 < height and 0 <= column1 < width and free[row1, column1] and label[row1, column1] < 0:
                    label[row1, column1] = count
                    queue[tail] = row1 * width + column1
                    tail += 1
        count += 1
    return label


@inner
def _push(keys: Floats, items: Ints, size: int, key: float, item: int) -> int:
    """Add to the binary heap; ties are ordered by item, so that equal inputs give equal paths."""
    i = size
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] < key or (keys[parent] == key and items[parent] <= item):
            break
        keys[i], items[i] = keys[parent], items[parent]
        i = parent
    keys[i], items[i] = key, item
    return size + 1


@inner
def _pop(keys: Floats, items: Ints, size: int) -> int:
    """Remove the top of the heap; the caller has read it."""
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        right = child + 1
        if right < size and (keys[right] < keys[child] or (keys[right] == keys[child] and items[right] < items[child])):
            child = right
        if key < keys[child] or (key == keys[child] and item <= items[child]):
            break
        keys[i], items[i] = keys[child], items[child]
        i = child
    keys[i], items[i] = key, item
    return size


@compiled
def shortest_path(free: Bools, start: int, goals: Ints) -> Ints:
    """Return the shortest 8-connected path from `start` to the nearest of `goals` (exact A*, no corner cutting).

    The heuristic is the octile distance to the goals' bounding box, which is consistent.

    Args:
        free: (height, width) cells that may be entered.
        start: flat index; must be free.
        goals: (n,) flat indices.

    Returns:
        (k,) flat indices, start and goal included; empty if no goal can be reached.
    """
    height, width = free.shape
    total = height * width
    wanted = np.zeros(total, np.bool_)
    low_row, high_row, low_column, high_column = height, -1, width, -1
    for g in goals:
        row, column = g // width, g % width
        if free[row, column]:
            wanted[g] = True
            low_row, high_row = min(low_row, row), max(high_row, row)
            low_column, high_column = min(low_column, column), max(high_column, column)
    if high_row < 0 or not free[start // width, start % width]:
        return np.empty(0, np.int32)
    cost = np.empty(total)
    cost[:] = np.inf
    parent = np.empty(total, np.int32)
    parent[:] = -1
    done = np.zeros(total, np.bool_)
    keys = np.empty(8 * total + 1)
    items = np.empty(8 * total + 1, np.int32)
    cost[start] = 0.0
    size = _push(keys, items, np.int64(0), 0.0, np.int64(start))
    while size > 0:
        cell = items[0]
        size = _pop(keys, items, size)
        if done[cell]:
            continue
        done[cell] = True
        if wanted[cell]:
            length = 1
            back = cell
            while parent[back] >= 0:
                back = parent[back]
                length += 1
            path = np.empty(length, np.int32)
            back = cell
            for k in range(length - 1, -1, -1):
                path[k] = back
                back = parent[back]
            return path
        row, column = cell // width, cell % width
        for dr in range(-1, 2):
            row1 = row + dr
            if row1 < 0 or row1 >= height:
                continue
            for dc in range(-1, 2):
                column1 = column + dc
                if column1 < 0 or column1 >= width or (dr == 0 and dc == 0) or not free[row1, column1]:
                    continue
                step = 1.0
                if dr != 0 and dc != 0:
                    if not free[row, column1] or not free[row1, column]:
                        continue
                    step = _DIAGONAL
                next_cell = row1 * width + column1
                reached = cost[cell] + step
                if reached < cost[next_cell] - 1e-9:
                    cost[next_cell] = reached
                    parent[next_cell] = cell
                    away_row = max(low_row - row1, row1 - high_row, 0)
                    away_column = max(low_column - column1, column1 - high_column, 0)
                    straight = abs(away_row - away_column)
                    ahead = straight + _DIAGONAL * min(away_row, away_column)
                    size = _push(keys, items, size, reached + ahead, next_cell)
    return np.empty(0, np.int32)


@compiled
def distance_field(free: Bools, sources: Ints) -> Floats:
    """Return the driving distance from the nearest source to every cell (Dijkstra; inf where none leads).

    Args:
        free: (height, width) cells that may be entered.
        sources: (n,) flat indices.

    Returns:
        (height, width), in cells.
    """
    height, width = free.shape
    total = height * width
    cost = np.empty(total)
    cost[:] = np.inf
    keys = np.empty(8 * total + 1 + sources.size)
    items = np.empty(8 * total + 1 + sources.size, np.int32)
    size = np.int64(0)
    for s in sources:
        if free[s // width, s % width]:
            cost[s] = 0.0
            size = _push(keys, items, np.int64(size), 0.0, np.int64(s))
    while size > 0:
        key, cell = keys[0], items[0]
        size = _pop(keys, items, size)
        if key > cost[cell]:
            continue
        row, column = cell // width, cell % width
        for dr in range(-1, 2):
            row1 = row + dr
            if row1 < 0 or row1 >= height:
                continue
            for dc in range(-1, 2):
                column1 = column + dc
                if column1 < 0 or column1 >= width or (dr == 0 and dc == 0) or not free[row1, column1]:
                    continue
                step = 1.0
                if dr != 0 and dc != 0:
                    if not free[row, column1] or not free[row1, column]:
                        continue
                    step = _DIAGONAL
                next_cell = row1 * width + column1
                reached = key + step
                if reached < cost[next_cell]:
                    cost[next_cell] = reached
                    size = _push(keys, items, size, reached, next_cell)
    return cost.reshape(height, width)
