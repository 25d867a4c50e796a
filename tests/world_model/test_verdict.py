"""Verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.defects import corrupt
from support.errands import draw_errand
from support.worlds import kitchen

from gavel_env.world_model.actions import Action, parse_action
from gavel_env.world_model.dynamics import Profile, ViolationKind, rollout, unsafe
from gavel_env.world_model.goals import Goal, parse_goal, unmet
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.verdict import Rank, Verdict, shortfall, validate

GOAL = parse_goal(["on_top(steak, breakfast_table)"])
GOOD = "NAVIGATE_TO(fridge_0) OPEN(fridge_0) GRASP(steak_0) CLOSE(fridge_0) NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)"  # noqa: E501


def plan(text: str) -> tuple[Action, ...]:
    return tuple(map(parse_action, text.split()))


def judge(text: str, goal: Goal = GOAL, **options: Any) -> Verdict:
    return validate(kitchen(near=()), plan(text), goal, **options)


def test_a_good_plan_is_valid() -> None:
    verdict = judge(GOOD)
    assert verdict.valid
    assert verdict.app
    assert verdict.safe
    assert verdict.unmet == ()
    assert len(verdict.trace) == 7
    assert verdict.cost == 2.0


def test_the_first_violation_says_kind_step_subject_and_blocker() -> None:
    verdict = judge("NAVIGATE_TO(fridge_0) GRASP(steak_0) GRASP(bowl_0)")
    assert verdict.violation == (ViolationKind.CLOSED, "steak_0", "fridge_0", 1)
    assert not verdict.app
    assert not verdict.valid
    assert len(verdict.trace) == 2
    assert verdict.end is verdict.trace[1]


def test_an_unmet_goal_is_listed() -> None:
    verdict = judge("NAVIGATE_TO(fridge_0)")
    assert verdict.app
    assert [str(lit) for lit in verdict.unmet] == ["on_top(steak, breakfast_table)"]
    assert not verdict.valid


def test_a_trace_is_reused_from_the_same_graph_alone() -> None:
    here, elsewhere = kitchen(near=()), kitchen(near=(), flags={"open": ["fridge_0"]})
    before = validate(elsewhere, plan(GOOD), GOAL)
    afresh = validate(here, plan(GOOD), GOAL)
    judged = validate(here, plan(GOOD), GOAL, known=before)
    assert judged == afresh
    assert judged.trace[0] is here
    longer = validate(here, (*plan(GOOD), *plan("NAVIGATE_TO(oven_0)")), GOAL, known=afresh)
    assert all(mine is theirs for mine, theirs in zip(longer.trace, afresh.trace, strict=False))


def test_a_shortfall_says_what_is_unmet_then_what_is_left_open_or_on() -> None:
    start = kitchen(near=())
    end = kitchen(flags={"open": ["fridge_0"], "toggled": ["stove_0"]})
    lacking = shortfall(start, end, GOAL)
    assert lacking.reasons() == [
        "unmet on_top(steak, breakfast_table)", "left open: fridge_0", "left on: stove_0",
    ]  # fmt: skip
    assert lacking
    assert shortfall(start, end, "on_top(apple, countertop)")
    assert shortfall(start, start, GOAL)
    assert not shortfall(start, start, "on_top(apple, countertop)")
    assert not shortfall(end, end, "on_top(apple, countertop)")  # what was open and on may stay so


def test_what_is_left_open_is_listed() -> None:
    verdict = judge(GOOD.replace("CLOSE(fridge_0) ", ""))
    assert verdict.app
    assert verdict.unmet == ()
    assert verdict.unsafe == ((Flag.OPEN, "fridge_0"),)
    assert not verdict.safe
    assert not verdict.valid


def test_unknown_names_come_with_the_nearest() -> None:
    verdict = judge("NAVIGATE_TO(frige_0)")
    assert verdict.violation is not None
    assert verdict.violation.kind is ViolationKind.UNKNOWN_OBJECT
    assert verdict.nearest[0] == "fridge_0"
    assert judge("GRASP(steak_0)").nearest == ()


def test_the_profile_decides_whether_doors_need_an_empty_hand() -> None:
    assert judge(GOOD, profile=Profile.PAPER).valid
    verdict = judge(GOOD, profile=Profile.OMNIGIBSON)
    assert verdict.violation == (ViolationKind.HAND_FULL, "fridge_0", "steak_0", 3)


def test_the_cost_is_what_the_cost_function_says() -> None:
    verdict = judge(GOOD, cost=lambda graph, steps: 10.0 * len(steps))
    assert verdict.cost == 60.0
    assert verdict.rank.negative_cost == -60.0


def test_rank_orders_by_applicability_then_goal_then_safety_then_cost() -> None:
    ranks = [
        judge("GRASP(steak_0)").rank,
        judge("").rank,
        judge(GOOD.replace("CLOSE(fridge_0) ", "")).rank,
        judge("NAVIGATE_TO(apple_0) " + GOOD).rank,
        judge(GOOD).rank,
    ]
    assert ranks == sorted(ranks)
    assert len(set(ranks)) == len(ranks)
    assert ranks[-1] == Rank(True, True, True, -2.0)


@pytest.mark.parametrize("profile", list(Profile))
def test_validation_agrees_with_the_world_model_and_reuses_traces(profile: Profile) -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        errand = draw_errand(rng)
        known = validate(errand.graph, errand.reference, errand.goal, profile=profile)
        steps, _ = corrupt(rng, errand, int(rng.integers(1, 6)))
        fresh = validate(errand.graph, steps, errand.goal, profile=profile)
        end, violation = rollout(errand.graph, steps, profile)
        assert fresh.violation == violation
        assert fresh.unmet == unmet(errand.goal, end)
        assert fresh.unsafe == unsafe(errand.graph, end, errand.goal)
        again = validate(errand.graph, steps, errand.goal, profile=profile, known=known)
        assert again == fresh


def test_references_of_drawn_errands_are_valid() -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        errand = draw_errand(rng)
        assert validate(errand.graph, errand.reference, errand.goal).valid, errand.shape
