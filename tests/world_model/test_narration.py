"""States, actions and refusals in words: what is said, and that every command is read back."""

from __future__ import annotations

import pytest
from support.worlds import build, kitchen, opened

from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import Profile, Violation, ViolationKind, apply, first_violation
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.narration import command, commands, look, nearest_commands, outcome_text, reason


def step(graph: SceneGraph, said: str, metres: float = 0.0) -> str:
    """Return what is told of an action that the world model carries out, or why it does not."""
    action = parse_action(said)
    violation = first_violation(graph, action)
    after = graph if violation is not None else apply(graph, action)
    return outcome_text(action, graph, after, "ok" if violation is None else violation.kind.value, metres)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("NAVIGATE_TO(fridge_0)", "go to fridge_0"),
        ("GRASP(apple_0)", "take apple_0"),
        ("RELEASE()", "drop"),
        ("PLACE_ON_TOP(stove_0)", "put on stove_0"),
        ("PLACE_INSIDE(fridge_0)", "put in fridge_0"),
        ("OPEN(fridge_0)", "open fridge_0"),
        ("CLOSE(fridge_0)", "close fridge_0"),
        ("TOGGLE_ON(stove_0)", "turn on stove_0"),
        ("TOGGLE_OFF(stove_0)", "turn off stove_0"),
    ],
)
def test_a_command_is_said_as_one_says_it_and_read_back(text: str, told: str) -> None:
    action = parse_action(text)
    assert command(action) == told
    assert parse_action(told) == action


@pytest.mark.parametrize("profile", list(Profile))
@pytest.mark.parametrize("held", [None, "bowl_0"])
def test_commands_are_all_that_the_world_model_accepts_reach_first(held: str | None, profile: Profile) -> None:
    near = ("fridge_0", "steak_0", "microwave_0")
    graph = kitchen({} if held is None else {held: "held"}, near=near)
    told = commands(graph, profile, find=["apple@kitchen"])
    assert told[-1] == "find apple@kitchen"
    actions = [parse_action(said) for said in told[:-1]]
    here = {*near, held}
    every = [Action(Primitive.RELEASE)]
    every += [Action(p, obj) for obj in graph.world.nodes for p in Primitive if p.takes_target]
    accepted = {a for a in every if first_violation(graph, a, profile) is None}
    assert set(actions) == {a for a in accepted if a.primitive is not Primitive.NAVIGATE_TO or a.target not in here}
    assert len(actions) == len(set(actions))
    drives = [a.primitive is Primitive.NAVIGATE_TO for a in actions]
    assert drives == sorted(drives)
    assert (Action(Primitive.RELEASE) in actions) == (held is not None)


def test_the_nearest_commands_are_found_whatever_the_case() -> None:
    known = ["go to fridge_0", "open fridge_0", "take apple_0"]
    assert nearest_commands("  OPEN FRIDGE ", known)[0] == "open fridge_0"
    assert nearest_commands("zzzz", known) == ()


@pytest.mark.parametrize("kind", list(ViolationKind))
def test_every_violation_has_a_reason_that_names_what_it_is_about(kind: ViolationKind) -> None:
    told = reason(Violation(kind, "the_subject", "the_blocker"))
    assert "{" not in told
    if kind is not ViolationKind.HAND_EMPTY:
        assert "the_subject" in told or "the_blocker" in told


# --- looking around ------------------------------------------------------------------------------------------------


def test_a_room_is_told_with_what_stands_in_it_and_what_lies_there() -> None:
    graph = kitchen(
        {"apple_0": "held", "teacup_0": "in bowl_0"},
        near=("apple_0", "stove_0", "fridge_0"),
        flags={"open": ("fridge_0",), "toggled": ("stove_0",), "cooked": ("apple_0",), "dirty": ("apple_0",)},
    )
    told = look(graph)
    assert told.startswith("You are in kitchen_0. You see ")
    assert "fridge_0 (open) with steak_0 in it, " in told
    assert "oven_0 (closed), " in told
    assert "stove_0 (on), " in told
    assert "breakfast_table_0 with backpack_0 (closed) with textbook_0 in it, bowl_0 with teacup_0 in it on it" in told
    assert "Within reach: fridge_0, stove_0." in told
    assert told.endswith("You hold apple_0 (cooked, dirty).")
    assert "bookcase_0" not in told
    assert "Next to this room" not in told


def test_contents_on_and_in_are_told_apart() -> None:
    graph = build(
        {"fridge_0": "floor kitchen_0", "steak_0": "in fridge_0", "apple_0": "on fridge_0"}, robot_room="kitchen_0"
    )
    assert look(graph) == (
        "You are in kitchen_0. You see fridge_0 (closed) with apple_0 on it and steak_0 in it. You hold nothing."
    )


