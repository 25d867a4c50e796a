"""What agents send to their model: a model that listens, and answers what it was told to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium as gym

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from eval.run.rig import ENVIRONMENTS
from gavel_agents.llm import Completion, Prompt
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import read_instructions, shipped

__all__ = ["Listening", "first_prompts", "prompts_sent"]


class Listening:
    """Keeps what it is asked; says its answers one after the other, the last one for ever."""

    name = "listening"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self, *answers: str) -> None:
        self.asked: list[Prompt] = []
        self._answers = answers or ("",)

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        first = len(self.asked)
        self.asked += prompts
        return [Completion(self._answers[min(i, len(self._answers) - 1)]) for i in range(first, len(self.asked))]


def prompts_sent(method: str, kind: str, names: Iterable[str], *answers: str) -> list[Prompt]:
    """Return what a method sends to a model that answers so, over shipped instructions of a kind."""
    instructions = read_instructions(shipped(kind))
    env: gym.Env[Any, Any] = gym.make(ENVIRONMENTS[kind], instructions=instructions, observation="symbolic")
    model = Listening(*answers)
    understanding = ReferenceUnderstanding(instructions.values())
    agent = gavel_agents.make(method, understanding=understanding, model=model)
    for name in names:
        agent.reset(*env.reset(seed=0, options={"instruction": name}))
    return model.asked


def first_prompts(kind: str, names: Iterable[str] | None = None) -> list[Prompt]:
    """Return the first prompts of shipped instructions of a kind (all of them by default)."""
    return prompts_sent("llm-only", kind, read_instructions(shipped(kind)) if names is None else names)
