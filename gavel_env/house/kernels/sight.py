"""Sight kernels: lines of sight, reach, camera pictures and frontiers (conventions as in `kernels`).

Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.kernels.compiling import compiled
from gavel_env.house.kernels.routes import Bools, Floats, Ints

__all__ = [
    "cluster_centres",
    "frontier_cells",
    "line_clear",
    "look",
    "reach_cells",
    "seen_near",
    "unseeable",
    "viewpoints",
    "watching_cells",
]


@compiled
def line_clear(opaque: Bools, x0: float, y0: float, x1: float, y1: float, spared: Floats) -> bool:
    """Tell whether a straight line between two points (in cells) meets no opaque cell.

    Opaque cells within two cells of the rectangle `spared` do not count: a piece may stand in its wall.
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
            if np.hypot(along, across) > 2.0:
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


@compiled
def watching_cells(
    opaque: Bools, rooms: NDArray[np.int16], room: int, rectangle: Floats, within: float, margin: float
) -> Ints:
    """Return the floor cells of a room whose sight reveals a rectangle: those within `within` of it.

    For a rectangle in the wall, the distance counts from the floor of the room that is nearest to it.

    Args:
        opaque: (height, width).
        rooms: (height, width) room index.
        room: index of the room that the piece belongs to.
        rectangle: (6,) as in `stamp_rectangle`.
        within: cells.
        margin: cells; a rectangle that is farther than this from all floor of its room has no watching cells.

    Returns:
        (n,) flat indices, ascending.
    """
    height, width = opaque.shape
    x, y, cosine, sine, half_depth, half_width = rectangle
    span_x = abs(cosine) * half_depth + abs(sine) * half_width + within + margin + 1.0
    span_y = abs(sine) * half_depth + abs(cosine) * half_width + within + margin + 1.0
    first_row, last_row = max(0, int(y - span_y)), min(height, int(y + span_y) + 1)
    first_column, last_column = max(0, int(x - span_x)), min(width, int(x + span_x) + 1)
    capacity = max(0, last_row - first_row) * max(0, last_column - first_column)
    cells = np.empty(capacity, np.int32)
    away = np.empty(capacity)
    count = 0
    nearest = np.inf
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            if opaque[row, column] or rooms[row, column] != room:
                continue
            dx, dy = column + 0.5 - x, row + 0.5 - y
            along = max(0.0, abs(dx * cosine + dy * sine) - half_depth)
            across = max(0.0, abs(dy * cosine - dx * sine) - half_width)
            cells[count] = row * width + column
            away[count] = np.hypot(along, across)
            nearest = min(nearest, away[count])
            count += 1
    kept = 0
    for k in range(count if nearest <= margin else 0):
        if away[k] <= nearest + within:
            cells[kept] = cells[k]
            kept += 1
    return cells[:kept].copy()


