"""What an edit rule is given and what it offers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import NamedTuple

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import Plan, Verdict

__all__ = ["Case", "Change", "Edit", "Rule", "drop", "insert", "replace"]


class Change(NamedTuple):
    """A changed plan, and the change in words."""

    plan: Plan
    text: str


class Edit(NamedTuple):
    """One applied edit; `str(edit)` is its line in the edit trace.

    Attributes:
        rule: name of the edit rule.
        step: 0-based step at which the plan failed, or None if it failed at its end.
        cause: what the verdict said, as in `closed(fridge_1)`.
        change: what was done, as in `insert OPEN(fridge_1)`.
        plan: the plan after the edit.
    """

    rule: str
    step: int | None
    cause: str
    change: str
    plan: Plan

    def __str__(self) -> str:
        where = "end" if self.step is None else f"step {self.step + 1}"
        return f"{where}: {self.cause} -> {self.change}"


class Case:
    """A verdict to be mended.

    Attributes:
        plan: the plan pi.
        verdict: omega.
        goal: g.
        profile: rules profile.
        step: index of the failing step; the plan's length if it failed at its end.
        graph: the state before that step.
    """

    def __init__(self, verdict: Verdict, goal: Goal, profile: Profile) -> None:
        self.plan = verdict.plan
        self.verdict = verdict
        self.goal = goal
        self.profile = profile
        self.step = len(self.plan) if verdict.violation is None else verdict.violation.step or 0
        self.graph: SceneGraph = verdict.end

    @property
    def action(self) -> Action:
        """The failing action."""
        return self.plan[self.step]

    @property
    def target(self) -> str:
        """The failing action's target."""
        return self.action.target or ""

    @property
    def trace(self) -> tuple[SceneGraph, ...]:
        """States before each step, up to the failing one."""
        return self.verdict.trace

    @cached_property
    def first_mention(self) -> dict[str, int]:
        """Name -> index of the first step that names it."""
        mentions: dict[str, int] = {}
        for index, action in enumerate(self.plan):
            for name in action.arguments:
                mentions.setdefault(name, index)
        return mentions

    def preferred(self, names: Iterable[str]) -> list[str]:
        """Sort names: those that the plan mentions first, otherwise in the order given."""
        return sorted(names, key=lambda name: name not in self.first_mention)

    def approach_start(self, step: int) -> int:
        """Return where the approach to `step` begins: the last navigation before it, if only doors come between."""
        index = step
        while index > 0 and self.plan[index - 1].primitive in (Primitive.OPEN, Primitive.CLOSE):
            index -= 1
        if index > 0 and self.plan[index - 1].primitive is Primitive.NAVIGATE_TO:
            return index - 1
        return step

    def held_since(self) -> int:
        """Return the first index of the run of states, up to the failing one, with the hand as it is now."""
        index = self.step
        while index > 0 and self.trace[index - 1].holding == self.graph.holding:
            index -= 1
        return index


Rule = Callable[[Case], Iterator[Change]]
"""Offers changes for a case, best first; none if the rule does not apply."""


def insert(plan: Plan, at: int, steps: Iterable[Action]) -> Change:
    """Return the plan with steps inserted before index `at`."""
    steps = tuple(steps)
    where = "append" if at == len(plan) else "insert"
    text = " ".join(map(str, steps))
    return Change((*plan[:at], *steps, *plan[at:]), f"{where} {text}")


def replace(plan: Plan, at: int, steps: Iterable[Action], until: int | None = None) -> Change:
    """Return the plan with the step at index `at` (or those up to `until`, exclusive) replaced."""
    steps = tuple(steps)
    until = at + 1 if until is None else until
    text = f"replace {' '.join(map(str, plan[at:until]))} by {' '.join(map(str, steps))}"
    return Change((*plan[:at], *steps, *plan[until:]), text)


def drop(plan: Plan, indices: Iterable[int]) -> Change:
    """Return the plan without some steps."""
    gone = sorted(set(indices))
    named = " ".join(f"{plan[i]} (step {i + 1})" for i in gone)
    return Change(tuple(a for i, a in enumerate(plan) if i not in gone), f"drop {named}")
