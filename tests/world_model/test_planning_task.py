"""The lifted PDDL domain against the transition model, stepped by unified-planning's simulator."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from support.worlds import build, kitchen, random_house_graph

from gavel_env.errors import NotExpressible
from gavel_env.world_model import dynamics
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, parse_goal, unmet
from gavel_env.world_model.graph import Node, SceneGraph
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.planning_task import (
    Expression,
    PlanningTask,
    household_domain,
    planning_task,
    state_of,
)


def all_actions(graph: SceneGraph) -> Iterator[Action]:
    for primitive in Primitive:
        if primitive.takes_target:
            yield from (Action(primitive, obj) for obj in graph.world.nodes)
        else:
            yield Action(primitive)


class Simulated:
    """The exported task in unified-planning's simulator."""

    def __init__(self, graph: SceneGraph, profile: Profile) -> None:
        shortcuts = pytest.importorskip("unified_planning.shortcuts")
        from gavel_agents.classical.engine import up_problem

        self.impossible = pytest.importorskip("unified_planning.exceptions").UPInvalidActionError
        task = planning_task(graph, Goal(), profile)
        self.ids = {**task.things, **task.rooms}
        self.written = {identifier: name for name, identifier in self.ids.items()}
        self.problem = up_problem(task)
        self.simulator = shortcuts.SequentialSimulator(self.problem)
        self.state = self.simulator.get_initial_state()

    def step(self, graph: SceneGraph, action: Action) -> Any:
        """Return the state after an action, or None if it is not allowed."""
        name = action.primitive.name.lower().replace("_", "-")
        parameters = [action.target] if action.target else []
        if action.primitive in (Primitive.RELEASE, Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE):
            if graph.holding is None:
                return None
            parameters = [graph.holding, *parameters]
        objects = [self.problem.object(self.written[p]) for p in parameters]
        try:
            return self.simulator.apply(self.state, self.problem.action(name), objects)
        except self.impossible:  # what a thing is rules the action out, whatever the state
            return None

    def facts(self, state: Any) -> set[tuple[str, ...]]:
        """Return what holds in a state, of what can change."""
        found = set()
        for fluent in self.problem.initial_values:
            if state.get_value(fluent).bool_constant_value():
                found.add((fluent.fluent().name, *(self.ids[str(a)] for a in fluent.args)))
        return {fact for fact in found if fact[0] in CHANGING}


CHANGING = {
    *("hand-empty", "holding", "robot-in", "lies", "on-floor", "on-top", "inside", "aboard", "rides", "carried"),
    *("in-room", "near", "shut", "next-to", "opened", "toggled", "cooked", "washed", "dried", "hot", "frozen", "dirty"),
}


@pytest.mark.parametrize(
    ("house", "profile"), [("Beechwood_0_int", Profile.PAPER), ("Wainscott_0_int", Profile.OMNIGIBSON)]
)
def test_the_domain_allows_and_changes_what_the_transition_model_does(house: str, profile: Profile) -> None:
    """Random walks; going to what is in the hand is left out of the domain, since it changes nothing."""
    rng = np.random.default_rng(3)
    taken = 0
    for _ in range(3):
        graph = random_house_graph(house, rng, pieces=4, movables=4)
        there = Simulated(graph, profile)
        for _ in range(12):
            assert there.facts(there.state) == set(state_of(graph, list(graph.world.nodes)))
            allowed = {}
            for action in all_actions(graph):
                after = there.step(graph, action)
                ours = dynamics.first_violation(graph, action, profile) is None
                if action.primitive is Primitive.NAVIGATE_TO and _carried(graph, action.target):
                    continue
                assert (after is not None) == ours, str(action)
                if ours:
                    allowed[action] = after
            actions = sorted(allowed)
            action = actions[int(rng.integers(len(actions)))]
            graph, there.state = dynamics.apply(graph, action), allowed[action]
            taken += 1
    assert taken == 36


def _carried(graph: SceneGraph, target: str | None) -> bool:
    held = graph.holding
    return held is not None and (target == held or target in graph.descendants(held))


# --- goals ---------------------------------------------------------------------------------------------------------


def holds(task: PlanningTask, expression: str | Expression, variables: Mapping[str, str] | None = None) -> bool:
    """Return whether a condition holds in a task's initial state."""
    assert not isinstance(expression, str)
    head, *rest = expression
    bound = dict(variables or {})
    if head == "exists":
        return any(holds(task, rest[1], bound | {str(rest[0]): thing}) for thing in task.things)
    if head == "and":
        return all(holds(task, part, bound) for part in rest)
    if head == "or":
        return any(holds(task, part, bound) for part in rest)
    if head == "not":
        return not holds(task, rest[0], bound)
    return (head, *(bound.get(str(a), a) for a in rest)) in set(task.init)


