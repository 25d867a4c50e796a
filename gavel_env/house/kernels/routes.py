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
_WANTED, _REACHED, _DONE = np.uint8(1), np.uint8(2), np.uint8(4)


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
    state = np.zeros(total, np.uint8)  # what was filled in for a cell: the arrays below need no filling
    low_row, high_row, low_column, high_column = height, -1, width, -1
    for g in goals:
        row, column = g // width, g % width
        if free[row, column]:
            state[g] = _WANTED
            low_row, high_row = min(low_row, row), max(high_row, row)
            low_column, high_column = min(low_column, column), max(high_column, column)
    if high_row < 0 or not free[start // width, start % width]:
        return np.empty(0, np.int32)
    cost = np.empty(total)
    parent = np.empty(total, np.int32)
    keys = np.empty(8 * total + 1)
    items = np.empty(8 * total + 1, np.int32)
    cost[start], parent[start] = 0.0, -1
    state[start] |= _REACHED
    size = 0
    size = _push(keys, items, size, 0.0, int(start))
    while size > 0:
        cell = items[0]
        size = _pop(keys, items, size)
        if state[cell] & _DONE:
            continue
        state[cell] |= _DONE
        if state[cell] & _WANTED:
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
                if not state[next_cell] & _REACHED or reached < cost[next_cell] - 1e-9:
                    state[next_cell] |= _REACHED
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
    """Return the driving distance from the nearest source to every cell (inf where none leads).

    Dijkstra's algorithm with buckets one cell wide: no step is shorter, so every cost in a bucket is final when the
    bucket's turn comes, in whatever order. No step is longer than two buckets, so three are enough.

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
    buckets = np.empty((3, 8 * total + sources.size), np.int32)
    sizes = np.zeros(3, np.int64)
    for s in sources:
        if free[s // width, s % width] and cost[s] > 0.0:
            cost[s] = 0.0
            buckets[0, sizes[0]] = s
            sizes[0] += 1
    turn = 0
    while sizes.any():
        here = turn % 3
        for k in range(sizes[here]):
            cell = buckets[here, k]
            key = cost[cell]
            if key < turn:  # it has had its turn in an earlier bucket
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
                        into = int(reached) % 3
                        buckets[into, sizes[into]] = next_cell
                        sizes[into] += 1
        sizes[here] = 0
        turn += 1
    return cost.reshape(height, width)
