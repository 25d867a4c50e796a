"""Short stretches of plan: what each brings about, what it shuts again, and when it gives up."""

from __future__ import annotations

import pytest
from support.worlds import kitchen, opened

from gavel_agents.edits.sketch import Sketch, outermost_shut
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import parse_goal
from gavel_env.world_model.graph import Relation, SceneGraph

NESTED = {"backpack_0": "in fridge_0"}
NO_GOAL = parse_goal(())


def steps(sketch: Sketch) -> str:
    return " ".join(map(str, sketch.plan))


def test_the_outermost_shut_container_is_opened_first() -> None:
    assert outermost_shut(kitchen(NESTED), "textbook_0") == "fridge_0"
    assert outermost_shut(opened("fridge_0", moved=NESTED), "textbook_0") == "backpack_0"
    assert outermost_shut(kitchen(NESTED), "apple_0") is None
    sketch = Sketch(kitchen(NESTED, near=()))
    assert sketch.reach("textbook_0")
    assert steps(sketch) == "NAVIGATE_TO(fridge_0) OPEN(fridge_0) OPEN(backpack_0)"
    assert sketch.shut()
    assert steps(sketch).endswith("OPEN(backpack_0) CLOSE(backpack_0) CLOSE(fridge_0)")
    assert sketch.shut()  # what is shut is not shut again
    assert steps(sketch).count("CLOSE") == 2


def test_what_stands_open_already_is_not_shut_by_the_sketch() -> None:
    sketch = Sketch(opened("fridge_0"))
    assert sketch.reach("steak_0")
    assert sketch.open("fridge_0")
    assert sketch.shut()
    assert sketch.plan == ()


def test_a_sketch_that_only_shuts_what_is_near_leaves_the_rest_for_later() -> None:
    sketch = Sketch(kitchen(near=()))
    assert sketch.reach("steak_0")
    assert sketch.approach("bookcase_0")
    assert sketch.shut(only_near=True)
    assert "CLOSE" not in steps(sketch)
    assert sketch.shut()
    assert steps(sketch).endswith("NAVIGATE_TO(bookcase_0) NAVIGATE_TO(fridge_0) CLOSE(fridge_0)")


@pytest.mark.parametrize(
    ("but", "shut"),
    [
        (None, ["backpack_0", "fridge_0"]),
        ("backpack_0", []),
        ("fridge_0", ["backpack_0"]),
        ("oven_0", ["backpack_0", "fridge_0"]),
    ],
)
def test_what_is_needed_next_and_what_is_around_it_is_left_open(but: str | None, shut: list[str]) -> None:
    sketch = Sketch(kitchen(NESTED, near=()))
    assert sketch.reach("textbook_0")
    before = len(sketch.plan)
    assert sketch.shut(only_near=True, but=but)
    assert [a.target for a in sketch.plan[before:]] == shut
    assert sketch.shut()
    assert [a.target for a in sketch.plan[before:]] == ["backpack_0", "fridge_0"]


def test_a_free_hand_is_waited_for_where_the_rules_want_one() -> None:
    sketch = Sketch(kitchen(near=()), Profile.OMNIGIBSON)
    assert sketch.take("steak_0")
    assert sketch.shut(only_near=True)
    assert "CLOSE" not in steps(sketch)
    assert sketch.put(Relation.ON_TOP, "stove_0")
    assert sketch.shut()
    assert steps(sketch).endswith("PLACE_ON_TOP(stove_0) NAVIGATE_TO(fridge_0) CLOSE(fridge_0)")


@pytest.mark.parametrize(
    ("held", "near", "put"),
    [
        ("apple_0", ("stove_0", "countertop_0"), "PLACE_ON_TOP(countertop_0)"),  # by name
        ("apple_0", ("backpack_0", "stove_0"), "PLACE_ON_TOP(stove_0)"),
        ("apple_0", (), "RELEASE()"),
        ("apple_0", ("steak_0",), "RELEASE()"),
        ("bowl_0", ("steak_0", "fridge_0"), "PLACE_ON_TOP(fridge_0)"),
    ],
)
def test_things_are_set_down_on_a_surface_near_or_on_the_floor(held: str, near: tuple[str, ...], put: str) -> None:
    sketch = Sketch(kitchen({held: "held"}, near=(held, *near)))
    assert sketch.set_down()
    assert steps(sketch) == put
    assert sketch.graph.holding is None


