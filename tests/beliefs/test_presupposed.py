"""What goes without saying before a task: what shall be shut stands open, what shall be off is on."""

from __future__ import annotations

import pytest

from gavel_agents.beliefs.believed_graph import believed_graph, presupposed
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.world_model.goals import Designator, parse_goal
from gavel_env.world_model.graph import Flag, Room
from gavel_env.world_model.ontology import default_ontology


def task(*goal: str, said: tuple[str, ...] = ()) -> TaskUnderstanding:
    wanted = parse_goal(goal)
    named = {d for lit in wanted.literals for d in (lit.subject, lit.object) if d is not None}
    return TaskUnderstanding("", tuple(sorted(named)), parse_goal(said).literals, wanted)


@pytest.mark.parametrize(
    ("tasks", "so"),
    [
        ([task("not open(fridge)")], ["open(fridge)"]),
        ([task("not toggled(floor_lamp@bedroom)", "open(oven)")], ["toggled(floor_lamp@bedroom)"]),
        ([task("open(fridge)")], []),
        ([task("inside(milk, fridge)", "not open(fridge)")], []),  # how it shall be left
        ([task("inside(milk, fridge)"), task("not open(fridge)")], []),
        ([task("not open(fridge)"), task("inside(milk, fridge)")], ["open(fridge)"]),
        ([task("on_top(apple, desk)", said=("inside(apple, fridge)",)), task("not open(fridge)")], []),
        ([task("not dirty(bowl)")], []),
    ],
)
def test_only_what_is_about_doors_and_switches_alone(tasks: list[TaskUnderstanding], so: list[str]) -> None:
    assert [str(literal) for literal in presupposed(tasks)] == so


def test_the_believed_graph_has_it() -> None:
    rooms = {"kitchen_0": Room("kitchen_0", "kitchen")}
    graph = believed_graph(rooms, frozenset(), [task("not open(fridge)")], default_ontology(), None)
    assert graph.flags[Flag.OPEN] == {str(Designator("fridge"))}
