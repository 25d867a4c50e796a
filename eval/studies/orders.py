"""Whether the ordering methods would order an instruction's tasks differently.

`gavel-map`, `gavel-static` and `gavel-full` each execute the certified reference plans in the order that they choose.
The question is only whether the three orders are the same, never who drives less. `gavel tasks list --orders` prints
the share of a set; the multi-task benchmark is drawn so that about 70 % differ (docs/reference/benchmarks.md).
"""

from __future__ import annotations

import gymnasium as gym

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import Instruction

__all__ = ["METHODS", "Orders"]

METHODS = ("gavel-map", "gavel-static", "gavel-full")


class Orders:
    """Finds the orders in which the methods execute an instruction's tasks."""

    def __init__(self, prior: str = "choice") -> None:
        """Build the environment.

        Args:
            prior: location prior of all three methods.
        """
        self._prior = prior
        self._env = gym.make("Gavel-MultiTask-v0", terminate_on_success=False, observation="symbolic")

    def of(self, instruction: Instruction) -> dict[str, tuple[int, ...]]:
        """Return the order of tasks by method."""
        model = ReferencePlans([instruction])
        understanding = ReferenceUnderstanding([instruction])
        return {name: self._order(name, instruction, model, understanding) for name in METHODS}

    def differ(self, instruction: Instruction) -> bool:
        """Return whether the orders are not all the same."""
        return len(set(self.of(instruction).values())) > 1

    def _order(
        self, name: str, instruction: Instruction, model: ReferencePlans, understanding: ReferenceUnderstanding
    ) -> tuple[int, ...]:
        agent = gavel_agents.make(name, understanding=understanding, model=model, prior=self._prior)
        assert isinstance(agent, PlanningAgent)
        observation, info = self._env.reset(seed=0, options={"instruction": instruction})
        agent.reset(observation, info)
        while (action := agent.act(observation, info)) is not None:
            observation, _, terminated, truncated, info = self._env.step(action)
            if terminated or truncated:
                break
        return tuple(agent.trace.order)
