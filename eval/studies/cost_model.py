"""How well the cost of an order predicts the metres that are then driven, and what ordering takes.

Plans are the certified reference plans, so that nothing but belief, search and ordering is measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import gymnasium as gym
import numpy as np

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm import load_model
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import Instruction, read_instructions, shipped

__all__ = ["Drive", "Fit", "drives", "fits"]


class Drive(NamedTuple):
    """One instruction as expected and as driven."""

    instruction_id: str
    tasks: int
    expected_m: float
    driven_m: float
    ordering_s: float


class Fit(NamedTuple):
    """The drives of instructions with the same number of tasks.

    Attributes:
        tasks: N, or None for all.
        instructions: how many.
        r_squared: squared correlation of metres expected and driven.
        slope: metres driven per metre expected (least squares through the means).
        expected_m, driven_m: means.
        ordering_ms: median milliseconds of all orderings of one instruction.
    """

    tasks: int | None
    instructions: int
    r_squared: float
    slope: float
    expected_m: float
    driven_m: float
    ordering_ms: float

    @property
    def bias(self) -> float:
        """Metres expected per metre driven, less 1."""
        return self.expected_m / self.driven_m - 1.0


def drives(
    source: str = "multi",
    agent: str = "gavel-static",
    prior: str = "choice",
    cost: str | None = None,
    coverage_width_m: float | None = None,
) -> Iterator[Drive]:
    """Yield one drive per instruction of a shipped file (or a path).

    Args:
        source: shipped name or path of the instructions.
        agent: a method that orders.
        prior: location prior.
        cost: what the method goes by; default its own.
        coverage_width_m: w_cov of J.
    """
    path = source if source.endswith(".jsonl") else shipped(source)
    instructions: Mapping[str, Instruction] = read_instructions(path)
    env = gym.make("Gavel-MultiTask-v0", instructions=instructions, terminate_on_success=False, observation="symbolic")
    driver = gavel_agents.make(
        agent,
        understanding=ReferenceUnderstanding(instructions.values()),
        model=load_model(f"reference:{source}"),
        prior=prior,
        cost=cost,
        coverage_width_m=coverage_width_m,
    )
    assert isinstance(driver, PlanningAgent)
    for instruction_id, instruction in instructions.items():
        observation, info = env.reset(seed=0, options={"instruction": instruction_id})
        driver.reset(observation, info)
        while (action := driver.act(observation, info)) is not None:
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
        expected_m = driver.trace.expected_m
        if expected_m is not None:
            seconds = driver.trace.seconds.get("order", 0.0)
            yield Drive(instruction_id, len(instruction.tasks), expected_m, float(info["metres"]), seconds)
    env.close()


def fits(found: Sequence[Drive]) -> list[Fit]:
    """Return the fit for every N with three drives or more, then for all together."""
    counts: list[int | None] = [*sorted({d.tasks for d in found}), None]
    groups = [(n, [d for d in found if n in (None, d.tasks)]) for n in counts]
    return [_fit(n, group) for n, group in groups if len(group) >= 3]


def _fit(tasks: int | None, group: Sequence[Drive]) -> Fit:
    expected = np.array([d.expected_m for d in group])
    driven = np.array([d.driven_m for d in group])
    correlation = float(np.corrcoef(expected, driven)[0, 1])
    slope = correlation * float(driven.std() / expected.std())
    ordering_ms = 1000.0 * float(np.median([d.ordering_s for d in group]))
    return Fit(tasks, len(group), correlation**2, slope, float(expected.mean()), float(driven.mean()), ordering_ms)
