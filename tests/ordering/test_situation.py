"""A situation compares orders by J, or drives them in simulated worlds where it has a simulator and what it needs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gavel_agents.ordering.cost import TravelModel
from gavel_agents.ordering.decision import SHORTLIST, ranked_orders
from gavel_agents.ordering.knowledge import Knowledge
from gavel_agents.ordering.order import best_by_first_task
from gavel_agents.ordering.simulator import Simulator, legs_of
from gavel_agents.ordering.situation import Situation
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.world_model.actions import parse_action


@pytest.fixture(scope="module")
def by_j() -> Situation:
    travel = TravelModel(known_layout(load_scene("Rs_int")))
    rng = np.random.default_rng(5)
    beliefs = {thing: rng.dirichlet(np.ones(len(travel.rooms))) for thing in "abcde"}
    plans = [[parse_action(f"NAVIGATE_TO({thing})"), parse_action(f"GRASP({thing})")] for thing in beliefs]
    return Situation(plans, travel, travel.at(travel.layout.start), beliefs, {})


@pytest.fixture(scope="module")
def simulated(by_j: Situation) -> Situation:
    layout = by_j.travel.layout
    nothing = np.zeros(layout.shape, np.bool_)
    rooms = by_j.travel.rooms
    known = Knowledge(layout.start, nothing, frozenset(), {}, by_j.beliefs, {n: n for n in by_j.beliefs}, rooms, None)
    return by_j._replace(simulator=Simulator(layout), known=known)


def test_without_a_simulator_orders_come_by_j(by_j: Situation, simulated: Situation) -> None:
    costs = by_j.pairwise()
    found = list(by_j.candidates())
    assert {c.order for c in found} == set(itertools.permutations(range(5)))
    assert [c.metres for c in found] == pytest.approx(sorted(costs.ordering_cost(c.order) for c in found))
    assert by_j.expected_m([c.order for c in found]) == [c.metres for c in found]
    for without in (simulated._replace(known=None), simulated._replace(simulator=None)):
        assert list(itertools.islice(without.candidates(), 3)) == found[:3]
        assert without.expected_m([found[0].order]) == [found[0].metres]


def test_with_a_simulator_the_short_list_by_j_is_driven(simulated: Situation) -> None:
    assert simulated.simulator is not None
    assert simulated.known is not None
    listed = best_by_first_task(simulated.pairwise(), SHORTLIST)
    found = list(simulated.candidates())
    assert found == ranked_orders(simulated.simulator, simulated.known, simulated.plans, listed)
    assert len(found) == len(listed) < 120
    assert found != list(itertools.islice(simulated._replace(simulator=None).candidates(), len(found)))


def test_expected_metres_are_means_over_all_worlds_in_the_order_asked(simulated: Situation) -> None:
    simulator, known = simulated.simulator, simulated.known
    assert simulator is not None
    assert known is not None
    orders = list(itertools.permutations(range(5)))[::17]
    things = list(known.belief)
    legs = legs_of(simulated.plans, {thing: i for i, thing in enumerate(things)}, None)
    metres = simulator.metres(simulator.worlds(things, known), legs, np.array(orders, np.int16)).mean(axis=1)
    assert len(set(metres)) == len(orders)
    assert simulated.expected_m(orders) == pytest.approx(metres.tolist())
