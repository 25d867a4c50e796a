"""Eq. (5) minimised exactly: every permutation, Held-Karp, and the search cost of the paper."""

from __future__ import annotations

import itertools
import math
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.cli import main
from eval.studies.room_coverage import coverage, room_searches
from gavel_agents.ordering.cost import COVERAGE_WIDTH_M, PAPER_COVERAGE_WIDTH_M, TravelModel
from gavel_agents.ordering.order import Costs, best_by_first_task, expected_costs, held_karp, orderings
from gavel_agents.ordering.situation import Situation
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.world_model.actions import parse_action


def random_costs(count: int, seed: int) -> Costs:
    rng = np.random.default_rng(seed)
    pairwise = rng.uniform(0.0, 20.0, (count, count))
    np.fill_diagonal(pairwise, 0.0)
    return Costs(rng.uniform(0.0, 20.0, count), pairwise)


def total(costs: Costs, order: tuple[int, ...]) -> float:
    metres = costs.first_cost[order[0]]
    for position in range(1, len(order)):
        metres += costs.pairwise_cost[order[position - 1], order[position]]
    return float(metres)


@given(st.integers(1, 6), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_orderings_are_all_permutations_by_increasing_cost(count: int, seed: int) -> None:
    costs = random_costs(count, seed)
    found = list(orderings(costs))
    assert sorted(found) == sorted(itertools.permutations(range(count)))
    values = [total(costs, order) for order in found]
    assert values == sorted(values)
    assert values == pytest.approx([costs.ordering_cost(order) for order in found])


@given(st.integers(2, 7), st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_held_karp_finds_the_enumerated_optimum(count: int, seed: int) -> None:
    costs = random_costs(count, seed)
    best = min(total(costs, order) for order in itertools.permutations(range(count)))
    assert total(costs, held_karp(costs)) == pytest.approx(best)


@given(st.integers(1, 7), st.integers(0, 10_000), st.integers(1, 40))
@settings(max_examples=60, deadline=None)
def test_the_short_list_has_the_best_orders_of_every_first_task(count: int, seed: int, size: int) -> None:
    costs = random_costs(count, seed)
    found = best_by_first_task(costs, size)
    share = math.ceil(size / count)
    for first in range(count):
        best = [order for order in orderings(costs) if order[0] == first][:share]
        assert [order for order in found if order[0] == first] == best


def test_eight_tasks_are_still_enumerated() -> None:
    costs = random_costs(8, 1)
    assert sum(1 for _ in orderings(costs)) == math.factorial(8)
    found = best_by_first_task(costs, 8 * 200)  # more than the neighbours of the optimum would be
    assert len(found) == 8 * 200
    assert [order[0] for order in found] == sorted(list(range(8)) * 200)


def test_beyond_enumeration_the_optimum_comes_first_and_neighbours_follow() -> None:
    costs = random_costs(10, 3)
    found = list(orderings(costs))
    assert found[0] == held_karp(costs)
    values = [total(costs, order) for order in found]
    assert values == sorted(values)
    assert len(found) == len(set(found)) == 82


@pytest.mark.parametrize("size", [1, 20, 30])
def test_beyond_enumeration_the_short_list_has_the_best_that_are_known_of_every_first_task(size: int) -> None:
    costs = random_costs(10, 3)
    known = list(orderings(costs))
    found = best_by_first_task(costs, size)
    for first in {order[0] for order in known}:
        mine = [order for order in known if order[0] == first]
        assert [order for order in found if order[0] == first] == mine[: math.ceil(size / 10)]
    assert [order[0] for order in found] == sorted(order[0] for order in found)


@pytest.fixture(scope="module")
def travel() -> TravelModel:
    return TravelModel(known_layout(load_scene("Rs_int")))


def kappa(travel: TravelModel, rooms: list[int], first_m: float, k: int) -> float:
    """kappa_k of the paper, term by term."""
    metres = first_m
    for m in range(k):
        metres += travel.search_m[rooms[m]] + travel.room_m[rooms[m], rooms[m + 1]]
    return float(metres + travel.found_fraction * travel.search_m[rooms[k]])


def test_search_cost_is_the_papers_expectation(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    belief = np.array([0.1, 0.4, 0.0, 0.3, 0.2])
    rooms = [1, 3, 4, 0]
    first = float(start.to_rooms_m[1])
    expected = sum(belief[r] * kappa(travel, rooms, first, k) for k, r in enumerate(rooms)) / belief.sum()
    assert travel.search_cost(start, belief) == pytest.approx(expected)


def test_equal_beliefs_are_searched_nearest_first(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    belief = np.full(len(travel.rooms), 1.0 / len(travel.rooms))
    rooms = [int(i) for i in np.argsort(start.to_rooms_m)]
    first = float(start.to_rooms_m[rooms[0]])
    expected = np.mean([kappa(travel, rooms, first, k) for k in range(len(rooms))])
    assert travel.search_cost(start, belief) == pytest.approx(float(expected))


def test_search_cost_does_not_depend_on_the_scale_of_the_belief(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    belief = np.array([0.1, 0.4, 0.0, 0.3, 0.2])
    assert travel.search_cost(start, belief) == pytest.approx(travel.search_cost(start, belief * 0.25))


def test_a_second_visit_is_driven_not_searched(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    one_hot = np.eye(len(travel.rooms))
    beliefs = {"cup": one_hot[0], "shelf": one_hot[3]}
    once = travel.rollout([parse_action("NAVIGATE_TO(cup)")], start, beliefs, {})
    there_and_back = [parse_action(f"NAVIGATE_TO({x})") for x in ("cup", "shelf", "cup")]
    cost = travel.rollout(there_and_back, start, beliefs, {})
    search_shelf = travel.room_m[0, 3] + travel.found_fraction * travel.search_m[3]
    reached = 2 * travel.reach_m
    assert cost.metres == pytest.approx(once.metres + search_shelf + travel.room_m[3, 0] - reached)
    assert cost.found == {"cup", "shelf"}


def test_pairwise_costs_start_where_the_first_task_ends(travel: TravelModel) -> None:
    one_hot = np.eye(len(travel.rooms))
    beliefs = MappingProxyType({"a": one_hot[0], "b": one_hot[4]})
    plans = [[parse_action("NAVIGATE_TO(a)")], [parse_action("NAVIGATE_TO(b)")]]
    costs = expected_costs(travel, plans, travel.at(travel.layout.start), beliefs, {})
    half, reach = travel.found_fraction, travel.reach_m
    assert costs.pairwise_cost[0, 1] == pytest.approx(travel.room_m[0, 4] + half * travel.search_m[4] - reach)
    assert costs.pairwise_cost[1, 0] == pytest.approx(travel.room_m[4, 0] + half * travel.search_m[0] - reach)
    assert costs.first_cost[1] == pytest.approx(
        travel.layout.distance_to_room(travel.layout.start, travel.rooms[4]) + half * travel.search_m[4] - reach
    )


def test_a_localised_object_costs_its_shortest_path_until_within_reach(travel: TravelModel) -> None:
    layout = travel.layout
    cell = layout.room_points["bedroom_0"]
    assert cell is not None
    cost = travel.rollout([parse_action("NAVIGATE_TO(bed)")], travel.at(layout.start), {}, {"bed": cell})
    metres = layout.distance(layout.start, (cell,))
    assert metres is not None
    assert cost.metres == pytest.approx(metres - travel.reach_m)
    again = travel.rollout([parse_action("NAVIGATE_TO(bed)")], travel.at(cell), {}, {"bed": cell})
    assert again.metres == 0.0


def test_a_search_after_others_is_the_expectation_over_what_they_searched(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    belief = np.array([0.1, 0.4, 0.0, 0.3, 0.2])
    searched = np.array([0.7, 0.25, 0.9, 0.0, 0.5])
    unknown = belief * (1.0 - searched)
    order = [r for r in np.argsort(-unknown) if belief[r] > 0.0]
    expected = 0.0
    for seen in itertools.product((False, True), repeat=5):
        chance = float(np.prod(np.where(seen, searched, 1.0 - searched)))
        left = [int(r) for r in order if not seen[r]]
        for room in range(5):
            if seen[room]:
                metres = float(start.to_rooms_m[room])
            elif room in left:
                metres = kappa(travel, left, float(start.to_rooms_m[left[0]]), left.index(room))
            else:
                continue
            expected += chance * belief[room] * metres
    assert travel.search(start, belief, searched).metres == pytest.approx(expected)


def test_a_search_leaves_rooms_searched_up_to_where_the_object_is(travel: TravelModel) -> None:
    start = travel.at(travel.layout.start)
    belief = np.array([0.0, 0.5, 0.0, 0.3, 0.2])
    half = travel.found_fraction
    left = travel.search(start, belief, np.zeros(5)).searched
    assert left == pytest.approx([0.0, 0.5 + half * 0.5, 0.0, 0.2 + half * 0.3, half * 0.2])
    before = np.array([0.2, 1.0, 0.0, 0.5, 0.0])
    after = travel.search(start, belief, before).searched
    assert (after >= before).all()
    assert (after <= 1.0).all()
    assert after[1] == 1.0


def test_the_next_task_profits_from_the_rooms_that_the_first_will_have_searched(travel: TravelModel) -> None:
    alike = np.full(len(travel.rooms), 1.0 / len(travel.rooms))
    start = travel.at(travel.layout.start)
    plans = [[parse_action("NAVIGATE_TO(a)")], [parse_action("NAVIGATE_TO(b)")]]
    costs = expected_costs(travel, plans, start, {"a": alike, "b": alike}, {})
    end = travel.rollout(plans[0], start, {"a": alike}, {}).end
    afresh = travel.rollout(plans[1], end, {"b": alike}, {}).metres
    assert costs.pairwise_cost[0, 1] < 0.9 * afresh


def test_a_whole_order_is_driven_task_by_task_from_what_the_ones_before_left(travel: TravelModel) -> None:
    alike = np.full(len(travel.rooms), 1.0 / len(travel.rooms))
    start = travel.at(travel.layout.start)
    beliefs = {"a": alike, "b": alike, "c": alike}
    plans = [[parse_action(f"NAVIGATE_TO({thing})")] for thing in beliefs]
    situation = Situation(plans, travel, start, beliefs, {})
    whole = travel.rollout([step for task in (2, 0, 1) for step in plans[task]], start, beliefs, {})
    assert situation.sequential_m((2, 0, 1)) == pytest.approx(whole.metres)
    assert situation.sequential_m(()) == 0.0
    assert situation.expected_m([(2, 0, 1)]) == [situation.pairwise().ordering_cost((2, 0, 1))]


def test_coverage_width_is_what_the_executor_takes_in_houses_of_no_benchmark() -> None:
    searches = list(room_searches())
    found = coverage(searches)
    assert pytest.approx(COVERAGE_WIDTH_M, abs=0.05) == found.width_m
    assert found.width_m > 3 * PAPER_COVERAGE_WIDTH_M
    assert found.at_once > 0.9
    assert all(s.until_seen_m <= s.metres for s in searches)


def test_coverage_command_prints_the_width(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "coverage", "--scenes", "Benevolence_0_int", "Ihlen_0_int"]) == 0
    assert "w_cov = " in capsys.readouterr().out
