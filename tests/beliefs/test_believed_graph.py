"""The believed graph: what is stated is inserted, what can be moved is movable, what is seen is taken over."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.worlds import kitchen

from gavel_agents.beliefs.believed_graph import believed_graph, is_fixed, observe_flags, uncertain
from gavel_agents.beliefs.mixture import category_weights
from gavel_agents.beliefs.narrowing import narrow
from gavel_agents.rsn.data import load_contents, training_scenes
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.errors import UnknownCategory
from gavel_env.world_model.condition_text import parse_formula
from gavel_env.world_model.goals import Designator, Goal, parse_goal, parse_literal
from gavel_env.world_model.graph import Flag, Relation, Room, SceneGraph, Support
from gavel_env.world_model.ontology import default_ontology

ROOMS = {name: Room(name, kind) for name, kind in (
    ("kitchen_0", "kitchen"), ("bathroom_0", "bathroom"), ("bathroom_1", "bathroom"))}  # fmt: skip
DOORS = frozenset({("bathroom_0", "kitchen_0")})
NAMES = ("apple", "mug", "fridge", "countertop@kitchen", "toilet@bathroom", "floor_lamp")


def believed(*relations: str, names: tuple[str, ...] = NAMES, condition: str = "") -> SceneGraph:
    goal = Goal((), (parse_formula(condition),) if condition else ())
    task = TaskUnderstanding("", tuple(map(Designator.parse, names)), tuple(map(parse_literal, relations)), goal)
    return believed_graph(ROOMS, DOORS, [task], default_ontology(), "bathroom_0")


def test_without_relations_only_the_one_room_of_a_type_says_where_something_is() -> None:
    graph = believed()
    assert tuple(graph.world.nodes) == NAMES
    assert graph.world.rooms == ROOMS
    assert graph.world.connections == DOORS
    assert graph.robot_room == "bathroom_0"
    assert graph.supports == {"countertop@kitchen": Support(Relation.FLOOR, "kitchen_0")}
    assert uncertain(graph) == ("apple", "mug", "fridge", "toilet@bathroom", "floor_lamp")
    assert graph.world.nodes["toilet@bathroom"].stated_room == "bathroom"


@pytest.mark.parametrize(
    ("relation", "node", "support"),
    [
        ("inside(apple, fridge)", "apple", Support(Relation.INSIDE, "fridge")),
        ("on_top(mug, countertop@kitchen)", "mug", Support(Relation.ON_TOP, "countertop@kitchen")),
        ("in_room(apple, kitchen)", "apple", Support(Relation.FLOOR, "kitchen_0")),
        ("in_room(apple, bathroom_1)", "apple", Support(Relation.FLOOR, "bathroom_1")),
        ("in_room(apple, bathroom)", "apple", None),
        ("next_to(mug, apple)", "mug", None),
    ],
)
def test_a_stated_relation_is_inserted(relation: str, node: str, support: Support | None) -> None:
    assert believed(relation).supports.get(node) == support


def test_a_room_type_of_several_rooms_bounds_where_something_may_be() -> None:
    assert believed("in_room(apple, bathroom)").world.nodes["apple"].stated_room == "bathroom"
    assert believed("in_room(apple, kitchen)").world.nodes["apple"].stated_room is None


@pytest.mark.parametrize("relation", ["next_to(mug, apple)", "next_to(apple, mug)", "under(mug, apple)"])
def test_what_is_beside_or_under_something_is_kept_as_an_ordered_pair(relation: str) -> None:
    assert believed(relation).next_to == {("apple", "mug")}
    both = believed(relation, "next_to(fridge, floor_lamp)")
    assert both.next_to == {("apple", "mug"), ("floor_lamp", "fridge")}


def test_states_are_inserted_and_taken_back() -> None:
    graph = believed("open(fridge)", "toggled(floor_lamp)", "cooked(apple)", "not toggled(floor_lamp)")
    assert {flag: graph.flags[flag] for flag in Flag if graph.flags[flag]} == {
        Flag.OPEN: {"fridge"}, Flag.COOKED: {"apple"},
    }  # fmt: skip


def test_a_name_that_no_category_has_is_an_error_and_an_index_is_passed_over() -> None:
    assert believed(names=("apple_3",)).world.nodes["apple_3"].category.name == "apple"
    with pytest.raises(UnknownCategory, match="zorgle"):
        believed(names=("zorgle",))


@pytest.mark.parametrize(
    ("condition", "moved"),
    [
        ("", False),
        ("(on_floor {x} kitchen)", True),
        ("(next_to {x} fridge)", True),
        ("(forall (?x {x} mug) (next_to ?x fridge))", True),
        ("(forall (?x mug) (next_to ?x {x}))", False),
        ("(not (dirty {x}))", False),
    ],
)
def test_what_takes_both_arms_is_movable_only_if_a_goal_wants_it_moved(condition: str, moved: bool) -> None:
    ontology = default_ontology()
    heavy = next(c for c in ontology.values() if c.carryable and not c.graspable and not c.wipes)
    names = (heavy.name, "mug", "fridge")
    node = believed(names=names, condition=condition.format(x=heavy.name)).world.nodes[heavy.name]
    assert node.fixed is not moved
    assert is_fixed(heavy, moved) is not moved


def test_flags_of_what_is_bound_are_those_that_are_seen() -> None:
    graph = believed("open(fridge)", "cooked(apple)", names=("apple", "fridge", "oven", "mug"))
    seen = kitchen(flags={"open": ("oven_0",), "toggled": ("oven_0",), "hot": ("apple_0",)})
    after = observe_flags(graph, seen, {"fridge": "fridge_0", "oven": "oven_0"})
    assert {flag: after.flags[flag] for flag in Flag if after.flags[flag]} == {
        Flag.OPEN: {"oven"},  # the fridge was said to be open and is seen to be shut
        Flag.TOGGLED: {"oven"},
        Flag.COOKED: {"apple"},  # not bound: what was said stays
    }
    assert observe_flags(graph, seen, {}) == graph


# --- concepts ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "condition",
    [
        "(on_floor mug {})",
        "(not (on_floor mug {}))",
        "(and (on_floor mug {}) (open fridge))",
        "(or (open fridge) (on_floor mug {}))",
        "(imply (on_floor mug {}) (open fridge))",
        "(imply (open fridge) (on_floor mug {}))",
        "(forall (?x mug apple) (on_floor ?x {}))",
        "(exists (?x mug apple) (on_floor ?x {}))",
        "(forn (1) (?x mug apple) (on_floor ?x {}))",
        "(forpairs (?x mug) (?y fridge) (imply (inside ?x ?y) (on_floor mug {})))",
        "(forall (?x desk@{}) (on_top mug ?x))",
        "(forpairs (?x desk@{}) (?y mug) (on_top ?y ?x))",
        "(forpairs (?y mug) (?x desk@{}) (on_top ?y ?x))",
    ],
)
def test_the_one_office_of_a_house_is_named_in_every_kind_of_condition(condition: str) -> None:
    rooms = {"private_office_0": Room("private_office_0", "private_office"), "kitchen_0": Room("kitchen_0", "kitchen")}
    said = TaskUnderstanding(
        "",
        tuple(map(Designator.parse, ("mug", "apple", "fridge", "desk@any_office"))),
        (),
        Goal((), (parse_formula(condition.format("any_office")),)),
    )
    [task], _ = narrow([said], rooms, default_ontology())
    [found] = task.goal.conditions
    assert str(found) == condition.format("private_office")
    assert [str(d) for d in task.objects] == ["mug", "apple", "fridge", "desk@private_office"]


def test_weights_without_a_room_are_all_alike_and_of_one_category_certain() -> None:
    assert category_weights(["bed", "hospital_bed"], []).tolist() == [0.5, 0.5]
    assert category_weights(["bed"], ["bedroom"]).tolist() == [1.0]


def test_weights_are_those_of_the_equation() -> None:
    contents = load_contents()
    rooms = [room for scene in training_scenes(contents) for room in contents.scenes[scene]]

    def share(category: str, kind: str) -> float:
        here = [room for room in rooms if room.type == kind]
        general = (sum(category in room.contents for room in rooms) + 0.5) / (len(rooms) + 1)
        return (sum(category in room.contents for room in here) + general) / (len(here) + 1)

    kinds, there = ("bed", "hospital_bed"), ("bedroom", "bedroom", "infirmary")
    expected = [(1 - math.prod(1 - share(c, kind) for kind in there)) / (1 + rank) for rank, c in enumerate(kinds)]
    assert category_weights(kinds, there) == pytest.approx(np.array(expected) / sum(expected))


def test_only_rooms_that_fit_what_is_stated_weigh_categories() -> None:
    rooms = {"bedroom_0": Room("bedroom_0", "bedroom"), "infirmary_0": Room("infirmary_0", "infirmary")}
    ontology = default_ontology()
    for stated, there in (
        ("infirmary", ["infirmary"]),
        (None, ["bedroom", "infirmary"]),
        ("garage", ["bedroom", "infirmary"]),
    ):
        task = TaskUnderstanding("", (Designator("any_bed", stated),), (), parse_goal(()))
        [node] = believed_graph(rooms, frozenset(), [task], ontology, None).world.nodes.values()
        names = [category.name for category in ontology.kinds("any_bed")]
        weights = dict(zip(names, category_weights(names, there), strict=True))
        assert {c.name: w for c, w in zip(node.categories, node.weights, strict=True)} == pytest.approx(weights)
    narrowed = {"any_bed": tuple(ontology.kinds("any_bed")[:1])}
    task = TaskUnderstanding("", (Designator("any_bed"),), (), parse_goal(()))
    [node] = believed_graph(rooms, frozenset(), [task], ontology, None, narrowed).world.nodes.values()
    assert node.categories == narrowed["any_bed"]


def test_presupposed_states_hold_in_the_graph_beside_what_is_said() -> None:
    task = TaskUnderstanding(
        "", (Designator("fridge"), Designator("oven")), (parse_literal("open(oven)"),), parse_goal(["not open(fridge)"])
    )
    graph = believed_graph(ROOMS, DOORS, [task], default_ontology(), None)
    assert graph.flags[Flag.OPEN] == {"fridge", "oven"}
