"""Shortening a valid plan: loops, needless navigation, doors and switches worked for nothing, put-back/take-out pairs.

A cut is kept only if the plan stays valid, ends in the very same state (supports and flags of everything), and costs no
more. What an appliance did to an object is thus never cut away, even if the goal does not mention it.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

from gavel_agents.edits.rule import Edit, drop
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, GoalText, as_goal
from gavel_env.world_model.graph import SceneGraph, Support
from gavel_env.world_model.own_actions import own_action
from gavel_env.world_model.verdict import CostFunction, Verdict, validate

__all__ = ["prune"]

PUTTING = (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE, Primitive.RELEASE)
INVERSE = {
    Primitive.OPEN: Primitive.CLOSE,
    Primitive.CLOSE: Primitive.OPEN,
    Primitive.TOGGLE_ON: Primitive.TOGGLE_OFF,
    Primitive.TOGGLE_OFF: Primitive.TOGGLE_ON,
}


class Cut(NamedTuple):
    """Steps that may be superfluous."""

    rule: str
    steps: tuple[int, ...]


def prune(
    verdict: Verdict,
    goal: GoalText,
    *,
    cost: CostFunction | None = None,
    profile: Profile = Profile.PAPER,
) -> tuple[Verdict, tuple[Edit, ...]]:
    """Return the verdict of the shortened plan, and the cuts in order.

    Args:
        verdict: of a valid plan.
        goal: g.
        cost: as in `validate`.
        profile: rules profile.
    """
    goal = as_goal(goal)
    edits: list[Edit] = []
    while True:
        shorter = _first_good_cut(verdict, goal, cost, profile)
        if shorter is None:
            return verdict, tuple(edits)
        verdict, edit = shorter
        edits.append(edit)


def _first_good_cut(
    verdict: Verdict, goal: Goal, cost: CostFunction | None, profile: Profile
) -> tuple[Verdict, Edit] | None:
    graph = verdict.trace[0]
    keys = _state_keys(verdict)
    for cut in (*cut_loop(verdict, keys), *drop_navigation(verdict), *drop_pair(verdict), *carry_on(verdict)):
        change = drop(verdict.plan, cut.steps)
        shorter = validate(graph, change.plan, goal, cost=cost, profile=profile, known=verdict)
        if shorter.valid and shorter.rank >= verdict.rank and _state_keys(shorter)[-1] == keys[-1]:
            return shorter, Edit(cut.rule, cut.steps[0], "superfluous", change.text, change.plan)
    return None


def cut_loop(verdict: Verdict, keys: list[Hashable]) -> Iterator[Cut]:
    """Loop: the steps between two visits to the same state, longest first."""
    last = len(verdict.plan)
    for first in range(last):
        for after in range(last, first, -1):
            if keys[first] == keys[after] and _leaves_no_trace(verdict, first, after):
                yield Cut("cut_loop", tuple(range(first, after)))
                return


def _leaves_no_trace(verdict: Verdict, first: int, after: int) -> bool:
    """Return whether the robot's place does not matter: the same, or left at once, or the plan ends."""
    if after == len(verdict.plan) or verdict.plan[after].primitive is Primitive.NAVIGATE_TO:
        return True
    before, then = verdict.trace[first], verdict.trace[after]
    return before.near == then.near and before.robot_room == then.robot_room


def drop_navigation(verdict: Verdict) -> Iterator[Cut]:
    """Navigation to where the robot is near enough already."""
    for step, action in enumerate(verdict.plan[:-1]):
        following = verdict.plan[step + 1]
        if action.primitive is Primitive.NAVIGATE_TO and following.target in verdict.trace[step].near:
            yield Cut("drop_navigation", (step,))


def drop_pair(verdict: Verdict) -> Iterator[Cut]:
    """Door or switch worked to and fro for nothing."""
    worked: dict[tuple[str | None, bool], int] = {}
    for step, (primitive, target, _) in enumerate(verdict.plan):
        if primitive not in INVERSE:
            continue
        kind = (target, primitive in (Primitive.OPEN, Primitive.CLOSE))
        before = worked.get(kind)
        if before is not None and verdict.plan[before].primitive is INVERSE[primitive]:
            yield Cut("drop_pair", (before, step))
        worked[kind] = step


def carry_on(verdict: Verdict) -> Iterator[Cut]:
    """Object put down only to be taken up again: keep it in the hand, or leave it where it was."""
    grasped: dict[str | None, int] = {}
    put: dict[str | None, int] = {}
    for step, (primitive, target, _) in enumerate(verdict.plan):
        if primitive is Primitive.GRASP:
            if target in put:
                yield Cut("carry_on", (put[target], step))
            grasped[target] = step
        elif primitive in PUTTING:
            held = verdict.trace[step].holding
            put[held] = step
            if held in grasped:
                yield Cut("carry_on", (grasped[held], step))


def _state_keys(verdict: Verdict) -> list[Hashable]:
    """Return a key per state of the trace: equal keys = same supports, flags and hand (the robot's place aside)."""
    start = verdict.trace[0]
    moved: dict[str, Support | None] = {}
    keys: list[Hashable] = [_key(start, moved)]
    for action, before, after in zip(verdict.plan, verdict.trace, verdict.trace[1:], strict=False):
        if after.supports is not before.supports and own_action(action.primitive) is not None:
            # The effect of an action of one's own may move anything.
            changed = (o for o in start.world.nodes if after.supports.get(o) != start.supports.get(o))
            moved = {o: after.supports.get(o) for o in changed}
        elif after.supports is not before.supports:
            obj = after.holding or before.holding
            assert obj is not None
            moved[obj] = after.supports.get(obj)
            if moved[obj] == start.supports.get(obj):
                del moved[obj]
        keys.append(_key(after, moved))
    return keys


def _key(graph: SceneGraph, moved: dict[str, Support | None]) -> Hashable:
    return graph.holding, frozenset(moved.items()), graph.flags, graph.next_to
