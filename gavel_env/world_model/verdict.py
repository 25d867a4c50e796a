"""Plan validation: roll a plan forward on the graph world model and say what is wrong with it.

Implements the validator of Sec. "Plan Validation and Repair": a plan is valid iff it is applicable,
unmet(g, G_H) is empty and safe(pi) holds. The verdict is structured; prose is made of it in `complaint` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec

from gavel_env.errors import nearest_names
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, Violation, ViolationKind, apply, first_violation, unsafe
from gavel_env.world_model.goals import Condition, GoalText, Literal, as_goal, unmet
from gavel_env.world_model.graph import Flag, SceneGraph

__all__ = ["CostFunction", "Plan", "Rank", "Shortfall", "Verdict", "navigations", "shortfall", "validate"]

Plan = tuple[Action, ...]

CostFunction = Callable[[SceneGraph, Sequence[Action]], float]
"""Believed metres of a plan from a graph."""


class Rank(NamedTuple):
    """rk(omega, pi); compares lexicographically, higher is better."""

    applicable: bool
    met: bool
    safe: bool
    negative_cost: float


class Shortfall(NamedTuple):
    """What is wrong with a graph that a plan has ended in; empty if nothing is.

    Attributes:
        unmet: conditions of the goal that do not hold.
        unsafe: what was left open or on, as (flag, object).
    """

    unmet: tuple[Literal | Condition, ...]
    unsafe: tuple[tuple[Flag, str], ...]

    def __bool__(self) -> bool:
        return bool(self.unmet or self.unsafe)

    def reasons(self) -> list[str]:
        """Return each reason in a few words, unmet conditions first."""
        left = {Flag.OPEN: "left open", Flag.TOGGLED: "left on"}
        missing = [f"unmet {condition}" for condition in self.unmet]
        return missing + [f"{left[flag]}: {obj}" for flag, obj in self.unsafe]


def shortfall(start: SceneGraph, end: SceneGraph, goal: GoalText) -> Shortfall:
    """Return unmet(g, G_H), and what violates safe: open or on at the end though it was not at the start."""
    goal = as_goal(goal)
    return Shortfall(unmet(goal, end), unsafe(start, end, goal))


class Verdict(msgspec.Struct, frozen=True):
    """omega, what validation found.

    Attributes:
        plan: the plan that was judged.
        violation: the first violated precondition with its step, or None if the plan is applicable.
        unmet: goal conditions that do not hold in the last graph of the trace.
        unsafe: (OPEN, x) for what the plan leaves open, (TOGGLED, x) for what it leaves on.
        cost: omega.d, believed metres (or whatever the cost function counts).
        trace: G_0, G_1, ... as far as the plan is applicable; `trace[k]` is the state before step k.
    """

    plan: Plan
    violation: Violation | None
    unmet: tuple[Literal | Condition, ...]
    unsafe: tuple[tuple[Flag, str], ...]
    cost: float
    trace: tuple[SceneGraph, ...]

    @property
    def app(self) -> bool:
        """omega.app: every action satisfies its preconditions along the trace."""
        return self.violation is None

    @property
    def safe(self) -> bool:
        """omega.safe: restoration requirements hold in the last graph of the trace."""
        return not self.unsafe

    @property
    def valid(self) -> bool:
        """Applicable, goal met and safe."""
        return self.violation is None and not self.unmet and not self.unsafe

    @property
    def rank(self) -> Rank:
        """rk(omega, pi) = (1[app], 1[unmet = empty], 1[safe], -d)."""
        return Rank(self.app, not self.unmet, self.safe, -self.cost)

    @property
    def end(self) -> SceneGraph:
        """G_H, or the graph in which the first violation happened."""
        return self.trace[-1]

    @property
    def nearest(self) -> tuple[str, ...]:
        """Names in the graph that look like the unknown one; empty unless the violation is `unknown_object`."""
        if self.violation is None or self.violation.kind is not ViolationKind.UNKNOWN_OBJECT:
            return ()
        return nearest_names(self.violation.subject, self.end.world.nodes)


def navigations(graph: SceneGraph, plan: Sequence[Action]) -> float:
    """Return the number of `NavigateTo` steps: the cost when no metres are believed."""
    return float(sum(action.primitive is Primitive.NAVIGATE_TO for action in plan))


def validate(
    graph: SceneGraph,
    plan: Sequence[Action],
    goal: GoalText,
    *,
    cost: CostFunction | None = None,
    profile: Profile = Profile.PAPER,
    known: Verdict | None = None,
) -> Verdict:
    """Roll `plan` forward from `graph` until its end or its first violation, and judge where it ends.

    Args:
        graph: believed (or hidden) graph G.
        plan: pi.
        goal: g; a `Goal`, text or a list of texts.
        cost: gives omega.d; default `navigations`.
        profile: rules profile.
        known: a verdict from the same graph and profile; its trace is reused as far as the two plans agree.
    """
    plan = tuple(plan)
    trace = [graph]
    if known is not None and known.trace[0] is graph:
        shared = 0
        for mine, theirs in zip(plan, known.plan[: len(known.trace) - 1], strict=False):
            if mine != theirs:
                break
            shared += 1
        trace = list(known.trace[: shared + 1])
    state = trace[-1]
    violation = None
    for step in range(len(trace) - 1, len(plan)):
        action = plan[step]
        violation = first_violation(state, action, profile)
        if violation is not None:
            violation = violation._replace(step=step)
            break
        state = apply(state, action)
        trace.append(state)
    return Verdict(
        plan=plan,
        violation=violation,
        **shortfall(graph, state, goal)._asdict(),
        cost=(cost or navigations)(graph, plan),
        trace=tuple(trace),
    )