CONDITIONS = [
    "(forall (?x apple_0 steak_0) (exists (?y countertop_0 fridge_0) (or (inside ?x ?y) (on_top ?x ?y))))",
    "(forn (1) (?x apple_0 bowl_0 backpack_0) (on_top ?x breakfast_table_0))",
    "(forn (2) (?x apple_0 bowl_0 backpack_0) (on_top ?x breakfast_table_0))",
    "(forpairs (?x apple_0 bowl_0) (?y countertop_0 breakfast_table_0) (on_top ?x ?y))",
    "(forpairs (?x apple_0 textbook_0) (?y countertop_0 breakfast_table_0) (on_top ?x ?y))",
    "(imply (open fridge_0) (cooked steak_0))",
    "(imply (not (open fridge_0)) (cooked steak_0))",
    "(within textbook_0 backpack_0)",
    "(within apple_0 fridge_0)",
    "(next_to bowl_0 backpack_0)",
    "(next_to apple_0 bowl_0)",
    "(under bowl_0 breakfast_table_0)",
    "(under textbook_0 breakfast_table_0)",
    "(under bookcase_0 breakfast_table_0)",
    "(under bookcase_0 oven_0)",
    "(in_room textbook_0 kitchen)",
    "(in_room textbook_0 living_room)",
    "(on_floor fridge_0 kitchen_0)",
    "(not (exists (?x apple_0 bowl_0) (inside ?x fridge_0)))",
    "(and (inside steak_0 fridge_0) (open oven_0))",
    "(or (open oven_0) (and (not (open fridge_0)) (inside steak_0 fridge_0)))",
    "(or (open oven_0) (and (open fridge_0) (inside steak_0 fridge_0)))",
    "(imply (and (inside steak_0 fridge_0) (open oven_0)) (open fridge_0))",
    "(forall (?x steak_0 apple_0) (or (inside ?x fridge_0) (and (on_top ?x countertop_0) (not (cooked ?x)))))",
]


@pytest.mark.parametrize("text", CONDITIONS)
def test_conditions_mean_in_pddl_what_they_mean_here(text: str) -> None:
    beside = [("bookcase_0", "breakfast_table_0"), ("bookcase_0", "oven_0"), ("breakfast_table_0", "textbook_0")]
    graph = kitchen(next_to=beside)
    goal = Goal((), (parse_formula(text),))
    task = planning_task(graph, goal)
    assert holds(task, task.goal) == (not unmet(goal, graph))


def test_literals_of_one_subject_speak_of_one_thing() -> None:
    graph = kitchen({"apple_1": "on breakfast_table_0"}, flags={"cooked": ["apple_0"]})
    both = parse_goal(["cooked(apple)", "on_top(apple, breakfast_table)"])
    task = planning_task(graph, both)
    assert unmet(both, graph)
    assert not holds(task, task.goal)
    one = parse_goal(["cooked(apple)", "on_top(apple, countertop)"])
    assert holds(task, planning_task(graph, one).goal)


def test_what_the_plan_opens_must_be_shut_unless_it_is_asked_for() -> None:
    graph = kitchen(flags={"open": ["oven_0"]})
    left_open = ("not", ("opened", "fridge_0"))
    assert left_open in planning_task(graph, parse_goal(["inside(apple, fridge)"])).goal
    assert left_open not in planning_task(graph, parse_goal(["open(fridge)"])).goal
    assert ("not", ("opened", "oven_0")) not in planning_task(graph, parse_goal(["inside(apple, fridge)"])).goal


def test_names_that_pddl_cannot_write_are_replaced_and_found_again() -> None:
    graph = random_house_graph("Rs_int", np.random.default_rng(0), pieces=2, movables=1)
    name = next(iter(graph.world.nodes))
    node = graph.world.nodes[name]._replace(id="fridge@kitchen")
    task = planning_task(graph.with_nodes({"fridge@kitchen": node, "fridge-kitchen": node}), Goal())
    assert {"fridge@kitchen", "fridge-kitchen"} <= set(task.things.values())
    assert "@" not in task.problem
    [written] = [w for w, identifier in task.things.items() if identifier == "fridge@kitchen"]
    assert task.action("place-on-top", ["x", written]) == Action(Primitive.PLACE_ON_TOP, "fridge@kitchen")


KINDS = {
    "fridge_0": {"fixed", "surface", "interior", "floor-mounted", "door", "freezes", "heatable", "freezable"},
    "cooler_0": {"fixed", "surface", "interior", "floor-mounted", "door", "heatable", "freezable"},
    "oven_0": {
        *("fixed", "surface", "interior", "floor-mounted", "door", "switch", "heats", "heats-when-shut"),
        *("heatable", "freezable"),
    },
    "dishwasher_0": {
        *("fixed", "surface", "interior", "floor-mounted", "door", "switch", "needs-shut", "washes"),
        *("heatable", "freezable"),
    },
    "clothes_dryer_0": {
        *("fixed", "surface", "interior", "floor-mounted", "door", "switch", "needs-shut", "dries"),
        *("heatable", "freezable"),
    },
    "stove_0": {"fixed", "surface", "floor-mounted", "switch", "heats", "heats-on-top"},
    "furniture_sink_0": {
        *("fixed", "surface", "interior", "floor-mounted", "switch", "clearance", "rinses", "heatable", "freezable"),
    },
    "breakfast_table_0": {"fixed", "surface", "floor-mounted", "clearance"},
    "backpack_0": {"loose", "surface", "interior", "floor-mounted", "door", "wipes", "heatable", "freezable"},
    "apple_0": {"loose", "floor-mounted", "cookable", "heatable", "freezable"},
}