@compiled
def look(
    opaque: Bools,
    rooms: NDArray[np.int16],
    origin: int,
    heading: float,
    turns: int,
    half_angle: float,
    far: float,
    seen: Bools,
    room_seen: Ints,
    starts: Ints,
    watched: Ints,
    spotted: Bools,
    fresh: Ints,
    log: Ints,
    logged: int,
) -> tuple[int, int]:
    """Take pictures, turning on the spot: mark the floor that a wedge of rays sees until they meet a wall.

    Args:
        opaque: (height, width).
        rooms: (height, width) room index.
        origin: flat index of the camera's cell.
        heading: of the first picture, radians, clockwise from x.
        turns: number of pictures, evenly around the full circle.
        half_angle: half the opening angle, radians.
        far: range in cells, to the centre of a cell.
        seen: (height, width), changed in place.
        room_seen: (rooms,) count of seen cells, changed in place.
        starts: (cells + 1,) where each cell's entries in `watched` begin.
        watched: pieces that each cell reveals, all cells in a row.
        spotted: (pieces,), changed in place.
        fresh: (pieces,) receives the pieces that these pictures reveal first.
        log: (cells,) the seen cells in the order seen; receives the new ones.
        logged: entries of `log` so far.

    Returns:
        How many entries of `fresh` were written, and how many `log` has now.
    """
    height, width = opaque.shape
    row0, column0 = origin // width, origin % width
    rays = int(np.ceil(2.0 * half_angle * far / 0.75)) + 1
    count = 0
    for turn in range(turns):
        middle = heading + 2.0 * np.pi * turn / turns
        for ray in range(rays):
            angle = middle + half_angle * (2.0 * ray / max(1, rays - 1) - 1.0)
            dx, dy = np.cos(angle), np.sin(angle)
            row, column = row0, column0
            step_column, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
            per_column = abs(1.0 / dx) if dx != 0.0 else np.inf
            per_row = abs(1.0 / dy) if dy != 0.0 else np.inf
            to_column, to_row = 0.5 * per_column, 0.5 * per_row
            while 0 <= row < height and 0 <= column < width and not opaque[row, column]:
                if not seen[row, column]:
                    if (row - row0) ** 2 + (column - column0) ** 2 > far * far:
                        break
                    seen[row, column] = True
                    room_seen[rooms[row, column]] += 1
                    cell = row * width + column
                    log[logged] = cell
                    logged += 1
                    for k in range(starts[cell], starts[cell + 1]):
                        piece = watched[k]
                        if not spotted[piece]:
                            spotted[piece] = True
                            fresh[count] = piece
                            count += 1
                if to_column < to_row:
                    if to_column > far:
                        break
                    column += step_column
                    to_column += per_column
                else:
                    if to_row > far:
                        break
                    row += step_row
                    to_row += per_row
    return count, logged


@compiled
def seen_near(cells: Ints, seen: Bools, rooms: NDArray[np.int16], within: float) -> Bools:
    """Tell for each cell whether floor of its room was seen within a distance of it.

    Args:
        cells: (n,) flat indices.
        seen: (height, width).
        rooms: (height, width) room index.
        within: cells.

    Returns:
        (n,) bool.
    """
    height, width = seen.shape
    span = int(within)
    found = np.zeros(cells.size, np.bool_)
    for k in range(cells.size):
        row0, column0 = cells[k] // width, cells[k] % width
        if seen[row0, column0]:
            found[k] = True
            continue
        room = rooms[row0, column0]
        for row in range(max(0, row0 - span), min(height, row0 + span + 1)):
            for column in range(max(0, column0 - span), min(width, column0 + span + 1)):
                if not seen[row, column] or rooms[row, column] != room:
                    continue
                if (row - row0) ** 2 + (column - column0) ** 2 <= within * within:
                    found[k] = True
                    break
            if found[k]:
                break
    return found


