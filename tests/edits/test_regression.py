"""What actions of one's own need is brought about: each kind of need, hints, chains of effects, and choices."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.worlds import kitchen

from gavel_agents.edits.repair import Repaired, repair
from gavel_env.world_model.actions import parse_action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.own_actions import OwnAction, own_state, registered

for _state in ("tried", "stage_a", "stage_b", "stage_c", "stage_d"):
    own_state(_state)

TABLE = "breakfast_table_0"
TAKE_APPLE = "NAVIGATE_TO(apple_0) GRASP(apple_0)"


def mend(start: SceneGraph, plan: str, goal: str, profile: Profile = Profile.PAPER) -> Repaired:
    return repair(start, tuple(parse_action(step) for step in plan.split(" ; ") if step), goal, profile=profile)


def inserted(repaired: Repaired) -> str:
    """Return what the first edit put before the failing step."""
    edit = repaired.edits[0]
    assert edit.rule == "bring_about_needs"
    return edit.change.removeprefix("insert ")


# --- every kind of need --------------------------------------------------------------------------------------------

NEEDS = [
    ("near(x)", "bowl_0", {}, "NAVIGATE_TO(bowl_0)"),
    ("accessible(x)", "steak_0", {}, "NAVIGATE_TO(fridge_0) OPEN(fridge_0)"),
    ("holding(x)", "apple_0", {}, TAKE_APPLE),
    ("opened(x)", "fridge_0", {}, "NAVIGATE_TO(fridge_0) OPEN(fridge_0)"),
    ("open(x)", "fridge_0", {}, "NAVIGATE_TO(fridge_0) OPEN(fridge_0)"),
    ("not open(x)", "oven_0", {"open": ["oven_0"]}, "NAVIGATE_TO(oven_0) CLOSE(oven_0)"),
    ("toggled(x)", "floor_lamp_0", {}, "NAVIGATE_TO(floor_lamp_0) TOGGLE_ON(floor_lamp_0)"),
    ("not toggled(x)", "stove_0", {"toggled": ["stove_0"]}, "NAVIGATE_TO(stove_0) TOGGLE_OFF(stove_0)"),
    (
        "cooked(x)",
        "apple_0",
        {},
        f"{TAKE_APPLE} NAVIGATE_TO(oven_0) OPEN(oven_0) PLACE_INSIDE(oven_0) CLOSE(oven_0) "
        "TOGGLE_ON(oven_0) TOGGLE_OFF(oven_0)",
    ),
    (
        "not dirty(x)",
        "bowl_0",
        {"dirty": ["bowl_0"]},
        "NAVIGATE_TO(bowl_0) GRASP(bowl_0) NAVIGATE_TO(dishwasher_0) OPEN(dishwasher_0) PLACE_INSIDE(dishwasher_0) "
        "CLOSE(dishwasher_0) TOGGLE_ON(dishwasher_0) TOGGLE_OFF(dishwasher_0)",
    ),
    (
        "frozen(x)",
        "apple_0",
        {},
        f"{TAKE_APPLE} NAVIGATE_TO(fridge_0) OPEN(fridge_0) PLACE_INSIDE(fridge_0) CLOSE(fridge_0)",
    ),
]


@pytest.mark.parametrize(("need", "thing", "flags", "stretch"), NEEDS, ids=[f"{n[0]} {n[1]}" for n in NEEDS])
def test_what_is_needed_is_brought_about_before_the_step(
    need: str, thing: str, flags: dict[str, list[str]], stretch: str
) -> None:
    with registered(OwnAction("TRY", needs=(need,), effects=("tried(x)",))):
        repaired = mend(kitchen(near=(), flags=flags), f"TRY({thing})", f"tried({thing})")
        assert inserted(repaired) == stretch
        assert repaired.verdict.valid


@pytest.mark.parametrize(
    ("need", "stretch"),
    [
        (f"on_top(apple_0, {TABLE})", f"{TAKE_APPLE} NAVIGATE_TO({TABLE}) PLACE_ON_TOP({TABLE})"),
        ("inside(apple_0, bowl_0)", f"{TAKE_APPLE} NAVIGATE_TO(bowl_0) PLACE_INSIDE(bowl_0)"),
    ],
)
def test_a_relation_is_brought_about_as_it_is_asked(need: str, stretch: str) -> None:
    name, rest = need.split("(", 1)
    first, second = rest.rstrip(")").split(", ")
    with registered(OwnAction("TRY", ("x", "y"), needs=(f"{name}(x, y)",), effects=("tried(x)",))):
        repaired = mend(kitchen(near=()), f"TRY({first}, {second})", f"tried({first})")
        assert inserted(repaired) == stretch
        assert repaired.verdict.valid


def test_a_hand_that_shall_be_free_puts_down_what_it_holds() -> None:
    with registered(OwnAction("TRY", needs=("hand_free(x)",), effects=("tried(x)",))):
        repaired = mend(kitchen(near=()), "NAVIGATE_TO(apple_0) ; GRASP(apple_0) ; TRY(bowl_0)", "tried(bowl_0)")
        assert inserted(repaired) == "PLACE_ON_TOP(countertop_0)"
        assert repaired.verdict.valid


def test_the_profile_s_empty_hand_holds_for_what_is_brought_about_too() -> None:
    with registered(OwnAction("TRY", needs=("open(x)",), effects=("tried(x)",))):
        held = "NAVIGATE_TO(bowl_0) ; GRASP(bowl_0) ; TRY(fridge_0)"
        paper = mend(kitchen(near=()), held, "tried(fridge_0)")
        assert inserted(paper) == "NAVIGATE_TO(fridge_0) OPEN(fridge_0)"
        strict = mend(kitchen(near=()), held, "tried(fridge_0)", Profile.OMNIGIBSON)
        assert inserted(strict).endswith("OPEN(fridge_0) GRASP(bowl_0)")
        assert strict.verdict.valid


def never(graph: SceneGraph, x: str) -> str | None:
    return "a full moon"


@pytest.mark.parametrize(
    ("need", "thing"),
    [
        ("graspable(x)", TABLE),
        ("surface(x)", "apple_0"),
        ("interior(x)", TABLE),
        ("door(x)", TABLE),
        ("switch(x)", TABLE),
        ("not cooked(x)", "apple_0"),
        ("stage_a(x)", "apple_0"),
        ("holding(x)", "fridge_0"),
        ("open(x)", TABLE),
        ("toggled(x)", TABLE),
        ("cooked(x)", "bowl_0"),
        (never, "apple_0"),
    ],
)
def test_what_nothing_brings_about_leaves_the_step_to_be_dropped(need: object, thing: str) -> None:
    action = OwnAction("TRY", needs=(need,), effects=("tried(x)",))  # type: ignore[arg-type]
    with registered(action):
        repaired = mend(kitchen(near=(), flags={"cooked": ["apple_0"]}), f"TRY({thing})", f"tried({thing})")
        assert "bring_about_needs" not in [edit.rule for edit in repaired.edits]
        assert not repaired.verdict.valid


@pytest.mark.parametrize("target", ["napkin_7", "kitchen_0"])
def test_an_unknown_thing_is_not_brought_about(target: str) -> None:
    with registered(OwnAction("TRY", needs=("near(x)",), effects=("tried(x)",))):
        repaired = mend(kitchen(near=()), f"TRY({target})", "tried(apple_0)")
        assert "bring_about_needs" not in [edit.rule for edit in repaired.edits]


def test_what_one_need_spoils_is_brought_about_again() -> None:
    """Whoever goes to the apple leaves the bookcase, which must be near."""
    with registered(OwnAction("TRY", ("x", "y"), needs=("near(x)", "holding(y)"), effects=("tried(x)",))):
        repaired = mend(kitchen(near=()), "TRY(bookcase_0, apple_0)", "tried(bookcase_0)")
        assert inserted(repaired) == f"NAVIGATE_TO(bookcase_0) {TAKE_APPLE} NAVIGATE_TO(bookcase_0)"
        assert repaired.verdict.valid


def test_needs_that_spoil_each_other_for_ever_are_given_up() -> None:
    with registered(OwnAction("TRY", ("x", "y"), needs=("near(x)", "near(y)"), effects=("tried(x)",))):
        repaired = mend(kitchen(near=()), "TRY(bookcase_0, apple_0)", "tried(bookcase_0)")
        assert not repaired.verdict.valid


# --- hints ---------------------------------------------------------------------------------------------------------


def lamp_on(graph: SceneGraph, x: str) -> str | None:
    return None if graph.has(Flag.TOGGLED, "floor_lamp_0") else "light"


@pytest.mark.parametrize(
    ("hint", "stretch"),
    [
        (("TOGGLE_ON(floor_lamp_0)",), "NAVIGATE_TO(floor_lamp_0) TOGGLE_ON(floor_lamp_0)"),
        (("NAVIGATE_TO(floor_lamp_0)", "TOGGLE_ON(floor_lamp_0)"), "NAVIGATE_TO(floor_lamp_0) TOGGLE_ON(floor_lamp_0)"),
        (
            ("GRASP(x)", "RELEASE()", "TOGGLE_ON(floor_lamp_0)"),
            f"{TAKE_APPLE} RELEASE() NAVIGATE_TO(floor_lamp_0) TOGGLE_ON(floor_lamp_0)",
        ),
    ],
)
def test_a_hint_is_followed_and_what_it_names_gone_to(hint: tuple[str, ...], stretch: str) -> None:
    with registered(OwnAction("TRY", needs=(lamp_on,), effects=("tried(x)",), hints={"lamp on": hint})):
        repaired = mend(kitchen(near=()), "TRY(apple_0)", "tried(apple_0)")
        assert inserted(repaired) == stretch
        assert repaired.verdict.valid


@pytest.mark.parametrize(
    "hint",
    [("DANCE(x)",), ("GRASP(napkin_7)",), ("GRASP(fridge_0)",), ("OPEN(bookcase_0)",), ("NAVIGATE_TO(apple_0)",)],
)
def test_a_hint_that_does_not_help_is_given_up(hint: tuple[str, ...]) -> None:
    with registered(OwnAction("TRY", needs=(lamp_on,), effects=("tried(x)",), hints={"lamp on": hint})):
        repaired = mend(kitchen(near=()), "TRY(apple_0)", "tried(apple_0)")
        assert "bring_about_needs" not in [edit.rule for edit in repaired.edits]


# --- effects of other actions --------------------------------------------------------------------------------------

A, B, C, D = (f"stage_{letter}(x)" for letter in "abcd")


@pytest.fixture
def chain() -> Iterator[None]:
    with registered(
        OwnAction("MAKE_A", needs=(B,), effects=(A,)),
        OwnAction("MAKE_B", needs=(C,), effects=(B,)),
        OwnAction("MAKE_C", needs=(D,), effects=(C,)),
        OwnAction("MAKE_D", effects=(D,)),
        OwnAction("UNDO_A", needs=("near(x)",), effects=("not stage_a(x)",)),
    ):
        yield


@pytest.mark.usefixtures("chain")
def test_regression_goes_three_actions_deep_and_no_deeper() -> None:
    step = "MAKE_D(apple_0) MAKE_C(apple_0) MAKE_B(apple_0)"
    assert inserted(mend(kitchen(near=()), "MAKE_A(apple_0)", "stage_a(apple_0)")) == step
    from_nothing = mend(kitchen(near=()), "", "stage_b(apple_0)")
    assert [edit.rule for edit in from_nothing.edits] == ["act_for"]
    assert " ".join(map(str, from_nothing.plan)) == step
    assert not mend(kitchen(near=()), "", "stage_a(apple_0)").verdict.valid


@pytest.mark.usefixtures("chain")
def test_a_state_is_taken_away_by_what_takes_it() -> None:
    start = kitchen(near=(), flags={"cooked": ["apple_0"]})
    marked = mend(start, "MAKE_D(apple_0)", "stage_d(apple_0)").verdict.end
    assert not mend(marked, "", "not stage_d(apple_0)").verdict.valid, "nothing takes it away"
    made = mend(marked, "MAKE_C(apple_0) ; MAKE_B(apple_0) ; MAKE_A(apple_0)", "stage_a(apple_0)")
    assert made.verdict.valid
    undone = mend(made.verdict.end, "", "not stage_a(apple_0)")
    assert " ".join(map(str, undone.plan)) == "NAVIGATE_TO(apple_0) UNDO_A(apple_0)"
    assert mend(made.verdict.end, "", "stage_a(apple_0)").plan == ()


@pytest.mark.parametrize(
    ("plan", "cover"),
    [
        ("", "apple_0"),  # the first that can be lifted
        ("NAVIGATE_TO(textbook_0) ; OPEN(backpack_0) ; CLOSE(backpack_0)", "backpack_0"),  # what the plan names
        ("NAVIGATE_TO(backpack_0) ; OPEN(backpack_0) ; GRASP(textbook_0) ; CLOSE(backpack_0)", "textbook_0"),  # is held
    ],
)
def test_the_other_arguments_are_things_that_afford_it_first_what_needs_least(plan: str, cover: str) -> None:
    cover_it = OwnAction("COVER", ("x", "y"), needs=("holding(y)", "near(x)"), effects=("tried(x)",))
    with registered(cover_it):
        repaired = mend(kitchen(near=()), plan, "tried(bowl_0)")
        assert repaired.verdict.valid
        assert str(repaired.plan[-1]) == f"COVER(bowl_0, {cover})"


def test_what_an_action_cannot_do_to_a_thing_is_not_tried() -> None:
    with registered(OwnAction("TRY", needs=("switch(x)", "near(x)"), effects=("tried(x)",))):
        assert not mend(kitchen(near=()), "", "tried(apple_0)").edits
        assert mend(kitchen(near=()), "", "tried(stove_0)").verdict.valid
    with registered(OwnAction("TRY", ("x", "y"), needs=("switch(y)", "near(y)"), effects=("tried(x)",))):
        found = mend(kitchen(near=()), "", "tried(apple_0)")
        assert str(found.plan[-1]) == "TRY(apple_0, oven_0)"


def test_without_actions_of_ones_own_a_state_of_ones_own_is_left_to_the_model() -> None:
    assert mend(kitchen(near=()), "", "tried(apple_0)").edits == ()
