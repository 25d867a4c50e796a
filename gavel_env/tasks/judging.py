"""How a plan ends on a graph: the one judgement that certificates and broken variants share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gavel_env.world_model.actions import Action
from gavel_env.world_model.dynamics import Profile, rollout
from gavel_env.world_model.goals import GoalText, as_goal
from gavel_env.world_model.graph import Flag, SceneGraph
from gavel_env.world_model.verdict import shortfall

__all__ = ["Ending", "judge"]


class Ending(NamedTuple):
    """How a plan ends.

    Attributes:
        kind: `valid`; the kind of the first violation; `goal_unmet`; or `left_open`, `left_on`.
        step: index of the violating step, or None.
        subject: what it is about, in text form.
        graph: the last graph.
    """

    kind: str
    step: int | None
    subject: str
    graph: SceneGraph


def judge(graph: SceneGraph, plan: Sequence[Action], goal: GoalText, profile: Profile = Profile.PAPER) -> Ending:
    """Return how a plan ends: its first violation, else what is unmet, else what is left open or on, else valid."""
    goal = as_goal(goal)
    end, violation = rollout(graph, plan, profile)
    if violation is not None:
        return Ending(violation.kind.value, violation.step, violation.subject, end)
    lacking = shortfall(graph, end, goal)
    if lacking.unmet:
        return Ending("goal_unmet", None, str(lacking.unmet[0]), end)
    if lacking.unsafe:
        flag, obj = lacking.unsafe[0]
        return Ending("left_open" if flag is Flag.OPEN else "left_on", None, obj, end)
    return Ending("valid", None, "", end)
