"""Recording a language model: every prompt that agents ask it, answered once and stored (`gavel record`).

Agents plan in `reset`, so an episode is begun but not driven. The recording is appended completion by completion: a
killed run loses at most the one under way and goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import NamedTuple

import gymnasium as gym

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm import ChatModel
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions import Instruction

__all__ = ["Asked", "record"]


class Asked(NamedTuple):
    """One instruction planned by one agent."""

    agent: str
    instruction_id: str
    attempts: int
    verdicts: tuple[str, ...]


def record(
    model: ChatModel,
    agents: Sequence[str],
    instructions: Mapping[str, Instruction],
    *,
    prior: str = "choice",
    threads: int = 2,
) -> Iterator[Asked]:
    """Let agents plan all instructions with a (recording) model; yield as each is done, agent by agent.

    Args:
        model: usually a `RecordingModel`; must allow calls from several threads.
        agents: methods that ask a model.
        instructions: what is planned.
        prior: location prior, part of what the prompts say.
        threads: prompts asked at the same time.
    """
    understanding = ReferenceUnderstanding(instructions.values())

    def ask(agent: str, instruction: Instruction) -> Asked:
        env = gym.make("Gavel-MultiTask-v0", instructions=[instruction], observation="symbolic")
        planner = gavel_agents.make(agent, understanding=understanding, model=model, prior=prior)
        planner.reset(*env.reset(seed=0, options={"instruction": instruction.id}))
        env.close()
        assert isinstance(planner, PlanningAgent), f"{agent} asks no language model"
        trace = planner.trace
        return Asked(agent, instruction.id, trace.attempts, tuple(task.verdict for task in trace.tasks))

    with ThreadPoolExecutor(max_workers=threads) as pool:
        for agent in agents:
            waiting = [pool.submit(ask, agent, instruction) for instruction in instructions.values()]
            for done in as_completed(waiting):
                yield done.result()