@pytest.mark.parametrize("profile", Profile)
def test_what_never_changes_is_what_categories_afford(profile: Profile) -> None:
    moved = dict.fromkeys(KINDS, "floor kitchen_0")
    facts = {fact for fact in planning_task(kitchen(moved), Goal(), profile).init if fact[0] not in CHANGING}
    for name, kinds in KINDS.items():
        assert {head for head, *about in facts if about == [name]} == kinds, name
    assert (("full-hand-may-operate",) in facts) == (profile is Profile.PAPER)


def test_a_state_is_written_with_all_that_follows_from_who_holds_whom() -> None:
    graph = build(
        {
            "fridge_0": "floor kitchen_0", "backpack_0": "in fridge_0", "textbook_0": "in backpack_0",
            "bowl_0": "held", "apple_0": "on bowl_0", "armchair_0": "floor hall_0",
        },
        near=("fridge_0",), robot_room="kitchen_0", flags={"open": ["backpack_0"], "dirty": ["bowl_0"]},
        next_to=[("armchair_0", "fridge_0"), ("fridge_0", "oven_0")],
    ).with_nodes({"mug_0": Node("mug_0", default_ontology()["mug"], False)})  # fmt: skip
    everything = list(graph.world.nodes)
    assert set(state_of(graph, everything)) == {
        ("holding", "bowl_0"), ("robot-in", "kitchen_0"), ("near", "fridge_0"),
        *((relation, o, o) for o in everything for relation in ("aboard", "rides")),
        ("lies", "fridge_0"), ("on-floor", "fridge_0", "kitchen_0"), ("in-room", "fridge_0", "kitchen_0"),
        ("shut", "fridge_0"), ("next-to", "armchair_0", "fridge_0"), ("next-to", "fridge_0", "armchair_0"),
        ("lies", "armchair_0"), ("on-floor", "armchair_0", "hall_0"), ("in-room", "armchair_0", "hall_0"),
        ("inside", "backpack_0", "fridge_0"), ("rides", "backpack_0", "fridge_0"), ("aboard", "backpack_0", "fridge_0"),
        ("in-room", "backpack_0", "kitchen_0"), ("opened", "backpack_0"),
        ("inside", "textbook_0", "backpack_0"), ("rides", "textbook_0", "backpack_0"),
        ("rides", "textbook_0", "fridge_0"), ("aboard", "textbook_0", "backpack_0"),
        ("aboard", "textbook_0", "fridge_0"), ("in-room", "textbook_0", "kitchen_0"),
        ("carried", "bowl_0"), ("dirty", "bowl_0"),
        ("on-top", "apple_0", "bowl_0"), ("rides", "apple_0", "bowl_0"), ("aboard", "apple_0", "bowl_0"),
        ("carried", "apple_0"), ("lies", "mug_0"),
    }  # fmt: skip
    few = set(state_of(graph, ["textbook_0", "fridge_0"]))
    assert few == {
        ("holding", "bowl_0"), ("robot-in", "kitchen_0"), ("near", "fridge_0"), ("shut", "fridge_0"),
        ("lies", "fridge_0"), ("on-floor", "fridge_0", "kitchen_0"), ("in-room", "fridge_0", "kitchen_0"),
        ("aboard", "fridge_0", "fridge_0"), ("rides", "fridge_0", "fridge_0"),
        ("aboard", "textbook_0", "textbook_0"), ("rides", "textbook_0", "textbook_0"),
        ("rides", "textbook_0", "fridge_0"), ("aboard", "textbook_0", "fridge_0"),
        ("in-room", "textbook_0", "kitchen_0"),
    }  # fmt: skip


def test_a_condition_of_an_unknown_kind_is_named() -> None:
    class Odd:
        def __str__(self) -> str:
            return "three apples in a row"

    with pytest.raises(NotExpressible, match="condition three apples in a row is of a kind"):
        planning_task(kitchen(), Goal((), (Odd(),)))  # type: ignore[arg-type]


def test_too_many_cases_are_refused() -> None:
    graph = kitchen({f"apple_{i}": "on countertop_0" for i in range(30)})
    members = " ".join(f"apple_{i}" for i in range(30))
    with pytest.raises(NotExpressible, match="cases"):
        planning_task(graph, Goal((), (parse_formula(f"(forn (15) (?x {members}) (cooked ?x))"),)))


def test_the_domain_names_every_primitive() -> None:
    for primitive in Primitive:
        assert f"(:action {primitive.name.lower().replace('_', '-')}\n" in household_domain()
