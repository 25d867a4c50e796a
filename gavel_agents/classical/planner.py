"""The classical planner behind the interface of language models (`classical`, `classical:fast-downward`).

It is given what a model is told in words: the believed graph and the goals that were understood, never the id of an
instruction. So it stands in a model's place where understanding is evaluated, and as the planner of `llm+p`, the
baseline in which a language model translates and a classical planner plans (Liu et al., 2023).

Tasks are planned one by one, each from the believed graph as it stands, as the pipeline judges them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec

from gavel_agents.classical.search import Found, search
from gavel_agents.llm.interface import Completion, PlanningProblem, Prompt
from gavel_env.errors import BadPlannerSpec, NotInstalled, nearest_names
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import SceneGraph

__all__ = ["ENGINES", "ClassicalPlanner", "chosen_engine"]

Solver = Callable[[SceneGraph, Goal, Profile], Found]


def _fast_downward(graph: SceneGraph, goal: Goal, profile: Profile) -> Found:
    from gavel_agents.classical.engine import solve

    return solve(graph, goal, profile)


ENGINES: Mapping[str, Solver] = {"fast-downward": _fast_downward, "search": search}
"""Name -> what plans for one task: Fast Downward on an export to PDDL, or this package's own search."""

_NEEDS = ("unified_planning", "up_fast_downward")


def chosen_engine(name: str = "") -> str:
    """Return the engine of a spec `classical:NAME`; without a name Fast Downward where it is installed, else `search`.

    Raises:
        BadPlannerSpec: an unknown engine.
        NotInstalled: the engine's packages are missing.
    """
    installed = all(find_spec(package) is not None for package in _NEEDS)
    if not name:
        return "fast-downward" if installed else "search"
    if name not in ENGINES:
        near = nearest_names(name, ENGINES) or tuple(ENGINES)
        raise BadPlannerSpec(f"unknown engine {name!r} in classical:{name}; known: {', '.join(near)}")
    if name == "fast-downward" and not installed:
        raise NotInstalled("classical:fast-downward needs the extra 'planning': pip install 'gavel-env[planning]'")
    return name


class ClassicalPlanner:
    """Answers a prompt for plans by planning for the problem that the prompt carries."""

    def __init__(self, engine: str = "") -> None:
        """Choose an engine.

        Args:
            engine: one of `ENGINES`; empty for the best that is installed.

        Raises:
            BadPlannerSpec: an unknown engine.
            NotInstalled: the engine's packages are missing.
        """
        self.engine = chosen_engine(engine)
        self.name = f"classical planner, {self.engine} (no model)"
        self.decoding: Mapping[str, str | float | int] = {}
        self._last: tuple[PlanningProblem, str] | None = None

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the plans, written as a model is asked to write them.

        Raises:
            BadPlannerSpec: a prompt is not for plans.
        """
        return [self._answer(prompt) for prompt in prompts]

    def _answer(self, prompt: Prompt) -> Completion:
        problem = prompt.problem
        if problem is None:
            raise BadPlannerSpec(
                "the classical planner reads no text: it plans for what an understanding has made of it"
            )
        if self._last is not None and self._last[0] is problem:  # a retry: nothing new is known
            return Completion(self._last[1])
        begun = time.perf_counter()
        lines: list[str] = []
        for number, goal in enumerate(problem.goals, start=1):
            found = ENGINES[self.engine](problem.graph, goal, problem.profile)
            lines.append(f"Task {number}:" + (f" # no plan: {found.reason}" if found.plan is None else ""))
            lines += [f"{a.primitive.name} {a.target or ''}".strip() for a in found.plan or ()]
        text = "\n".join(lines)
        self._last = (problem, text)
        return Completion(text, seconds=time.perf_counter() - begun)