def test_nothing_is_set_down_where_a_door_can_shut_it_away() -> None:
    moved = {"bowl_0": "held", "tray_0": "in fridge_0"}
    sketch = Sketch(kitchen(moved, near=("bowl_0", "tray_0"), flags={"open": ("fridge_0",)}))
    assert sketch.set_down()
    assert steps(sketch) == "RELEASE()"


def graph_with(held: str | None = None, **state: object) -> SceneGraph:
    return kitchen({} if held is None else {held: "held"}, **state)


@pytest.mark.parametrize(
    ("graph", "appliance", "goal", "run"),
    [
        (graph_with(near=()), "oven_0", (), "NAVIGATE_TO(oven_0) TOGGLE_ON(oven_0) TOGGLE_OFF(oven_0)"),
        (opened("oven_0"), "oven_0", (), "CLOSE(oven_0) TOGGLE_ON(oven_0) TOGGLE_OFF(oven_0)"),
        (graph_with(), "oven_0", ("toggled(oven)",), "TOGGLE_ON(oven_0)"),
        (graph_with(), "oven_0", ("not toggled(oven)",), "TOGGLE_ON(oven_0) TOGGLE_OFF(oven_0)"),
        (graph_with(), "floor_lamp_0", (), "TOGGLE_ON(floor_lamp_0)"),
        (opened("fridge_0"), "fridge_0", (), "CLOSE(fridge_0)"),
        (graph_with(), "fridge_0", (), ""),
        (graph_with(), "breakfast_table_0", (), ""),
        (graph_with(), "napkin_7", (), None),
    ],
)
def test_an_appliance_is_run_shut_and_switched_off_unless_it_shall_be_on(
    graph: SceneGraph, appliance: str, goal: tuple[str, ...], run: str | None
) -> None:
    sketch = Sketch(graph)
    assert sketch.run(appliance, parse_goal(goal)) is (run is not None)
    assert steps(sketch) == (run or "")


def test_what_is_taken_is_brought_and_what_was_opened_for_it_shut_on_the_way() -> None:
    sketch = Sketch(kitchen(near=()))
    assert sketch.bring("steak_0", Relation.INSIDE, "oven_0")
    assert steps(sketch) == (
        "NAVIGATE_TO(fridge_0) OPEN(fridge_0) GRASP(steak_0) CLOSE(fridge_0) "
        "NAVIGATE_TO(oven_0) OPEN(oven_0) PLACE_INSIDE(oven_0) CLOSE(oven_0)"
    )
    within = Sketch(kitchen(near=()))
    assert within.bring("textbook_0", Relation.FLOOR, "backpack_0")
    assert steps(within) == ("NAVIGATE_TO(backpack_0) OPEN(backpack_0) GRASP(textbook_0) RELEASE() CLOSE(backpack_0)")


def test_a_held_thing_is_not_taken_again_and_another_is_set_down_first() -> None:
    sketch = Sketch(kitchen({"apple_0": "held"}))
    assert sketch.take("apple_0")
    assert not sketch.plan
    assert sketch.take("bowl_0")
    assert [a.primitive for a in sketch.plan] == [Primitive.PLACE_ON_TOP, Primitive.GRASP]


@pytest.mark.parametrize("obj", ["fridge_0", "napkin_7"])
def test_what_cannot_be_taken_is_not(obj: str) -> None:
    assert not Sketch(kitchen()).take(obj)


def test_a_place_without_surface_interior_or_name_takes_nothing() -> None:
    for relation, place in ((Relation.ON_TOP, "apple_0"), (Relation.INSIDE, "stove_0"), (Relation.FLOOR, "napkin_7")):
        assert not Sketch(kitchen({"bowl_0": "held"})).put(relation, place)


def test_a_fork_goes_its_own_way_until_it_is_adopted() -> None:
    sketch = Sketch(kitchen(near=()), Profile.OMNIGIBSON)
    assert sketch.reach("steak_0")
    trial = sketch.fork()
    assert trial.take("steak_0")
    assert steps(sketch) == "NAVIGATE_TO(fridge_0) OPEN(fridge_0)"
    before = sketch.graph
    assert before.holding is None
    sketch.adopt(trial)
    assert sketch.plan == trial.plan
    assert sketch.graph.holding == "steak_0"
    assert sketch.shut()  # what the fork inherited as opened is remembered, and its profile
    assert steps(sketch).endswith("PLACE_ON_TOP(fridge_0) CLOSE(fridge_0) GRASP(steak_0)")