def test_an_empty_room_and_its_neighbours() -> None:
    rooms = kitchen().world.rooms
    doors = frozenset({("kitchen_0", "living_room_0")})
    for room, other in (("kitchen_0", "living_room_0"), ("living_room_0", "kitchen_0")):
        graph = SceneGraph(kitchen().world.of(rooms, doors, {}), {}, {}, robot_room=room)
        assert look(graph) == f"You are in {room}. You see nothing yet. You hold nothing. Next to this room: {other}."
    assert look(SceneGraph(kitchen().world.of({}, frozenset(), {}), {}, {})).startswith("You are in no room. ")


# --- what an action did ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("graph", "said", "told"),
    [
        (kitchen(), "NAVIGATE_TO(apple_0)", "You are at apple_0."),
        (kitchen(), "NAVIGATE_TO(fridge_0)", "You are at fridge_0 (closed) with steak_0 in it."),
        (kitchen(), "GRASP(apple_0)", "You take apple_0."),
        (kitchen({"bowl_0": "held"}), "RELEASE()", "You drop bowl_0 on the floor of kitchen_0."),
        (kitchen({"bowl_0": "held"}), "PLACE_ON_TOP(stove_0)", "You put bowl_0 on stove_0."),
        (kitchen({"bowl_0": "held"}), "PLACE_INSIDE(bookcase_0)", "You put bowl_0 in bookcase_0."),
        (kitchen(), "OPEN(fridge_0)", "You open fridge_0 (open) with steak_0 in it."),
        (opened("fridge_0"), "CLOSE(fridge_0)", "You close fridge_0. steak_0 is frozen now."),
        (kitchen(), "TOGGLE_ON(floor_lamp_0)", "You turn on floor_lamp_0."),
        (kitchen(), "TOGGLE_OFF(floor_lamp_0)", "You turn off floor_lamp_0."),
        (
            kitchen({"apple_0": "in microwave_0"}),
            "TOGGLE_ON(microwave_0)",
            "You turn on microwave_0. apple_0 is cooked now. apple_0 is hot now.",
        ),
        (kitchen(), "GRASP(steak_0)", "Nothing happens: fridge_0 is closed."),
        (kitchen(near=()), "GRASP(apple_0)", "Nothing happens: the robot is not near apple_0."),
        (kitchen(), "GRASP(napkin_7)", "Nothing happens: there is no napkin_7."),
        (kitchen(), "RELEASE()", "Nothing happens: the hand is empty."),
        (kitchen({"bowl_0": "held"}), "GRASP(apple_0)", "Nothing happens: the hand already holds bowl_0."),
    ],
)
def test_an_action_is_told_by_what_it_changed(graph: SceneGraph, said: str, told: str) -> None:
    assert step(graph, said) == told


def test_metres_are_told_where_the_robot_drove() -> None:
    assert step(kitchen(), "NAVIGATE_TO(apple_0)", 3.25) == "You are at apple_0 (3.2 m)."
    assert step(kitchen(), "NAVIGATE_TO(napkin_7)", 0.5) == "Nothing happens: there is no napkin_7 (0.5 m)."


def test_what_came_into_view_is_told_last_and_its_states_are_not_news() -> None:
    before = build({"breakfast_table_0": "floor kitchen_0"}, robot_room="kitchen_0")
    after = build(
        {"breakfast_table_0": "floor kitchen_0", "fridge_0": "floor kitchen_0", "apple_0": "on breakfast_table_0"},
        robot_room="kitchen_0",
        flags={"cooked": ("apple_0",)},
    )
    action = Action(Primitive.NAVIGATE_TO, "apple")
    assert outcome_text(action, before, after, "ok", 2.0) == (
        "You are at apple (2.0 m). New in sight: fridge_0 (closed), apple_0 (cooked)."
    )
    assert outcome_text(action, before, after, "not_found") == (
        "Nothing happens: apple was not found anywhere. New in sight: fridge_0 (closed), apple_0 (cooked)."
    )
    opening = Action(Primitive.OPEN, "drawer")
    assert outcome_text(opening, before, before, "ok") == "You open drawer."


def test_the_world_s_own_outcome_wins_over_what_was_known() -> None:
    """The believed graph may allow what the world does not."""
    graph = kitchen()
    told = outcome_text(Action(Primitive.GRASP, "apple_0"), graph, graph, "unreachable")
    assert told == "Nothing happens: no way leads to apple_0."
