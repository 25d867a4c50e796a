"""Complaint(I, G_0, {pi_i, omega_i}) of Algorithm 1: what a verdict says, structured, and in words for a retry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from gavel_agents.proposing.parse import ParsedPlans
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, Violation
from gavel_env.world_model.goals import Condition, Goal, Literal
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.narration import reason
from gavel_env.world_model.own_actions import own_action
from gavel_env.world_model.verdict import Verdict

__all__ = ["CONTRACTS", "Complaint", "complain", "complaint"]

CONTRACTS: Mapping[Primitive, str] = {
    Primitive.NAVIGATE_TO: "a known object that is no room and is not inside something closed",
    Primitive.GRASP: "to be near it, an empty hand, something that can be carried and is not inside something closed",
    Primitive.RELEASE: "something in the hand",
    Primitive.PLACE_ON_TOP: "something in the hand, to be near the target, and a target with a surface",
    Primitive.PLACE_INSIDE: "something in the hand, to be near the target, and a target with an inside that is open",
    Primitive.OPEN: "to be near it, and something with a door",
    Primitive.CLOSE: "to be near it, and something with a door",
    Primitive.TOGGLE_ON: "to be near it, and something with a switch; appliances with a door must be closed",
    Primitive.TOGGLE_OFF: "to be near it, and something with a switch",
}
"""What each primitive needs."""


class Complaint(msgspec.Struct, frozen=True):
    """What is wrong with one plan.

    Attributes:
        task: number of the task, from 1; None if there is only one plan.
        plan: the plan that was judged.
        violation: the first violated precondition, with its step, or None.
        needs: what the failing action needs, or empty.
        missing: which of that is missing, or empty.
        nearest: known names that look like the unknown one.
        unmet: goal conditions that the plan does not reach (as far as it was carried out).
        left_open, left_on: what it leaves open or on.
    """

    task: int | None
    plan: tuple[Action, ...]
    violation: Violation | None
    needs: str
    missing: str
    nearest: tuple[str, ...]
    unmet: tuple[str, ...]
    left_open: tuple[str, ...]
    left_on: tuple[str, ...]

    def text(self) -> str:
        """Return the complaint in words."""
        name = "The plan" if self.task is None else f"Task {self.task}"
        lines = [f"{name} {self._summary()}"]
        step = None if self.violation is None else self.violation.step
        for index, action in enumerate(self.plan):
            words = action.words
            mark = f"   <- fails: {self.missing}" if index == step else ""
            lines.append(f"{index + 1}. {words}{mark}")
        if self.violation is not None and step is not None:
            lines.append(f"{self.plan[step].primitive.name} needs {self.needs}.")
        if self.nearest:
            lines.append(f"Known names like it: {', '.join(self.nearest)}.")
        if self.unmet:
            lines.append(f"Not reached: {', '.join(self.unmet)}.")
        if self.violation is None and self.left_open:
            lines.append(f"Left open at the end: {', '.join(self.left_open)}.")
        if self.violation is None and self.left_on:
            lines.append(f"Left on at the end: {', '.join(self.left_on)}.")
        return "\n".join(lines)

    def _summary(self) -> str:
        if not self.plan:
            return "has no steps."
        if self.violation is not None:
            return f"fails at step {(self.violation.step or 0) + 1}:"
        return "does not reach its goal:" if self.unmet else "reaches its goal but leaves things open or on:"


def complaint(verdict: Verdict, task: int | None = None, profile: Profile = Profile.PAPER) -> Complaint | None:
    """Return what a verdict complains of, or None if the plan is valid."""
    if verdict.valid:
        return None
    violation = verdict.violation
    needs = missing = ""
    if violation is not None and violation.step is not None:
        primitive = verdict.plan[violation.step].primitive
        own = own_action(primitive)
        needs = CONTRACTS[primitive] if own is None else own.contract
        if profile is Profile.OMNIGIBSON and Primitive.OPEN <= primitive <= Primitive.TOGGLE_OFF:
            needs += "; an empty hand"
        missing = reason(violation)
    return Complaint(
        task=task,
        plan=verdict.plan,
        violation=violation,
        needs=needs,
        missing=missing,
        nearest=verdict.nearest,
        unmet=tuple(map(_told, verdict.unmet)),
        left_open=tuple(obj for flag, obj in verdict.unsafe if flag is Flag.OPEN),
        left_on=tuple(obj for flag, obj in verdict.unsafe if flag is Flag.TOGGLED),
    )


def _told(condition: Literal | Condition) -> str:
    return str(condition) if isinstance(condition, Literal) else condition.text()


_MOST_DROPPED = 3


def complain(
    verdicts: Sequence[Verdict],
    goals: Sequence[Goal],
    parsed: ParsedPlans | None = None,
    profile: Profile = Profile.PAPER,
) -> str:
    """Return the words that go back to the model: one complaint per invalid plan, and what could not be read.

    Args:
        verdicts: per task.
        goals: per task, as the planner was told them.
        parsed: the answer as it was read; what was dropped is quoted.
        profile: rules profile.
    """
    parts: list[str] = []
    if parsed is not None and parsed.problem:
        parts.append(f"The answer could not be read: {parsed.problem}.")
    if parsed is not None and parsed.dropped:
        quoted = [repr(d.text) for d in parsed.dropped[:_MOST_DROPPED]]
        more = len(parsed.dropped) - len(quoted)
        parts.append("Not an action: " + ", ".join(quoted) + (f" and {more} more" if more else "") + ".")
    for number, (verdict, goal) in enumerate(zip(verdicts, goals, strict=True), start=1):
        found = complaint(verdict, number, profile)
        if found is None:
            parts.append(f"Task {number} is right; repeat its plan.")
        else:
            parts.append(f"{found.text()}\nTask {number} goal: {', '.join(goal.text())}")
    parts.append("Answer with the complete corrected plan of every task, and nothing else.")
    return "\n\n".join(parts)
