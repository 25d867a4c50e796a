"""A small deterministic task planner for BEHAVIOR activities: reference plans are found here, never written by hand.

For each way to meet the goal (`activity_wants.choices`, cheapest first) states are made first (dirt washed off, food
heated or frozen), then things are brought to their places, holders before what they hold; then switches and doors. What
was opened on the way is shut as soon as nothing more is needed from it. A plan counts only if the transition model
carries it out, meets the goal and calls it safe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from envs_data.build.activity_steps import Doer, Stuck
from envs_data.build.activity_wants import about_nearness, choices
from gavel_env.world_model.actions import Action
from gavel_env.world_model.conditions import Formula, conjuncts
from gavel_env.world_model.dynamics import rollout, unsafe
from gavel_env.world_model.goals import Goal, unmet
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Found", "find_plan"]


class Found(NamedTuple):
    """A plan, or why there is none.

    Attributes:
        plan: the actions; empty if there is none.
        why: empty, or what stands in the way of the way to meet the goal that came furthest.
    """

    plan: tuple[Action, ...]
    why: str = ""


def find_plan(start: SceneGraph, condition: Formula, scope: Sequence[str], reachable: Callable[[str], bool]) -> Found:
    """Return a plan that meets a condition.

    Args:
        start: G*_0.
        condition: the goal.
        scope: ids of the activity's own objects; appliances and tools among them are preferred.
        reachable: whether the robot can get at a piece.
    """
    parking = [o for o in scope if o in start.world.nodes and start.world.nodes[o].fixed and start.category(o).surface]
    goal = Goal(conditions=(condition,))
    parts = list(conjuncts(condition))
    backwards = parts[::-1]
    orders = [sorted(parts, key=about_nearness), parts, backwards, sorted(backwards, key=about_nearness)]
    why = ""
    for way in (way for order in orders for way in choices(order, start, parking)):
        try:
            plan = tuple(Doer(start, way, scope, reachable).run())
        except Stuck as stuck:
            why = why or str(stuck)
            continue
        end, violation = rollout(start, plan)
        if violation is not None or unmet(goal, end) or unsafe(start, end, goal):
            why = why or "the plan found does not meet the goal"
            continue
        return Found(plan)
    return Found((), why or _why_no_way(condition, start))


def _why_no_way(condition: Formula, start: SceneGraph) -> str:
    """Say which part of the goal cannot come about, and what cannot be moved for it."""
    nodes = start.world.nodes
    for part in conjuncts(condition):
        if choices([part], start, ()):
            continue
        movers = dict.fromkeys(
            obj
            for atom, _, domains in part.asked()
            if len(atom.args) == 2
            for obj in domains.get(atom.args[0], atom.args[:1])
            if obj in nodes
        )
        fixed = [obj for obj in movers if nodes[obj].fixed]
        heavy = [obj for obj in movers if not nodes[obj].fixed and not start.category(obj).liftable]
        reasons = [f"{', '.join(heavy)} cannot be lifted"] if heavy else []
        reasons += [f"{', '.join(fixed)} of the scene stays where it is"] if fixed else []
        return f"{' and '.join(reasons) or 'no way to bring it about'}: {str(part)[:100]}"
    return "no way was found that does all parts of the goal together"
