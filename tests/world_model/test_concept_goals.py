"""Goals over concepts against goals over the instances that fit them, here and in PDDL."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.worlds import kitchen, random_house_graph

from gavel_agents.classical.search import search
from gavel_env.errors import MalformedGoal, UnknownObject
from gavel_env.world_model import dynamics
from gavel_env.world_model.concepts import default_concepts, is_concept
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import (
    Designator,
    Goal,
    Literal,
    Predicate,
    check_goal,
    parse_goal,
    parse_literal,
    unmet,
)
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.pddl import action_of, state_facts
from gavel_env.world_model.planning_task import planning_task

THINGS = [
    *sorted(filter(is_concept, default_concepts().things)),
    "countertop|any_table",
    "mug|any_glass",
    "fridge|oven",
]
PLACES = [*sorted(filter(is_concept, default_concepts().places)), "kitchen|living_room", "bedroom|any_office"]


def instances(graph: SceneGraph, designator: Designator) -> list[str]:
    """Return what fits a designator, by the table of concepts alone."""
    table = default_concepts()
    found = []
    for obj, node in graph.world.nodes.items():
        room = graph.room_of(obj)
        types = set() if designator.room is None else set(table.room_types(designator.room))
        there = designator.room is None or (room is not None and graph.world.rooms[room].type in types)
        if node.category.name in table.categories(designator.name) and there:
            found.append(obj)
    return found


def met_by_some_choice(goal: Goal, graph: SceneGraph) -> bool:
    """Return whether some instance for every subject, and for every other place, makes all literals true."""
    subjects = list(dict.fromkeys(literal.subject for literal in goal.literals))
    for chosen in itertools.product(*(instances(graph, s) for s in subjects)):
        bound = dict(zip(subjects, chosen, strict=True))
        if all(_true(literal, bound, graph) for literal in goal.literals):
            return True
    return False


def _true(literal: Literal, bound: dict[Designator, str], graph: SceneGraph) -> bool:
    subject = Designator(bound[literal.subject])
    if literal.object is None:
        options: list[Designator | None] = [None]
    elif literal.predicate is Predicate.IN_ROOM:
        kinds = default_concepts().room_types(str(literal.object))
        options = [Designator(kind) for kind in kinds]
    elif literal.object in bound:
        options = [Designator(bound[literal.object])]
    else:
        options = [Designator(obj) for obj in instances(graph, literal.object)]
    return any(not unmet(Goal((literal._replace(subject=subject, object=o),)), graph) for o in options)


DESIGNATORS = st.builds(Designator, st.sampled_from(THINGS), st.one_of(st.none(), st.sampled_from(PLACES)))
FEW = st.sampled_from(
    [
        "any_table",
        "any_table|any_cabinet",
        "any_cabinet",
        "any_sink",
        "any_lamp",
        "any_furniture",
        "any_bag",
        "any_box",
        "any_fruit",
    ]
)
OFTEN = st.one_of(DESIGNATORS, st.builds(Designator, FEW, st.none()))
LITERALS = st.one_of(
    st.builds(
        Literal,
        st.sampled_from([Predicate.OPEN, Predicate.TOGGLED, Predicate.COOKED]),
        OFTEN,
        st.none(),
        st.just(False),
    ),
    st.builds(
        Literal,
        st.sampled_from([Predicate.ON_TOP, Predicate.INSIDE, Predicate.NEXT_TO]),
        OFTEN,
        OFTEN,
        st.just(False),
    ),
    st.builds(
        Literal,
        st.just(Predicate.IN_ROOM),
        OFTEN,
        st.builds(Designator, st.sampled_from(PLACES), st.none()),
        st.just(False),
    ),
)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 7), st.lists(LITERALS, min_size=1, max_size=3))
def test_goals_over_concepts_are_met_where_some_instances_meet_them(seed: int, literals: list[Literal]) -> None:
    graph = random_house_graph(("Beechwood_0_int", "Merom_1_int")[seed % 2], np.random.default_rng(seed))
    goal = Goal(tuple(literals))
    assert (not unmet(goal, graph)) == met_by_some_choice(goal, graph)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 7), st.data())
def test_goals_about_what_is_there_are_met(seed: int, data: st.DataObject) -> None:
    """Random concepts seldom hold; these are drawn from what stands on what."""
    graph = random_house_graph(("Beechwood_0_int", "Merom_1_int")[seed % 2], np.random.default_rng(seed))
    held = sorted(o for o, s in graph.supports.items() if s.holder in graph.world.nodes)
    if not held:
        return
    obj = data.draw(st.sampled_from(held))
    relation, holder = graph.supports[obj]
    predicate = (Predicate.ON_TOP, Predicate.INSIDE)[relation]
    kinds = [sorted(graph.category(o).concepts) or [graph.category(o).name] for o in (obj, holder)]
    said = [[*names, f"hammer|{names[0]}"] for names in kinds]
    subject, second = (Designator(data.draw(st.sampled_from(names))) for names in said)
    assume(subject != second)  # one designator speaks of one thing
    goal = Goal((Literal(predicate, subject, second),))
    assert met_by_some_choice(goal, graph)
    assert not unmet(goal, graph)


@settings(deadline=None)
@given(LITERALS, st.booleans())
def test_literals_over_concepts_are_read_as_they_are_written(literal: Literal, negated: bool) -> None:
    literal = literal._replace(negated=negated)
    assert parse_literal(str(literal)) == literal


def test_a_goal_may_leave_the_choice_between_rooms_or_pieces() -> None:
    graph = kitchen({"apple_0": "on breakfast_table_0"})
    for there in (
        "any_table@kitchen|bathroom",
        "any_table@bathroom|kitchen_0",
        "bed|breakfast_table",
        "bed|any_table",
        "bed|breakfast_table_0",
    ):
        goal = parse_goal([f"on_top(apple_0, {there})"])
        assert not unmet(goal, graph), there
    assert unmet(parse_goal(["on_top(apple_0, countertop|any_sink)"]), graph)
    assert not unmet(parse_goal(["in_room(apple_0, bathroom|kitchen)"]), graph)
    assert unmet(parse_goal(["in_room(apple_0, bathroom|bedroom)"]), graph)


@pytest.mark.parametrize("name", ["desk|", "|desk", "desk||bed", "desk@|kitchen", "desk@kitchen|", "|"])
def test_a_choice_has_a_name_on_each_side(name: str) -> None:
    with pytest.raises(MalformedGoal, match="needs the form"):
        parse_goal([f"on_top(apple_0, {name})"])


def test_each_room_of_a_choice_must_be_one_of_the_house() -> None:
    with pytest.raises(UnknownObject, match="'kichen'"):
        check_goal(parse_goal(["on_top(apple_0, any_table@kichen|kitchen)"]), kitchen())


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("(exists (?x any_fruit) (on_top ?x any_table))", True),
        ("(forall (?x any_fruit any_book) (on_top ?x any_table))", False),
        ("(on_floor breakfast_table_0 any_office)", False),
        ("(forn (1) (?x any_fruit) (on_top ?x any_furniture))", True),
    ],
)
def test_conditions_may_speak_of_concepts(text: str, holds: bool) -> None:
    formula = parse_formula(text)
    assert formula.holds(kitchen({"apple_0": "on breakfast_table_0"})) is holds
    assert str(formula) == text


# --- PDDL ------------------------------------------------------------------------------------------------------------


def test_a_concept_in_a_goal_is_written_out_over_what_fits_it() -> None:
    graph = kitchen()
    concept = planning_task(graph, parse_goal(["on_top(bowl_0, any_table)"]))
    fits = instances(graph, Designator("any_table"))
    assert fits == ["breakfast_table_0"]
    assert concept.goal == planning_task(graph, parse_goal(["on_top(bowl_0, breakfast_table)"])).goal
    two = kitchen({"coffee_table_0": "floor kitchen_0"})
    goal = planning_task(two, parse_goal(["on_top(bowl_0, any_table)"])).problem
    assert "(on-top bowl_0 breakfast_table_0)" in goal
    assert "(on-top bowl_0 coffee_table_0)" in goal


@pytest.mark.parametrize("text", ["on_top(apple_0, any_table)", "inside(any_fruit, fridge)", "open(any_bag)"])
def test_a_plan_for_a_concept_runs_in_pyperplans_world_too(text: str) -> None:
    from world_model.test_pddl import about_world, grounded

    graph = kitchen(near=())
    goal = parse_goal([text])
    plan = search(graph, goal).plan
    assert plan
    for action in plan:
        task = grounded(graph, Profile.PAPER)
        state = frozenset(task.initial_state)
        [operator] = [o for o in task.operators if action_of(o.name) == action and o.applicable(state)]
        graph = dynamics.apply(graph, action)
        assert about_world(operator.apply(state)) == state_facts(graph)
    assert not unmet(goal, graph)
    [literal] = goal.literals
    names = [instances(graph, d) for d in (literal.subject, literal.object) if d is not None and "_0" not in d.name]
    written = {"on_top": "on-top", "inside": "inside", "open": "open"}[literal.predicate.value]
    assert any(
        fact.startswith(f"({written} ") and all(any(obj in fact for obj in fits) for fits in names)
        for fact in state_facts(graph)
    )
