"""Algorithm 1: the one pipeline behind every method but the oracle; `MethodConfig` says what each of them does.

understand -> believed graph and belief -> proposals (repair, validate, complain) -> order -> execute, binding
designators to what is observed -> update the belief -> order again.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Sequence
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_agents.agent import AgentTrace, stage
from gavel_agents.beliefs.belief import Belief, Prior
from gavel_agents.beliefs.believed_graph import believed_graph, observe_flags
from gavel_agents.beliefs.narrowing import Narrowed, narrow
from gavel_agents.beliefs.unsaid import with_appliances
from gavel_agents.binding import Binder
from gavel_agents.edits.repair import repair
from gavel_agents.findings import Findings
from gavel_agents.llm import ChatModel
from gavel_agents.methods import MethodConfig
from gavel_agents.ordering.cost import TravelModel, travel_model
from gavel_agents.ordering.decision import Candidate, returning_search
from gavel_agents.ordering.knowledge import Knowledge, knowledge, localised
from gavel_agents.ordering.simulator import Simulator
from gavel_agents.ordering.situation import Situation
from gavel_agents.proposing.proposals import Planned, Problem, edited_plans, proposed_plans
from gavel_agents.understanding import TaskUnderstanding, Understanding
from gavel_env.exchange import EnvAction, Observation, Observed, view
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
        on_surprise: Literal["stop", "next"] = "next",
        coverage_width_m: float | None = None,
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
            on_surprise: what to do when something is not in the piece where it was said to be: close that piece and try
                the "next" one that fits what was said, or "stop".
            coverage_width_m: w_cov of J (default: 1.2 m with the paper's cost, else as measured on the executor).
            seed: of the model's sampling, if it samples, and of simulated worlds.
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
        self._simulator: Simulator | None = None

    # --- lines 1-18: understand and plan ---------------------------------------------------------------------------

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Understand the instruction, believe, plan and order."""
        observed = view(observation)
        self.trace = AgentTrace()
        self._binder = Binder()
        self._running: deque[Action] = deque()
        self._sent: Action | None = None
        self._order: list[int] = []
        self._remaining: list[int] = []
        self._begun = self._committed = self._returning = False
        if self._travel is None or self._travel.layout is not observed.layout:
            self._travel = travel_model(observed.layout, self.config.cost, self._coverage_width_m)
            simulates = self.config.cost == "simulated"
            self._simulator = Simulator(observed.layout, self._seed or 0) if simulates else None
        with stage(self.trace, "understand"):
            understood = self._understanding.understand(observed.instruction, rooms=observed.graph.world.rooms)
        if understood.asked is not None:  # perhaps of an earlier episode with the same text
            self.trace.seconds["understand"] = understood.asked.seconds
            self.trace.prompt_tokens += understood.asked.prompt_tokens
            self.trace.completion_tokens += understood.asked.completion_tokens
        if not understood.tasks:
            self.trace.stopped = f"not understood: {understood.refused}"
            return
        narrowed = narrow(understood.tasks, observed.graph.world.rooms, self._ontology)
        said = self._believed(narrowed, observed)
        completed = with_appliances(narrowed, said, self._ontology)
        self._tasks = completed.tasks
        self._graph = said if completed is narrowed else self._believed(completed, observed)
        self._findings = Findings(self._binder, self._graph)
        self._belief = Belief.initial(self._graph, observed.layout, self._travel.rooms, self._prior)
        self._belief = self._belief.update(self._graph, observed, self._binder.bound)
        self._planned = self._plan(observed)
        self._remaining = list(range(len(self._tasks)))
        self._order = list(self._remaining) if self.config.order == "written" else self._reorder(observed)

    def _believed(self, narrowed: Narrowed, observed: Observed) -> SceneGraph:
        world, (tasks, kinds) = observed.graph.world, narrowed
        return believed_graph(world.rooms, world.connections, tasks, self._ontology, observed.graph.robot_room, kinds)

    def _plan(self, observed: Observed) -> Planned:
        travel = self._travel
        assert travel is not None
        start = travel.at(observed.cell)
        beliefs, cells = self._cost_view(observed)

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

    def act(self, observation: Observation, info: dict[str, Any]) -> EnvAction | None:
        """Take in what the last action showed; return the next one, or None when all tasks are done."""
        observed = view(observation)
        if self._sent is not None:
            if observed.outcome != "ok":
                self.trace.stopped = f"{self._sent} was invalid: {observed.outcome}"
                return None
            if self._returning and observed.reached is None:
                self._come_back(self._sent, observed)
            elif not self._take_in(self._sent, observed):
                self._running.appendleft(self._sent)
            self._sent = None
        while True:
            while not self._running:
                if not self._order:
                    return None
                self._begin_task(observed)
            action = self._running.popleft()
            if not self._findings.is_needless(action, observed):
                break
        self._returning = False
        if self._on_surprise == "next":
            surprise = self._binder.surprise(action, self._graph, observed)
            if surprise is not None:
                self._graph, steps = self._findings.after(surprise, action, self._graph, observed)
                self._running.extendleft(reversed(steps))
                action = self._running.popleft()
        self._sent = action
        sent = self._binder.send(self._sent, self._graph, observed, self._belief.priors())
        goes = sent.primitive is Primitive.NAVIGATE_TO
        self._committed = self._committed or not goes
        searches = goes and self._sent.target in self._belief and sent.target not in observed.graph.world.nodes
        self._returning = searches and self.config.rooms == "simulated"
        return self._returning_search(sent, observed) if self._returning else sent

    def _begin_task(self, observed: Observed) -> None:
        if self.config.order == "every_task" and self._begun:
            self._order = self._reorder(observed)
        task = self._order.pop(0)
        self._remaining.remove(task)
        self.trace.order.append(task)
        self._running.extend(self._planned.plans[task])
        self._begun, self._committed = True, False
        if self._findings.may_differ:
            self._adapt()

    # --- gavel-plus: searches that come back to be decided again ---------------------------------------------------

    def _returning_search(self, search: EnvAction, observed: Observed) -> EnvAction:
        """Return a search that comes back; unless its task has changed the world, also for what other tasks want."""
        assert self._sent is not None
        assert self._simulator is not None
        with stage(self.trace, "order"):
            known = self._knowledge(observed)
            others = [self._planned.plans[i] for i in self._order]
            steps = () if self._committed else itertools.chain(*others)
            wanted = {
                self._binder.designator(step.target, self._graph)
                for step in steps
                if step.primitive is Primitive.NAVIGATE_TO and step.target and not known.where.get(step.target, "?")
            }
            plans = [[self._sent, *self._running], *others]
            return returning_search(self._simulator, known, search, plans, sorted(wanted))

    def _come_back(self, action: Action, observed: Observed) -> None:
        """Take in what was seen on the way; unless the task has changed the world already, any task may come next."""
        self._graph = msgspec.structs.replace(self._graph, robot_room=observed.graph.robot_room)
        self._belief = self._belief.update(self._graph, observed, self._binder.bound, self._binder.rejected)
        self._running.appendleft(action)
        if not self._committed:
            task = self.trace.order.pop()
            self._running.clear()
            self._remaining = sorted([*self._remaining, task])
            self._order.insert(0, task)

    def _knowledge(self, observed: Observed) -> Knowledge:
        belief = self._belief.collapsed() if self.config.belief == "argmax" else self._belief
        return knowledge(self._graph, belief, self._binder, observed)

    def _adapt(self) -> None:
        """Repair the rest of the task under way if what was found affords other steps than what was expected."""
        if not self.config.repair:
            return
        task = self.trace.order[-1]
        with stage(self.trace, "repair"):
            repaired = repair(
                self._graph, tuple(self._running), self._tasks[task].goal, profile=self._profile, shorten=False
            )
        if repaired.verdict.rank[:3] > repaired.before.rank[:3]:
            self._running = deque(repaired.plan)
            self.trace.tasks[task].edits += tuple(f"under way: {edit}" for edit in repaired.trace)

    def _take_in(self, action: Action, observed: Observed) -> bool:
        """Advance the believed graph by f(G, a), bind what was reached, and update B <- Upsilon(B, a, z).

        Returns:
            False if a search came to something else than it was for, and must go on.
        """
        if not self._binder.arrived(action, self._graph, observed):
            return False
        expected = self._graph
        self._graph = self._findings.settle(self._graph, observed)
        differs = self._graph is not expected
        for node, instance in self._binder.bound.items():
            room = observed.graph.room_of(instance)
            if node not in self._graph.supports and room is not None and instance != observed.graph.holding:
                self._graph = self._graph.place(node, Support(Relation.FLOOR, room))
        if first_violation(self._graph, action, self._profile) is None:
            self._graph = apply(self._graph, action)
        self._graph = msgspec.structs.replace(self._graph, robot_room=observed.graph.robot_room)
        self._graph = observe_flags(self._graph, observed.graph, self._binder.bound)
        self._belief = self._belief.update(self._graph, observed, self._binder.bound, self._binder.rejected)
        if differs:
            self._adapt()
        return True

    def _reorder(self, observed: Observed) -> list[int]:
        """Return the cheapest ordering of the remaining tasks whose concatenation validates (the cheapest if none)."""
        with stage(self.trace, "order"):
            tasks = list(self._remaining)
            if len(tasks) < 2 and self.trace.expected_m is not None:
                return tasks
            plans = [self._planned.plans[i] for i in tasks]
            candidates = self.situation(observed, tasks).candidates()
            goal = _union([self._tasks[i] for i in tasks])

            def passes(candidate: Candidate) -> bool:
                joined: Plan = tuple(action for j in candidate.order for action in plans[j])
                return validate(self._graph, joined, goal, profile=self._profile).valid

            cheapest = next(candidates)
            # A plan that is invalid alone is invalid in every order: then nothing is to be gained by trying them.
            sound = all(self._planned.verdicts[i].valid for i in tasks)
            chosen = next(filter(passes, itertools.chain([cheapest], candidates)), cheapest) if sound else cheapest
            if self.trace.expected_m is None:
                self.trace.expected_m = chosen.metres
            return [tasks[j] for j in chosen.order]

    def situation(self, observed: Observed, tasks: Sequence[int] | None = None) -> Situation:
        """Return what orders of tasks, by default of all that remain, are compared in."""
        assert self._travel is not None
        beliefs, cells = self._cost_view(observed)
        return Situation(
            [self._planned.plans[i] for i in (self._remaining if tasks is None else tasks)],
            self._travel,
            self._travel.at(observed.cell),
            beliefs,
            cells,
            self._simulator,
            None if self._simulator is None else self._knowledge(observed),
        )

    def _cost_view(self, observed: Observed) -> tuple[dict[str, Floats], dict[str, int]]:
        """Return the beliefs that the cost model sees, and the map cells of what is localised."""
        cells = localised(self._graph, self._binder, observed)
        belief = self._belief.collapsed() if self.config.belief == "argmax" else self._belief
        return {node: belief[node] for node in self._graph.world.nodes if node not in cells}, cells


def _union(tasks: list[TaskUnderstanding]) -> Goal:
    goal = Goal()
    for task in tasks:
        goal = goal | task.goal
    return goal
