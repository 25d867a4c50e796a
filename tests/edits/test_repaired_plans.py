"""Whole repairs of small plans, edit by edit: which rule comes first, where it puts its steps, what pruning leaves."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from support.worlds import kitchen

from gavel_agents.edits.repair import repair
from gavel_env.world_model.actions import parse_action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import parse_goal

CASES: list[dict[str, Any]] = tomllib.loads((Path(__file__).parent / "data/repairs.toml").read_text("utf-8"))["case"]


@pytest.mark.parametrize("case", CASES, ids=[f"{case.get('rules', 'paper')}: {case['goal']}" for case in CASES])
def test_a_plan_is_mended_as_written_down(case: dict[str, Any]) -> None:
    start = kitchen(case.get("moved"), near=(), flags=case.get("states"))
    plan = tuple(map(parse_action, case["plan"].split()))
    repaired = repair(start, plan, parse_goal(case["goal"].split(" & ")), profile=Profile(case.get("rules", "paper")))
    assert list(repaired.trace) == case["edits"]
    assert " ".join(map(str, repaired.plan)) == case["left"]
    assert repaired.verdict.valid


@pytest.mark.parametrize(
    "goal",
    [
        "next_to(fridge, oven)",
        "not in_room(apple, kitchen)",
        "under(fridge, stove)",
        "inside(napkin, fridge)",
        "cooked(napkin)",
    ],
)
def test_what_no_rule_brings_about_is_left_to_the_model(goal: str) -> None:
    repaired = repair(kitchen(near=()), (), parse_goal([goal]))
    assert (repaired.edits, repaired.plan) == ((), ())
    assert not repaired.verdict.valid
