"""Concepts in the believed graph: narrowed by house and goal, believed as a mixture over what they may be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gavel_agents.beliefs.belief import Belief, load_prior
from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.beliefs.mixture import category_weights
from gavel_agents.beliefs.narrowing import narrow
from gavel_agents.rsn.data import RoomInfo
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.errors import UnknownConcept
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import default_concepts, is_concept
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.goals import Designator, Goal, parse_goal, parse_literal
from gavel_env.world_model.graph import Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import default_ontology

TYPES = sorted(default_vocabulary().rooms)
CONCEPTS = sorted(name for name in default_concepts().things if is_concept(name))


def house(*types: str) -> dict[str, Room]:
    return {f"{kind}_{i}": Room(f"{kind}_{i}", kind) for i, kind in enumerate(types)}


def task(
    *objects: str, goal: tuple[str, ...] = (), relations: tuple[str, ...] = (), condition: str = ""
) -> TaskUnderstanding:
    return TaskUnderstanding(
        "",
        tuple(map(Designator.parse, objects)),
        tuple(map(parse_literal, relations)),
        parse_goal(goal) | Goal((), (parse_formula(condition),) if condition else ()),
    )


# --- narrowing -------------------------------------------------------------------------------------------------------


def test_a_task_without_concepts_stays_as_it_is() -> None:
    tasks = (task("mug", "fridge@kitchen", goal=("inside(mug, fridge@kitchen)",)),)
    assert narrow(tasks, house("kitchen"), default_ontology()) == (tasks, {})


def test_a_choice_between_rooms_stays_a_choice() -> None:
    said = task("mug", "any_table@kitchen|any_office", goal=("on_top(mug, any_table@kitchen|any_office)",))
    [settled], kinds = narrow([said], house("private_office", "kitchen", "bedroom"), default_ontology())
    assert settled == said
    assert list(kinds) == ["any_table@kitchen|any_office"]
    graph = believed_graph(
        house("private_office", "kitchen", "bedroom"), frozenset(), [settled], default_ontology(), None, kinds
    )
    assert graph.world.nodes["any_table@kitchen|any_office"].stated_room == "kitchen|any_office"


def test_rooms_of_the_house_settle_concepts_everywhere_in_a_task() -> None:
    said = task(
        "mug", "any_table@any_office", "desk@any_office",
        goal=("on_top(mug, any_table@any_office)", "in_room(mug, any_office)", "not toggled(desk@any_office)"),
        relations=("on_top(mug, desk@any_office)",),
        condition="(forall (?x desk@any_office) (on_floor mug any_office))",
    )  # fmt: skip
    [settled], kinds = narrow([said], house("private_office", "kitchen"), default_ontology())
    assert list(kinds) == ["any_table@private_office"]
    assert [str(d) for d in settled.objects] == ["mug", "any_table@private_office", "desk@private_office"]
    assert settled.goal.text() == (
        "on_top(mug, any_table@private_office)",
        "in_room(mug, private_office)",
        "not toggled(desk@private_office)",
        "on_floor(mug, private_office)",
    )
    assert [str(r) for r in settled.relations] == ["on_top(mug, desk@private_office)"]
    both = narrow([said], house("private_office", "shared_office"), default_ontology())
    assert both.tasks[0].goal == said.goal


def test_what_cannot_do_what_is_asked_is_not_meant() -> None:
    ontology = default_ontology()
    asked = task("mug", "any_furniture", goal=("inside(mug, any_furniture)",))
    settled, kinds = narrow([asked], house("bedroom"), ontology)
    assert settled == (asked,)
    assert set(kinds["any_furniture"]) == {c for c in ontology.kinds("any_furniture") if c.interior}
    assert set(kinds["any_furniture"]) < set(ontology.kinds("any_furniture"))
    kept = narrow([task("any_furniture", goal=("not on_top(any_furniture, bed)",))], house("bedroom"), ontology)
    assert kept.kinds["any_furniture"] == ontology.kinds("any_furniture")


def test_a_concept_of_which_one_category_can_becomes_that_category() -> None:
    said = task("pizza", "any_stove", goal=("inside(pizza, any_stove)", "cooked(pizza)"))
    settled, kinds = narrow([said], house("kitchen"), default_ontology())
    assert [str(d) for d in settled[0].objects] == ["pizza", "oven"]
    assert settled[0].goal == parse_goal(("inside(pizza, oven)", "cooked(pizza)"))
    assert kinds == {}


def test_unknown_concepts_are_refused_by_name() -> None:
    with pytest.raises(UnknownConcept, match="any_cabinet"):
        narrow([task("any_cabnet")], house("kitchen"), default_ontology())


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.sampled_from(CONCEPTS), min_size=1, max_size=3),
    st.lists(st.sampled_from(TYPES), min_size=1, max_size=6),
    st.sampled_from([None, *sorted(n for n in default_concepts().places if is_concept(n))]),
)
def test_narrowing_twice_is_narrowing_once(names: list[str], types: list[str], room: str | None) -> None:
    rooms, ontology = house(*types), default_ontology()
    said = task(*(str(Designator(name, room)) for name in names))
    once = narrow([said], rooms, ontology)
    assert narrow(once.tasks, rooms, ontology) == once


# --- the believed graph ----------------------------------------------------------------------------------------------


def test_a_concept_node_may_be_any_of_its_categories_the_likeliest_first() -> None:
    graph = believed_graph(house("kitchen"), frozenset(), [task("any_cabinet@kitchen")], default_ontology(), None)
    node = graph.world.nodes["any_cabinet@kitchen"]
    assert {c.name for c in node.categories} == set(default_concepts().categories("any_cabinet"))
    assert list(node.weights) == sorted(node.weights, reverse=True)
    assert sum(node.weights) == pytest.approx(1.0)
    assert node.fixed
    assert graph.room_of("any_cabinet@kitchen") == "kitchen_0"


def test_the_only_office_is_where_the_desk_of_any_office_stands() -> None:
    rooms = house("kitchen", "shared_office")
    graph = believed_graph(rooms, frozenset(), [task("desk@any_office")], default_ontology(), None)
    assert graph.room_of("desk@any_office") == "shared_office_1"


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(CONCEPTS), st.lists(st.sampled_from(TYPES), min_size=1, max_size=8), st.booleans())
def test_the_belief_of_a_concept_is_the_mixture_of_its_categories(name: str, types: list[str], stated: bool) -> None:
    rooms = house(*types)
    infos = [RoomInfo(room.id, room.type, 12.0) for room in rooms.values()]
    designator = str(Designator(name, types[0] if stated and types.count(types[0]) > 1 else None))
    prior = load_prior("uniform")
    graph = believed_graph(rooms, frozenset(), [task(designator)], default_ontology(), None)
    belief = Belief.over(graph, infos, prior)[designator]
    assert belief.sum() == pytest.approx(1.0)
    assert (belief >= 0.0).all()
    if "@" in designator:
        assert all((p > 0.0) == (info.type == types[0]) for p, info in zip(belief, infos, strict=True))


def test_the_mixture_follows_the_weights_exactly() -> None:
    rooms = house("kitchen", "bathroom", "bathroom", "garage", "utility_room")
    infos = [RoomInfo(room.id, room.type, 12.0) for room in rooms.values()]
    prior = load_prior("choice")
    graph = believed_graph(rooms, frozenset(), [task("any_sink")], default_ontology(), None)
    node = graph.world.nodes["any_sink"]
    expected = sum(w * prior(c.name, infos) for w, c in zip(node.weights, node.categories, strict=True))
    np.testing.assert_allclose(Belief.over(graph, infos, prior)["any_sink"], expected)


# --- weights ---------------------------------------------------------------------------------------------------------


@settings(deadline=None)
@given(st.sampled_from(CONCEPTS), st.lists(st.sampled_from(TYPES), min_size=1, max_size=10))
def test_weights_are_a_distribution(name: str, types: list[str]) -> None:
    weights = category_weights(default_concepts().categories(name), types)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights > 0.0).all()


def test_the_house_decides_what_a_word_likely_means() -> None:
    kinds = default_concepts().categories("any_bed")
    at_home = dict(zip(kinds, category_weights(kinds, ["bedroom", "bedroom"]), strict=True))
    in_the_infirmary = dict(zip(kinds, category_weights(kinds, ["infirmary"]), strict=True))
    assert max(at_home, key=lambda kind: at_home[kind]) == "bed"
    assert in_the_infirmary["hospital_bed"] > at_home["hospital_bed"]


def test_a_piece_that_was_rejected_is_no_sign_of_the_one_that_was_meant() -> None:
    rooms = house("kitchen", "bathroom")
    infos = [RoomInfo(room.id, room.type, 12.0) for room in rooms.values()]
    graph = believed_graph(rooms, frozenset(), [task("any_cabinet")], default_ontology(), None)
    seen = SceneGraph(
        World.of(rooms, frozenset(), {"top_cabinet_0": Node("top_cabinet_0", default_ontology()["top_cabinet"], True)}),
        {"top_cabinet_0": Support(Relation.FLOOR, "bathroom_1")},
        {},
    )
    evidence = Seen(seen, frozenset({"bathroom_1"}))
    start = Belief.over(graph, infos, load_prior("uniform"))
    assert start.update(graph, evidence, {})["any_cabinet"].tolist() == [0.0, 1.0]
    assert start.update(graph, evidence, {}, {"top_cabinet_0"})["any_cabinet"].tolist() == [1.0, 0.0]


class Seen(NamedTuple):
    graph: SceneGraph
    searched: frozenset[str]
