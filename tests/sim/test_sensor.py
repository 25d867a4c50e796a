"""What the camera shows: never through walls, never beyond its wedge, and nothing less than what is in sight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from support.floor_scenes import empty_room, flat
from support.random_worlds import furnished

from gavel_env.house.floor_map import FloorMap, floor_map
from gavel_env.house.robot_config import RobotConfig
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.sim.room_search import RoomSearch
from gavel_env.sim.sensor import Sensor, observed_part, revealed, watch
from gavel_env.world_model.graph import Flag

SCENES = [flat(), load_scene("Rs_int"), load_scene("Ihlen_1_int"), load_scene("Wainscott_1_int")]


@pytest.fixture(params=SCENES, ids=lambda scene: scene.scene)
def floor(request: pytest.FixtureRequest) -> FloorMap:
    return floor_map(request.param)


def _poses(floor: FloorMap, count: int, seed: int) -> list[tuple[int, float]]:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.nonzero(floor.reachable.ravel())[0], count)
    return [(int(cell), float(rng.uniform(-math.pi, math.pi))) for cell in cells]


def _clear(floor: FloorMap, start: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell for (n, 2) end points (column, row) whether the straight line from `start` crosses no opaque cell.

    Walks the line in steps of a fiftieth of a cell: independent of the sensor's ray kernel.
    """
    steps = int(np.hypot(*(ends - start).T).max() * 50) + 2
    line = start + np.linspace(0.0, 1.0, steps)[:, None, None] * (ends - start)
    clear: NDArray[np.bool_] = ~floor.opaque[line[..., 1].astype(int), line[..., 0].astype(int)].any(axis=0)
    return clear


def test_no_floor_is_seen_through_a_wall(floor: FloorMap) -> None:
    inside = np.array([(dx, dy) for dx in np.linspace(0.02, 0.98, 9) for dy in np.linspace(0.02, 0.98, 9)])
    for cell, heading in _poses(floor, 12, 1):
        sensor = Sensor(floor)
        sensor.look(cell, heading)
        row, column = floor.cell(cell)
        start = np.array([column + 0.5, row + 0.5])
        for seen_row, seen_column in np.argwhere(sensor.seen)[::5]:
            ends = inside + np.array([seen_column, seen_row])
            assert _clear(floor, start, ends).any(), (cell, heading, seen_row, seen_column)


def test_no_wall_is_floor(floor: FloorMap) -> None:
    sensor = Sensor(floor)
    for cell, heading in _poses(floor, 60, 2):
        sensor.scan(cell, heading)
    assert not (sensor.seen & floor.opaque).any()


def test_a_picture_covers_its_wedge_and_no_more(floor: FloorMap) -> None:
    robot = floor.robot
    half, far = math.radians(robot.camera_fov_deg) / 2.0, robot.camera_range_m / robot.cell_m
    margins = np.array([(dx, dy) for dx in (0.0, 0.5, 1.0) for dy in (0.0, 0.5, 1.0)])
    rows, columns = np.nonzero(~floor.opaque)
    for cell, heading in _poses(floor, 12, 3):
        sensor = Sensor(floor)
        sensor.look(cell, heading)
        row, column = floor.cell(cell)
        away = np.hypot(rows - row, columns - column)
        turn = np.abs((np.arctan2(rows - row, columns - column) - heading + math.pi) % (2 * math.pi) - math.pi)
        slack = np.arcsin(np.minimum(1.0, 0.7072 / np.maximum(away, 1e-9)))  # half a diagonal of a cell
        seen = sensor.seen[rows, columns]
        assert not (seen & (away > far)).any()
        assert not (seen & (turn > half + slack) & (away > 0)).any()
        surely = np.nonzero((away < far - 1.0) & (turn < half - slack))[0][::11]
        start = np.array([column + 0.5, row + 0.5])
        for k in surely:
            if _clear(floor, start, margins + np.array([columns[k], rows[k]])).all():
                assert seen[k], (cell, heading, rows[k], columns[k])


def test_a_scan_sees_all_around() -> None:
    floor = floor_map(empty_room())
    sensor = Sensor(floor)
    sensor.scan(floor.start, 0.3)
    assert sensor.seen_share("hall_0") == 1.0
    sensor = Sensor(floor)
    sensor.look(floor.start, 0.3)
    assert 0.1 < sensor.seen_share("hall_0") < 0.4


def test_a_piece_is_spotted_when_floor_of_its_room_near_it_was_seen(floor: FloorMap) -> None:
    table = watch(floor)
    origin, cell_m = floor.origin_m, floor.robot.cell_m
    sensor = Sensor(floor)
    spotted: set[str] = set()
    for cell, heading in _poses(floor, 6, 4):
        fresh = sensor.look(cell, heading)
        assert not spotted & set(fresh)
        spotted |= set(fresh)
        for piece in table.pieces:
            it = floor.pieces[piece]
            depth, width, _ = it.size_m
            room = floor.room_index[it.room]
            own = floor.points(np.nonzero(((floor.rooms == room) & ~floor.opaque).ravel())[0].astype(np.int32))
            own = own[np.hypot(*(own - (it.x, it.y)).T) < np.hypot(depth, width) / 2 + 2.5]
            if not len(own):
                continue
            away = _distances(own, it.x, it.y, it.yaw, depth, width)
            index = ((own - origin) / cell_m).astype(int)
            seen = sensor.seen[index[:, 1], index[:, 0]]
            expected = bool((seen & (away <= away.min() + floor.robot.seen_within_m + 1e-6)).any())
            assert (piece in spotted) == expected, piece


