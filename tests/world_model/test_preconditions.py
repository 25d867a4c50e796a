"""Preconditions: each of the table's fails alone and holds, for both rules profiles."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from support.worlds import KITCHEN, kitchen, opened

from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import RULES, Profile, Violation, ViolationKind, first_violation, violations
from gavel_env.world_model.graph import SceneGraph

K = ViolationKind
HELD_APPLE = {"apple_0": "held"}


class Case(NamedTuple):
    """An action, a state in which exactly one precondition fails, and a state in which none does."""

    action: str
    refused: SceneGraph
    violation: Violation
    allowed: SceneGraph


def without(*gone: str) -> tuple[str, ...]:
    return tuple(o for o in KITCHEN if o not in gone)


UNKNOWN = Violation(K.UNKNOWN_OBJECT, "piano_0")
ROOM = Violation(K.ROOM_TARGET, "kitchen_0")
STEAK_SHUT_IN = Violation(K.CLOSED, "steak_0", "fridge_0")
# A box inside a shut fridge: whatever is done to it, the fridge is in the way.
BOXED = {"backpack_0": "in fridge_0", "blender_0": "in fridge_0"}
TRAY = {"bowl_0": "held", "apple_0": "in bowl_0"}

CASES = {
    "navigate, unknown": Case("NAVIGATE_TO(piano_0)", kitchen(), UNKNOWN, kitchen()),
    "navigate, room": Case("NAVIGATE_TO(kitchen_0)", kitchen(), ROOM, kitchen()),
    "navigate, hidden": Case(
        "NAVIGATE_TO(steak_0)", kitchen(), Violation(K.HIDDEN, "steak_0", "fridge_0"), opened("fridge_0")
    ),
    "grasp, not near": Case(
        "GRASP(apple_0)", kitchen(near=without("apple_0")), Violation(K.NOT_NEAR, "apple_0"), kitchen()
    ),
    "grasp, hand full": Case(
        "GRASP(bowl_0)", kitchen(HELD_APPLE), Violation(K.HAND_FULL, "bowl_0", "apple_0"), kitchen()
    ),
    "grasp, shut in": Case("GRASP(steak_0)", kitchen(), STEAK_SHUT_IN, opened("fridge_0")),
    "grasp, furniture": Case(
        "GRASP(oven_0)", kitchen(), Violation(K.NOT_GRASPABLE, "oven_0"), kitchen({"oven_0": "floor kitchen_0"})
    ),
    "release, nothing held": Case("RELEASE()", kitchen(), Violation(K.HAND_EMPTY, ""), kitchen(HELD_APPLE)),
    "on top, nothing held": Case(
        "PLACE_ON_TOP(countertop_0)", kitchen(), Violation(K.HAND_EMPTY, "countertop_0"), kitchen(HELD_APPLE)
    ),
    "on top, not near": Case(
        "PLACE_ON_TOP(countertop_0)",
        kitchen(HELD_APPLE, near=without("countertop_0")),
        Violation(K.NOT_NEAR, "countertop_0"),
        kitchen(HELD_APPLE),
    ),
    "on top, no surface": Case(
        "PLACE_ON_TOP(floor_lamp_0)",
        kitchen(HELD_APPLE),
        Violation(K.NO_SURFACE, "floor_lamp_0"),
        kitchen(HELD_APPLE),
    ),
    "on top, shut in": Case(
        "PLACE_ON_TOP(tray_0)",
        kitchen({**HELD_APPLE, "tray_0": "in fridge_0"}),
        Violation(K.CLOSED, "tray_0", "fridge_0"),
        opened("fridge_0", moved={**HELD_APPLE, "tray_0": "in fridge_0"}),
    ),
    "inside, nothing held": Case(
        "PLACE_INSIDE(bookcase_0)", kitchen(), Violation(K.HAND_EMPTY, "bookcase_0"), kitchen(HELD_APPLE)
    ),
    "inside, not near": Case(
        "PLACE_INSIDE(bookcase_0)",
        kitchen(HELD_APPLE, near=without("bookcase_0")),
        Violation(K.NOT_NEAR, "bookcase_0"),
        kitchen(HELD_APPLE),
    ),
    "inside, no interior": Case(
        "PLACE_INSIDE(floor_lamp_0)",
        kitchen(HELD_APPLE),
        Violation(K.NO_INTERIOR, "floor_lamp_0"),
        kitchen(HELD_APPLE),
    ),
    "inside, shut": Case(
        "PLACE_INSIDE(fridge_0)",
        kitchen(HELD_APPLE),
        Violation(K.CLOSED, "fridge_0", "fridge_0"),
        opened("fridge_0", moved=HELD_APPLE),
    ),
    "inside, shut in": Case(
        "PLACE_INSIDE(bowl_0)",
        kitchen({**HELD_APPLE, "bowl_0": "in fridge_0"}),
        Violation(K.CLOSED, "bowl_0", "fridge_0"),
        opened("fridge_0", moved={**HELD_APPLE, "bowl_0": "in fridge_0"}),
    ),
    "inside, cycle": Case(
        "PLACE_INSIDE(bowl_0)",
        kitchen({"backpack_0": "held", "bowl_0": "in backpack_0"}, flags={"open": ("backpack_0",)}),
        Violation(K.CYCLE, "bowl_0", "backpack_0"),
        kitchen({"backpack_0": "held"}),
    ),
    "inside, itself": Case(
        "PLACE_INSIDE(bowl_0)",
        kitchen({"bowl_0": "held"}),
        Violation(K.SELF_PLACEMENT, "bowl_0", "bowl_0"),
        kitchen(HELD_APPLE),
    ),
    "on top, cycle": Case(
        "PLACE_ON_TOP(tray_0)",
        kitchen({"bowl_0": "held", "tray_0": "in bowl_0"}),
        Violation(K.CYCLE, "tray_0", "bowl_0"),
        kitchen({"bowl_0": "held", "tray_0": "on countertop_0"}),
    ),
    "on top, itself": Case(
        "PLACE_ON_TOP(tray_0)",
        kitchen({"tray_0": "held"}),
        Violation(K.SELF_PLACEMENT, "tray_0", "tray_0"),
        kitchen({**HELD_APPLE, "tray_0": "on countertop_0"}),
    ),
    "open, not near": Case(
        "OPEN(fridge_0)", kitchen(near=without("fridge_0")), Violation(K.NOT_NEAR, "fridge_0"), kitchen()
    ),
    "open, no door": Case("OPEN(countertop_0)", kitchen(), Violation(K.NO_DOOR, "countertop_0"), kitchen()),
    "open, shut in": Case(
        "OPEN(backpack_0)",
        kitchen(BOXED),
        Violation(K.CLOSED, "backpack_0", "fridge_0"),
        opened("fridge_0", moved=BOXED),
    ),
    "close, not near": Case(
        "CLOSE(fridge_0)", kitchen(near=without("fridge_0")), Violation(K.NOT_NEAR, "fridge_0"), kitchen()
    ),
    "close, no door": Case("CLOSE(countertop_0)", kitchen(), Violation(K.NO_DOOR, "countertop_0"), kitchen()),
    "close, shut in": Case(
        "CLOSE(backpack_0)",
        opened("backpack_0", moved=BOXED),
        Violation(K.CLOSED, "backpack_0", "fridge_0"),
        opened("fridge_0", "backpack_0", moved=BOXED),
    ),
    "on, not near": Case(
        "TOGGLE_ON(stove_0)", kitchen(near=without("stove_0")), Violation(K.NOT_NEAR, "stove_0"), kitchen()
    ),
    "on, no switch": Case("TOGGLE_ON(fridge_0)", kitchen(), Violation(K.NO_SWITCH, "fridge_0"), kitchen()),
    "on, shut in": Case(
        "TOGGLE_ON(blender_0)",
        kitchen(BOXED),
        Violation(K.CLOSED, "blender_0", "fridge_0"),
        opened("fridge_0", moved=BOXED),
    ),
    "on, door open": Case(
        "TOGGLE_ON(microwave_0)",
        opened("microwave_0"),
        Violation(K.DOOR_OPEN, "microwave_0", "microwave_0"),
        kitchen(),
    ),
    "off, not near": Case(
        "TOGGLE_OFF(stove_0)", kitchen(near=without("stove_0")), Violation(K.NOT_NEAR, "stove_0"), kitchen()
    ),
    "off, no switch": Case("TOGGLE_OFF(fridge_0)", kitchen(), Violation(K.NO_SWITCH, "fridge_0"), kitchen()),
    "off, shut in": Case(
        "TOGGLE_OFF(blender_0)",
        kitchen(BOXED),
        Violation(K.CLOSED, "blender_0", "fridge_0"),
        opened("fridge_0", moved=BOXED),
    ),
}
# Conditions that the category alone decides: the allowed state is the same action on another piece.
OTHER_PIECE = {
    "navigate, unknown": "NAVIGATE_TO(oven_0)",
    "navigate, room": "NAVIGATE_TO(oven_0)",
    "grasp, furniture": "GRASP(bowl_0)",
    "on top, no surface": "PLACE_ON_TOP(countertop_0)",
    "inside, no interior": "PLACE_INSIDE(bookcase_0)",
    "open, no door": "OPEN(fridge_0)",
    "close, no door": "CLOSE(fridge_0)",
    "on, no switch": "TOGGLE_ON(stove_0)",
    "off, no switch": "TOGGLE_OFF(stove_0)",
    "inside, cycle": "PLACE_INSIDE(bookcase_0)",
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("profile", Profile)
def test_precondition_fails_alone(name: str, profile: Profile) -> None:
    case = CASES[name]
    action = parse_action(case.action)
    operates = action.primitive in (Primitive.OPEN, Primitive.CLOSE, Primitive.TOGGLE_ON, Primitive.TOGGLE_OFF)
    assert first_violation(case.refused, action, profile) == case.violation
    assert violations(case.refused, action, profile) == (case.violation,)
    assert operates or first_violation(case.refused, action, Profile.PAPER) == case.violation


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("profile", Profile)
def test_precondition_holds(name: str, profile: Profile) -> None:
    case = CASES[name]
    action = parse_action(OTHER_PIECE.get(name, case.action))
    assert violations(case.allowed, action, profile) == ()


def test_cases_cover_every_precondition_of_the_table() -> None:
    kinds_of = {
        "known": {K.UNKNOWN_OBJECT, K.ROOM_TARGET},
        "_not_hidden": {K.HIDDEN},
        "accessible": {K.CLOSED},
        "near": {K.NOT_NEAR},
        "graspable": {K.NOT_GRASPABLE},
        "hand_free": {K.HAND_FULL},
        "_hand_holds": {K.HAND_EMPTY},
        "surface": {K.NO_SURFACE},
        "interior": {K.NO_INTERIOR},
        "opened": {K.CLOSED},
        "_not_itself": {K.SELF_PLACEMENT},
        "_no_cycle": {K.CYCLE},
        "door": {K.NO_DOOR},
        "switch": {K.NO_SWITCH},
        "_door_shut": {K.DOOR_OPEN},
    }
    tested = {(parse_action(c.action).primitive, c.violation.kind) for c in CASES.values()}
    for primitive, row in RULES.items():
        for check in row.preconditions:
            if check.__name__ == "known" and primitive is not Primitive.NAVIGATE_TO:
                continue  # tested for all primitives below
            assert {(primitive, kind) for kind in kinds_of[check.__name__]} <= tested, (primitive, check.__name__)


@pytest.mark.parametrize("primitive", [p for p in Primitive if p.takes_target])
def test_unknown_names_and_rooms_are_no_targets(primitive: Primitive) -> None:
    graph = kitchen(HELD_APPLE)
    assert violations(graph, Action(primitive, "piano_0")) == (UNKNOWN,)
    assert violations(graph, Action(primitive, "kitchen_0")) == (ROOM,)


@pytest.mark.parametrize("text", ["OPEN(fridge_0)", "CLOSE(fridge_0)", "TOGGLE_ON(stove_0)", "TOGGLE_OFF(stove_0)"])
def test_profiles_differ_in_the_hand_at_doors_and_switches(text: str) -> None:
    action = parse_action(text)
    full = kitchen(HELD_APPLE)
    refusal = Violation(K.HAND_FULL, action.target or "", "apple_0")
    assert violations(full, action, Profile.PAPER) == ()
    assert violations(full, action, Profile.OMNIGIBSON) == (refusal,)
    assert violations(kitchen(), action, Profile.OMNIGIBSON) == ()


def test_several_violations_come_in_table_order() -> None:
    graph = kitchen({"steak_0": "in fridge_0"} | HELD_APPLE, near=("apple_0",))
    kinds = [v.kind for v in violations(graph, Action(Primitive.GRASP, "steak_0"))]
    assert kinds == [K.NOT_NEAR, K.HAND_FULL, K.CLOSED]
    assert first_violation(graph, Action(Primitive.GRASP, "steak_0")) == Violation(K.NOT_NEAR, "steak_0")
