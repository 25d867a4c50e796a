"""The free floor of one room while it is being furnished: what fits, and what stays reachable.

Footprints are axis-aligned rectangles `(x0, y0, x1, y1)`, metres. The room is rasterised together with a short strip of
floor beyond each opening, so that "the room can be entered" is a connectivity question inside the raster.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import BufferCapStyle
from shapely.geometry import LineString, Point, Polygon, box
from shapely.ops import unary_union

from gavel_env.house.scenes import Opening

__all__ = ["WALL_GAP_M", "Rect", "RoomSpace", "WallLine", "keepout_of"]

Rect = tuple[float, float, float, float]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CLEARANCE_M = 0.31
TIGHT_CLEARANCE_M = 0.27
KEEPOUT_M = 0.55
TIGHT_KEEPOUT_M = 0.4
STRIP_M = 0.75
OPEN_PORTAL_M = 0.9
WALL_GAP_M = 0.02
EPS = 1e-6


class WallLine(NamedTuple):
    """A straight piece of wall: horizontal or vertical, seen from inside the room.

    Attributes:
        horizontal: True if it runs along x.
        at: its coordinate across (y if horizontal, else x), metres.
        inward: +1 or -1, the direction into the room across the line.
        start: first coordinate along the line, metres.
        wall: (n,) cumulative share of wall per 0.05 m step along the line.
        ends: coordinates along the line where corners lie.
    """

    horizontal: bool
    at: float
    inward: int
    start: float
    wall: Floats
    ends: tuple[float, ...]

    @property
    def yaw(self) -> int:
        """Yaw of a piece with its back to this wall."""
        if self.horizontal:
            return 90 if self.inward > 0 else 270
        return 0 if self.inward > 0 else 180


def _portal_line(opening: Opening) -> Any:
    """Return the part of an opening that is kept free: all of a doorway, the middle of an open side."""
    line = LineString(opening.segment)
    limit = OPEN_PORTAL_M if opening.kind == "open" else 1.3
    if line.length <= limit:
        return line
    spare = (line.length - limit) / 2
    return LineString([line.interpolate(spare), line.interpolate(line.length - spare)])


def keepout_of(opening: Opening, depth_m: float) -> Any:
    """Return the floor around an opening that furniture leaves free, on both sides of it."""
    return _portal_line(opening).buffer(depth_m, cap_style=BufferCapStyle.flat)


class RoomSpace:
    """What stands in a room so far, on a raster, with the questions that placing asks.

    Args:
        polygon: floor of the room.
        openings: openings that lead into it.
        house: union of all rooms' floors (what is outside is wall).
        tight: leave just enough room for the robot instead of a comfortable aisle.
    """

    def __init__(self, polygon: Any, openings: Sequence[Opening], house: Any, tight: bool = False) -> None:
        self.polygon = polygon
        self.house = house
        shapely.prepare(self.polygon)
        shapely.prepare(self.house)
        self.tight = tight
        self.clearance_m = TIGHT_CLEARANCE_M if tight else CLEARANCE_M
        depth = TIGHT_KEEPOUT_M if tight else KEEPOUT_M
        self.keepout = unary_union([keepout_of(o, depth) for o in openings]) if openings else Polygon()
        shapely.prepare(self.keepout)
        self.rects: list[Rect] = []
        self.fronts: list[Rect] = []
        self._accesses: list[tuple[slice, slice]] = []
        self.cell = 0.05 if polygon.area < 90.0 else 0.1
        x0, y0, x1, y1 = polygon.bounds
        pad = STRIP_M + 0.2
        self._x0, self._y0 = round(x0 - pad, 2), round(y0 - pad, 2)
        width = int(np.ceil((x1 + pad - self._x0) / self.cell))
        height = int(np.ceil((y1 + pad - self._y0) / self.cell))
        xs = self._x0 + (np.arange(width) + 0.5) * self.cell
        ys = self._y0 + (np.arange(height) + 0.5) * self.cell
        grid_x, grid_y = np.meshgrid(xs, ys)
        inside = shapely.contains_xy(self.polygon, grid_x.ravel(), grid_y.ravel()).reshape(height, width)
        strips = [self._strip(o).intersection(house) for o in openings]
        floor = inside.copy()
        for strip in strips:
            floor |= shapely.contains_xy(strip, grid_x.ravel(), grid_y.ravel()).reshape(height, width)
        self.inside = inside
        self.floor = floor.astype(np.uint8)
        self._portals = []
        for strip in strips:
            beyond = strip.difference(self.polygon.buffer(0.04))
            mask = shapely.contains_xy(beyond, grid_x.ravel(), grid_y.ravel()).reshape(height, width)
            self._portals.append(np.flatnonzero(mask))
        self.main = self._main(self.floor, check=False)
        self._portals = [p for p in self._portals if self.main.ravel()[p].any()]

    def _strip(self, opening: Opening) -> Any:
        return _portal_line(opening).buffer(STRIP_M, cap_style=BufferCapStyle.flat)

    @property
    def entered(self) -> int:
        """Number of openings through which the empty room can be entered."""
        return len(self._portals)

    def distance(self) -> NDArray[np.float32]:
        """Return the distance of every cell from the nearest obstacle, metres, (height, width)."""
        cells = np.asarray(cv2.distanceTransform(self.floor, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
        return np.asarray(cells * np.float32(self.cell), np.float32)

    def at(self, values: NDArray[Any], x: Floats, y: Floats) -> NDArray[Any]:
        """Return the raster's values at points."""
        column = np.clip(((x - self._x0) / self.cell).astype(int), 0, values.shape[1] - 1)
        row = np.clip(((y - self._y0) / self.cell).astype(int), 0, values.shape[0] - 1)
        return np.asarray(values[row, column])

    def _main(self, floor: NDArray[np.uint8], check: bool = True) -> Bools:
        """Return the cells where the robot can be, connected with every opening; all False if one is cut off."""
        distance = np.asarray(cv2.distanceTransform(floor, cv2.DIST_L2, cv2.DIST_MASK_PRECISE))
        free = (distance * self.cell > self.clearance_m).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
        if not self._portals:
            if len(stats) < 2:
                return np.zeros(floor.shape, bool)
            return np.asarray(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
        flat = labels.ravel()
        wanted = None
        for portal in self._portals:
            found = set(np.unique(flat[portal]).tolist()) - {0}
            if wanted is None or not check:
                wanted = found if wanted is None or not wanted else wanted | found
            else:
                wanted &= found
        if not wanted:
            return np.zeros(floor.shape, bool)
        if not check:
            inside = [(int((labels[self.inside] == label).sum()), -label) for label in sorted(wanted)]
            return np.asarray(labels == -max(inside)[1])
        return np.asarray(np.isin(labels, sorted(wanted)))

    def _slices(self, rect: Rect) -> tuple[slice, slice]:
        rows = slice(
            max(0, int((rect[1] - self._y0) / self.cell)), max(0, int(np.ceil((rect[3] - self._y0) / self.cell)))
        )
        columns = slice(
            max(0, int((rect[0] - self._x0) / self.cell)), max(0, int(np.ceil((rect[2] - self._x0) / self.cell)))
        )
        return rows, columns

    def fits(self, rects: Floats, allow: Sequence[Rect] = (), soft: bool = True) -> Bools:
        """Return which (n, 4) footprints lie on the floor, clear of doorways and of what stands there.

        Args:
            rects: (n, 4) candidates.
            allow: footprints that may be overlapped (the table of a chair).
            soft: also keep clear of the space in front of the pieces placed so far.
        """
        if not len(rects):
            return np.zeros(0, bool)
        ok = np.ones(len(rects), bool)
        others = [r for r in self.rects if r not in allow] + (list(self.fronts) if soft else [])
        if others:
            placed = np.array(others)
            for start in range(0, len(rects), 4096):
                part = rects[start : start + 4096]
                hit = (
                    (part[:, None, 0] < placed[None, :, 2] - EPS)
                    & (part[:, None, 2] > placed[None, :, 0] + EPS)
                    & (part[:, None, 1] < placed[None, :, 3] - EPS)
                    & (part[:, None, 3] > placed[None, :, 1] + EPS)
                )
                ok[start : start + 4096] &= ~hit.any(axis=1)
        index = np.flatnonzero(ok)
        if len(index):
            shapes = shapely.box(rects[index, 0], rects[index, 1], rects[index, 2], rects[index, 3])
            good = shapely.covers(self.polygon, shapes)
            if not self.keepout.is_empty:
                good &= ~shapely.intersects(self.keepout, shapes)
            ok[index] = good
        return ok

    def add(self, rect: Rect, access: Rect, front: Rect | None = None) -> bool:
        """Put a blocking footprint down if everything stays reachable; return whether it was put.

        Args:
            rect: footprint.
            access: where the robot must be able to stand for this piece.
            front: floor that later pieces should rather leave free.
        """
        rows, columns = self._slices(rect)
        before = self.floor[rows, columns].copy()
        self.floor[rows, columns] = 0
        main = self._main(self.floor)
        usable = main & self.inside
        own = self._slices(access)
        if not (usable[own].any() and all(usable[s].any() for s in self._accesses)):
            self.floor[rows, columns] = before
            return False
        self.main = main
        self.rects.append(rect)
        self._accesses.append(own)
        if front is not None:
            self.fronts.append(front)
        return True

    def reach(self, rect: Rect, access: Rect) -> None:
        """Let a footprint that was put down be reached from elsewhere than was asked then."""
        if rect in self.rects:
            self._accesses[self.rects.index(rect)] = self._slices(access)

    def reachable(self, rect: Rect, reach_m: float) -> bool:
        """Return whether the robot can stand within reach of a footprint, in this room and not behind a wall."""
        x0, y0, x1, y1 = rect
        rows, columns = self._slices((x0 - reach_m, y0 - reach_m, x1 + reach_m, y1 + reach_m))
        row, column = np.nonzero((self.main & self.inside)[rows, columns])
        x = self._x0 + (column + columns.start + 0.5) * self.cell
        y = self._y0 + (row + rows.start + 0.5) * self.cell
        nx, ny = np.clip(x, x0, x1), np.clip(y, y0, y1)
        away = np.hypot(x - nx, y - ny)
        order = np.argsort(away, kind="stable")
        order = order[away[order] <= reach_m][::7][:40]
        lines = shapely.linestrings(np.stack([np.stack([x, y], 1), np.stack([nx, ny], 1)], axis=1)[order])
        return bool(len(order)) and bool(shapely.covers(self.polygon, lines).any())

    def wall_lines(self) -> list[WallLine]:
        """Return the straight walls of the room, each with where it really is wall."""
        ring = list(self.polygon.exterior.coords)
        found: dict[tuple[bool, float, int], list[float]] = {}
        for (ax, ay), (bx, by) in itertools.pairwise(ring):
            horizontal = abs(ay - by) <= 0.035 and abs(ax - bx) >= 0.25
            vertical = abs(ax - bx) <= 0.035 and abs(ay - by) >= 0.25
            if not (horizontal or vertical):
                continue
            mx, my = (ax + bx) / 2, (ay + by) / 2
            step = 0.06
            if horizontal:
                inward = 1 if self.polygon.contains(Point(mx, my + step)) else -1
                at, ends = (max(ay, by) if inward > 0 else min(ay, by)), (ax, bx)
            else:
                inward = 1 if self.polygon.contains(Point(mx + step, my)) else -1
                at, ends = (max(ax, bx) if inward > 0 else min(ax, bx)), (ay, by)
            found.setdefault((horizontal, round(at, 3), inward), []).extend(ends)
        lines = []
        x0, y0, x1, y1 = self.polygon.bounds
        for (horizontal, at, inward), marks in sorted(found.items()):
            start, stop = (x0, x1) if horizontal else (y0, y1)
            t = np.arange(start + 0.025, stop, 0.05)
            back, front = np.full(len(t), at - inward * 0.05), np.full(len(t), at + inward * 0.06)
            if horizontal:
                wall = ~shapely.contains_xy(self.house, t, back) & shapely.contains_xy(self.polygon, t, front)
            else:
                wall = ~shapely.contains_xy(self.house, back, t) & shapely.contains_xy(self.polygon, front, t)
            share = np.concatenate([[0.0], np.cumsum(wall)])
            lines.append(WallLine(horizontal, at, inward, start, share, tuple(sorted(set(marks)))))
        return lines

    @property
    def bounds(self) -> Rect:
        """Bounding box of the room."""
        x0, y0, x1, y1 = self.polygon.bounds
        return float(x0), float(y0), float(x1), float(y1)

    @staticmethod
    def shape(rect: Rect) -> Any:
        """Return a footprint as a polygon."""
        return box(*rect)
