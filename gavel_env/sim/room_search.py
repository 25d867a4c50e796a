"""Searching for what has not been seen: which room next, and where to look from within it.

Rooms go by the agent's weights, ties and zeros by path distance. Within a room the robot drives to the nearest frontier
cluster and looks around, until enough of the floor is seen and no spot is left where an object could hide. A frontier
longer than one look around shows counts as several: the middle of a long one may lie across the hall. A frontier that
stays dark although the robot went to see it is given up, so every search ends.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from gavel_env.errors import BadSearchPrior, UnknownObject
from gavel_env.house.floor_map import FloorMap, Indices, Route
from gavel_env.sim.sensor import Sensor

__all__ = ["BadSearchPrior", "RoomSearch", "check_search_prior", "next_room"]

_FRONTIER_M = 1.0  # how close the robot goes to a frontier, if it can


def check_search_prior(floor: FloorMap, prior: Mapping[str, float]) -> None:
    """Check the weights of a search prior.

    Raises:
        UnknownObject: a key is not a room of the scene.
        BadSearchPrior: a weight is negative, infinite or not a number.
    """
    for room, weight in prior.items():
        if room not in floor.room_index:
            raise UnknownObject(room, floor.room_index, "search_prior (rooms of the scene)")
        if not math.isfinite(weight) or weight < 0.0:
            raise BadSearchPrior(f"search_prior[{room!r}] is {weight!r}; weights are finite and not negative")


def next_room(
    floor: FloorMap,
    cell: int,
    searched: Collection[str],
    prior: Mapping[str, float],
    within: Collection[str] | None = None,
) -> str | None:
    """Return the room to search next, or None if every room (of those `within`) that can be entered was searched.

    The heaviest weight goes first; equal weights, and rooms without weight, by path distance from `cell`.
    """
    here = floor.room_of(cell)
    best: tuple[float, float, int] | None = None
    for index, room in enumerate(floor.room_ids):
        if room in searched or (within is not None and room not in within):
            continue
        metres = 0.0 if room == here else floor.distance_to_room(cell, room)
        if metres is None:
            continue
        key = (-prior.get(room, 0.0), metres, index)
        if best is None or key < best:
            best = key
    return None if best is None else floor.room_ids[best[2]]


class RoomSearch:
    """The search of one room: a sequence of drives, each followed by a look around."""

    def __init__(self, sensor: Sensor, room: str) -> None:
        self.sensor = sensor
        self.room = room
        self._given_up: NDArray[np.bool_] = np.zeros(sensor.floor.shape, np.bool_)
        self._views: dict[int, Indices] = {}
        self._aims: list[int] = []
        cell_m = sensor.floor.robot.cell_m
        self._reach = (_FRONTIER_M / cell_m, sensor.floor.robot.camera_range_m / cell_m)

    def next_route(self, cell: int) -> Route | None:
        """Return the drive to the nearest place worth looking from; None when the room is done."""
        floor = self.sensor.floor
        if self.sensor.is_complete(self.room):
            return None
        if self.sensor.seen_share(self.room) == 0.0:
            self._views, self._aims = {}, []
            return floor.route(cell, floor.room_cells[self.room])
        while True:
            suspects, targets = self._targets()
            if targets.size == 0:
                return None
            self._views = {int(t): views for t in targets if (views := self._viewpoints(int(t))).size}
            if len(self._views) < len(targets):
                self._give_up_unseeable(suspects)
            if not self._views:
                continue
            route = floor.route(cell, np.concatenate(list(self._views.values())))
            if route is not None:
                self._aims = [target for target, views in self._views.items() if route.cells[-1] in views]
                return route
            self._given_up.ravel()[list(self._views)] = True

    def _targets(self) -> tuple[Indices, Indices]:
        """Return the cells still to be seen, and those of them to look at next."""
        from gavel_env.house.kernels import sight as sight_kernels

        frontier = self.sensor.frontier(self.room, self._given_up)
        if frontier.size:
            least, look_around = self.sensor.floor.robot.frontier_min_cells, 2 * int(self._reach[1])
            return frontier, sight_kernels.cluster_centres(frontier, *self.sensor.floor.shape, least, look_around)
        hiding = self.sensor.hiding_cells(self.room)
        hiding = hiding[~self._given_up.ravel()[hiding]]
        return hiding, hiding[:1]

    def _give_up_unseeable(self, suspects: Indices) -> None:
        from gavel_env.house.kernels import sight as sight_kernels

        dark = sight_kernels.unseeable(suspects, self.sensor.floor.reachable, self.sensor.floor.opaque, *self._reach)
        self._given_up.ravel()[suspects[dark]] = True

    def settled(self) -> bool:
        """Tell whether the drive under way has lost its purpose: what it went to see has come into view."""
        return bool(self._aims) and all(self.sensor.seen.flat[target] for target in self._aims)

    def looked(self, cell: int) -> None:
        """Note that the robot looked around at a cell: what it should have seen from there and did not is given up."""
        for target, views in self._views.items():
            if not self.sensor.seen.flat[target] and cell in views:
                self._given_up.flat[target] = True

    def _viewpoints(self, target: int) -> Indices:
        from gavel_env.house.kernels import sight as sight_kernels

        return sight_kernels.viewpoints(self.sensor.floor.reachable, self.sensor.floor.opaque, target, *self._reach)
