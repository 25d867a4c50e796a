"""Searches drive no farther than a room asks for: long frontiers are cut, those of a house's rooms stay whole."""

from typing import Any

import numpy as np
import pytest

from gavel_env.house.floor_map import FloorMap, floor_map
from gavel_env.house.kernels import sight as sight_kernels
from gavel_env.house.scenes import load_scene
from gavel_env.sim.robot import Robot
from gavel_env.sim.room_search import RoomSearch, next_room


def _search_all(floor: FloorMap) -> Robot:
    robot = Robot(floor, lambda pieces: None)
    robot.scan()
    done: list[str] = []
    while (room := next_room(floor, robot.cell, done, {})) is not None:
        search = RoomSearch(robot.sensor, room)
        while (route := search.next_route(robot.cell)) is not None:
            robot.drive(route, search.settled)
            robot.scan()
            search.looked(robot.cell)
        done.append(room)
    return robot


@pytest.mark.parametrize("scene", ["hall_conference_large", "Wainscott_0_garden"])
def test_a_large_room_is_searched_by_strips_and_not_criss_cross(scene: str) -> None:
    floor = floor_map(load_scene(scene))
    robot = _search_all(floor)
    strip_m = floor.floor.sum() * floor.robot.cell_m**2 / robot.metres
    assert strip_m > 4.0  # the camera sees five metres to each side; criss-crossing leaves one to three
    assert all(robot.sensor.seen_share(room) > 0.95 for room in floor.room_ids if floor.room_cells[room].size)


@pytest.mark.parametrize("scene", ["Wainscott_1_int", "Pomaria_1_int", "Beechwood_0_int"])
def test_in_a_house_no_frontier_is_long_enough_to_be_cut(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    floor = floor_map(load_scene(scene))
    trail = _search_all(floor).take_trail()
    whole: Any = sight_kernels.cluster_centres
    monkeypatch.setattr(sight_kernels, "cluster_centres", lambda *args: whole(*args[:-1], floor.rooms.size))
    assert np.array_equal(trail, _search_all(floor).take_trail())


def test_a_long_cluster_is_cut_and_every_part_has_its_centre() -> None:
    line = np.arange(3 * 40, 3 * 40 + 30, dtype=np.int32)  # thirty cells of row 3, of forty in a row
    assert sight_kernels.cluster_centres(line, 10, 40, 1, 100).tolist() == [3 * 40 + 14]
    parts = sight_kernels.cluster_centres(line, 10, 40, 1, 9)
    assert (parts - 3 * 40).tolist() == [4, 14, 24]
