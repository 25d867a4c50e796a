"""Rooms, walls, routes and stances against independent computations."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from shapely import affinity
from shapely.geometry import LineString, Point, Polygon, box
from shapely.ops import nearest_points
from support.floor_scenes import empty_room, flat, room_with_niche

from gavel_env.errors import SceneError, UnknownObject
from gavel_env.house.floor_map import FloorMap, floor_map, known_layout
from gavel_env.house.robot_config import BadRobotConfig, RobotConfig
from gavel_env.house.scenes import Scene, load_scene

SHIPPED = ("Rs_int", "Beechwood_1_int", "Wainscott_1_int")


def _scenes() -> list[Scene]:
    return [flat(), room_with_niche(), *(load_scene(name) for name in SHIPPED)]


@pytest.fixture(params=_scenes(), ids=lambda scene: scene.scene)
def mapped(request: pytest.FixtureRequest) -> FloorMap:
    return floor_map(request.param)


def _reference_distances(free: NDArray[np.bool_], source: int) -> NDArray[np.float64]:
    """Distances in cells by scipy on a graph built here, edge by edge, from the definition of a legal step."""
    height, width = free.shape
    number = np.arange(height * width).reshape(height, width)
    ends = []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        rows = slice(0, height - dr)
        here = (rows, slice(0, width - 1)) if dc == 1 else (rows, slice(1, width)) if dc == -1 else (rows, slice(None))
        there = (slice(dr, height), slice(1, width) if dc == 1 else slice(0, width - 1) if dc == -1 else slice(None))
        legal = free[here] & free[there]
        if dr and dc:
            beside = (here[0], there[1])
            below = (there[0], here[1])
            legal &= free[beside] & free[below]
        ends.append((number[here][legal], number[there][legal], np.hypot(dr, dc)))
    a = np.concatenate([e[0] for e in ends])
    b = np.concatenate([e[1] for e in ends])
    cost = np.concatenate([np.full(len(e[0]), e[2]) for e in ends])
    graph = coo_array((cost, (a, b)), shape=(height * width, height * width)).tocsr()
    distances: NDArray[np.float64] = dijkstra(graph, directed=False, indices=source)
    return distances


def test_route_lengths_equal_an_independent_dijkstra(mapped: FloorMap) -> None:
    rng = np.random.default_rng(3)
    cells = np.nonzero(mapped.reachable.ravel())[0]
    for source in rng.choice(cells, 3):
        expected = _reference_distances(mapped.free, int(source)) * mapped.robot.cell_m
        field = mapped.distance_field(int(source)).ravel()
        assert np.array_equal(np.isfinite(field), np.isfinite(expected) & mapped.free.ravel())
        assert np.allclose(field[cells], expected[cells], atol=1e-9)
        for target in rng.choice(cells, 40):
            route = mapped.route(int(source), [int(target)])
            assert route is not None
            assert route.metres == pytest.approx(expected[target], abs=1e-9)
            assert route.metres == pytest.approx(mapped.length_m(route.cells), abs=1e-12)
        goals = rng.choice(cells, 12)
        nearest = mapped.route(int(source), goals)
        assert nearest is not None
        assert nearest.metres == pytest.approx(expected[goals].min(), abs=1e-9)


def test_routes_cut_no_corner_and_stay_on_free_floor(mapped: FloorMap) -> None:
    rng = np.random.default_rng(4)
    cells = np.nonzero(mapped.reachable.ravel())[0]
    for source, target in rng.choice(cells, (60, 2)):
        route = mapped.route(int(source), [int(target)])
        assert route is not None
        assert (route.cells[0], route.cells[-1]) == (source, target)
        rows, columns = np.divmod(route.cells, mapped.shape[1])
        assert mapped.free[rows, columns].all()
        assert (np.maximum(abs(np.diff(rows)), abs(np.diff(columns))) == 1).all()
        assert mapped.free[rows[:-1], columns[1:]].all()
        assert mapped.free[rows[1:], columns[:-1]].all()


def test_free_floor_keeps_the_robot_off_walls_and_furniture(mapped: FloorMap) -> None:
    least_m = mapped.robot.robot_radius_m - mapped.robot.erosion_tolerance_m - 1e-6
    blocking = [_polygon(mapped, piece) for piece in mapped.pieces if mapped.pieces[piece].blocks]
    rng = np.random.default_rng(5)
    for index in rng.choice(np.nonzero(mapped.free.ravel())[0], 200):
        centre = Point(mapped.point(int(index)))
        assert all(centre.distance(footprint) >= least_m for footprint in blocking)
        walls = _walls(mapped.scene)
        assert centre.distance(walls) >= least_m


def _polygon(mapped: FloorMap, piece: str) -> Polygon:
    it = mapped.pieces[piece]
    depth, width, _ = it.size_m
    upright = box(-depth / 2, -width / 2, depth / 2, width / 2)
    return affinity.translate(affinity.rotate(upright, it.yaw, origin=(0, 0)), it.x, it.y)


def _walls(scene: Scene) -> object:
    outline = None
    for room in scene.rooms:
        ring = Polygon(room.polygon).exterior
        for opening in scene.openings:
            if room.id in opening.rooms:
                ring = ring.difference(LineString(opening.segment).buffer(0.16, cap_style="flat"))
        outline = ring if outline is None else outline.union(ring)
    return outline


def test_no_step_and_no_diagonal_joins_rooms_without_an_opening(mapped: FloorMap) -> None:
    openings: dict[frozenset[str], list[Any]] = {frozenset(o.rooms): [] for o in mapped.scene.openings}
    for o in mapped.scene.openings:
        openings[frozenset(o.rooms)].append(LineString(o.segment))
    height, width = mapped.shape
    open_floor = ~mapped.opaque
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        for row in range(height - dr):
            for column in range(max(0, -dc), width - max(0, dc)):
                a, b = (row, column), (row + dr, column + dc)
                if not (open_floor[a] and open_floor[b]) or mapped.rooms[a] == mapped.rooms[b]:
                    continue
                pair = frozenset((mapped.room_ids[mapped.rooms[a]], mapped.room_ids[mapped.rooms[b]]))
                assert pair in openings
                middle = Point(*np.mean([mapped.point(r * width + c) for r, c in (a, b)], axis=0))
                assert min(middle.distance(line) for line in openings[pair]) < 0.3


def test_passages_are_open_and_the_narrow_one_is_not() -> None:
    layout = known_layout(flat())
    assert layout.room_distance("kitchen_0", "living_room_0") is not None
    assert layout.room_distance("living_room_0", "study_0") is not None
    assert layout.room_distance("kitchen_0", "pantry_0") is None
    assert layout.traversable_m2("pantry_0") == 0.0
    assert layout.room_points["pantry_0"] is None
    assert layout.distance_to_room(layout.start, "pantry_0") is None
    pantry = layout.cell_at(1.0, 6.0)
    assert pantry is not None
    assert layout.route(layout.start, [pantry]) is None


def test_room_distances_are_a_metric_over_reachable_rooms(mapped: FloorMap) -> None:
    rooms = [room for room in mapped.room_ids if mapped.room_points[room] is not None]
    for a in rooms:
        assert mapped.room_distance(a, a) == 0.0
        for b in rooms:
            there, back = mapped.room_distance(a, b), mapped.room_distance(b, a)
            assert there is not None
            assert back == pytest.approx(there)
            point = mapped.room_points[a]
            assert point is not None
            assert mapped.distance_to_room(point, b) == pytest.approx(there)
            for c in rooms:
                through_ac, through_cb = mapped.room_distance(a, c), mapped.room_distance(c, b)
                assert through_ac is not None
                assert through_cb is not None
                assert there <= through_ac + through_cb + 1e-9


def test_known_layout_ignores_furniture_and_the_true_map_does_not() -> None:
    layout, true_map = known_layout(flat()), floor_map(flat())
    assert not layout.pieces
    assert layout.scene.furniture == ()
    assert layout.scene.items == ()
    assert (layout.rooms == true_map.rooms).all()
    assert (layout.free | ~true_map.free).all()
    assert layout.traversable_m2("kitchen_0") > true_map.traversable_m2("kitchen_0") + 1.0
    with pytest.raises(UnknownObject, match="fridge_0"):
        layout.stances("fridge_0")


def test_traversable_area_is_the_eroded_room() -> None:
    layout = known_layout(empty_room())
    assert layout.traversable_m2("hall_0") == pytest.approx((4.0 - 0.4) * (3.0 - 0.4), rel=0.03)


def test_stances_are_within_reach_in_the_room_and_not_behind_a_wall(mapped: FloorMap) -> None:
    rooms = {room.id: Polygon(room.polygon).buffer(0.08) for room in mapped.scene.rooms}
    for piece, it in mapped.pieces.items():
        room = rooms[it.room]
        shapes = [_polygon(mapped, piece)]
        base = it.on
        while base is not None:
            shapes.append(_polygon(mapped, base))
            base = mapped.pieces[base].on
        for index in mapped.stances(piece)[::3]:
            assert mapped.reachable.flat[index]
            assert mapped.room_of(int(index)) == it.room
            centre = Point(mapped.point(int(index)))
            assert all(centre.distance(shape) <= mapped.robot.reach_m + 1e-6 for shape in shapes)
            arm = LineString(nearest_points(centre, shapes[0]))
            assert arm.difference(room).difference(shapes[0].buffer(0.35)).length < 0.1, (piece, mapped.cell(index))


def test_every_shipped_interactable_piece_has_a_stance(mapped: FloorMap) -> None:
    without = [p for p, it in mapped.pieces.items() if it.mount == "floor" and not mapped.stances(p).size]
    assert without == (["shelf_0"] if mapped.scene.scene == "flat" else [])


def test_an_arm_does_not_reach_through_a_wall() -> None:
    mapped = floor_map(flat())
    shelf_side = mapped.nearest_reachable(1.0, 4.7)
    assert shelf_side is not None
    assert mapped.stances("shelf_0").size == 0
    assert shelf_side not in mapped.stances("shelf_0")


def test_start_is_in_the_middle_of_the_largest_region(mapped: FloorMap) -> None:
    assert mapped.reachable.flat[mapped.start]
    cells = mapped.points(np.nonzero(mapped.reachable.ravel())[0].astype(np.int32))
    away = np.hypot(*(cells - cells.mean(axis=0)).T)
    assert np.hypot(*(np.array(mapped.point(mapped.start)) - cells.mean(axis=0))) == pytest.approx(away.min())


def test_cells_and_points_are_inverse(mapped: FloorMap) -> None:
    for index in np.random.default_rng(6).integers(0, mapped.rooms.size, 100):
        assert mapped.cell_at(*mapped.point(int(index))) == index
    assert mapped.cell_at(-1e6, 0.0) is None


def test_maps_are_cached_and_read_only() -> None:
    assert floor_map(flat()) is floor_map(flat(), RobotConfig())
    assert known_layout(flat()) is known_layout(flat(), robot=RobotConfig())
    assert floor_map(flat()) is not floor_map(flat(), RobotConfig(robot_radius_m=0.3))
    with pytest.raises(ValueError, match="read-only"):
        floor_map(flat()).free[0, 0] = True


def test_a_robot_wider_than_the_room_finds_no_floor() -> None:
    wide = empty_room()
    slim = msgspec.structs.replace(wide.rooms[0], polygon=((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0)))
    layout = known_layout(msgspec.structs.replace(wide, rooms=(slim,)), RobotConfig(robot_radius_m=1.0))
    with pytest.raises(SceneError, match="no floor is free for a robot of 1"):
        _ = layout.start


def test_robot_config_refuses_impossible_values() -> None:
    with pytest.raises(BadRobotConfig, match=r"RobotConfig.cell_m is 0.0; it must be between 0.02 and 0.5"):
        RobotConfig(cell_m=0.0)
    assert RobotConfig().camera_fov_deg == pytest.approx(63.4, abs=0.05)
    assert RobotConfig().scan_headings == 6


def test_unknown_rooms_are_named() -> None:
    with pytest.raises(UnknownObject, match="did you mean 'kitchen_0'"):
        known_layout(flat()).room_distance("kitchen_1", "hall_0")


@pytest.mark.parametrize("name", ["Merom_0_int", "Pomaria_1_int"])
def test_nothing_drives_or_looks_through_a_pillar(name: str) -> None:
    scene = load_scene(name)
    floor = known_layout(scene)
    holes = [hole for room in scene.rooms for hole in room.holes]
    assert holes
    for hole in holes:
        x, y = np.mean(hole, axis=0)
        row, column = int((y - floor.origin_m[1]) / 0.1), int((x - floor.origin_m[0]) / 0.1)
        assert floor.opaque[row, column]
        assert not floor.free[row, column]
