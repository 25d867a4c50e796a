"""The robot's body: where it is, how far it drove, and the pictures that it takes on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from gavel_env.house.floor_map import FloorMap, Indices, Route
from gavel_env.sim.sensor import Sensor

__all__ = ["Robot"]


class Robot:
    """A disc with a camera on a floor map.

    Args:
        floor: the map it drives on; it starts at the map's start cell.
        see: receives the pieces that every picture shows for the first time.

    Attributes:
        sensor: what the camera has seen.
        cell: flat index of the robot's cell.
        heading: radians, clockwise from x.
        metres: driven so far.
    """

    def __init__(self, floor: FloorMap, see: Callable[[Iterable[str]], None]) -> None:
        self.floor = floor
        self.sensor = Sensor(floor)
        self.cell = floor.start
        self.heading = 0.0
        self.metres = 0.0
        self._see = see
        self._driven: list[Indices] = []

    @property
    def room(self) -> str | None:
        """Return the room that the robot is in."""
        return self.floor.room_of(self.cell)

    def scan(self) -> None:
        """Turn on the spot and take pictures all around."""
        self._see(self.sensor.scan(self.cell, self.heading))

    def drive(self, route: Route, stop: Callable[[], bool] | None = None) -> None:
        """Drive along a route with a picture every `camera_every_m`; `stop` may end the drive after each picture."""
        cells = route.cells
        if len(cells) == 1:
            return
        rows, columns = np.divmod(cells, self.floor.shape[1])
        steps_row, steps_column = np.diff(rows), np.diff(columns)
        headings = np.arctan2(steps_row, steps_column)
        driven_m = np.cumsum(np.hypot(steps_row, steps_column)) * self.floor.robot.cell_m
        every_m = self.floor.robot.camera_every_m
        end = len(cells) - 1
        for step in np.searchsorted(driven_m, np.arange(every_m, driven_m[-1], every_m) - 1e-9):
            at = int(step) + 1
            if at >= end:
                break
            self._see(self.sensor.look(int(cells[at]), float(headings[step])))
            if stop is not None and stop():
                end = at
                break
        self._driven.append(cells[: end + 1])
        self.metres += route.metres if end == len(cells) - 1 else self.floor.length_m(cells[: end + 1])
        self.cell = int(cells[end])
        self.heading = float(headings[end - 1])

    def take_trail(self) -> Indices:
        """Return the cells driven since the last call, (n,) flat, the present one last; forget them."""
        if not self._driven:
            return np.array([self.cell], np.int32)
        trail = [cells[:-1] for cells in self._driven]
        self._driven = []
        return np.concatenate([*trail, np.array([self.cell], np.int32)])
