"""Recording a language model: every prompt that agents ask it, answered once and stored (`gavel record`).

Agents plan in `reset`, so an episode is begun but not driven, and many can be planned at the same time. The recording
is appended completion by completion: a killed run loses at most those under way and goes on where it stopped. What
`gavel eval --planner replay:FILE` asks afterwards is the same, prompt by prompt, so its results depend neither on how
many threads recorded nor on which prompts met in a batch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from eval.records.scrub import scrub_secrets
from gavel_agents.llm import ChatModel, load_model, tell
from gavel_agents.llm.batching import BatchingModel
from gavel_agents.llm.deadline import DeadlineModel
from gavel_agents.llm.replay import RecordingModel
from gavel_agents.methods import METHODS
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import Understanding
from gavel_env.errors import DataError
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.dynamics import Profile

__all__ = ["Asked", "record", "recorder"]

_BATCHED = ("hf",)
"""Kinds of planners to which prompts go together. The others run requests side by side, and a batch would make each
wait for the slowest."""


class Asked(NamedTuple):
    """One instruction planned by one agent: a verdict per task, or why it was not understood."""

    agent: str
    instruction_id: str
    attempts: int
    verdicts: tuple[str, ...]


def recorder(planner: str, out: str | Path, threads: int, timeout_s: float | None = None) -> RecordingModel:
    """Return a model that records what a planner answers.

    Args:
        planner: spec of the model.
        out: the recording; an existing one is continued.
        threads: from which it is asked.
        timeout_s: of one call in all, with its retries; None = as the backend has it.

    Raises:
        BadPlannerSpec: unknown kind of planner, or what it needs is missing.
        DataError: `out` exists and is not a recording.
    """
    model = load_model(planner)
    if timeout_s is not None:
        model = DeadlineModel(model, timeout_s)
    if planner.partition(":")[0] in _BATCHED:
        model = BatchingModel(model, threads)
    return RecordingModel(model, out, scrub_secrets)


def record(
    model: ChatModel,
    agents: Sequence[str],
    instructions: Mapping[str, Instruction],
    *,
    understanding: Understanding,
    prior: str = "choice",
    profile: Profile = Profile.PAPER,
    threads: int = 2,
    seeds: Sequence[int] = (0,),
) -> Iterator[Asked]:
    """Let agents plan all instructions with a (recording) model; yield as each is done, agent by agent.

    Args:
        model: usually a `recorder`; must allow calls from several threads.
        agents: methods that ask a model.
        instructions: what is planned.
        understanding: of the instructions, part of what the prompts say.
        prior: location prior, likewise.
        profile: rules profile, which decides what is complained about.
        threads: instructions planned, and so prompts asked, at the same time.
        seeds: of the model's sampling; a greedy model is asked once for all of them.

    Raises:
        DataError: an agent is not one of the methods that ask a model.
        GavelError: the model does not answer; what has not begun by then is not begun.
    """

    def ask(agent: str, instruction: Instruction, seed: int) -> Asked:
        env = gym.make("Gavel-MultiTask-v0", instructions=[instruction], profile=profile.value, observation="symbolic")
        tell(model, instruction)
        planner = gavel_agents.make(
            agent, understanding=understanding, model=model, prior=prior, profile=profile, seed=seed
        )
        if not isinstance(planner, PlanningAgent) or planner.config.source != "model":
            asking = ", ".join(sorted(name for name, config in METHODS.items() if config.source == "model"))
            raise DataError(f"agent {agent!r} is not one of the methods that ask a language model: {asking}")
        planner.reset(*env.reset(seed=seed, options={"instruction": instruction.id}))
        env.close()
        trace = planner.trace
        verdicts = tuple(task.verdict for task in trace.tasks) or (trace.stopped,)
        return Asked(agent, instruction.id, trace.attempts, verdicts)

    with ThreadPoolExecutor(max_workers=threads) as pool:
        try:
            for agent in agents:
                waiting = [pool.submit(ask, agent, one, seed) for seed in seeds for one in instructions.values()]
                for done in as_completed(waiting):
                    yield done.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
