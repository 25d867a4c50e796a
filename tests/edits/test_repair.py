"""Model-derived repair: every rule by itself, and corrupted reference plans by the thousand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.worlds import kitchen

from gavel_agents.edits import LITERAL_RULES, SAFETY_RULES, VIOLATION_RULES, prune
from gavel_agents.edits.repair import MOST_EDITS, repair
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import Profile, ViolationKind, rollout, unsafe
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, parse_goal, unmet
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import validate

TABLE, SHELF, FRIDGE, OVEN = "breakfast_table_0", "bookcase_0", "fridge_0", "oven_0"


class RuleCase(NamedTuple):
    rule: str
    plan: str
    goal: str
    profile: Profile = Profile.PAPER
    edit: str = ""


ON_TABLE = "on_top(apple, breakfast_table)"
CARRY = f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({TABLE}) PLACE_ON_TOP({TABLE})"
BOWL = f"NAVIGATE_TO(bowl_0) GRASP(bowl_0) NAVIGATE_TO({SHELF}) PLACE_INSIDE({SHELF})"
IN_OVEN = f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({OVEN}) OPEN({OVEN}) PLACE_INSIDE({OVEN})"

CASES = [
    RuleCase(
        "read_name",
        CARRY.replace("apple_0", "red_apple_2"),
        ON_TABLE,
        edit="step 1: unknown_object(red_apple_2) -> read red_apple_2 as apple_0",
    ),
    RuleCase(
        "approach",
        CARRY.replace("NAVIGATE_TO(apple_0) ", ""),
        ON_TABLE,
        edit="step 1: not_near(apple_0) -> insert NAVIGATE_TO(apple_0)",
    ),
    RuleCase(
        "open_the_box",
        CARRY.replace("apple", "steak"),
        "on_top(steak, breakfast_table)",
        edit="step 1: hidden(steak_0) (because of fridge_0) -> "
        "replace NAVIGATE_TO(steak_0) by NAVIGATE_TO(fridge_0) OPEN(fridge_0)",
    ),
    RuleCase(
        "open_first",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({FRIDGE}) PLACE_INSIDE({FRIDGE})",
        "inside(apple, fridge)",
        edit="step 4: closed(fridge_0) -> insert OPEN(fridge_0)",
    ),
    RuleCase(
        "shut_door",
        IN_OVEN.replace("oven", "microwave") + " TOGGLE_ON(microwave_0) TOGGLE_OFF(microwave_0)",
        "cooked(apple)",
        edit="step 6: door_open(microwave_0) -> insert CLOSE(microwave_0)",
    ),
    RuleCase(
        "place_in_passing",
        CARRY.replace(f" PLACE_ON_TOP({TABLE})", " ") + BOWL,
        f"{ON_TABLE} & inside(bowl, bookcase)",
        edit="step 5: hand_full(bowl_0) (because of apple_0) -> insert PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "already_held",
        CARRY.replace("GRASP(apple_0)", "GRASP(apple_0) GRASP(apple_0)"),
        ON_TABLE,
        edit="step 3: hand_full(apple_0) -> drop GRASP(apple_0) (step 3)",
    ),
    RuleCase(
        "finish_errand",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) {BOWL}",
        "inside(apple, fridge) & inside(bowl, bookcase)",
        edit="step 4: hand_full(bowl_0) (because of apple_0) -> "
        "insert NAVIGATE_TO(fridge_0) OPEN(fridge_0) PLACE_INSIDE(fridge_0) CLOSE(fridge_0)",
    ),
    RuleCase(
        "leave_it",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) {BOWL}",
        "inside(bowl, bookcase)",
        edit="step 4: hand_full(bowl_0) (because of apple_0) -> drop GRASP(apple_0) (step 2)",
    ),
    RuleCase(
        "park",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) {BOWL}",
        "not on_top(apple, countertop) & inside(bowl, bookcase)",
        edit="step 4: hand_full(bowl_0) (because of apple_0) -> insert PLACE_ON_TOP(countertop_0)",
    ),
    RuleCase(
        "set_down_to_operate",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({FRIDGE}) OPEN({FRIDGE}) "
        f"PLACE_INSIDE({FRIDGE}) CLOSE({FRIDGE})",
        "inside(apple, fridge)",
        Profile.OMNIGIBSON,
        edit="step 4: hand_full(fridge_0) (because of apple_0) -> "
        "replace OPEN(fridge_0) by PLACE_ON_TOP(fridge_0) OPEN(fridge_0) GRASP(apple_0)",
    ),
    RuleCase(
        "grasp_in_passing",
        CARRY.replace("GRASP(apple_0) ", ""),
        ON_TABLE,
        edit="step 3: hand_empty(breakfast_table_0) -> insert GRASP(apple_0)",
    ),
    RuleCase(
        "fetch",
        f"NAVIGATE_TO({TABLE}) PLACE_ON_TOP({TABLE})",
        ON_TABLE,
        edit="step 2: hand_empty(breakfast_table_0) -> insert NAVIGATE_TO(apple_0) GRASP(apple_0)",
    ),
    RuleCase("drop_step", f"{CARRY} RELEASE()", ON_TABLE, edit="step 5: hand_empty() -> drop RELEASE() (step 5)"),
    RuleCase(
        "drop_step",
        CARRY.replace("NAVIGATE_TO(b", "NAVIGATE_TO(kitchen_0) NAVIGATE_TO(b"),
        ON_TABLE,
        edit="step 3: room_target(kitchen_0) -> drop NAVIGATE_TO(kitchen_0) (step 3)",
    ),
    RuleCase(
        "drop_step",
        f"NAVIGATE_TO({TABLE}) GRASP({TABLE}) {CARRY}",
        ON_TABLE,
        edit="step 2: not_graspable(breakfast_table_0) -> drop GRASP(breakfast_table_0) (step 2)",
    ),
    RuleCase(
        "other_relation",
        CARRY.replace("PLACE_ON_TOP", "PLACE_INSIDE"),
        ON_TABLE,
        edit="step 4: no_interior(breakfast_table_0) -> "
        "replace PLACE_INSIDE(breakfast_table_0) by PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "deliver_instead",
        CARRY.replace(TABLE, "floor_lamp_0"),
        ON_TABLE,
        edit="step 4: no_surface(floor_lamp_0) -> replace PLACE_ON_TOP(floor_lamp_0) by "
        "NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "deliver_instead",
        CARRY.replace(f"PLACE_ON_TOP({TABLE})", "PLACE_ON_TOP(apple_0)"),
        ON_TABLE,
        edit="step 4: self_placement(apple_0) -> replace PLACE_ON_TOP(apple_0) by PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "place_elsewhere",
        CARRY.replace(TABLE, "napkin_0"),
        ON_TABLE,
        edit="step 3: unknown_object(napkin_0) -> replace NAVIGATE_TO(napkin_0) PLACE_ON_TOP(napkin_0) "
        "by NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "release_in_room",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({SHELF}) PLACE_ON_TOP(living_room_0)",
        "in_room(apple, living_room)",
        edit="step 4: room_target(living_room_0) -> replace PLACE_ON_TOP(living_room_0) by RELEASE()",
    ),
    RuleCase(
        "drop_doors",
        BOWL.replace("PLACE", f"OPEN({SHELF}) PLACE") + f" CLOSE({SHELF})",
        "inside(bowl, bookcase)",
        edit="step 4: no_door(bookcase_0) -> drop OPEN(bookcase_0) (step 4) CLOSE(bookcase_0) (step 6)",
    ),
    RuleCase(
        "drop_switches",
        f"NAVIGATE_TO({TABLE}) TOGGLE_ON({TABLE}) {CARRY}",
        ON_TABLE,
        edit="step 2: no_switch(breakfast_table_0) -> drop TOGGLE_ON(breakfast_table_0) (step 2)",
    ),
    RuleCase(
        "shut_before_running",
        f"{IN_OVEN} TOGGLE_ON({OVEN}) TOGGLE_OFF({OVEN})",
        "cooked(apple)",
        edit="end: unmet cooked(apple) -> insert CLOSE(oven_0)",
    ),
    RuleCase(
        "run_while_inside",
        f"{IN_OVEN} CLOSE({OVEN})",
        "cooked(apple)",
        edit="end: unmet cooked(apple) -> append TOGGLE_ON(oven_0) TOGGLE_OFF(oven_0)",
    ),
    RuleCase(
        "load_before_running",
        f"NAVIGATE_TO({OVEN}) TOGGLE_ON({OVEN}) TOGGLE_OFF({OVEN})",
        "cooked(apple)",
        edit="end: unmet cooked(apple) -> insert NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO(oven_0) OPEN(oven_0) "
        "PLACE_INSIDE(oven_0) CLOSE(oven_0)",
    ),
    RuleCase(
        "run_named_appliance",
        f"NAVIGATE_TO({OVEN})",
        f"cooked(apple) & {ON_TABLE}",
        edit="end: unmet on_top(apple, breakfast_table) -> append OPEN(oven_0) GRASP(apple_0) CLOSE(oven_0) "
        "NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "place_held",
        CARRY.replace(f" PLACE_ON_TOP({TABLE})", ""),
        ON_TABLE,
        edit="end: unmet on_top(apple, breakfast_table) -> append PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "change_relation",
        BOWL.replace("PLACE_INSIDE", "PLACE_ON_TOP"),
        "inside(bowl, bookcase)",
        edit="end: unmet inside(bowl, bookcase) -> replace PLACE_ON_TOP(bookcase_0) by PLACE_INSIDE(bookcase_0)",
    ),
    RuleCase(
        "redirect",
        CARRY.replace(TABLE, "stove_0"),
        ON_TABLE,
        edit="end: unmet on_top(apple, breakfast_table) -> replace PLACE_ON_TOP(stove_0) by "
        "NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "deliver",
        CARRY,
        f"{ON_TABLE} & on_top(steak, breakfast_table)",
        edit="end: unmet on_top(steak, breakfast_table) -> append NAVIGATE_TO(fridge_0) OPEN(fridge_0) GRASP(steak_0) "
        "CLOSE(fridge_0) NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "take_away",
        "",
        "not inside(steak, fridge)",
        edit="end: unmet not inside(steak, fridge) -> append NAVIGATE_TO(fridge_0) OPEN(fridge_0) GRASP(steak_0) "
        "CLOSE(fridge_0) RELEASE()",
    ),
    RuleCase(
        "put_beside",
        "",
        "next_to(apple, fridge)",
        edit="end: unmet next_to(apple, fridge) -> append NAVIGATE_TO(apple_0) GRASP(apple_0) "
        "NAVIGATE_TO(fridge_0) RELEASE()",
    ),
    RuleCase(
        "put_beside",
        "",
        "next_to(apple, bowl)",
        edit="end: unmet next_to(apple, bowl) -> append NAVIGATE_TO(apple_0) GRASP(apple_0) "
        "NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)",
    ),
    RuleCase(
        "put_beside",
        "",
        "under(apple, breakfast_table)",
        edit="end: unmet under(apple, breakfast_table) -> append NAVIGATE_TO(apple_0) GRASP(apple_0) "
        "NAVIGATE_TO(breakfast_table_0) RELEASE()",
    ),
    RuleCase(
        "bring_into_room",
        "",
        "in_room(apple, living_room)",
        edit="end: unmet in_room(apple, living_room) -> append NAVIGATE_TO(apple_0) GRASP(apple_0) "
        "NAVIGATE_TO(bookcase_0) PLACE_ON_TOP(bookcase_0)",
    ),
    RuleCase(
        "leave_it_so",
        f"NAVIGATE_TO({FRIDGE}) OPEN({FRIDGE}) CLOSE({FRIDGE})",
        "open(fridge)",
        edit="end: unmet open(fridge) -> drop CLOSE(fridge_0) (step 3)",
    ),
    RuleCase(
        "operate_at_end",
        "",
        "toggled(floor_lamp)",
        edit="end: unmet toggled(floor_lamp) -> append NAVIGATE_TO(floor_lamp_0) TOGGLE_ON(floor_lamp_0)",
    ),
    RuleCase(
        "close_in_time",
        CARRY.replace("NAVIGATE_TO(apple_0)", f"NAVIGATE_TO({FRIDGE}) OPEN({FRIDGE}) NAVIGATE_TO(apple_0)"),
        ON_TABLE,
        edit="end: left open fridge_0 -> insert CLOSE(fridge_0)",
    ),
    RuleCase(
        "switch_off",
        f"{IN_OVEN} CLOSE({OVEN}) TOGGLE_ON({OVEN})",
        "cooked(apple)",
        edit="end: left on oven_0 -> append TOGGLE_OFF(oven_0)",
    ),
    RuleCase(
        "drop_navigation",
        f"{CARRY} {BOWL}",
        f"{ON_TABLE} & inside(bowl, bookcase)",
        edit="step 5: superfluous -> drop NAVIGATE_TO(bowl_0) (step 5)",
    ),
    RuleCase(
        "drop_pair",
        f"{CARRY} GRASP(bowl_0) NAVIGATE_TO({FRIDGE}) OPEN({FRIDGE}) CLOSE({FRIDGE}) OPEN({FRIDGE}) "
        f"PLACE_INSIDE({FRIDGE}) CLOSE({FRIDGE})",
        f"{ON_TABLE} & inside(bowl, fridge)",
    ),
    RuleCase(
        "carry_on",
        f"NAVIGATE_TO(apple_0) GRASP(apple_0) NAVIGATE_TO({FRIDGE}) PLACE_ON_TOP({FRIDGE}) OPEN({FRIDGE}) "
        f"GRASP(apple_0) PLACE_INSIDE({FRIDGE}) CLOSE({FRIDGE})",
        "inside(apple, fridge)",
        edit="step 4: superfluous -> drop PLACE_ON_TOP(fridge_0) (step 4) GRASP(apple_0) (step 6)",
    ),
    RuleCase(
        "read_name",
        CARRY.replace(TABLE, "dining_table"),
        ON_TABLE,
        edit="step 3: unknown_object(dining_table) -> read dining_table as breakfast_table_0",
    ),
    RuleCase(
        "cut_loop",
        f"NAVIGATE_TO({TABLE}) NAVIGATE_TO({FRIDGE}) OPEN({FRIDGE}) CLOSE({FRIDGE}) {CARRY} NAVIGATE_TO({OVEN})",
        ON_TABLE,
    ),
]


def plan(text: str) -> tuple[Action, ...]:
    return tuple(map(parse_action, text.split()))


@pytest.mark.parametrize("case", CASES, ids=[f"{case.rule}-{number}" for number, case in enumerate(CASES)])
def test_each_rule_mends_what_it_is_for(case: RuleCase) -> None:
    goal = parse_goal(case.goal.split(" & "))
    repaired = repair(kitchen(near=()), plan(case.plan), goal, profile=case.profile)
    assert case.rule in [edit.rule for edit in repaired.edits]
    if case.edit:
        assert case.edit in repaired.trace
    assert repaired.verdict.valid
    assert repaired.plan == repaired.verdict.plan


def test_every_rule_of_the_tables_has_a_case() -> None:
    rules = {rule.__name__ for row in VIOLATION_RULES.values() for rule in row}
    rules |= {rule.__name__ for row in LITERAL_RULES.values() for rule in row}
    rules |= {rule.__name__ for row in SAFETY_RULES.values() for rule in row}
    assert rules <= {case.rule for case in CASES}


def test_every_violation_kind_is_in_the_table() -> None:
    assert set(VIOLATION_RULES) == set(ViolationKind)


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        ("NAVIGATE_TO(napkin_0) GRASP(napkin_0)", ON_TABLE),  # which object was meant
        (CARRY, f"{ON_TABLE} & cooked(apple)"),  # which appliance cooks
        (CARRY, "washed(bowl)"),
    ],
)
def test_what_needs_semantics_is_left_to_the_model(text: str, goal: str) -> None:
    start = kitchen(near=())
    repaired = repair(start, plan(text), parse_goal(goal.split(" & ")))
    assert not repaired.verdict.valid
    assert repaired.verdict.rank >= repaired.before.rank


def test_a_valid_plan_stays_as_it_is() -> None:
    repaired = repair(kitchen(near=()), plan(CARRY), parse_goal([ON_TABLE]))
    assert repaired.plan == plan(CARRY)
    assert repaired.edits == ()
    assert repaired.before.valid


def test_pruning_keeps_what_an_appliance_did_though_the_goal_does_not_ask_for_it() -> None:
    text = f"{IN_OVEN} CLOSE({OVEN}) TOGGLE_ON({OVEN}) TOGGLE_OFF({OVEN}) OPEN({OVEN}) GRASP(apple_0) CLOSE({OVEN}) "
    text += f"NAVIGATE_TO({TABLE}) PLACE_ON_TOP({TABLE})"
    assert repair(kitchen(near=()), plan(text), parse_goal([ON_TABLE])).plan == plan(text)


def test_pruning_never_takes_a_dearer_plan() -> None:
    def cost(graph: SceneGraph, steps: Sequence[Action]) -> float:
        return 100.0 - len(steps)

    goal = parse_goal([ON_TABLE])
    verdict = validate(kitchen(near=()), plan(f"NAVIGATE_TO({OVEN}) {CARRY}"), goal, cost=cost)
    assert prune(verdict, goal, cost=cost) == (verdict, ())
    assert prune(validate(kitchen(near=()), verdict.plan, goal), goal)[0].plan == plan(CARRY)


def test_the_number_of_edits_is_bounded() -> None:
    bad = plan(" ".join(["GRASP(apple_0) OPEN(fridge_0) RELEASE() PLACE_INSIDE(apple_0)"] * 60))
    repaired = repair(kitchen(near=()), bad, parse_goal(["cooked(apple)"]), most_edits=7)
    assert len(repaired.edits) <= 7
    assert len(repair(kitchen(near=()), bad, parse_goal(["cooked(apple)"])).edits) <= MOST_EDITS


def test_repair_without_any_plan_fetches_what_the_goal_wants() -> None:
    goal = parse_goal([ON_TABLE, "inside(bowl, fridge)", "open(microwave)", "toggled(floor_lamp)"])
    assert repair(kitchen(near=()), (), goal).verdict.valid


# --- plans and goals at random -------------------------------------------------------------------------------------

_OBJECTS = [*sorted(kitchen().world.nodes), "kitchen_0", "living_room_0", "napkin_0"]
_ACTIONS = st.builds(
    lambda primitive, target: Action(primitive, target if primitive.takes_target else None),
    st.sampled_from(list(Primitive)),
    st.sampled_from(_OBJECTS),
)
_NAMES = ("apple", "steak_0", "bowl", "fridge", "oven_0", "washer", "backpack", "textbook", "bookcase@living_room")
_LITERALS = st.builds(
    lambda predicate, a, b, negated: Literal(predicate, a, b if predicate.arity == 2 else None, negated),
    st.sampled_from(list(Predicate)),
    st.sampled_from(_NAMES).map(Designator.parse),
    st.sampled_from((*_NAMES, "kitchen")).map(Designator.parse),
    st.booleans(),
)


@settings(max_examples=400, deadline=None)
@given(
    st.lists(_ACTIONS, max_size=20).map(tuple),
    st.lists(_LITERALS, min_size=1, max_size=4).map(lambda literals: Goal(tuple(literals))),
    st.sampled_from(list(Profile)),
)
def test_repair_of_anything_terminates_never_lowers_rk_and_never_errs_on_validity(
    steps: tuple[Action, ...], goal: Goal, profile: Profile
) -> None:
    start = kitchen(near=())
    repaired = repair(start, steps, goal, profile=profile)
    end, violation = rollout(start, repaired.plan, profile)
    assert repaired.verdict.valid == (violation is None and not unmet(goal, end) and not unsafe(start, end, goal))
    assert repaired.verdict.rank >= repaired.before.rank
    for edit in repaired.edits:
        assert edit.plan != steps
