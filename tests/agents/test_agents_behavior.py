"""Agents on BEHAVIOR activities: with certified plans in a model's place, what comes after the plan loses nothing."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium as gym
import pytest

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.edits.condition_literals import grounded
from gavel_agents.edits.repair import repair
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.understanding import ReferenceUnderstanding, TaskUnderstanding
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.instructions.reference_names import spoken
from gavel_env.world_model.actions import parse_action
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.goals import Designator, Goal
from gavel_env.world_model.graph import Flag, Room, SceneGraph
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.verdict import validate

CAUSES = {
    "boxing_books_up_for_storage": "six books, told apart by their ids alone",
    "bringing_in_mail": "a condition with a quantifier; the mail starts in something shut",
    "buy_mulch": "bags that both arms carry, and money in whichever of two registers",
    "clearing_table_after_dinner": "a literal says chicken, a condition chicken_0",
    "cleaning_the_yard": "several leaves, and a bin that has to be carried",
    "clean_a_crab": "dirty, in a box in a cabinet that the text names by its id",
    "clean_wine_glasses": "two things to be washed, and nothing said of where",
    "preparing_clothes_for_the_next_day": "things wanted on a floor",
}


@cache
def activities() -> dict[str, Instruction]:
    return dict(read_instructions(shipped("behavior")))


@cache
def world() -> Any:
    return gym.make(
        "Gavel-Behavior-v0", instructions=activities().values(), observation="symbolic", terminate_on_success=False
    )


def understood(name: str) -> TaskUnderstanding:
    record = activities()[f"behavior-{name}"]
    [task] = ReferenceUnderstanding([record]).understand(record.text).tasks
    return task


def believed(task: TaskUnderstanding, *rooms: str) -> SceneGraph:
    known = {f"{room}_0": Room(f"{room}_0", room) for room in rooms}
    return believed_graph(known, frozenset(), [task], default_ontology(), None)


@pytest.mark.parametrize("method", ["llm-only", "gavel-full"])
@pytest.mark.parametrize("name", CAUSES)
def test_certified_plans_succeed(name: str, method: str) -> None:
    agent: Any = gavel_agents.make(
        method, understanding=ReferenceUnderstanding(activities().values()), model=ReferencePlans(activities().values())
    )
    observation, info = world().reset(seed=0, options={"instruction": f"behavior-{name}"})
    agent.reset(observation, info)
    while (action := agent.act(observation, info)) is not None:
        observation, _, over, _, info = world().step(action)
        if over:
            break
    judgement = world().unwrapped.judge()
    assert judgement.success, (judgement, agent.trace.tasks[0].edits)


@pytest.mark.parametrize("name", activities())
def test_everything_that_plan_and_goal_name_is_an_object(name: str) -> None:
    """Every name resolves in the believed graph, distinct instances of a goal stay distinct, and no thing has two."""
    record = activities()[name]
    task = understood(name.removeprefix("behavior-"))
    objects = {str(designator) for designator in task.objects}
    names = spoken(record, 0).names
    assert {names[a.target] for a in record.reference_plan() if a.target is not None} <= objects
    for literal in task.goal.literals:
        assert str(literal.subject) in objects
    by_id = [obj for obj, called in names.items() if called == obj]
    assert {f"{names[obj]}" for obj in by_id} <= objects
    grasped = {a.target for a in record.reference_plan() if a.primitive.name == "GRASP"}
    assert len({names[str(obj)] for obj in grasped}) == len(grasped)


def test_what_shall_be_clean_is_believed_dirty_and_the_tool_is_no_furniture() -> None:
    graph = believed(understood("clean_wine_glasses"), "kitchen")
    assert {"wineglass_0", "wineglass_1"} <= graph.flags[Flag.DIRTY]
    graph = believed(understood("buy_mulch"), "grocery_store")
    assert not graph.world.nodes["bag_of_mulch_0"].fixed
    assert graph.world.nodes["checkout_counter_0"].fixed


def test_a_thing_has_one_name_in_literals_and_conditions() -> None:
    task = understood("clearing_table_after_dinner")
    assert "inside(chicken_0, tupperware_0)" in task.goal.text()
    assert "chicken" not in map(str, task.objects)


@pytest.mark.parametrize(
    ("formal", "told"),
    [
        ("(forall (?x apple_0 apple_1) (inside ?x fridge_0))", "each A of apple_0, apple_1: inside(A, fridge_0)"),
        ("(exists (?y bed_0) (on_top cat_0 ?y))", "on_top(cat_0, bed_0)"),
        (
            "(exists (?y bed_0 bed_1) (forall (?x a_0 a_1) (not (on_top ?x ?y))))",
            "some A of bed_0, bed_1: each B of a_0, a_1: not on_top(B, A)",
        ),
        (
            "(forpairs (?x a_0 a_1) (?y b_0 b_1) (or (hot ?x) (inside ?x ?y)))",
            "pair off A of a_0, a_1 with B of b_0, b_1: hot(A) or inside(A, B)",
        ),
        ("(forn (1) (?x a_0 a_1) (open ?x))", "exactly 1 A of a_0, a_1: open(A)"),
        ("(imply (and (open a_0) (hot b_0)) (open c_0))", "if (open(a_0) and hot(b_0)) then open(c_0)"),
    ],
)
def test_conditions_are_told_in_words(formal: str, told: str) -> None:
    assert Goal(conditions=(parse_formula(formal),)).text() == (told,)


GOALS = {
    "each": "(forall (?x apple_0 apple_1) (inside ?x fridge))",
    "some": "(exists (?y fridge bowl) (forall (?x apple_0 apple_1) (inside ?x ?y)))",
    "exactly one": "(forn (1) (?x apple_0 apple_1) (inside ?x bowl))",
    "pairs": "(forpairs (?x apple_0 apple_1) (?y bowl plate) (on_top ?x ?y))",
    "either": "(or (cooked apple_0) (inside apple_1 bowl))",
    "within": "(within apple_0 fridge)",
    "if": "(imply (not (inside apple_0 fridge)) (on_top apple_0 plate))",
}


@pytest.mark.parametrize("formal", GOALS.values(), ids=GOALS)
@pytest.mark.parametrize("plan", [(), ("NAVIGATE_TO(apple_1)", "GRASP(apple_1)")], ids=["nothing", "in the hand"])
def test_conditions_are_repaired_as_literals(formal: str, plan: tuple[str, ...]) -> None:
    objects = tuple(map(Designator.parse, ("apple_0", "apple_1", "bowl", "plate", "fridge")))
    goal = Goal(conditions=(parse_formula(formal),))
    graph = believed(TaskUnderstanding("", objects, (), goal), "kitchen")
    proposed = tuple(map(parse_action, plan))
    before = validate(graph, proposed, goal)
    repaired = repair(graph, proposed, goal)
    assert before.unmet
    assert repaired.verdict.valid, repaired.trace
    assert not repaired.verdict.unmet
    assert grounded(goal, before).literals


def test_a_goal_beyond_the_rules_leaves_the_proposal_alone() -> None:
    """No edit rule puts a thing on the floor of a room: then a plan that does is not shortened to one that does not."""
    agent: Any = gavel_agents.make(
        "gavel-basic",
        understanding=ReferenceUnderstanding(activities().values()),
        model=ReferencePlans(activities().values()),
    )
    name = "behavior-preparing_clothes_for_the_next_day"
    agent.reset(*world().reset(seed=0, options={"instruction": name}))
    [task] = agent.trace.tasks
    assert task.verdict == "valid" or task.plan == task.proposed