def _distances(
    points: NDArray[np.float64], x: float, y: float, yaw: float, depth: float, width: float
) -> NDArray[np.float64]:
    turn = math.radians(yaw)
    dx, dy = points[:, 0] - x, points[:, 1] - y
    along = np.abs(dx * math.cos(turn) + dy * math.sin(turn)) - depth / 2
    across = np.abs(dy * math.cos(turn) - dx * math.sin(turn)) - width / 2
    away: NDArray[np.float64] = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    return away


def test_pieces_in_the_next_room_are_not_spotted_through_the_wall() -> None:
    floor = floor_map(flat())
    sensor = Sensor(floor)
    cell = floor.nearest_reachable(1.0, 4.6)
    assert cell is not None
    spotted = sensor.scan(cell, 0.0)
    assert {"fridge_0", "breakfast_table_0"} <= set(spotted)
    assert not {"sofa_0", "bookcase_0", "bottom_cabinet_0"} & set(spotted)


def test_a_complete_room_has_no_place_left_to_hide(floor: FloorMap) -> None:
    sensor = Sensor(floor)
    for room in floor.room_ids:
        search = RoomSearch(sensor, room)
        cell, stops = floor.start, 0
        while (route := search.next_route(cell)) is not None:
            cell = int(route.cells[-1])
            sensor.scan(cell, 0.0)
            search.looked(cell)
            stops += 1
            assert stops < 60
        assert search.next_route(cell) is None
        if not sensor.is_complete(room):
            continue
        own = floor.points(np.nonzero(((floor.rooms == floor.room_index[room]) & ~floor.opaque).ravel())[0].astype(int))
        seen = own[sensor.seen.ravel()[((floor.rooms == floor.room_index[room]) & ~floor.opaque).ravel()]]
        assert len(seen) >= floor.robot.searched_share * len(own)
        for point in own[::17]:
            assert np.hypot(*(seen - point).T).min() <= floor.robot.seen_within_m + 1e-9


def test_searches_reach_the_share_wherever_sight_allows(floor: FloorMap) -> None:
    for room in floor.room_ids:
        if floor.room_points[room] is None:
            continue
        sensor = Sensor(floor)
        search = RoomSearch(sensor, room)
        cell = floor.start
        while (route := search.next_route(cell)) is not None:
            cell = int(route.cells[-1])
            sensor.scan(cell, 0.0)
            search.looked(cell)
        if sensor.is_complete(room):
            continue
        everywhere = Sensor(floor)
        for stand in np.nonzero(floor.reachable.ravel())[0][::3]:
            everywhere.scan(int(stand), 0.0)
        assert sensor.seen_share(room) >= everywhere.seen_share(room) - 0.05, room


def test_contents_are_seen_with_their_holder_unless_a_shut_door_is_between() -> None:
    graph = scene_graph(flat())
    assert list(revealed(graph, "fridge_0")) == ["fridge_0"]
    opened = graph.with_flag(Flag.OPEN, frozenset({"fridge_0"}))
    assert list(revealed(opened, "fridge_0")) == ["fridge_0", "apple_0"]
    assert list(revealed(graph, "breakfast_table_0")) == ["breakfast_table_0", "bowl_0", "apple_1"]
    assert list(revealed(graph, "countertop_0")) == ["countertop_0"]


def test_the_observed_part_is_closed_and_mentions_nothing_else() -> None:
    rng = np.random.default_rng(9)
    graph = furnished(load_scene("Rs_int"), rng, 40)
    chosen = [obj for obj in graph.world.nodes if graph.world.nodes[obj].fixed]
    part = observed_part(graph, chosen)
    assert tuple(part.world.nodes) == tuple(chosen)
    assert set(part.supports) == set(chosen)
    assert not [obj for obj in graph.world.nodes if obj not in chosen and f"'{obj}'" in repr(part)]
    assert all(set(held) <= set(chosen) for held in part.contents.values())
    assert observed_part(graph, graph.world.nodes) == graph


def test_a_longer_range_sees_more() -> None:
    near = floor_map(_scene(), RobotConfig(camera_range_m=2.0))
    far = floor_map(_scene(), RobotConfig(camera_range_m=8.0))
    shares = []
    for floor in (near, far):
        sensor = Sensor(floor)
        sensor.scan(floor.start, 0.0)
        shares.append(sensor.seen.sum())
    assert shares[0] < shares[1]


def _scene() -> Scene:
    return load_scene("Wainscott_0_int")
