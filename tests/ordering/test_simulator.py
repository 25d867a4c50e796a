"""Simulated worlds: the compiled rollout against a plain one, the executor, and enumeration; what must not matter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray
from support.floor_scenes import flat
from support.houses import unwrapped

import gavel_agents
from gavel_agents.ordering.decision import ranked_orders
from gavel_agents.ordering.knowledge import Knowledge, Spot, knowledge
from gavel_agents.ordering.simulator import Simulator, Worlds, legs_of
from gavel_agents.pipeline import PlanningAgent
from gavel_env.house.floor_map import FloorMap, known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.house.sight_points import SightPoints
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.world_model.actions import Action, parse_action

SEARCHED_SHARE, EVERY_M = 0.95, 1.0


def plan(*steps: str) -> list[Action]:
    return [parse_action(step) for step in steps]


def known_in(layout: FloorMap, belief: Mapping[str, Mapping[str, float]], **more: Any) -> Knowledge:
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    vectors = {node: np.array([of.get(r, 0.0) for r in rooms]) for node, of in belief.items()}
    plain = Knowledge(
        layout.start, np.zeros(layout.shape, np.bool_), frozenset(), {}, vectors, {n: n for n in belief}, rooms, None
    )
    return plain._replace(**more)


class PlainRollout:
    """The same robot written with sets, as the docstrings of the kernels tell it."""

    def __init__(self, points: SightPoints, seen: set[int]) -> None:
        self.points = points
        self.seen = set(seen)
        self.metres = 0.0

    def members(self, words: NDArray[np.uint64]) -> set[int]:
        return {64 * k + bit for k, word in enumerate(words.tolist()) for bit in range(64) if word >> bit & 1}

    def shown(self, place: int) -> bool:
        return bool(self.members(self.points.reveals[place]) & self.seen)

    def drive(self, here: int, goal: int, aim: int | None, place: int | None) -> int:
        at, since = here, 0.0
        while at != goal:
            onward = int(self.points.onward[at, goal])
            since += float(self.points.metres[at, onward])
            heading, at = int(self.points.heading[at, onward]), onward
            if since >= EVERY_M - 1e-6:
                since = 0.0
                self.seen |= self.members(self.points.ahead[at, heading])
                if aim in self.seen or (place is not None and self.shown(place)):
                    break
        self.metres += float(self.points.metres[here, at])
        return at

    def search(self, here: int, room: int, place: int) -> int:
        floor = self.members(self.points.floor[room])
        if not floor & self.seen:
            here = self.drive(here, int(self.points.entry[here, room]), None, place)
            if not self.shown(place):
                self.seen |= self.members(self.points.around[here])
        while not self.shown(place):
            unseen = sorted(floor - self.seen)
            if len(unseen) <= (1 - SEARCHED_SHARE) * len(floor) and all(map(self.shown, unseen)):
                break
            if not unseen:
                break
            aim = min(unseen, key=lambda p: (self.points.metres[here, p], p))
            here = self.drive(here, self.nearest(here, self.points.close[aim], aim), aim, place)
            if not self.shown(place):
                self.seen |= self.members(self.points.around[here]) | {aim}
        return here

    def go(self, here: int, place: int, weights: Sequence[float], searched: set[int]) -> int:
        while not self.shown(place):
            left = [
                (-w, float(self.points.metres[here, self.points.entry[here, r]]), r)
                for r, w in enumerate(weights)
                if w > 0 and r not in searched and self.points.entry[here, r] >= 0
            ]
            if not left:
                break
            room = min(left)[2]
            here = self.search(here, room, place)
            if not self.shown(place):
                searched.add(room)
        return self.reach(here, place)

    def reach(self, here: int, place: int) -> int:
        here = self.drive(here, self.nearest(here, self.points.reach[place], place), None, None)
        self.seen |= self.members(self.points.around[here])
        return here

    def nearest(self, here: int, words: NDArray[np.uint64], place: int) -> int:
        stand = int(self.points.stand[place])
        return min(sorted(self.members(words)), key=lambda p: self.points.metres[here, p], default=stand)


@pytest.mark.parametrize("name", ["flat", "Rs_int"])
def test_the_compiled_rollout_drives_as_a_plain_one(name: str) -> None:
    layout = known_layout(flat() if name == "flat" else load_scene(name))
    simulator = Simulator(layout, seed=3, worlds=25)
    rooms = [r for r in layout.room_ids if layout.room_points[r] is not None]
    rng = np.random.default_rng(4)
    belief = {node: dict(zip(rooms, rng.dirichlet(np.ones(len(rooms))), strict=True)) for node in "abc"}
    known = known_in(layout, belief, searched=frozenset(rooms[:1]))
    things = list(known.belief)
    worlds = simulator.worlds(things, known)
    plans = [plan("NAVIGATE_TO(a)", "NAVIGATE_TO(b)"), plan("NAVIGATE_TO(c)"), plan("NAVIGATE_TO(b)")]
    legs = legs_of(plans, {t: i for i, t in enumerate(things)}, None)
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        metres = simulator.metres(worlds, legs, np.array([order], np.int16))[0]
        for world, places in enumerate(worlds.places):
            robot = PlainRollout(simulator.points, set())
            here, found = worlds.start, set()
            searched = {layout.room_index[rooms[0]]}
            for step in (step for task in order for step in plans[task]):
                thing = things.index(step.target or "")
                if thing in found:
                    here = robot.reach(here, int(places[thing]))
                else:
                    here = robot.go(here, int(places[thing]), worlds.weights[thing].tolist(), searched)
                found.add(thing)
            assert metres[world] == pytest.approx(robot.metres, abs=1e-3)


def test_the_mean_over_worlds_is_the_expectation_over_all_places() -> None:
    layout = known_layout(flat())
    known = known_in(layout, {"a": {"kitchen_0": 0.5, "study_0": 0.3, "living_room_0": 0.2}})
    simulator = Simulator(layout, seed=1, worlds=4096)
    legs = legs_of([plan("NAVIGATE_TO(a)")], {"a": 0}, None)
    order = np.zeros((1, 1), np.int16)
    worlds = simulator.worlds(["a"], known)
    every = np.arange(len(simulator.points.cells), dtype=np.int16)[:, None]
    metres = simulator.metres(worlds._replace(places=every), legs, order)[0]
    room = simulator.points.room
    chance = worlds.weights[0][room] / np.bincount(room, minlength=len(layout.room_ids))[room]
    exact = float(metres @ chance) / float(chance.sum())
    assert chance.sum() == pytest.approx(1.0)
    assert simulator.metres(worlds, legs, order).mean() == pytest.approx(exact, rel=0.01)
    few = [Simulator(layout, seed=s).metres(Simulator(layout, seed=s).worlds(["a"], known), legs, order).mean()
           for s in range(30)]  # fmt: skip
    assert np.mean(few) == pytest.approx(exact, rel=0.03)


def test_floor_that_was_seen_hides_nothing() -> None:
    layout = known_layout(flat())
    kitchen = layout.rooms == layout.room_index["kitchen_0"]
    half = kitchen & (np.arange(layout.shape[0])[:, None] < layout.shape[0] // 2)
    belief = {"a": {"kitchen_0": 0.5, "study_0": 0.5}}
    simulator = Simulator(layout, worlds=400)
    places = simulator.worlds(["a"], known_in(layout, belief, seen=half)).places[:, 0]
    cells = simulator.points.cells[places]
    assert not half.ravel()[cells].any()
    share = float((simulator.points.room[places] == layout.room_index["kitchen_0"]).mean())
    unseen = 1.0 - half.sum() / kitchen.sum()
    assert 0.3 < share < 0.5
    assert share == pytest.approx(unseen / (1.0 + unseen), abs=0.12)
    all_seen = simulator.worlds(["a"], known_in(layout, belief, seen=layout.floor.copy()))
    legs = legs_of([plan("NAVIGATE_TO(a)")], {"a": 0}, None)
    assert (simulator.metres(all_seen, legs, np.zeros((1, 1), np.int16)) < 15.0).all()  # driven to, not searched for


def test_a_localised_thing_is_the_instance_nearest_when_it_is_gone_to() -> None:
    layout = known_layout(flat())
    kitchen, study = (1.0, 2.0, "kitchen_0"), (6.0, -3.0, "study_0")
    where = {"table": [Spot(*kitchen), Spot(*study)], "lamp": [Spot(7.0, -3.5, "study_0")]}
    belief = {"table": {"kitchen_0": 1.0}, "lamp": {"study_0": 1.0}}
    known = known_in(layout, belief, where=where)
    simulator = Simulator(layout)
    legs = legs_of([plan("NAVIGATE_TO(lamp)", "NAVIGATE_TO(table)")], {"table": 0, "lamp": 1}, None)
    one = np.zeros((1, 1), np.int16)
    both = simulator.metres(simulator.worlds(["table", "lamp"], known), legs, one)
    alone = known._replace(where={**where, "table": [Spot(*study)]})
    assert both == pytest.approx(simulator.metres(simulator.worlds(["table", "lamp"], alone), legs, one))
    far = known._replace(where={**where, "table": [Spot(*kitchen)]})
    assert both.mean() < simulator.metres(simulator.worlds(["table", "lamp"], far), legs, one).mean()


def test_what_is_carried_is_where_it_was_put() -> None:
    layout = known_layout(flat())
    where = {"cup": [Spot(1.0, 1.0, "kitchen_0")], "shelf": [Spot(12.5, 2.5, "living_room_0")]}
    known = known_in(layout, {n: {"kitchen_0": 1.0} for n in where}, where=where)
    simulator = Simulator(layout)
    index = {"cup": 0, "shelf": 1}
    worlds = simulator.worlds(list(where), known)
    one = np.zeros((1, 1), np.int16)

    def metres(*steps: str) -> float:
        return float(simulator.metres(worlds, legs_of([plan(*steps)], index, None), one).mean())

    there = metres("NAVIGATE_TO(cup)", "GRASP(cup)", "NAVIGATE_TO(shelf)", "PLACE_ON_TOP(shelf)")
    again = metres("NAVIGATE_TO(cup)", "GRASP(cup)", "NAVIGATE_TO(shelf)", "PLACE_ON_TOP(shelf)", "NAVIGATE_TO(cup)")
    assert again == pytest.approx(there)
    left = metres("NAVIGATE_TO(cup)", "NAVIGATE_TO(shelf)", "NAVIGATE_TO(cup)")
    assert left > there + 5.0
    dropped = metres("NAVIGATE_TO(cup)", "GRASP(cup)", "NAVIGATE_TO(shelf)", "RELEASE()", "NAVIGATE_TO(cup)")
    assert dropped == pytest.approx(there)


@pytest.fixture(scope="module")
def start() -> tuple[Simulator, Knowledge, list[list[Action]]]:
    layout = known_layout(load_scene("Rs_int"))
    rooms = [r for r in layout.room_ids if layout.room_points[r] is not None]
    rng = np.random.default_rng(7)
    belief = {n: dict(zip(rooms, rng.dirichlet(np.ones(len(rooms))), strict=True)) for n in "abcdefgh"}
    plans = [plan(f"NAVIGATE_TO({a})", f"GRASP({a})", f"NAVIGATE_TO({b})", f"PLACE_ON_TOP({b})") for a, b in
             ("ab", "cd", "ef", "gh")]  # fmt: skip
    return Simulator(layout), known_in(layout, belief), plans


def test_names_scales_and_company_do_not_matter(start: tuple[Simulator, Knowledge, list[list[Action]]]) -> None:
    simulator, known, plans = start
    orders = [(0, 1, 2, 3), (3, 2, 1, 0), (1, 0, 3, 2)]
    plain = ranked_orders(simulator, known, plans, orders)
    scaled = known._replace(belief={n: 0.25 * v for n, v in known.belief.items()})
    assert ranked_orders(simulator, scaled, plans, orders) == plain
    more = known._replace(belief={**known.belief, "z": known.belief["a"]}, root={**known.root, "z": "z"})
    assert ranked_orders(simulator, more, plans, orders) == plain
    for candidate in plain:
        assert ranked_orders(simulator, known, plans, [candidate.order]) == [candidate]
    renamed = [plans[i] for i in (2, 0, 1, 3)]
    other = ranked_orders(simulator, known, renamed, [(1, 2, 0, 3)])
    assert other[0].metres == pytest.approx(next(c.metres for c in plain if c.order == (0, 1, 2, 3)))


def test_things_in_one_place_are_found_together(start: tuple[Simulator, Knowledge, list[list[Action]]]) -> None:
    simulator, known, _ = start
    together = known._replace(root={**known.root, "b": "a"}, belief={**known.belief, "b": known.belief["a"]})
    worlds = simulator.worlds(list("ab"), together)
    assert (worlds.places[:, 0] == worlds.places[:, 1]).all()
    apart = simulator.worlds(list("ab"), known)
    assert (apart.places[:, 0] != apart.places[:, 1]).any()


def test_more_tasks_take_more_metres_and_fewer_worlds_the_same_ones(
    start: tuple[Simulator, Knowledge, list[list[Action]]],
) -> None:
    simulator, known, plans = start
    worlds = simulator.worlds(list(known.belief), known)
    legs = legs_of(plans, {t: i for i, t in enumerate(known.belief)}, None)
    rows = np.array([[0, -1, -1, -1], [0, 1, -1, -1], [0, 1, 2, -1], [0, 1, 2, 3]], np.int16)
    metres = simulator.metres(worlds, legs, rows)
    assert (np.diff(metres, axis=0) >= -1e-9).all()
    assert (simulator.metres(worlds, legs, rows, span=(10, 20)) == metres[:, 10:20]).all()


def test_with_the_world_given_it_drives_what_the_executor_drives() -> None:
    """R² >= .85 and |bias| <= 5 % against the metres of gavel-static on a sample of the multi-task instructions."""
    instructions = read_instructions(shipped("multi"))
    env = gym.make("Gavel-MultiTask-v0", terminate_on_success=False, observation="symbolic", max_episode_steps=400)
    agent = gavel_agents.make("gavel-static", understanding="reference", planner="reference:multi")
    assert isinstance(agent, PlanningAgent)
    simulated, driven = [], []
    for name in list(instructions)[::4]:
        observation, info = env.reset(seed=0, options={"instruction": instructions[name]})
        agent.reset(observation, info)
        order = list(agent._order)
        first = info["observed"]
        known = knowledge(agent._graph, agent._belief, agent._binder, first)
        executor = unwrapped(env).privileged_state().executor
        places, start = executor.places, unwrapped(env).privileged_state().graph
        spots = dict(places.spots)
        while (action := agent.act(observation, info)) is not None:
            observation, _, _, _, info = env.step(action)
        assert info["outcome"] == "ok"
        places.spots = spots
        things = list(known.belief)
        simulator = Simulator(first.layout)
        worlds = simulator.worlds(things, known)
        true, choices = worlds.places[:1].copy(), worlds.choices.copy()
        for i, thing in enumerate(things):
            if instance := agent._binder.bound.get(thing):
                x, y = places.position(start, instance, first.cell)
                true[0, i] = simulator.points.nearest(first.layout, x, y, start.room_of(instance))
                choices[worlds.choice_starts[i] : worlds.choice_starts[i + 1]] = true[0, i]
        plans = [agent._planned.plans[i] for i in order]
        legs = legs_of(plans, {t: i for i, t in enumerate(things)}, None)
        rows = np.arange(len(plans), dtype=np.int16)[None]
        given: Worlds = worlds._replace(places=true, choices=choices)
        simulated.append(float(simulator.metres(given, legs, rows)[0, 0]))
        driven.append(float(info["metres"]))
    env.close()
    assert np.corrcoef(simulated, driven)[0, 1] ** 2 >= 0.85
    assert abs(np.mean(simulated) / np.mean(driven) - 1.0) <= 0.05
