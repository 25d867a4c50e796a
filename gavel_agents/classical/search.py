"""A plain planner over the transition model itself: weighted best-first search with the estimate of `estimate`.

Nothing is translated: successors are `dynamics.apply`, so a plan that is found is valid by construction. The search is
for one task at a time and looks only at what its goal can need.

The robot of the search is a little less capable than the model says: beside an open piece of furniture it can work on
what it went to, not on everything that lies there. In a house a countertop is longer than an arm, and the agents go to
the thing on it, not to its middle.
"""

from __future__ import annotations

import heapq
from collections.abc import Hashable, Iterator
from typing import NamedTuple

from gavel_agents.classical.estimate import HOPELESS, estimate
from gavel_agents.classical.needs import Needs
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, apply, first_violation, unsafe
from gavel_env.world_model.goals import GoalText, as_goal, unmet
from gavel_env.world_model.graph import Flag, SceneGraph

__all__ = ["MOST_STATES", "Found", "handy", "search"]

MOST_STATES = 1_500
"""States that are looked at before the search gives up: a single task takes at most 50, the largest activity that is
solved about 1,200."""

_WEIGHT = 3.0


class Found(NamedTuple):
    """What a search came to.

    Attributes:
        plan: the plan, or None.
        states: states that were expanded.
        reason: why there is no plan; empty if there is one.
    """

    plan: tuple[Action, ...] | None
    states: int = 0
    reason: str = ""


class _Node(NamedTuple):
    graph: SceneGraph
    at: str | None
    parent: _Node | None
    action: Action | None
    depth: int

    def plan(self) -> tuple[Action, ...]:
        steps: list[Action] = []
        node: _Node | None = self
        while node is not None and node.action is not None:
            steps.append(node.action)
            node = node.parent
        return tuple(reversed(steps))


def search(
    graph: SceneGraph, goal: GoalText, profile: Profile = Profile.PAPER, most_states: int = MOST_STATES
) -> Found:
    """Search for a valid plan: applicable, goal met, and safe at its end.

    Args:
        graph: the state that is planned from.
        goal: g of one task.
        profile: rules profile.
        most_states: states to expand at most.
    """
    goal = as_goal(goal)
    needs = Needs(graph, goal, profile)
    start = _Node(graph, None, None, None, 0)
    first = estimate(needs, graph, handy(graph, None))
    if first >= HOPELESS:
        return Found(None, 0, "no sequence of actions known here brings the goal about")
    queue: list[tuple[float, float, int, _Node]] = [(0.0, first, 0, start)]
    seen = {_key(start)}
    pushed = expanded = 0
    while queue and expanded < most_states:
        _, _, _, node = heapq.heappop(queue)
        if not unmet(goal, node.graph) and not unsafe(graph, node.graph, goal):
            return Found(node.plan(), expanded)
        expanded += 1
        for action in _actions(node, needs.relevant):
            if first_violation(node.graph, action, profile) is not None:
                continue
            after = apply(node.graph, action)
            at = action.target if action.primitive is Primitive.NAVIGATE_TO else node.at
            child = _Node(after, at, node, action, node.depth + 1)
            key = _key(child)
            if key in seen:
                continue
            seen.add(key)
            left = estimate(needs, after, handy(after, at))
            if left >= HOPELESS:
                continue
            pushed += 1
            heapq.heappush(queue, (child.depth + _WEIGHT * left, left, pushed, child))
    if queue:
        return Found(None, expanded, f"gave up after {expanded} states")
    return Found(None, expanded, f"none of the {expanded} states that can be reached meets the goal")


def handy(graph: SceneGraph, at: str | None) -> frozenset[str]:
    """Return what can be worked on from where the robot went: on an open piece of furniture not all that lies there.

    Args:
        graph: the state.
        at: what it went to last, or None.
    """
    if at is None or at == graph.holding:
        return graph.near
    category = graph.category(at)
    if category.graspable or category.has_door:
        return graph.near
    return graph.near.difference(graph.descendants(at))


def _actions(node: _Node, relevant: tuple[str, ...]) -> Iterator[Action]:
    """Yield the actions that may be of use in a state."""
    graph = node.graph
    near = handy(graph, node.at)
    held = graph.holding
    for x in relevant:
        category = graph.category(x)
        if x != held and x != node.at:
            yield Action(Primitive.NAVIGATE_TO, x)
        if x not in near:
            continue
        if held is None and category.liftable:
            yield Action(Primitive.GRASP, x)
        if held is not None and category.surface:
            yield Action(Primitive.PLACE_ON_TOP, x)
        if held is not None and category.interior:
            yield Action(Primitive.PLACE_INSIDE, x)
        if category.openable:
            yield Action(Primitive.CLOSE if graph.has(Flag.OPEN, x) else Primitive.OPEN, x)
        if category.toggleable:
            yield Action(Primitive.TOGGLE_ON, x)
            if graph.has(Flag.TOGGLED, x):
                yield Action(Primitive.TOGGLE_OFF, x)
    if held is not None:
        yield Action(Primitive.RELEASE)


def _key(node: _Node) -> Hashable:
    graph = node.graph
    return frozenset(graph.supports.items()), graph.flags, graph.holding, node.at, graph.near, graph.next_to
