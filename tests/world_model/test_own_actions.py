"""Actions of one's own, written outside the package: validated, repaired, read, told of, and exported."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from support.counting import calls_of

import gavel_agents
from gavel_agents.edits.repair import repair
from gavel_agents.llm.grammar import plan_gbnf, step_pattern
from gavel_agents.proposing.complaint import complaint
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.proposing.prompts import SYSTEM, system_prompt
from gavel_env.errors import BadOwnAction, MalformedAction, NotExpressible
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import RULES, ViolationKind, apply, first_violation, violations
from gavel_env.world_model.goals import parse_goal, parse_literal
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.narration import command, reason
from gavel_env.world_model.own_actions import (
    OwnAction,
    own_actions,
    own_state,
    register_action,
    registered,
    unregister_action,
)
from gavel_env.world_model.pddl import action_of, export_pddl
from gavel_env.world_model.planning_task import planning_task
from gavel_env.world_model.verdict import validate

own_state("filled")
own_state("rinsed")


def rag_in_hand(graph: SceneGraph, x: str) -> str | None:
    held = graph.holding
    return None if held is not None and graph.category(held).wipes else "a rag in the hand"


WIPE = OwnAction("WIPE", ("x",), needs=("near(x)", rag_in_hand), effects=("not dirty(x)",), words=("clean",),
                 hints={"rag in hand": ("GRASP(rag)",)})  # fmt: skip
POUR = OwnAction("POUR", ("x", "y"), needs=("holding(x)", "filled(x)", "near(y)", "interior(y)"),
                 effects=("filled(y)", "not filled(x)"), words=("tip",), says="pour what is in x into y")  # fmt: skip
FILL = OwnAction("FILL", ("x", "y"), needs=("holding(x)", "near(y)", "switch(y)"), effects=("filled(x)",))
LAB: dict[str, Any] = {
    "format": "gavel-graph/1",
    "rooms": [{"id": "lab"}, {"id": "store"}],
    "categories": {
        "jug": {"graspable": True, "interior": True},
        "cup": {"graspable": True, "interior": True},
        "tap": {"toggleable": True},
        "cloth": {"graspable": True, "wipes": True},
    },
    "nodes": [
        {"id": "bench", "category": "lab_table", "room": "lab", "flags": ["dirty"]},
        {"id": "cupboard", "category": "bottom_cabinet", "room": "store"},
        {"id": "tap", "category": "tap", "room": "lab"},
        {"id": "jug", "category": "jug", "inside": "cupboard", "flags": ["filled"]},
        {"id": "cup", "category": "cup", "on_top": "bench"},
        {"id": "rag", "category": "cloth", "room": "store"},
    ],
    "robot": {"room": "lab"},
}


@pytest.fixture(autouse=True)
def own() -> Iterator[tuple[Primitive, ...]]:
    with registered(WIPE, POUR, FILL) as primitives:
        yield primitives
    assert own_actions() == ()


def lab(**flags: list[str]) -> SceneGraph:
    data = copy.deepcopy(LAB)
    for node in data["nodes"]:
        node["flags"] = flags.get(node["id"], node.get("flags", []))
    return SceneGraph.from_json(data)


def plan(*steps: str) -> tuple[Action, ...]:
    return tuple(map(parse_action, steps))


FETCHED = ("NAVIGATE_TO(cupboard)", "OPEN(cupboard)", "GRASP(jug)", "CLOSE(cupboard)", "NAVIGATE_TO(cup)")


# --- validation ---------------------------------------------------------------------------------------------------


def test_a_plan_of_ones_own_actions_is_valid_and_does_what_they_declare() -> None:
    graph = lab()
    verdict = validate(graph, plan(*FETCHED, "POUR(jug, cup)"), "filled(cup), not filled(jug)")
    assert verdict.valid
    assert graph.has(Flag["FILLED"], "jug")
    assert not verdict.end.has(Flag["FILLED"], "jug")


@pytest.mark.parametrize(
    ("step", "flags", "found"),
    [
        ("POUR(jug, cup)", {}, "hand_empty(jug)"),
        ("POUR(jug, cupp)", {}, "unknown_object(cupp)"),
        ("POUR(lab, cup)", {}, "room_target(lab)"),
        ("WIPE(bench)", {}, "not_near(bench)"),
    ],
)
def test_needs_are_checked_in_their_order(step: str, flags: dict[str, list[str]], found: str) -> None:
    assert str(first_violation(lab(**flags), parse_action(step))) == found


def test_a_missing_state_and_a_function_say_what_is_missing() -> None:
    dry = validate(lab(jug=[]), plan(*FETCHED, "POUR(jug, cup)"), "filled(cup)").violation
    assert dry is not None
    assert (dry.kind, dry.subject, dry.blocker, dry.step) == (ViolationKind("precondition"), "jug", "filled(jug)", 5)
    assert reason(dry) == "it needs filled(jug)"
    bare = validate(lab(), plan("NAVIGATE_TO(bench)", "WIPE(bench)"), "not dirty(bench)").violation
    assert str(bare) == "precondition(bench) (because of a rag in the hand)"
    all_of = violations(lab(jug=[]), parse_action("POUR(jug, bench)"))
    assert [str(v) for v in all_of[:2]] == ["hand_empty(jug)", "precondition(jug) (because of filled(jug))"]
    assert all_of[-1].kind is ViolationKind.NO_INTERIOR


def test_an_effect_may_be_a_function() -> None:
    def tip_out(graph: SceneGraph, x: str) -> SceneGraph:
        for item in graph.contents.get(x, ()):
            graph = graph.place(item, graph.supports[x])
        return graph

    with registered(OwnAction("EMPTY", needs=("near(x)",), effect=tip_out)):
        graph = apply(lab(), parse_action("EMPTY(cupboard)"))
        assert graph.room_of("jug") == "store"
        assert graph.contents.get("cupboard") is None
        found = repair(
            lab(), plan("NAVIGATE_TO(cupboard)", "EMPTY(cupboard)", "NAVIGATE_TO(tap)"), "in_room(jug, store)"
        )
        assert found.verdict.valid


# --- repair -------------------------------------------------------------------------------------------------------


def test_what_an_action_needs_is_brought_about() -> None:
    found = repair(lab(), plan("POUR(jug, cup)"), "filled(cup)")
    assert found.verdict.valid
    assert found.edits[0].rule == "bring_about_needs"
    assert {"POUR(jug, cup)", "CLOSE(cupboard)"} <= set(map(str, found.plan))


def test_regression_goes_over_the_effects_of_other_actions() -> None:
    found = repair(lab(jug=[]), plan("POUR(jug, cup)"), "filled(cup)")
    assert found.verdict.valid
    steps = [str(step) for step in found.plan]
    assert steps.index("FILL(jug, tap)") < steps.index("POUR(jug, cup)")


def test_an_unmet_goal_is_reached_from_nothing() -> None:
    found = repair(lab(jug=[]), (), "filled(cup)")
    assert found.verdict.valid
    assert found.edits[0].rule == "act_for"


def test_a_hint_says_how_a_function_is_brought_about() -> None:
    found = repair(lab(), plan("NAVIGATE_TO(bench)", "WIPE(bench)"), "not dirty(bench)")
    assert found.verdict.valid
    assert "GRASP(rag)" in map(str, found.plan)
    wiped = repair(lab(), (), "not dirty(bench)")
    assert wiped.verdict.valid
    # The jug is set down before the rag is taken.
    both = repair(lab(), plan(*FETCHED, "POUR(jug, cup)"), "filled(cup), not dirty(bench)")
    assert both.verdict.valid


def test_what_nothing_brings_about_is_dropped_or_left() -> None:
    with registered(OwnAction("SWIRL", needs=("rinsed(x)",), effects=("filled(x)",))):
        found = repair(lab(), plan("SWIRL(cup)"), "in_room(cup, lab)")
        assert found.verdict.valid
        assert found.plan == ()


def test_the_gate_serves_them_too() -> None:
    found = gavel_agents.verify(graph=LAB, goal="filled(cup)", plan="\n".join([*FETCHED, "POUR(jug, cup)"]))
    assert found.valid
    found = gavel_agents.verify(graph=LAB, goal="filled(cup)", plan="\n".join([*FETCHED, "POUR(jug)"]))
    assert not found.passed
    assert found.unread[0].line == 6


# --- parser, prompts, words ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["POUR(jug, cup)", "pour jug, cup", "Pour the jug into the cup", "1. TIP jug into cup", '[["POUR", "jug", "cup"]]',
     '[{"action": "POUR", "args": ["jug", "cup"]}]', "Pour(x=jug, y=cup)", '["POUR(jug, cup)"]'],
)  # fmt: skip
def test_they_are_read_in_every_form(text: str) -> None:
    assert [str(a) for a in parse_plans(text).plan] == ["POUR(jug, cup)"]
    assert [a.arguments for a in parse_plans(text).plan] == [("jug", "cup")]


def test_what_is_written_is_read() -> None:
    step = parse_action("POUR(jug, cup)")
    assert parse_action(str(step)) == parse_action(step.words) == step == Action(Primitive["POUR"], "jug", ("cup",))
    with pytest.raises(MalformedAction, match=r"has 1 arguments; write POUR\(x, y\)"):
        parse_action("POUR(jug)")


def test_planners_are_told_of_them_and_grammars_allow_them() -> None:
    assert system_prompt().count("POUR x, y: pour what is in x into y. Needs: holding(x), filled(x)") == 1
    assert "WIPE x: makes not dirty(x). Needs: near(x), rag in hand." in system_prompt()
    assert '"POUR " name ", " name' in plan_gbnf()
    assert re.fullmatch(step_pattern(["jug", "cup"]), "POUR jug, cup")
    assert re.fullmatch(step_pattern(), "WIPE bench")
    assert command(parse_action("POUR(jug, cup)")) == "pour jug, cup"
    told = complaint(validate(lab(), plan("POUR(jug, cup)"), "filled(cup)"))
    assert told is not None
    assert "POUR needs holding(x), filled(x), near(y), interior(y)." in told.text()


def test_graphs_with_ones_own_states_go_to_and_fro() -> None:
    graph = lab()
    assert SceneGraph.from_json(graph.to_json()) == graph
    assert graph.to_networkx().nodes["jug"]["flags"] == ("filled",)


# --- PDDL ---------------------------------------------------------------------------------------------------------


def test_the_lifted_domain_has_them_when_pddl_can_say_them() -> None:
    with pytest.raises(NotExpressible, match="WIPE: 'rag in hand' is a function"):
        _ = planning_task(lab(), "filled(cup)").domain
    unregister_action("WIPE")
    task = planning_task(lab(), "filled(cup)")
    assert "(:action pour" in task.domain
    assert ":parameters (?x - thing ?y - thing)" in task.domain
    assert "(holding ?x) (filled ?x) (near ?y) (interior ?y)" in task.domain
    assert ("filled", "jug") in task.init
    assert task.action("pour", ["jug", "cup"]) == parse_action("POUR(jug, cup)")
    assert task.domain.count("(") == task.domain.count(")")


@pytest.mark.parametrize(
    ("flags", "goal"), [({}, "filled(cup)"), ({"jug": [], "bench": ["dirty"]}, "filled(cup), not dirty(bench)")]
)
def test_another_planner_solves_the_lifted_task(flags: dict[str, list[str]], goal: str) -> None:
    """Fast Downward reads the domain with the added actions, and its plans are valid here."""
    shortcuts = pytest.importorskip("unified_planning.shortcuts")
    reader = pytest.importorskip("unified_planning.io").PDDLReader()
    pytest.importorskip("up_fast_downward")
    shortcuts.get_environment().credits_stream = None
    unregister_action("WIPE")
    plain = OwnAction("WIPE", ("x",), needs=("near(x)", "hand_free(x)", "accessible(x)"), effects=("not dirty(x)",))
    with registered(plain):
        task = planning_task(lab(**flags), goal)
        with shortcuts.OneshotPlanner(name="fast-downward") as planner:
            solved = planner.solve(reader.parse_problem_string(task.domain, task.problem)).plan
        steps = [task.action(a.action.name, [str(x) for x in a.actual_parameters]) for a in solved.actions]
        assert validate(lab(**flags), steps, goal).valid


def test_the_grounded_export_steps_as_the_model_does() -> None:
    """Every grounded step of one's own is applicable, and changes the state's facts, as in the world model."""
    unregister_action("WIPE")
    graph = lab()
    for step in plan(*FETCHED):
        graph = apply(graph, step)
        domain = export_pddl(graph).domain
        facts = set(export_pddl(graph).problem.split("(:init\n")[1].split(")\n(:goal")[0].split("\n"))
        for text in domain.split("(:action ")[1:]:
            name = text.split("\n")[0]
            action = action_of(name)
            if action.primitive in RULES:
                continue
            needs = {f"({n})" for n in text.split("(and (")[1].split("))")[0].split(") (")}
            assert (needs <= facts) == (first_violation(graph, action) is None), name
    assert "pour--jug-and-cup--" in domain


# --- registering --------------------------------------------------------------------------------------------------


def test_the_nine_stay_as_they_are() -> None:
    assert len(list(Primitive)) == 9
    assert set(RULES) == set(Primitive)
    assert len(list(ViolationKind)) == 17
    assert [flag.name for flag in Flag][-1] == "DIRTY"
    for action in (WIPE, POUR, FILL):
        unregister_action(action.name)
    assert system_prompt() == SYSTEM
    with pytest.raises(MalformedAction):
        parse_action("POUR(jug, cup)")


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (OwnAction("Stir"), "capitals"),
        (OwnAction("GRASP"), "'GRASP' is taken by GRASP"),
        (OwnAction("STIR", words=("pick up",)), "'pick up' is taken by GRASP"),
        (OwnAction("STIR", needs=("neer(x)",)), "'neer\\(x\\)' is neither check nor state; did you mean near"),
        (OwnAction("STIR", needs=("near x",)), "not of the form"),
        (OwnAction("STIR", needs=("near(z)",)), "takes 1 of the parameters x"),
        (OwnAction("STIR", needs=("inside(x)",)), "takes 2 of the parameters"),
        (OwnAction("STIR", needs=("not near(x)",)), "only states can be negated"),
        (OwnAction("STIR", effects=("stirred(x)",)), r"a new state needs own_state\('stirred'\)"),
        (OwnAction("STIR", effects=("near(x)",)), "neither check nor state"),
        (OwnAction("STIR", ("x", "x")), "different names"),
        (OwnAction("POUR"), "'POUR' is taken by POUR"),
    ],
)
def test_what_cannot_be_registered_is_said(action: OwnAction, message: str) -> None:
    with pytest.raises(BadOwnAction, match=message):
        register_action(action)


def test_states_are_made_once_and_relations_are_none() -> None:
    assert own_state("filled") is own_state("filled") is Flag["FILLED"]
    assert own_state("dirty") is Flag.DIRTY
    assert parse_literal("filled(cup)").predicate.flag is Flag["FILLED"]
    assert parse_goal("not filled(cup)").text() == ("not filled(cup)",)
    for name in ("on_top", "near", "ontop", "Filled", "a b"):
        with pytest.raises(BadOwnAction):
            own_state(name)
    assert register_action(POUR) is Primitive["POUR"]
    assert copy.deepcopy(Primitive["POUR"]) is Primitive["POUR"]


# --- as fast as before --------------------------------------------------------------------------------------------


def test_a_step_of_the_nine_runs_no_more_functions_with_actions_of_ones_own_than_without() -> None:
    graph, steps = lab(), plan(*FETCHED)
    goal = parse_goal("in_room(jug, lab)")

    def judge() -> None:
        validate(graph, steps, goal)

    judge()
    with_own = calls_of(judge)
    for action in (WIPE, POUR, FILL):
        unregister_action(action.name)
    assert calls_of(judge) == with_own


def test_the_json_of_a_verdict_names_them() -> None:
    found = gavel_agents.verify(graph=LAB, goal="filled(cup)", plan="POUR(jug, cup)")
    assert "POUR(jug, cup)" in json.dumps(found.as_dict())