@compiled
def frontier_cells(
    before: Ints, fresh: Ints, seen: Bools, opaque: Bools, rooms: NDArray[np.int16], room: int, touched: Bools
) -> Ints:
    """Bring a room's frontier up to date: its unseen floor that touches seen floor.

    Args:
        before: (n,) flat indices, the frontier when all but `fresh` had been seen.
        fresh: (m,) flat indices of what has been seen since.
        seen: (height, width).
        opaque: (height, width).
        rooms: (height, width) room index.
        room: index of the room.
        touched: (height, width) all False; is so again at the end.

    Returns:
        (k,) flat indices, in no order.
    """
    height, width = seen.shape
    found = np.empty(before.size + 4 * fresh.size, np.int32)
    count = 0
    for cell in before:
        row, column = cell // width, cell % width
        if not seen[row, column]:
            touched[row, column] = True
            found[count] = cell
            count += 1
    for cell in fresh:
        row, column = cell // width, cell % width
        for step in range(4):
            row1, column1 = row + (0, 1, 0, -1)[step], column + (1, 0, -1, 0)[step]
            if not (0 <= row1 < height and 0 <= column1 < width) or seen[row1, column1] or touched[row1, column1]:
                continue
            if rooms[row1, column1] == room and not opaque[row1, column1]:
                touched[row1, column1] = True
                found[count] = row1 * width + column1
                count += 1
    for k in range(count):
        touched[found[k] // width, found[k] % width] = False
    return found[:count].copy()


@compiled
def cluster_centres(cells: Ints, height: int, width: int, least: int, span: int) -> Ints:
    """Cluster touching cells (8 neighbours) and return the member nearest to each cluster's centroid.

    Args:
        cells: (n,) flat indices.
        height: of the grid.
        width: of the grid.
        least: clusters of fewer cells are dropped if any is larger.
        span: a cluster is cut where it is more than this many rows or columns away from its first cell.

    Returns:
        (clusters,) flat indices.
    """
    waiting = np.zeros((height, width), np.bool_)
    for cell in cells:
        waiting[cell // width, cell % width] = True
    centres = np.empty(cells.size, np.int32)
    sizes = np.empty(cells.size, np.int32)
    queue = np.empty(cells.size, np.int32)
    count, largest = 0, 0
    for start in cells:
        if not waiting[start // width, start % width]:
            continue
        waiting[start // width, start % width] = False
        queue[0] = start
        head, tail = 0, 1
        sum_row, sum_column = 0, 0
        row0, column0 = start // width, start % width
        while head < tail:
            row, column = queue[head] // width, queue[head] % width
            head += 1
            sum_row += row
            sum_column += column
            for row1 in range(max(0, row - 1, row0 - span), min(height, row + 2, row0 + span + 1)):
                for column1 in range(max(0, column - 1, column0 - span), min(width, column + 2, column0 + span + 1)):
                    if waiting[row1, column1]:
                        waiting[row1, column1] = False
                        queue[tail] = row1 * width + column1
                        tail += 1
        best, best_away = queue[0], np.inf
        for k in range(tail):
            away = (queue[k] // width - sum_row / tail) ** 2 + (queue[k] % width - sum_column / tail) ** 2
            if away < best_away:
                best, best_away = queue[k], away
        centres[count], sizes[count] = best, tail
        largest = max(largest, tail)
        count += 1
    kept = 0
    for k in range(count):
        if sizes[k] >= least or largest < least:
            centres[kept] = centres[k]
            kept += 1
    return centres[:kept].copy()


@compiled
def viewpoints(reachable: Bools, opaque: Bools, cell: int, near: float, far: float) -> Ints:
    """Return the reachable cells that see a cell: those within `near` of it, else all those within `far`.

    Args:
        reachable: (height, width).
        opaque: (height, width).
        cell: flat index.
        near: cells.
        far: cells.

    Returns:
        (n,) flat indices; empty if the cell cannot be seen from anywhere.
    """
    height, width = opaque.shape
    row0, column0 = cell // width, cell % width
    nothing_spared = np.array([-1e6, -1e6, 1.0, 0.0, 0.0, 0.0])
    for distance in (near, far):
        span = int(distance)
        found = np.empty((2 * span + 1) ** 2, np.int32)
        count = 0
        for row in range(max(0, row0 - span), min(height, row0 + span + 1)):
            for column in range(max(0, column0 - span), min(width, column0 + span + 1)):
                if not reachable[row, column] or (row - row0) ** 2 + (column - column0) ** 2 > distance * distance:
                    continue
                if line_clear(opaque, column + 0.5, row + 0.5, column0 + 0.5, row0 + 0.5, nothing_spared):
                    found[count] = row * width + column
                    count += 1
        if count:
            return found[:count].copy()
    return np.empty(0, np.int32)


@compiled
def unseeable(cells: Ints, reachable: Bools, opaque: Bools, near: float, far: float) -> Bools:
    """Tell for each cell whether no reachable cell within `far` sees it; (n,) bool, arguments as in `viewpoints`."""
    height, width = opaque.shape
    nothing_spared = np.array([-1e6, -1e6, 1.0, 0.0, 0.0, 0.0])
    dark = np.zeros(cells.size, np.bool_)
    for k in range(cells.size):
        row0, column0 = cells[k] // width, cells[k] % width
        dark[k] = True
        for distance in (near, far):  # most cells are seen from nearby
            span = int(distance)
            for row in range(max(0, row0 - span), min(height, row0 + span + 1)):
                for column in range(max(0, column0 - span), min(width, column0 + span + 1)):
                    if not dark[k] or not reachable[row, column]:
                        continue
                    if (row - row0) ** 2 + (column - column0) ** 2 > distance * distance:
                        continue
                    if line_clear(opaque, column + 0.5, row + 0.5, column0 + 0.5, row0 + 0.5, nothing_spared):
                        dark[k] = False
    return dark
