"""Algorithm 1: the one pipeline behind every method but the oracle; `MethodConfig` says what each of them does.

understand -> believed graph and belief -> proposals (repair, validate, complain) -> order -> execute, binding
designators to what is observed -> update the belief -> order again.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_agents.agent import AgentTrace, stage
from gavel_agents.beliefs.belief import Belief, Prior
from gavel_agents.beliefs.believed_graph import believed_graph, observe_flags
from gavel_agents.binding import Binder
from gavel_agents.llm import ChatModel
from gavel_agents.methods import MethodConfig
from gavel_agents.ordering.cost import COVERAGE_WIDTH_M, Place, TravelModel
from gavel_agents.ordering.order import expected_costs, orderings
from gavel_agents.proposing.proposals import Planned, Problem, edited_plans, proposed_plans
from gavel_agents.understanding import TaskUnderstanding, Understanding
from gavel_env.exchange import EnvAction, Observed
from gavel_env.instructions.lookup import About
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, apply, first_violation
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import Relation, SceneGraph, Support
from gavel_env.world_model.ontology import Ontology, default_ontology
from gavel_env.world_model.verdict import Plan, validate

__all__ = ["PlanningAgent"]

Floats = NDArray[np.float64]


class PlanningAgent:
    """An agent that plans over its believed graph and executes task by task."""

    def __init__(
        self,
        name: str,
        config: MethodConfig,
        *,
        understanding: Understanding,
        model: ChatModel | None,
        prior: Prior,
        profile: Profile = Profile.PAPER,
        ontology: Ontology | None = None,
        on_surprise: Literal["stop", "next"] = "stop",
        coverage_width_m: float = COVERAGE_WIDTH_M,
        seed: int | None = None,
    ) -> None:
        """Configure the pipeline.

        Args:
            name: shown in tables.
            config: the method.
            understanding: shared by all methods of a comparison.
            model: the planner; None for methods that ask none.
            prior: where objects of a category usually are.
            profile: rules profile of the environment.
            ontology: affordances (default: the shipped ones).
            on_surprise: what to do when something is not in the piece where it was said to be: "stop" (the benchmarks'
                sources are unique), or close that piece and try the "next" one that fits.
            coverage_width_m: w_cov of the cost model (default: as measured on the executor; the paper's is 1.2 m).
            seed: of the model's sampling, if it samples.
        """
        self.name = name
        self.config = config
        self.trace = AgentTrace()
        self._understanding = understanding
        self._model = model
        self._prior = prior
        self._profile = profile
        self._on_surprise = on_surprise
        self._coverage_width_m = coverage_width_m
        self._seed = seed
        self._ontology = ontology or default_ontology()
        self._travel: TravelModel | None = None

    # --- lines 1-18: understand and plan ---------------------------------------------------------------------------

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        """Understand the instruction, believe, plan and order."""
        observed: Observed = info["observed"]
        self.trace = AgentTrace()
        self._binder = Binder()
        self._running: deque[Action] = deque()
        self._sent: Action | None = None
        self._order: list[int] = []
        self._remaining: list[int] = []
        if self._travel is None or self._travel.layout is not observed.layout:
            self._travel = TravelModel(observed.layout, self._coverage_width_m)
        with stage(self.trace, "understand"):
            understood = self._understanding.understand(observed.instruction, rooms=observed.graph.world.rooms)
        if understood.asked is not None:  # perhaps of an earlier episode with the same text
            self.trace.seconds["understand"] = understood.asked.seconds
            self.trace.prompt_tokens += understood.asked.prompt_tokens
            self.trace.completion_tokens += understood.asked.completion_tokens
        if not understood.tasks:
            self.trace.stopped = f"not understood: {understood.refused}"
            return
        self._tasks = understood.tasks
        world = observed.graph.world
        self._graph = believed_graph(
            world.rooms, world.connections, self._tasks, self._ontology, observed.graph.robot_room
        )
        self._belief = Belief.initial(self._graph, observed.layout, self._travel.rooms, self._prior)
        self._belief = self._belief.update(self._graph, observed, self._binder.bound)
        self._planned = self._plan(observed)
        self._remaining = list(range(len(self._tasks)))
        self._order = list(self._remaining) if self.config.order == "written" else self._reorder(observed)

    def _plan(self, observed: Observed) -> Planned:
        start = self._place(observed)
        beliefs, cells = self._cost_view(observed)
        travel = self._travel
        assert travel is not None

        def cost(_: SceneGraph, plan: Any) -> float:
            return travel.rollout(plan, start, beliefs, cells).metres

        problem = Problem(
            About.of(observed.instruction, observed.graph.world.rooms),
            self._tasks,
            self._graph,
            self._belief.likely(),
            cost,
            self._profile,
            self._seed,
        )
        if self.config.source == "edits":
            return edited_plans(problem, self.trace)
        assert self._model is not None
        return proposed_plans(problem, self.config, self._model, self.trace)

    @property
    def beliefs(self) -> dict[str, dict[str, float]]:
        """Return node of the believed graph -> room id -> belief, possible rooms only; empty if nothing is planned."""
        return self._belief.priors() if self.trace.tasks else {}

    # --- lines 19-30: order, execute, update -----------------------------------------------------------------------

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        """Take in what the last action showed; return the next one, or None when all tasks are done."""
        observed: Observed = info["observed"]
        if self._sent is not None:
            if observed.outcome != "ok":
                self.trace.stopped = f"{self._sent} was refused: {observed.outcome}"
                return None
            if not self._take_in(self._sent, observed):
                self._running.appendleft(self._sent)
            self._sent = None
        while not self._running:
            if not self._order:
                return None
            if self.config.order == "every_task" and self.trace.order:
                self._order = self._reorder(observed)
            task = self._order.pop(0)
            self._remaining.remove(task)
            self.trace.order.append(task)
            self._running.extend(self._planned.plans[task])
        self._sent = self._running.popleft()
        if self._on_surprise == "next":
            empty = self._binder.missing(self._sent, self._graph, observed)
            if empty is not None:
                return self._try_next(empty)
        return self._binder.send(self._sent, self._graph, observed, self._belief.priors())

    def _try_next(self, holder: str) -> EnvAction:
        """Leave a piece that does not hold what was said, and plan to try the next one that fits."""
        assert self._sent is not None
        steps = [Action(Primitive.NAVIGATE_TO, holder)]
        if self._graph.category(holder).has_door:
            steps.append(Action(Primitive.OPEN, holder))
        self._running.extendleft(reversed([*steps, self._sent]))
        wrong = self._binder.reject(holder)
        if not self._graph.category(holder).has_door:
            self._sent = self._running.popleft()
            return EnvAction(Primitive.NAVIGATE_TO, holder, self._belief.priors().get(holder), (wrong,))
        self._sent = Action(Primitive.CLOSE, wrong)
        return EnvAction.of(self._sent)

    def _take_in(self, action: Action, observed: Observed) -> bool:
        """Advance the believed graph by f(G, a), bind what was reached, and update B <- Upsilon(B, a, z).

        Returns:
            False if a search came to something else than it was for, and must go on.
        """
        if not self._binder.arrived(action, self._graph, observed):
            return False
        for node, instance in self._binder.bound.items():
            room = observed.graph.room_of(instance)
            if node not in self._graph.supports and room is not None and instance != observed.graph.holding:
                self._graph = self._graph.place(node, Support(Relation.FLOOR, room))
        if first_violation(self._graph, action, self._profile) is None:
            self._graph = apply(self._graph, action)
        self._graph = msgspec.structs.replace(self._graph, robot_room=observed.graph.robot_room)
        self._graph = observe_flags(self._graph, observed.graph, self._binder.bound)
        self._belief = self._belief.update(self._graph, observed, self._binder.bound)
        return True

    def _reorder(self, observed: Observed) -> list[int]:
        """Return the cheapest ordering of the remaining tasks whose concatenation validates (the cheapest if none)."""
        with stage(self.trace, "order"):
            tasks = list(self._remaining)
            if len(tasks) < 2 and self.trace.expected_m is not None:
                return tasks
            beliefs, cells = self._cost_view(observed)
            plans = [self._planned.plans[i] for i in tasks]
            assert self._travel is not None
            costs = expected_costs(self._travel, plans, self._place(observed), beliefs, cells)
            goal = _union([self._tasks[i] for i in tasks])

            def passes(order: tuple[int, ...]) -> bool:
                joined: Plan = tuple(action for j in order for action in plans[j])
                return validate(self._graph, joined, goal, profile=self._profile).valid

            cheapest = next(orderings(costs))
            # A plan that is invalid alone is invalid in every order: then nothing is to be gained by trying them.
            sound = all(self._planned.verdicts[i].valid for i in tasks)
            order = next(filter(passes, orderings(costs)), cheapest) if sound else cheapest
            if self.trace.expected_m is None:
                self.trace.expected_m = costs.ordering_cost(order)
            return [tasks[j] for j in order]

    def _place(self, observed: Observed) -> Place:
        assert self._travel is not None
        return self._travel.at(observed.cell)

    def _cost_view(self, observed: Observed) -> tuple[dict[str, Floats], dict[str, int]]:
        """Return the beliefs that the cost model sees, and the map cells of what is localised."""
        cells: dict[str, int] = {}
        for node in self._graph.world.nodes:
            instance = self._binder.destination(node, self._graph, observed)
            if instance is not None and instance in observed.positions:
                x, y = observed.positions[instance]
                cell = observed.layout.nearest_reachable(x, y, observed.graph.room_of(instance))
                if cell is not None:
                    cells[node] = cell
        belief = self._belief.collapsed() if self.config.belief == "argmax" else self._belief
        return {node: belief[node] for node in self._graph.world.nodes if node not in cells}, cells


def _union(tasks: list[TaskUnderstanding]) -> Goal:
    goal = Goal()
    for task in tasks:
        goal = goal | task.goal
    return goal
