"""Prompts and complaints say the rules that plans are judged by; worked examples are valid under them."""

from __future__ import annotations

import pytest

from gavel_agents.proposing.complaint import complain
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.proposing.prompts import EXAMPLES, SYSTEM, examples, plan_prompt, system_prompt
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, parse_goal
from gavel_env.world_model.graph import Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.verdict import validate

ROOMS = {"kitchen_0": Room("kitchen_0", "kitchen"), "bedroom_0": Room("bedroom_0", "bedroom")}
HELD_BY = {
    "mug": Support(Relation.ON_TOP, "coffee_table"),
    "plate": Support(Relation.FLOOR, "kitchen_0"),
    "pie": Support(Relation.INSIDE, "fridge"),
    "teddy": Support(Relation.FLOOR, "bedroom_0"),
}


def graph_of(question: str) -> SceneGraph:
    """Build the graph of a worked example from its list of objects."""
    names = [line[2:].split(":")[0] for line in question.splitlines() if line.startswith("- ")]
    kinds = {"teddy": "teddy_bear", "pie": "apple_pie"}
    ontology = default_ontology()
    nodes = {}
    for name in names:
        category = name.partition("@")[0]
        nodes[name] = Node(name, ontology[kinds.get(category, category)], name not in HELD_BY)
    graph = SceneGraph(World.of(ROOMS, frozenset(), nodes), {}, {}, robot_room="kitchen_0")
    for name in names:
        if name not in HELD_BY:
            graph = graph.place(name, Support(Relation.FLOOR, "kitchen_0"))
    for name in names:
        if name in HELD_BY:
            graph = graph.place(name, HELD_BY[name])
    return graph


def goals_of(question: str) -> list[Goal]:
    lines = [line.partition(" goal: ")[2] for line in question.splitlines() if " goal: " in line]
    return [parse_goal(tuple(part + ")" for part in line[:-1].split("), "))) for line in lines]


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_worked_examples_are_valid_under_the_profile(profile: Profile, number: int) -> None:
    question, answer = examples(profile)[number]
    graph, goals = graph_of(question), goals_of(question)
    parsed = parse_plans(answer, graph, len(goals))
    assert not parsed.dropped
    for plan, goal in zip(parsed.plans, goals, strict=True):
        verdict = validate(graph, plan, goal, profile=profile)
        assert verdict.valid, verdict


def test_the_paper_s_examples_are_invalid_where_doors_need_an_empty_hand() -> None:
    question, answer = EXAMPLES[0]
    graph, goals = graph_of(question), goals_of(question)
    [plan] = parse_plans(answer, graph, 1).plans
    verdict = validate(graph, plan, goals[0], profile=Profile.OMNIGIBSON)
    assert not verdict.valid
    assert "an empty hand" in complain([verdict], goals, profile=Profile.OMNIGIBSON)


def test_the_prompt_says_what_doors_and_switches_need() -> None:
    assert system_prompt() == SYSTEM
    assert examples() == EXAMPLES
    other = system_prompt(Profile.OMNIGIBSON)
    assert other.count("near y, empty hand, ") == SYSTEM.count("near y, empty hand, ") + 2
    graph = graph_of(EXAMPLES[2][0])
    paper, omnigibson = (plan_prompt("x", (), graph, {}, profile) for profile in Profile)
    assert paper[0].content == SYSTEM
    assert omnigibson[0].content == other
    assert paper[-1] == omnigibson[-1]
