"""What the world model accepts can be driven; what is hidden stays hidden; searches end and miss nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from operator import eq
from pathlib import Path
from unittest.mock import ANY

import numpy as np
import pytest
from support.floor_scenes import flat, room_with_niche, two_lobes
from support.random_worlds import HOUSES, accepted_plan, at, furnished

from gavel_env.errors import UnknownObject
from gavel_env.house.floor_map import FloorMap
from gavel_env.house.kernels import sight as sight_kernels
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.sim.executor import Executor, Outcome
from gavel_env.sim.room_search import BadSearchPrior, next_room
from gavel_env.sim.sensor import observed_part, watch
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Violation, ViolationKind, apply
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

GO, GRASP, OPEN = Primitive.NAVIGATE_TO, Primitive.GRASP, Primitive.OPEN
NOTHING = "zebra_crossing"


def _flat() -> Executor:
    return Executor(flat(), scene_graph(flat()), rng=np.random.default_rng(1))


def _search_everywhere(executor: Executor) -> Outcome:
    return executor.step(Action(GO, NOTHING), accepts=lambda obj: False)


def _root(graph: SceneGraph, obj: str) -> str | None:
    while not graph.world.nodes[obj].fixed:
        relation, holder = graph.supports[obj]
        if relation > Relation.INSIDE:
            return None
        obj = holder
    return obj


def test_it_starts_in_the_middle_and_has_looked_around() -> None:
    executor = _flat()
    state = executor.observed
    assert state.cell == executor.floor.start
    assert state.metres == 0.0
    assert state.graph.robot_room == executor.floor.room_of(state.cell)
    assert state.seen.flat[state.cell]
    assert not state.graph.near


def test_what_is_shut_away_is_unknown_until_its_door_is_opened() -> None:
    executor = _flat()
    _search_everywhere(executor)
    assert "fridge_0" in executor.graph.world.nodes
    assert "apple_0" not in executor.graph.world.nodes
    refused = executor.step(Action(GO, "apple_0"))
    assert refused.violation == Violation(ViolationKind.UNKNOWN_OBJECT, "apple_0")
    assert executor.step(Action(GO, "fridge_0")).ok
    assert "apple_0" not in executor.graph.world.nodes
    assert executor.step(Action(GRASP, "apple_0")).violation == Violation(ViolationKind.UNKNOWN_OBJECT, "apple_0")
    opened = executor.step(Action(OPEN, "fridge_0"))
    assert opened.observed == ("apple_0",)
    assert executor.graph.supports["apple_0"] == (Relation.INSIDE, "fridge_0")
    assert executor.step(Action(Primitive.CLOSE, "fridge_0")).ok
    for target in ("apple_0", "apple"):
        shut_away = executor.step(Action(GO, target), accepts=None if target == "apple_0" else {"apple_0"}.__contains__)
        assert shut_away.violation == Violation(ViolationKind.HIDDEN, "apple_0", "fridge_0")
        assert shut_away.metres == 0.0
    assert executor.step(Action(OPEN, "fridge_0")).observed == ()
    assert executor.step(Action(GRASP, "apple_0")).ok


def test_shelves_without_doors_and_bowls_show_their_contents() -> None:
    executor = _flat()
    _search_everywhere(executor)
    assert {"plate_0", "bowl_0", "apple_1", "tray_0", "table_lamp_0"} <= set(executor.graph.world.nodes)


def test_a_category_is_searched_and_bound_to_what_is_found() -> None:
    executor = _flat()
    outcome = executor.step(Action(GO, "bookcase"))
    assert outcome.ok
    assert outcome.action == Action(GO, "bookcase_0")
    assert executor.graph.robot_room == "living_room_0"
    assert {"bookcase_0", "plate_0"} <= executor.graph.near
    again = executor.step(Action(GO, "bookcase"))
    assert again.action.target == "bookcase_0"
    assert again.metres == 0.0


def test_a_search_can_be_for_certain_instances() -> None:
    executor = _flat()
    outcome = executor.step(Action(GO, "apple"), accepts=lambda obj: obj == "apple_1")
    assert outcome.action == Action(GO, "apple_1")
    assert executor.graph.robot_room == "kitchen_0"


def test_a_stated_room_is_searched_alone() -> None:
    executor = _flat()
    outcome = executor.step(Action(GO, "apple@kitchen"))
    assert outcome.action == Action(GO, "apple_1")
    lost = executor.step(Action(GO, "apple@study"))
    assert lost.violation == Violation(ViolationKind.NOT_FOUND, "apple@study")
    assert lost.searched == ("study_0",)
    assert "living_room_0" not in executor.observed.searched
    assert executor.step(Action(GO, "apple@bathroom")).metres == 0.0
    assert executor.step(Action(GO, "aple@kitchen")).violation == Violation(
        ViolationKind.UNKNOWN_OBJECT, "aple@kitchen"
    )


def test_names_that_mean_nothing_rooms_and_the_unfindable_are_refused() -> None:
    executor = _flat()
    assert executor.step(Action(GO, "frige")).violation == Violation(ViolationKind.UNKNOWN_OBJECT, "frige")
    assert executor.step(Action(GO, "kitchen_0")).violation == Violation(ViolationKind.ROOM_TARGET, "kitchen_0")
    assert executor.observed.metres == 0.0
    lost = executor.step(Action(GO, "dishwasher"))
    assert lost.violation == Violation(ViolationKind.NOT_FOUND, "dishwasher")
    assert lost.metres > 0.0
    assert set(lost.searched) | set(executor.observed.searched) >= {"kitchen_0", "hall_0", "living_room_0", "study_0"}
    assert executor.step(Action(GO, "dishwasher")).metres == 0.0


def test_what_cannot_be_reached_is_unreachable() -> None:
    executor = _flat()
    outcome = executor.step(Action(GO, "shelf"))
    assert "shelf_0" in executor.graph.world.nodes
    assert outcome.violation == Violation(ViolationKind.UNREACHABLE, "shelf_0")
    assert executor.step(Action(GO, "shelf_0")) == (Action(GO, "shelf_0"), outcome.violation, 0.0, ANY, (), (), False)


def test_a_search_looks_around_the_last_corner() -> None:
    scene = room_with_niche()
    executor = Executor(scene, scene_graph(scene))
    assert "floor_lamp_0" not in executor.graph.world.nodes
    assert executor.step(Action(GO, "floor_lamp")).ok


def test_a_search_looks_from_another_room_if_it_must() -> None:
    executor = Executor(two_lobes(), scene_graph(two_lobes()))
    outcome = executor.step(Action(GO, "floor_lamp@hall"))
    assert outcome.violation == Violation(ViolationKind.UNREACHABLE, "floor_lamp_0")
    assert "floor_lamp_0" in executor.graph.world.nodes


def test_a_search_that_finds_nothing_leaves_what_was_near() -> None:
    executor = _flat()
    for action in (Action(GO, "bowl"), Action(GRASP, "bowl_0"), Action(GO, "fridge")):
        assert executor.step(action).ok
    assert not _search_everywhere(executor).ok
    assert executor.observed.metres > 0.0
    for graph in (executor.graph, executor.hidden):
        assert graph.near == {"bowl_0", "apple_1"}
        assert graph.robot_room == executor.floor.room_of(executor.observed.cell)
    assert executor.step(Action(OPEN, "fridge_0")).violation == Violation(ViolationKind.NOT_NEAR, "fridge_0")


def test_a_refused_action_changes_nothing() -> None:
    executor = _flat()
    executor.step(Action(GO, "fridge"))
    before, hidden = executor.observed, executor.hidden
    for action in (Action(GRASP, "fridge_0"), Action(Primitive.RELEASE), Action(Primitive.TOGGLE_ON, "fridge_0")):
        outcome = executor.step(action)
        assert not outcome.ok
        assert outcome.metres == 0.0
        assert executor.hidden is hidden
        assert executor.graph is before.graph


def test_released_things_lie_where_the_robot_stood() -> None:
    executor = _flat()
    for action in (Action(GO, "bowl"), Action(GRASP, "bowl_0"), Action(GO, "sofa")):
        assert executor.step(action).ok
    spot = executor.observed.cell
    assert executor.step(Action(Primitive.RELEASE)).ok
    assert executor.step(Action(GO, "fridge_0")).metres > 0.0
    assert executor.measured_distance_m("bowl_0") > executor.floor.robot.reach_m
    assert executor.step(Action(GO, "bowl_0")).ok
    assert executor.graph.robot_room == "living_room_0"
    back = executor.floor.points(np.array([spot, executor.observed.cell], np.int32))
    assert np.hypot(*(back[0] - back[1])) <= executor.floor.robot.reach_m + 1e-9
    assert executor.position("bowl_0") == executor.floor.point(spot)
    assert "apple_1" in executor.graph.near


def test_an_instance_id_goes_to_its_nearest_stance() -> None:
    executor = _flat()
    _search_everywhere(executor)
    for target in ("fridge_0", "sofa_0", "table_lamp_0", "apple_1", "tray_0"):
        field = executor.floor.distance_field(executor.observed.cell)
        expected = field.flat[executor.stances(target)].min()
        outcome = executor.step(Action(GO, target))
        assert outcome.metres == pytest.approx(expected, abs=1e-9)


def test_the_route_is_the_metres() -> None:
    executor = _flat()
    total = 0.0
    at_cell = executor.observed.cell
    for target in ("tray", "sofa", "fridge", "plate", NOTHING):
        accepts = (lambda obj: False) if target == NOTHING else None
        outcome = executor.step(Action(GO, target), accepts=accepts)
        assert outcome.route[0] == at_cell
        assert outcome.metres == pytest.approx(executor.floor.length_m(outcome.route), abs=1e-9)
        rows, columns = np.divmod(outcome.route, executor.floor.shape[1])
        assert (np.maximum(abs(np.diff(rows)), abs(np.diff(columns))) == 1).all()
        total += outcome.metres
        at_cell = executor.observed.cell
        assert outcome.route[-1] == at_cell
    assert executor.observed.metres == pytest.approx(total)


def test_rooms_are_searched_by_weight_and_then_by_distance() -> None:
    floor = _flat().floor
    hall = floor.room_points["hall_0"]
    assert hall is not None
    by_distance = sorted(
        (room for room in floor.room_ids if floor.room_points[room] is not None),
        key=lambda room: 0.0 if room == "hall_0" else floor.distance_to_room(hall, room) or 0.0,
    )
    order: list[str] = []
    while (room := next_room(floor, hall, order, {})) is not None:
        order.append(room)
    assert order == by_distance
    assert order[0] == "hall_0"
    assert "pantry_0" not in order
    weighted = {"study_0": 0.2, "living_room_0": 0.7, "pantry_0": 1.0}
    assert next_room(floor, hall, (), weighted) == "living_room_0"
    assert next_room(floor, hall, ("living_room_0",), weighted) == "study_0"
    assert next_room(floor, hall, ("living_room_0", "study_0"), weighted) == "hall_0"
    equal = {"study_0": 0.5, "living_room_0": 0.5}
    first = min(equal, key=lambda room: floor.distance_to_room(hall, room) or 0.0)
    assert next_room(floor, hall, (), equal) == first


def test_the_prior_decides_where_a_search_goes_first() -> None:
    metres = {}
    for room in ("kitchen_0", "living_room_0"):
        executor = _flat()
        outcome = executor.step(Action(GO, "apple"), {room: 1.0}, lambda obj: obj == "plate_0")
        assert outcome.ok
        metres[room] = outcome.metres
    assert metres["living_room_0"] < metres["kitchen_0"]


def test_bad_priors_are_refused() -> None:
    executor = _flat()
    with pytest.raises(UnknownObject, match="did you mean 'kitchen_0'"):
        executor.step(Action(GO, "apple"), {"kitchen": 1.0})
    for weight in (-0.1, float("nan"), float("inf")):
        with pytest.raises(BadSearchPrior, match="kitchen_0"):
            executor.step(Action(GO, "apple"), {"kitchen_0": weight})


@pytest.mark.parametrize("house", HOUSES)
def test_a_searched_house_holds_nothing_visible_and_unseen(house: str) -> None:
    scene = load_scene(house)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        graph = furnished(scene, rng, 30)
        executor = Executor(scene, graph, rng=rng)
        outcome = _search_everywhere(executor)
        assert outcome.violation == Violation(ViolationKind.NOT_FOUND, NOTHING)
        floor, table = executor.floor, watch(executor.floor)
        assert set(executor.observed.searched) == {r for r in floor.room_ids if floor.room_points[r] is not None}
        reach_cells = floor.robot.camera_range_m / floor.robot.cell_m
        for obj in graph.world.nodes:
            shut_away = graph.closed_container(obj) is not None
            if obj in executor.graph.world.nodes:
                assert not shut_away
                continue
            if shut_away:
                continue
            root = _root(graph, obj)
            assert root is not None, f"{obj} lies on reachable floor and was not seen"
            piece = table.pieces.index(root)
            owners = np.repeat(np.arange(len(table.starts) - 1), np.diff(table.starts))
            for cell in owners[table.watched == piece]:
                views = sight_kernels.viewpoints(floor.reachable, floor.opaque, int(cell), reach_cells, reach_cells)
                assert views.size == 0, f"{obj} could have been seen from {floor.cell(views[0])}"


@pytest.mark.parametrize("house", HOUSES)
def test_a_search_ends_for_every_category_and_finds_what_can_be_found(house: str) -> None:
    scene = load_scene(house)
    graph = furnished(scene, np.random.default_rng(7), 30)
    for category, instances in graph.world.by_category.items():
        executor = Executor(scene, graph, rng=np.random.default_rng(8))
        outcome = executor.step(Action(GO, category))
        findable = [obj for obj in instances if graph.closed_container(obj) is None and executor.stances(obj).size]
        assert outcome.ok == bool(findable), (category, outcome.violation)
        if outcome.ok:
            assert outcome.action.target in instances
        else:
            assert outcome.violation is not None
            assert outcome.violation.kind in (ViolationKind.NOT_FOUND, ViolationKind.UNREACHABLE)


@pytest.mark.parametrize("house", HOUSES)
def test_plans_that_the_world_model_accepts_can_be_driven(house: str) -> None:
    scene = load_scene(house)
    for seed in range(50):
        rng = np.random.default_rng(seed)
        graph = furnished(scene, rng, 20)
        executor = Executor(scene, graph, rng=rng)
        floor = executor.floor
        model = at(graph, executor.hidden.robot_room or "")

        def reachable(state: SceneGraph, obj: str, floor: FloorMap = floor) -> bool:
            root = _root(state, obj)
            return root is None or floor.stances(root).size > 0

        for action in accepted_plan(model, 17, rng, reachable):
            expected = apply(model, action)
            if action.primitive is GO and action.target not in executor.graph.world.nodes:
                outcome = executor.step(action, accepts=partial(eq, action.target))
            else:
                outcome = executor.step(action)
            assert outcome.ok, (house, seed, str(action), outcome.violation)
            model = expected
            hidden = executor.hidden
            assert (hidden.supports, hidden.flags, hidden.near, hidden.holding, hidden.robot_room, hidden.next_to) == (
                (model.supports, model.flags, model.near, model.holding, model.robot_room, model.next_to)
            )
            assert executor.graph == observed_part(hidden, executor.graph.world.nodes)
            assert floor.room_of(executor.observed.cell) == hidden.robot_room
            for obj in hidden.near:
                assert executor.measured_distance_m(obj) <= floor.robot.reach_m + 1e-9, (house, seed, str(action), obj)


def test_opening_shows_what_was_cooked_unseen() -> None:
    graph = scene_graph(flat()).with_flag(Flag.COOKED, frozenset({"apple_0"}))
    executor = Executor(flat(), graph, rng=np.random.default_rng(1))
    executor.step(Action(GO, "fridge"))
    assert not executor.graph.flags[Flag.COOKED]
    executor.step(Action(OPEN, "fridge_0"))
    assert executor.graph.flags[Flag.COOKED] == {"apple_0"}


_TRACE = """
import numpy as np
from support.random_worlds import furnished
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.sim.executor import Executor
from gavel_env.house.scenes import load_scene
scene = load_scene("Rs_int")
rng = np.random.default_rng(5)
executor = Executor(scene, furnished(scene, rng, 25), rng=rng)
for name in ("mug", "plate", "sofa", "apple", "bed"):
    outcome = executor.step(Action(Primitive.NAVIGATE_TO, name))
    print(name, outcome.action, outcome.violation, repr(outcome.metres), outcome.observed, outcome.searched)
    print(outcome.route.tolist())
"""


def test_the_same_seed_gives_the_same_trajectory_in_any_process() -> None:
    outputs = []
    for hash_seed in ("0", "1"):
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(Path(__file__).parents[1])}
        run = subprocess.run(
            [sys.executable, "-c", _TRACE], capture_output=True, text=True, env=environment, check=True, timeout=120
        )
        outputs.append(run.stdout)
    assert outputs[0] == outputs[1]
    assert "mug" in outputs[0]
