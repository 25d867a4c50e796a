"""The cost reference: reference subplans, ground-truth locations, and the ordering that drives the fewest metres.

The oracle alone is privileged: `reveal` takes the environment's one privileged call, which makes every object known.
"""

from __future__ import annotations

import copy
import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gavel_agents.agent import AgentTrace, TaskTrace, stage
from gavel_env.errors import ResetNeeded
from gavel_env.exchange import EnvAction, Observation, view
from gavel_env.instructions.record import TaskSpec
from gavel_env.sim.episode import Privileged
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import apply, first_violation
from gavel_env.world_model.goals import Goal, unmet
from gavel_env.world_model.graph import SceneGraph

__all__ = ["OracleAgent"]


class _Situation(NamedTuple):
    """A simulated state: the graph, the robot's cell, and where things lie on the floor."""

    graph: SceneGraph
    cell: int
    spots: Mapping[str, int]


class _Driven:
    """Where a simulated robot is after driving some reference plans."""

    def __init__(self, state: Privileged) -> None:
        self._state = state
        self._places = copy.copy(state.executor.places)
        self._metres: dict[tuple[int, tuple[int, ...]], tuple[float, int]] = {}

    def follow(self, plan: Sequence[Action], start: _Situation) -> tuple[float, _Situation] | None:
        """Return the metres and the situation after a plan, or None if it is refused."""
        metres = 0.0
        graph, cell, spots = start
        for action in plan:
            if first_violation(graph, action, self._state.executor.profile) is not None:
                return None
            if action.primitive is Primitive.NAVIGATE_TO and action.target is not None:
                self._places.spots = dict(spots)
                driven, cell = self._leg(graph, action.target, cell)
                metres += driven
            elif action.primitive is Primitive.RELEASE and graph.holding is not None:
                spots = {**spots, graph.holding: cell}
            graph = apply(graph, action)
        return metres, _Situation(graph, cell, spots)

    def _leg(self, graph: SceneGraph, target: str, cell: int) -> tuple[float, int]:
        stances = self._places.stances(graph, target, cell)
        key = (cell, tuple(stances.tolist()))
        if key not in self._metres:
            route = self._state.floor.route(cell, stances)
            self._metres[key] = (np.inf, cell) if route is None else (route.metres, int(route.cells[-1]))
        return self._metres[key]


class OracleAgent:
    """Knows where everything is."""

    name = "oracle"

    def __init__(self) -> None:
        self.trace = AgentTrace()
        self._state: Privileged | None = None

    def reveal(self, env: Any) -> None:
        """Take the hidden state of the episode that has just begun."""
        self._state = env.unwrapped.reveal()

    def reset(self, observation: Observation, info: Mapping[str, Any]) -> None:
        """Order the reference plans by the metres they really take; a task without one is planned classically.

        Raises:
            ResetNeeded: `reveal` has not been called for this episode.
        """
        if self._state is None or self._state.instruction.text != view(observation).instruction:
            raise ResetNeeded("the oracle needs reveal(env) after env.reset(...) and before its own reset(...)")
        state = self._state
        self.trace = AgentTrace()
        self._left: deque[Action] = deque()
        plans: list[Sequence[Action]] = []
        for task in state.instruction.tasks:
            plan = task.parsed_plan() or _planned(state, task)
            if plan is None:
                self.trace.stopped = f"not understood: no_reference: no plan is known or found for {task.text!r}"
                return
            plans.append(plan)
            verdict = "reference" if task.reference_plan else "planned"
            steps = tuple(map(str, plan))
            self.trace.tasks.append(TaskTrace(text=task.text, goal=task.goal, plan=steps, verdict=verdict))
        with stage(self.trace, "order"):
            order = _cheapest(state, plans)
        self.trace.order.extend(order)
        self._left = deque(action for index in order for action in plans[index])

    def act(self, observation: Observation, info: Mapping[str, Any]) -> EnvAction | None:
        """Return the next step of the reference plans; None at their end or after a refusal."""
        outcome = view(observation).outcome
        if outcome not in ("", "ok"):
            self.trace.stopped = f"invalid: {outcome}"
            return None
        return EnvAction.of(self._left.popleft()) if self._left else None


def _planned(state: Privileged, task: TaskSpec) -> tuple[Action, ...] | None:
    """Return a plan over the true graph, or None if a search finds none."""
    from gavel_agents.classical.search import search

    return search(state.graph, task.parsed_goal(), state.executor.profile).plan


def _cheapest(state: Privileged, plans: Sequence[Sequence[Action]]) -> tuple[int, ...]:
    """Return the ordering of fewest metres among those that run and meet the whole goal; ties in written order.

    Orderings are grown task by task, so that common beginnings are driven once; a beginning that already takes longer
    than the best whole ordering is cut off.
    """
    goal: Goal = state.instruction.goal()
    driven = _Driven(state)
    written = tuple(range(len(plans)))
    if len(plans) < 2:
        return written
    best: tuple[float, tuple[int, ...]] = (float("inf"), written)

    def grow(order: tuple[int, ...], metres: float, situation: _Situation) -> None:
        nonlocal best
        if metres >= best[0] - 1e-9:
            return
        if len(order) == len(plans):
            if not unmet(goal, situation.graph):
                best = (metres, order)
            return
        for index in itertools.filterfalse(order.__contains__, written):
            after = driven.follow(plans[index], situation)
            if after is not None:
                grow((*order, index), metres + after[0], after[1])

    grow((), 0.0, _Situation(state.graph, state.cell, state.executor.places.spots))
    return best[1]
