"""Actions of one's own in PDDL: facts ask what the world model asks and change what it changes."""

from __future__ import annotations

import re

import pytest
from support.worlds import kitchen

from gavel_env.errors import NotExpressible
from gavel_env.world_model.actions import Action
from gavel_env.world_model.dynamics import apply, first_violation
from gavel_env.world_model.goals import parse_literal
from gavel_env.world_model.graph import Flag, Node, SceneGraph
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.own_actions import CHECKS, OwnAction, own_state, registered
from gavel_env.world_model.own_actions_pddl import grounded_own_actions, with_own_actions
from gavel_env.world_model.pddl import export_pddl

own_state("tried")
own_state("half_done")

STATES = [
    kitchen(near=()),
    kitchen({"apple_0": "held"}, flags={"open": ["oven_0", "backpack_0"]}).with_flag(
        Flag["TRIED"], frozenset(("oven_0", "apple_0")), value=True
    ),
    kitchen({"backpack_0": "in fridge_0"}, near=("fridge_0", "stove_0"), flags={"toggled": ["stove_0"]}),
]
OBJECTS = ("apple_0", "textbook_0", "backpack_0", "fridge_0", "oven_0", "stove_0", "breakfast_table_0", "bowl_0")
NEEDS = [f"{name}(x, y)" if name in ("on_top", "inside") else f"{name}(x)" for name in CHECKS]
NEEDS += ["open(x)", "not open(x)", "toggled(x)", "tried(x)"]


def facts(graph: SceneGraph) -> frozenset[str]:
    return frozenset(export_pddl(graph).problem.split("(:init\n")[1].split(")\n(:goal")[0].split("\n"))


@pytest.mark.parametrize("need", NEEDS)
def test_a_step_can_be_asked_in_facts_just_where_the_world_model_allows_it(need: str) -> None:
    parameters = ("x", "y") if "y" in need.partition("(")[2] else ("x",)
    with registered(OwnAction("TRY", parameters, needs=(need,), effects=("tried(x)",))) as (primitive,):
        allowed = 0
        for graph in STATES:
            true = facts(graph)
            found = {step.action: step for step in grounded_own_actions(graph, OBJECTS)}
            for x in OBJECTS:
                for others in [(y,) for y in OBJECTS] if len(parameters) == 2 else [()]:
                    action = Action(primitive, x, others)
                    step = found.get(action)
                    asked = step is not None and set(step.needs) <= true
                    reached = step is not None and all(
                        graph.closed_container(thing) is None for thing in step.accessible
                    )
                    assert (asked and reached) == (first_violation(graph, action) is None), (need, action)
                    allowed += asked and reached
        assert 0 < allowed < len(STATES) * len(OBJECTS) ** len(parameters)


@pytest.mark.parametrize(
    "effects",
    [
        ("tried(x)",),
        ("not tried(x)",),
        ("open(x)",),
        ("not open(x)",),
        ("toggled(x)", "not tried(x)", "half_done(x)"),
    ],
)
def test_a_step_changes_the_facts_that_the_world_model_changes(effects: tuple[str, ...]) -> None:
    with registered(OwnAction("TRY", effects=effects)):
        for graph in STATES:
            before = facts(graph)
            for step in grounded_own_actions(graph, OBJECTS):
                assert (before - set(step.deletes)) | set(step.adds) == facts(apply(graph, step.action)), step


def test_the_export_of_a_state_has_what_a_step_adds_and_deletes() -> None:
    with registered(OwnAction("TRY", needs=("near(x)",), effects=("tried(x)", "not half_done(x)"))):
        domain = export_pddl(STATES[1]).domain
    [step] = [text for text in domain.split("(:action ") if text.startswith("try--stove_0-")]
    effect = step.partition(":effect")[2]
    assert "(tried stove_0)" in effect
    assert "(not (half_done stove_0))" in effect


def test_the_export_asks_what_is_around_a_thing_that_must_be_accessible_to_stand_open() -> None:
    with registered(OwnAction("TRY", needs=("accessible(x)",), effects=("tried(x)",))):
        domain = export_pddl(STATES[2]).domain
    asked = {}
    for text in domain.split("(:action try--")[1:]:
        asked[text.partition("--")[0]] = set(re.findall(r"\(open (\w+)\)", text.partition(":effect")[0]))
    assert asked["textbook_0"] == {"backpack_0", "fridge_0"}
    assert asked["backpack_0"] == {"fridge_0"}
    assert asked["fridge_0"] == asked["apple_0"] == set()


def test_a_thing_whose_place_nobody_knows_is_exported_too() -> None:
    graph = STATES[0].with_nodes({"mug_0": Node("mug_0", default_ontology()["mug"], False)})
    assert "(:action navigate_to--mug_0--" in export_pddl(graph).domain


def test_a_state_that_is_new_is_a_flag_and_a_predicate_of_its_name() -> None:
    made = own_state("made_just_now")
    assert made is Flag["MADE_JUST_NOW"]
    assert made.name == "MADE_JUST_NOW"
    literal = parse_literal("not made_just_now(apple)")
    assert (literal.predicate.flag, str(literal)) == (made, "not made_just_now(apple)")


@pytest.mark.parametrize("need", ["not tried(x)", "not toggled(x)"])
def test_strips_knows_no_negation_but_that_of_doors(need: str) -> None:
    with registered(OwnAction("TRY", needs=(need,), effects=("tried(x)",))), pytest.raises(NotExpressible, match="TRY"):
        list(grounded_own_actions(STATES[0], OBJECTS))


def test_functions_are_not_expressible_as_effects_either() -> None:
    with registered(OwnAction("TRY", effect=lambda graph, x: graph)), pytest.raises(NotExpressible, match="its effect"):
        list(grounded_own_actions(STATES[0], OBJECTS))


def test_an_action_without_parameters_is_one_step() -> None:
    with registered(OwnAction("WAIT", (), needs=(), effects=())):
        [step] = grounded_own_actions(STATES[0], OBJECTS)
        assert str(step.action) == "WAIT()"


DOMAIN = "(define (domain d)\n(:predicates (dirty ?x - thing))\n)\n"


def test_the_lifted_domain_declares_states_and_says_needs_and_effects() -> None:
    needs = ("near(x)", "not open(x)", "open(y)", "inside(x, y)", "opened(y)", "hand_free(x)", "not half_done(x)")
    effects = ("half_done(y)", "not tried(x)", "open(x)", "not open(y)")
    with registered(OwnAction("TRY_IT", ("x", "y"), needs=needs, effects=effects)):
        text = with_own_actions(DOMAIN)
    states, _, action = text.partition("\n(:action ")
    assert states.startswith("(define (domain d)\n(:predicates (dirty ?x - thing) (")
    assert "(tried ?x - thing)" in states
    assert "(half-done ?x - thing)" in states
    assert action == (
        "try-it\n  :parameters (?x - thing ?y - thing)\n"
        "  :precondition (and (near ?x) (not (opened ?x)) (opened ?y) (inside ?x ?y) (not (shut ?y)) (hand-empty) "
        "(not (half-done ?x)))\n"
        "  :effect (and (half-done ?y) (not (tried ?x)) (opened ?x) (not (shut ?x)) (not (opened ?y)) "
        "(when (door ?y) (shut ?y))))\n)\n"
    )
