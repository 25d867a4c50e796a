"""What rollouts cost: as printed and as measured, from uncertain places, after what was searched and found before."""

from __future__ import annotations

import numpy as np
import pytest

from gavel_agents.ordering.cost import COVERAGE_WIDTH_M, PAPER_COVERAGE_WIDTH_M, TravelModel, travel_model
from gavel_env.house.floor_map import FloorMap, known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.world_model.actions import Action, parse_action


@pytest.fixture(scope="module")
def layout() -> FloorMap:
    return known_layout(load_scene("Rs_int"))


@pytest.fixture(scope="module")
def travel(layout: FloorMap) -> TravelModel:
    return TravelModel(layout)


@pytest.fixture(scope="module")
def printed(layout: FloorMap) -> TravelModel:
    return travel_model(layout, "paper")


def to(*things: str) -> list[Action]:
    return [parse_action(f"NAVIGATE_TO({thing})") for thing in things]


def test_room_searches_are_traversable_floor_by_the_width_of_the_cost(layout: FloorMap) -> None:
    floor_m2 = np.array([layout.traversable_m2(room) for room in layout.room_ids if layout.room_points[room]])
    for cost, width_m, used_m in (
        ("paper", None, PAPER_COVERAGE_WIDTH_M), ("expected", None, COVERAGE_WIDTH_M),
        ("simulated", None, COVERAGE_WIDTH_M), ("paper", 2.0, 2.0), ("expected", 2.0, 2.0),
    ):  # fmt: skip
        assert travel_model(layout, cost, width_m).search_m == pytest.approx(floor_m2 / used_m), cost


def test_metres_between_rooms_are_those_of_the_layout(layout: FloorMap, travel: TravelModel) -> None:
    for i, room in enumerate(travel.rooms):
        point = layout.room_points[room]
        assert point is not None
        between = [layout.room_distance(room, other) for other in travel.rooms]
        assert travel.room_m[i].tolist() == between
        assert min(m for j, m in enumerate(between) if m is not None and j != i) > 1.0
        assert travel.at(point).to_rooms_m.tolist() == [layout.distance_to_room(point, r) for r in travel.rooms]


def test_drives_end_within_the_robots_reach_unless_the_paper_is_followed_to_the_letter(
    travel: TravelModel, printed: TravelModel
) -> None:
    cells = {"bed": travel.layout.room_points["bedroom_0"] or 0}
    far = travel.rollout(to("bed"), travel.at(travel.layout.start), {}, cells).metres
    assert travel.layout.robot.reach_m > 1.0
    to_the_bed = printed.rollout(to("bed"), printed.at(printed.layout.start), {}, cells).metres
    assert to_the_bed == pytest.approx(far + travel.layout.robot.reach_m)


def test_as_printed_a_rollout_forgets_which_rooms_it_has_searched(travel: TravelModel, printed: TravelModel) -> None:
    alike = np.full(len(travel.rooms), 1.0 / len(travel.rooms))
    beliefs = {"a": alike, "b": alike}
    start = printed.at(printed.layout.start)
    both = printed.rollout(to("a", "b"), start, beliefs, {})
    afresh = printed.search_cost(start, alike) + printed.search_cost(printed.among(alike), alike)
    assert both.metres == pytest.approx(afresh)
    assert (both.searched == 0.0).all()
    assert travel.rollout(to("a", "b"), start, beliefs, {}).searched.min() > 0.4


def test_what_was_searched_and_found_before_is_driven_to(travel: TravelModel) -> None:
    belief = np.array([0.1, 0.4, 0.0, 0.3, 0.2])
    start = travel.at(travel.layout.start)
    everywhere = np.array([1.0, 1.0, 0.25, 1.0, 1.0])
    driven_m = float(belief @ start.to_rooms_m)
    found = travel.search(start, belief, everywhere)
    assert found.metres == pytest.approx(driven_m)
    assert found.searched == pytest.approx(everywhere)
    for before in ({"searched": everywhere}, {"found": frozenset({"cup"})}):
        cost = travel.rollout(to("cup"), start, {"cup": belief}, {}, **before)
        assert cost.metres == pytest.approx(driven_m - travel.reach_m)
        assert cost.end.to_rooms_m == pytest.approx(belief @ travel.room_m)
        assert cost.searched == pytest.approx(before.get("searched", np.zeros(5)))


def test_from_where_something_was_found_a_drive_is_the_expectation_over_rooms(travel: TravelModel) -> None:
    belief = np.array([0.1, 0.4, 0.0, 0.3, 0.2])
    layout = travel.layout
    cell = layout.room_points["bedroom_0"] or 0
    expected = sum(
        p * (layout.distance_to_room(cell, room) or 0.0) for p, room in zip(belief, travel.rooms, strict=True)
    )
    assert expected > 1.0
    assert travel.known_cost(travel.among(belief), cell) == pytest.approx(expected)
    there, back = travel.at(layout.start), travel.at(cell)
    assert travel.known_cost(there, cell) == travel.known_cost(back, layout.start) == layout.distance(
        layout.start, (cell,)
    )  # fmt: skip


def test_only_drives_to_what_is_somewhere_cost_metres(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    cells = {"bed": travel.layout.room_points["bedroom_0"] or 0, "pillow": travel.layout.room_points["kitchen_0"] or 0}
    alone = travel.rollout(to("bed"), start, {}, cells)
    aside = [parse_action("GRASP(pillow)"), *to("elsewhere", "bed"), parse_action("RELEASE()"), *to("elsewhere")]
    among_others = travel.rollout(aside, start, {}, cells)
    assert among_others.metres == alone.metres
    assert among_others.end is travel.at(cells["bed"])
    assert not among_others.found
    assert travel.rollout([], start, {}, cells, frozenset({"cup"})).found == {"cup"}
