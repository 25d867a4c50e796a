"""Appliances that a goal needs and nobody names join the believed graph, and no others do."""

from __future__ import annotations

import pytest

from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.beliefs.narrowing import Narrowed, narrow
from gavel_agents.beliefs.unsaid import with_appliances
from gavel_agents.understanding import TaskUnderstanding, load_understanding
from gavel_env.instructions.record import shipped_instructions
from gavel_env.world_model.goals import Designator, parse_goal
from gavel_env.world_model.graph import Room
from gavel_env.world_model.ontology import Ontology, default_ontology

HOUSE = {"kitchen_0": Room("kitchen_0", "kitchen"), "utility_room_0": Room("utility_room_0", "utility_room")}


def said(*objects: str, goal: tuple[str, ...]) -> TaskUnderstanding:
    return TaskUnderstanding("", tuple(map(Designator.parse, objects)), (), parse_goal(goal))


def completed(*tasks: TaskUnderstanding, ontology: Ontology | None = None) -> tuple[Narrowed, Narrowed]:
    ontology = ontology or default_ontology()
    narrowed = narrow(tasks, HOUSE, ontology)
    graph = believed_graph(HOUSE, frozenset(), narrowed.tasks, ontology, None, narrowed.kinds)
    return narrowed, with_appliances(narrowed, graph, ontology)


@pytest.mark.parametrize(
    ("thing", "state", "appliance"),
    [
        ("t_shirt", "washed", "washer"),
        ("plate", "washed", "dishwasher"),
        ("t_shirt", "dried", "clothes_dryer"),
        ("potato", "cooked", "any_cooking_appliance"),
        ("potato", "hot", "any_cooking_appliance"),
        ("shoulder_bag", "washed", "any_washing_appliance"),  # people put it into neither
    ],
)
def test_the_appliance_is_the_one_for_such_things(thing: str, state: str, appliance: str) -> None:
    _, (tasks, _) = completed(said(thing, goal=(f"{state}({thing})",)))
    assert [str(d) for d in tasks[0].objects] == [thing, appliance]


def test_a_concept_stands_for_what_people_cook_such_things_in() -> None:
    _, (_, kinds) = completed(said("potato", goal=("cooked(potato)",)))
    assert [kind.name for kind in kinds["any_cooking_appliance"]][:4] == ["oven", "microwave", "stove", "burner"]


@pytest.mark.parametrize(
    "tasks",
    [
        (said("potato", "burner", goal=("cooked(potato)",)),),  # on it, not in it
        (said("t_shirt", "washer", goal=("washed(t_shirt)",)),),
        (said("t_shirt", goal=("washed(t_shirt)",)), said("sock", "washer", goal=("washed(sock)",))),
        (said("t_shirt", "bed", goal=("on_top(t_shirt, bed)", "not washed(t_shirt)")),),
    ],
)
def test_nothing_joins_where_something_can_do_it(tasks: tuple[TaskUnderstanding, ...]) -> None:
    before, after = completed(*tasks)
    assert after is before


def test_one_concept_serves_two_things_that_it_is_for() -> None:
    _, (tasks, kinds) = completed(said("potato", goal=("cooked(potato)",)), said("egg", goal=("cooked(egg)",)))
    assert all("any_cooking_appliance" in map(str, task.objects) for task in tasks)
    assert list(kinds) == ["any_cooking_appliance"]


def test_own_categories_count() -> None:
    own = default_ontology().extend({"autoclave": {"like": "dishwasher", "words": ["steriliser"]}})
    _, (tasks, _) = completed(said("plate", goal=("washed(plate)",)), ontology=own)
    assert [str(d) for d in tasks[0].objects] == ["plate", "dishwasher"]  # what people put plates into


def test_the_benchmarks_name_their_machines() -> None:
    instructions = [i for i in shipped_instructions() if i.kind in ("single", "multi", "behavior")][::7]
    assert len(instructions) > 100
    reference = load_understanding("reference", instructions)
    for instruction in instructions:
        tasks = reference.understand(instruction.text).tasks
        before, after = completed(*tasks)
        assert after is before, instruction.id
