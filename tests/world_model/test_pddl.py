"""The transition model against an independent export of it, stepped by pyperplan."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import msgspec
import numpy as np
import pytest
from pyperplan.grounding import ground
from pyperplan.pddl.parser import Parser
from pyperplan.task import Operator, Task
from support.worlds import build, kitchen, random_house_graph, restrict

from gavel_env.house.scenes import BENCHMARK_HOUSES, scene_names
from gavel_env.world_model import dynamics
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.pddl import BOOKKEEPING, PddlNameError, action_of, export_pddl, state_facts

HOUSES = BENCHMARK_HOUSES


def grounded(graph: SceneGraph, profile: Profile = Profile.PAPER) -> Task:
    domain, problem = export_pddl(graph, profile)
    parser = Parser("")
    parser.domInput, parser.probInput = domain, problem
    parsed = parser.parse_problem(parser.parse_domain(read_from_file=False), read_from_file=False)
    return ground(parsed, remove_statics_from_initial_state=False, remove_irrelevant_operators=False)


def about_world(state: frozenset[str]) -> frozenset[str]:
    return frozenset(fact for fact in state if fact.strip("()").split()[0] not in BOOKKEEPING)


def all_actions(graph: SceneGraph) -> Iterator[Action]:
    for primitive in Primitive:
        if primitive.takes_target:
            for obj in (*graph.world.nodes, *graph.world.rooms, "nothing_7"):
                yield Action(primitive, obj)
        else:
            yield Action(primitive)


def compare(graph: SceneGraph, task: Task, state: frozenset[str], profile: Profile) -> dict[Action, Operator]:
    """Assert that both models allow the same actions with the same results; return the allowed ones."""
    assert about_world(state) == state_facts(graph)
    allowed: dict[Action, Operator] = {}
    for operator in task.operators:
        if operator.applicable(state):
            action = action_of(operator.name)
            assert action not in allowed, f"two cases of {action} hold at once"
            allowed[action] = operator
    ours = {a for a in all_actions(graph) if dynamics.first_violation(graph, a, profile) is None}
    assert ours == set(allowed), sorted(str(a) for a in ours ^ set(allowed))
    for action, operator in allowed.items():
        theirs = about_world(operator.apply(state))
        assert state_facts(dynamics.apply(graph, action)) == theirs, str(action)
    return allowed


def walk(
    draw: Callable[[np.random.Generator], SceneGraph], steps: int, seed: int, profile: Profile
) -> dict[Primitive, int]:
    """Walk at random, both models side by side; return how often each primitive was taken."""
    rng = np.random.default_rng(seed)
    taken = dict.fromkeys(Primitive, 0)
    graph = draw(rng)
    task = grounded(graph, profile)
    state = frozenset(task.initial_state)
    for step in range(steps):
        if step % 100 == 99:
            graph = draw(rng)
            task = grounded(graph, profile)
            state = frozenset(task.initial_state)
        allowed = compare(graph, task, state, profile)
        by_primitive: dict[Primitive, list[Action]] = {}
        for action in sorted(allowed):
            by_primitive.setdefault(action.primitive, []).append(action)
        primitive = sorted(by_primitive)[int(rng.integers(len(by_primitive)))]
        action = by_primitive[primitive][int(rng.integers(len(by_primitive[primitive])))]
        taken[primitive] += 1
        state = frozenset(allowed[action].apply(state))
        graph = dynamics.apply(graph, action)
        if "(as-exported)" not in state:
            task = grounded(graph, profile)
            state = frozenset(task.initial_state)
    return taken


@pytest.mark.parametrize("house", HOUSES)
def test_pyperplan_agrees_on_random_steps(house: str) -> None:
    for profile in Profile:
        taken = walk(partial(random_house_graph, house), steps=75, seed=HOUSES.index(house), profile=profile)
        assert sum(taken.values()) == 75


@pytest.mark.slow
@pytest.mark.parametrize("house", HOUSES)
def test_pyperplan_agrees_on_two_thousand_random_steps_per_house(house: str) -> None:
    totals = dict.fromkeys(Primitive, 0)
    for profile in Profile:
        for primitive, count in walk(
            partial(random_house_graph, house), 1_050, 1_000 + HOUSES.index(house), profile
        ).items():
            totals[primitive] += count
    assert sum(totals.values()) >= 2_000
    assert all(totals.values()), totals


def test_pyperplan_agrees_about_appliances_that_no_house_has() -> None:
    """A freezer without a door, a cooler that does not freeze, lidded things in appliances."""

    def draw(rng: np.random.Generator) -> SceneGraph:
        moved = {"freezer_0": "floor kitchen_0", "cooler_0": "floor kitchen_0", "textbook_0": "in bowl_0"}
        for obj in ("apple_0", "steak_0", "backpack_0"):
            moved[obj] = str(rng.choice(["in freezer_0", "in backpack_0", "on stove_0", "in cooler_0", "in fridge_0"]))
        if moved["backpack_0"] == "in backpack_0":
            moved["backpack_0"] = "on freezer_0"
        return kitchen(moved, flags={"open": ["backpack_0", "fridge_0"][: int(rng.integers(3))]})

    assert walk(draw, 150, 7, Profile.PAPER)[Primitive.PLACE_INSIDE] > 0


FILLED = {
    "dirty things in a dishwasher, one in another": {"bowl_0": "in dishwasher_0", "apple_0": "in bowl_0"},
    "a lidded thing in a washer": {"backpack_0": "in washer_0"},
    "food in a bowl in a running microwave": {"bowl_0": "in microwave_0", "apple_0": "in bowl_0"},
    "a bag of food in an open fridge": {"backpack_0": "in fridge_0", "apple_0": "in backpack_0"},
    "a lidded thing for a freezer without a door": {
        "freezer_0": "floor kitchen_0", "steak_0": "in freezer_0", "apple_0": "in backpack_0", "backpack_0": "held",
    },
    "a bowl of food in the hand": {"bowl_0": "held", "apple_0": "in bowl_0"},
}  # fmt: skip
"""Where appliances act on what is in something in them, so that a fact is written of each."""


@pytest.mark.parametrize("moved", FILLED.values(), ids=list(FILLED))
@pytest.mark.parametrize("opened", [(), ("fridge_0", "dishwasher_0"), ("backpack_0", "fridge_0", "washer_0")])
def test_pyperplan_agrees_about_what_is_in_appliances(moved: dict[str, str], opened: tuple[str, ...]) -> None:
    flags = {"open": opened, "toggled": ("microwave_0", "stove_0"), "dirty": ("bowl_0", "apple_0", "textbook_0")}
    graph = restrict(kitchen(moved, flags=flags), {*moved, "textbook_0", "fridge_0", "microwave_0", "dishwasher_0"})
    for profile in Profile:
        task = grounded(graph, profile)
        assert compare(graph, task, frozenset(task.initial_state), profile)


def test_pyperplan_agrees_on_a_whole_house() -> None:
    """One export of every object of a house with its own contents, not a random part of it."""
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import scene_graph

    graph = scene_graph(load_scene("Rs_int"))
    task = grounded(graph)
    assert compare(graph, task, frozenset(task.initial_state), Profile.PAPER)


def test_houses_are_shipped() -> None:
    assert set(HOUSES) <= set(scene_names())


def test_operators_name_their_action() -> None:
    actions = {action_of(op.name) for op in grounded(kitchen()).operators}
    assert Action(Primitive.TOGGLE_ON, "dishwasher_0") in actions
    assert Action(Primitive.TOGGLE_ON, "fridge_0") not in actions


def test_export_expires_when_the_structure_changes() -> None:
    task = grounded(kitchen())
    state = frozenset(task.initial_state)
    grasp = next(op for op in task.operators if action_of(op.name) == Action(Primitive.GRASP, "apple_0"))
    assert not [op for op in task.operators if op.applicable(grasp.apply(state))]


def test_omnigibson_profile_needs_an_empty_hand_at_doors() -> None:
    holding = kitchen({"apple_0": "held"})
    opening = Action(Primitive.OPEN, "fridge_0")

    def allowed(profile: Profile) -> set[Action]:
        task = grounded(holding, profile)
        return {action_of(op.name) for op in task.operators if op.applicable(task.initial_state)}

    assert opening in allowed(Profile.PAPER)
    assert opening not in allowed(Profile.OMNIGIBSON)


def test_names_that_pddl_cannot_write_are_refused() -> None:
    graph = kitchen()
    room = graph.world.rooms["kitchen_0"]
    bad = {**graph.world.rooms, "Große Küche": room}

    broken = msgspec.structs.replace(graph, world=msgspec.structs.replace(graph.world, rooms=bad))
    with pytest.raises(PddlNameError, match="Große Küche"):
        export_pddl(broken)


@pytest.mark.parametrize("name", ["kitchen--0", "salt-and-pepper", "nowhere", "start"])
def test_names_that_the_export_uses_itself_are_refused(name: str) -> None:
    assert export_pddl(build({"apple_0": "floor kitchen-0"}))
    with pytest.raises(PddlNameError, match=f"'{name}' is not a PDDL name"):
        export_pddl(build({"apple_0": f"floor {name}"}))
