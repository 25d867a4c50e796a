"""Decisions by simulation: a short list driven in some worlds, the best in all, and where a search begins."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from support.floor_scenes import flat

from gavel_agents.ordering.decision import (
    FINALISTS,
    FIRST_WORLDS,
    ROOMS,
    Candidate,
    ranked_orders,
    returning_search,
)  # fmt: skip
from gavel_agents.ordering.knowledge import Knowledge, Spot
from gavel_agents.ordering.simulator import Simulator, legs_of
from gavel_env.exchange import EnvAction, ReturnWhen
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.world_model.actions import Action, Primitive, parse_action


class Given(NamedTuple):
    simulator: Simulator
    known: Knowledge
    plans: list[list[Action]]


@pytest.fixture(scope="module")
def given() -> Given:
    layout = known_layout(load_scene("Rs_int"))
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    rng = np.random.default_rng(5)
    belief = {thing: rng.dirichlet(np.ones(len(rooms))) for thing in "abcd"}
    known = Knowledge(
        layout.start, np.zeros(layout.shape, np.bool_), frozenset(), {}, belief, {n: n for n in belief}, rooms, None
    )
    plans = [[parse_action(f"NAVIGATE_TO({thing})"), parse_action(f"GRASP({thing})")] for thing in belief]
    return Given(Simulator(layout), known, plans)


def driven(given: Given, orders: list[tuple[int, ...]]) -> np.ndarray:
    """Return (orders, worlds) metres."""
    things = list(given.known.belief)
    legs = legs_of(given.plans, {thing: i for i, thing in enumerate(things)}, None)
    return given.simulator.metres(given.simulator.worlds(things, given.known), legs, np.array(orders, np.int16))


@pytest.mark.parametrize("finalists", [None, 1, 7])
def test_the_best_of_the_first_worlds_are_driven_in_all_and_come_first(given: Given, finalists: int | None) -> None:
    orders = list(itertools.permutations(range(4)))
    metres = driven(given, orders)
    first = metres[:, :FIRST_WORLDS].mean(axis=1)
    count = FINALISTS if finalists is None else finalists
    found = ranked_orders(given.simulator, given.known, given.plans, orders, finalists)
    final = sorted(np.argsort(first, kind="stable")[:count].tolist(), key=lambda i: float(metres[i].mean()))
    rest = [i for i in np.argsort(first, kind="stable").tolist() if i not in final]
    assert [c.order for c in found] == [orders[i] for i in (*final, *rest)]
    assert [c.metres for c in found[:count]] == pytest.approx([metres[i].mean() for i in final])
    assert [c.metres for c in found[count:]] == pytest.approx([first[i] for i in rest])


def test_a_few_orders_are_all_driven_in_all_worlds(given: Given) -> None:
    orders = list(itertools.permutations(range(4)))[:FINALISTS]
    metres = driven(given, orders).mean(axis=1)
    found = ranked_orders(given.simulator, given.known, given.plans, orders)
    assert {c.order: c.metres for c in found} == pytest.approx(dict(zip(orders, metres, strict=True)))
    assert [c.metres for c in found] == sorted(c.metres for c in found)
    assert isinstance(found[0], Candidate)


def test_what_is_held_is_carried_from_the_start(given: Given) -> None:
    plans = [[parse_action(step) for step in plan.split()] for plan in (
        "NAVIGATE_TO(b) PLACE_ON_TOP(b)", "NAVIGATE_TO(a) GRASP(a)")]  # fmt: skip
    [free] = ranked_orders(given.simulator, given.known, plans, [(0, 1)])
    [held] = ranked_orders(given.simulator, given.known._replace(holding="a"), plans, [(0, 1)])
    assert held.metres < free.metres - 1.0  # it is where it was put, not to be looked for


def test_fewer_worlds_than_the_first_are_all_worlds(given: Given) -> None:
    orders = list(itertools.permutations(range(4)))
    small = given._replace(simulator=Simulator(given.simulator.layout, worlds=3))
    metres = driven(small, orders).mean(axis=1)
    found = ranked_orders(small.simulator, small.known, small.plans, orders)
    assert [c.metres for c in found] == pytest.approx(sorted(metres.tolist()))


def search(known: Knowledge, thing: str) -> EnvAction:
    prior = dict(zip(known.rooms, known.belief[thing].tolist(), strict=True))
    return EnvAction(Primitive.NAVIGATE_TO, thing, search_prior=prior)


def test_a_search_begins_in_the_room_of_fewest_metres_and_comes_back(given: Given) -> None:
    simulator, known, plans = given
    things = list(known.belief)
    action = search(known, "a")
    found = returning_search(simulator, known, action, plans, ["b", "c"])
    assert found.return_when == ReturnWhen(("b", "c"), room_done=True)
    worlds = simulator.worlds(things, known)
    rooms = simulator.rooms_worth(worlds, 0)[:ROOMS]
    legs = legs_of(plans, {thing: i for i, thing in enumerate(things)}, None)
    order = np.arange(4, dtype=np.int16)[None]
    metres = [float(simulator.metres(worlds, legs, order, np.array([room], np.int16)).mean()) for room in rooms]
    best = simulator.layout.room_ids[rooms[int(np.argmin(metres))]]
    assert len(set(metres)) > 1
    prior = dict(found.search_prior or {})
    assert max(prior, key=lambda room: prior[room]) == best
    assert prior.pop(best) == 1.0 + max((action.search_prior or {}).values())
    assert prior == {room: p for room, p in (action.search_prior or {}).items() if room != best}
    assert found._replace(search_prior=action.search_prior, return_when=action.return_when) == action


def test_a_search_does_not_begin_where_the_next_thing_is_if_that_is_in_the_hand(given: Given) -> None:
    index = {room: i for i, room in enumerate(given.known.rooms)}
    one_hot = np.eye(len(index))
    either = 0.5 * (one_hot[index["bedroom_0"]] + one_hot[index["entryway_0"]])
    known = given.known._replace(belief={"a": either, "b": one_hot[index["entryway_0"]]})
    plans = [[parse_action("NAVIGATE_TO(a)"), parse_action("PLACE_ON_TOP(a)")], [parse_action("NAVIGATE_TO(b)")]]

    def first_room(holding: str | None) -> str:
        here = known._replace(holding=holding)
        prior = returning_search(given.simulator, here, search(here, "a"), plans, []).search_prior or {}
        return max(prior, key=lambda room: prior[room])

    assert first_room(None) == "entryway_0"
    assert first_room("b") == "bedroom_0"


def test_a_search_with_one_room_left_goes_as_it_was_asked(given: Given) -> None:
    simulator, known, plans = given
    one = known._replace(belief={**known.belief, "a": np.eye(len(known.rooms))[1]})
    action = search(one, "a")
    assert returning_search(simulator, one, action, plans, []) == action._replace(
        return_when=ReturnWhen((), room_done=True)
    )
    bare = action._replace(search_prior=None)
    begun = returning_search(simulator, known, bare, plans, [])
    assert list((begun.search_prior or {}).values()) == [1.0]


def test_things_of_no_common_root_are_drawn_apart() -> None:
    layout = known_layout(flat())
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    alike = np.full(len(rooms), 1.0 / len(rooms))
    known = Knowledge(
        layout.start, np.zeros(layout.shape, np.bool_), frozenset(), {}, {"a": alike, "b": alike}, {}, rooms, None
    )
    simulator = Simulator(layout)
    worlds = simulator.worlds(["a", "b"], known)
    assert (worlds.places[:, 0] != worlds.places[:, 1]).any()
    assert (worlds.places[:, 0] == simulator.worlds(["a", "b"], known._replace(root={"b": "a"})).places.T).all()


def test_rooms_worth_a_search_are_those_by_probability_per_metre() -> None:
    layout = known_layout(flat())
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    belief = {"a": np.full(len(rooms), 1.0 / len(rooms))}
    known = Knowledge(layout.start, np.zeros(layout.shape, np.bool_), frozenset(), {}, belief, {}, rooms, None)
    simulator = Simulator(layout)

    def worth(known: Knowledge) -> list[str]:
        return [layout.room_ids[room] for room in simulator.rooms_worth(simulator.worlds(["a"], known), 0)]

    every = worth(known)
    assert sorted(every) == sorted(rooms)
    assert worth(known._replace(searched=frozenset(every[:1]))) == every[1:]
    least = np.array([0.0 if room == every[0] else 1.0 for room in rooms])
    assert worth(known._replace(belief={"a": least / least.sum()})) == every[1:]
    last = np.array([0.98 if room == every[-1] else 0.01 for room in rooms])
    assert worth(known._replace(belief={"a": last / last.sum()}))[0] == every[-1]
    seen = layout.rooms == layout.room_index[every[0]]
    assert worth(known._replace(seen=seen)) == every[1:]
    assert worth(known._replace(seen=layout.floor.copy())) == every  # something may be behind what was seen


def test_legs_are_drives_and_what_they_carry() -> None:
    from gavel_agents.ordering.rollout_kernels import GO, PUT_AT, PUT_HERE

    def legs(*plans: str, holding: str | None = None) -> tuple[list[list[int]], list[int]]:
        steps = [[parse_action(step) for step in plan.split()] for plan in plans]
        found = legs_of(steps, {"cup": 0, "shelf": 1}, holding)
        return found.legs.tolist(), found.starts.tolist()

    carry = "NAVIGATE_TO(cup) GRASP(cup) NAVIGATE_TO(shelf) PLACE_ON_TOP(shelf)"
    go_cup, go_shelf = [GO, 0, -1], [GO, 1, -1]
    assert legs(carry) == ([go_cup, go_shelf, [PUT_AT, 0, 1]], [0, 3])
    assert legs(carry.replace("ON_TOP", "INSIDE"))[0][-1] == [PUT_AT, 0, 1]
    assert legs(carry.replace("PLACE_ON_TOP(shelf)", "RELEASE()"))[0][-1] == [PUT_HERE, 0, -1]
    assert legs(carry.replace("PLACE_ON_TOP(shelf)", "PLACE_ON_TOP(table)"))[0][-1] == [PUT_HERE, 0, -1]
    assert legs("GRASP(shelf) PLACE_ON_TOP(cup)")[0] == [[PUT_AT, 1, 0]]
    assert legs(carry.replace("GRASP(cup)", "GRASP(box)"))[0] == [go_cup, go_shelf]
    assert legs("NAVIGATE_TO(box) OPEN(cup)") == ([], [0, 0])
    assert legs("PLACE_ON_TOP(shelf)", "RELEASE()", holding="cup") == ([[PUT_AT, 0, 1], [PUT_HERE, 0, -1]], [0, 1, 2])
    assert legs("RELEASE() RELEASE()", holding="cup")[0] == [[PUT_HERE, 0, -1]]
    assert legs() == ([], [0])


def test_a_localised_thing_has_a_choice_for_each_instance() -> None:
    layout = known_layout(flat())
    where = {"b": [Spot(1.0, 2.0, "kitchen_0"), Spot(6.0, -3.0, "study_0")]}
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    belief = {thing: np.full(len(rooms), 1.0 / len(rooms)) for thing in "ab"}
    known = Knowledge(
        layout.start, np.zeros(layout.shape, np.bool_), frozenset(rooms[:1]), where, belief, {}, rooms, None
    )
    simulator = Simulator(layout)
    worlds = simulator.worlds(["a", "b"], known)
    assert worlds.choice_starts.tolist() == [0, 0, 2]
    assert worlds.choices.tolist() == [simulator.points.nearest(layout, *spot) for spot in where["b"]]
    assert [layout.room_ids[i] for i in np.nonzero(worlds.searched)[0]] == list(rooms[:1])
    assert worlds.start == simulator.points.standing(layout, layout.start)
    columns = [layout.room_index[room] for room in rooms]
    assert worlds.weights[:, columns] == pytest.approx(np.array(list(belief.values())))
