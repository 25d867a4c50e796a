"""What searching a room takes: the coverage width w_cov of s(r) = A_trav(r) / w_cov, measured on the executor.

A robot that has seen nothing stands where it enters a room, looks around, and searches the room to the end as the
executor does. w_cov is the area searched per metre driven, over all rooms together, so that the metres of all searches
are right. Measured on houses that no benchmark uses; `gavel_agents.ordering.cost.COVERAGE_WIDTH_M` is the result.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gavel_env.house.floor_map import FloorMap, floor_map, known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.sim.robot import Robot
from gavel_env.sim.room_search import RoomSearch

__all__ = ["CALIBRATION_HOUSES", "Coverage", "RoomSearched", "coverage", "room_searches"]

CALIBRATION_HOUSES = ("Benevolence_0_int", "Benevolence_2_int", "Ihlen_0_int", "Merom_0_int", "Pomaria_2_int")
"""Houses with measured floor plans that are not benchmark houses."""

_ENTRANCES = 2


class RoomSearched(NamedTuple):
    """One complete search of a room.

    Attributes:
        area_m2: A_trav of the known layout.
        metres: driven from the entrance until the room was searched.
        at_once: share of the room's floor where an object would be seen from the entrance.
        until_seen_m: metres until an object somewhere on the floor is seen, on average; drives count to their end.
    """

    scene: str
    room: str
    entered_from: str
    area_m2: float
    metres: float
    at_once: float
    until_seen_m: float


class Coverage(NamedTuple):
    """The searches of several rooms together; the line is metres = constant_m + area / line_width_m."""

    searches: int
    area_m2: float
    metres: float
    until_seen_m: float
    at_once: float
    width_m: float
    constant_m: float
    line_width_m: float
    line_r_squared: float


def room_searches(scenes: Iterable[str] = CALIBRATION_HOUSES) -> Iterator[RoomSearched]:
    """Yield the complete search of every room of some scenes, entered from each of the two rooms nearest to it."""
    for name in scenes:
        scene = load_scene(name)
        layout, floor = known_layout(scene), floor_map(scene)
        for room in floor.room_ids:
            near = sorted((m, r) for r in floor.room_ids if r != room and (m := floor.room_distance(r, room)))
            for _, other in near[:_ENTRANCES]:
                yield _search(floor, name, room, other, layout.traversable_m2(room))


def coverage(searches: Sequence[RoomSearched]) -> Coverage:
    """Return w_cov, and how well area describes the metres at all.

    Raises:
        ValueError: nothing was driven, or fewer than two rooms of different area.
    """
    area = np.array([s.area_m2 for s in searches])
    metres = np.array([s.metres for s in searches])
    if len(searches) < 2 or metres.std() == 0.0 or area.std() == 0.0:
        raise ValueError("a coverage width needs rooms of different area whose searches take different metres")
    slope, constant = np.polyfit(area, metres, 1)
    return Coverage(
        len(searches),
        float(area.mean()),
        float(metres.mean()),
        float(np.mean([s.until_seen_m for s in searches])),
        float(np.mean([s.at_once for s in searches])),
        float(area.sum() / metres.sum()),
        float(constant),
        float(1.0 / slope),
        float(np.corrcoef(area, metres)[0, 1] ** 2),
    )


def _search(floor: FloorMap, scene: str, room: str, entered_from: str, area_m2: float) -> RoomSearched:
    robot = Robot(floor, lambda _: None)
    robot.cell = _entrance(floor, room, entered_from)
    cells = np.nonzero((floor.rooms == floor.room_index[room]) & floor.floor)
    spots = np.ravel_multi_index(cells, floor.shape).astype(np.int32)
    until_m = np.full(len(spots), np.nan)

    def look() -> None:
        robot.scan()
        until_m[np.isnan(until_m) & robot.sensor.saw_floor_near(spots)] = robot.metres

    look()
    search = RoomSearch(robot.sensor, room)
    while (route := search.next_route(robot.cell)) is not None:
        robot.drive(route, search.settled)
        look()
        search.looked(robot.cell)
    at_once = float(np.mean(until_m == 0.0))
    return RoomSearched(scene, room, entered_from, area_m2, robot.metres, at_once, float(np.nanmean(until_m)))


def _entrance(floor: FloorMap, room: str, entered_from: str) -> int:
    """Return the first cell of a room on the shortest route between two rooms' points."""
    start, goal = floor.room_points[entered_from], floor.room_points[room]
    assert start is not None
    assert goal is not None
    route = floor.route(start, [goal])
    assert route is not None
    return next(int(cell) for cell in route.cells if floor.room_of(int(cell)) == room)
