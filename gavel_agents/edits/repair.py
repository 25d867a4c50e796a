"""Model-derived plan repair (Alg. 2 of the paper).

The loop is the algorithm as printed. Three things are made definite that the paper leaves open:

* EDIT may have several edits for a verdict (grasp in passing, fetch, drop the step); they come best first, and the
  first that leads to a plan not in S is taken. The search ends, as printed, when none is left.
* Insertions could lengthen a plan without end, so the number of edits is bounded.
* A valid plan is finally shortened (`edits.pruning`), which can only raise rk.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from gavel_agents.edits import Edit, offers, prune
from gavel_env.world_model.actions import Action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import GoalText, as_goal
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import CostFunction, Plan, Verdict, validate

__all__ = ["MOST_EDITS", "Repaired", "repair"]

MOST_EDITS = 120


class Repaired(msgspec.Struct, frozen=True):
    """What repair returns.

    Attributes:
        plan: pi*, the best candidate by rk.
        verdict: omega* of that plan.
        edits: the edits that led from the proposal to it, in order.
        before: verdict of the proposal.
    """

    plan: Plan
    verdict: Verdict
    edits: tuple[Edit, ...]
    before: Verdict

    @property
    def trace(self) -> tuple[str, ...]:
        """The edit trace, one line per edit."""
        return tuple(map(str, self.edits))


def repair(
    graph: SceneGraph,
    plan: Sequence[Action],
    goal: GoalText,
    *,
    cost: CostFunction | None = None,
    profile: Profile = Profile.PAPER,
    shorten: bool = True,
    most_edits: int = MOST_EDITS,
) -> Repaired:
    """Repair a plan as far as the action model, the graph and the goal determine how.

    Args:
        graph: believed (or hidden) graph G.
        plan: pi.
        goal: g; a `Goal`, text or a list of texts.
        cost: gives omega.d; default: number of navigations.
        profile: rules profile.
        shorten: prune a valid plan.
        most_edits: bound on the number of edits.

    Returns:
        The best candidate by rk, never below the proposal; valid only if its verdict says so.
    """
    plan, goal = tuple(plan), as_goal(goal)
    best = before = verdict = validate(graph, plan, goal, cost=cost, profile=profile)
    seen = {plan}
    edits: list[Edit] = []
    edits_of_best = 0
    while True:
        verdict = validate(graph, plan, goal, cost=cost, profile=profile, known=verdict)
        if verdict.rank > best.rank:
            best, edits_of_best = verdict, len(edits)
        if verdict.app and verdict.safe and not verdict.unmet:
            break
        edit = next((e for e in offers(verdict, goal, profile) if e.plan not in seen), None)
        if edit is None or len(edits) == most_edits:
            break
        seen.add(edit.plan)
        edits.append(edit)
        plan = edit.plan
    applied = tuple(edits[:edits_of_best])
    if shorten and best.valid:
        best, cuts = prune(best, goal, cost=cost, profile=profile)
        applied += cuts
    return Repaired(best.plan, best, applied, before)
