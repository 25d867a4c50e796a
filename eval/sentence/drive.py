"""One episode with everything kept that is told and drawn of it: what was believed, seen and held at every step."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

import gavel_env  # noqa: F401  (registers the environments)
from eval.records.provenance import code_version
from eval.records.schema import EpisodeKey, EpisodeRecord, Step
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings, Episode, classify, step_record
from gavel_agents.agent import AgentTrace
from gavel_agents.llm import ChatModel
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import Decomposition, TaskUnderstanding
from gavel_env.exchange import Observed
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.goals import unmet
from gavel_env.world_model.graph import SceneGraph

if TYPE_CHECKING:
    from gavel_env.envs.env import GavelEnv

__all__ = ["Drive", "Moment", "Understood", "drive"]


class Understood:
    """An understanding that has been reached before: it answers with that, whatever it is asked."""

    name = "given"

    def __init__(self, tasks: Sequence[TaskUnderstanding]) -> None:
        self._answer = Decomposition(tuple(tasks))

    def understand(self, text: str, **_: Any) -> Decomposition:
        """Return what was understood."""
        return self._answer


class Moment(NamedTuple):
    """What is to be drawn after a step (the first: before any).

    Attributes:
        observed: the agent's view.
        seen: (height, width) bool, floor seen so far, per cell of the layout.
        route: cells driven over in the step.
        searched: rooms gone through in the step, in order.
        new: ids seen for the first time.
    """

    observed: Observed
    seen: NDArray[np.bool_]
    route: tuple[int, ...] = ()
    searched: tuple[str, ...] = ()
    new: tuple[str, ...] = ()


class Drive(NamedTuple):
    """An episode.

    Attributes:
        record: as of any other episode.
        start: the hidden graph at the start.
        end: the hidden graph at the end.
        spots: where the things that were put are at the start, x, y in metres.
        beliefs: node -> room -> belief at the start, for what was not seen yet.
        moments: one per step, and one before.
    """

    record: EpisodeRecord
    start: SceneGraph
    end: SceneGraph
    spots: Mapping[str, tuple[float, float]]
    beliefs: Mapping[str, Mapping[str, float]]
    moments: tuple[Moment, ...]


def drive(
    instruction: Instruction, agent: PlanningAgent, model: ChatModel | None, *, planner: str, prior: str, seed: int
) -> Drive:
    """Carry an instruction out.

    Args:
        instruction: what, and where everything is.
        agent: who; it has its understanding.
        model: its planner, for the record.
        planner: spec of that, for the record.
        prior: name of its location prior, for the record.
        seed: decides where on the floor things lie that start there.

    Raises:
        GavelError: the instruction does not fit its scene, or the planner does not answer.
    """
    settings = EnvironmentSettings()
    env = gym.make(
        "Gavel-MultiTask-v0",
        disable_env_checker=True,
        max_episode_steps=settings.max_steps,
        instructions=[instruction],
        terminate_on_success=False,
        observation="symbolic",
        max_nodes=8192,
    )
    world = cast("GavelEnv", env.unwrapped)
    observation, info = env.reset(seed=seed, options={"instruction": instruction})
    start, executor = world.privileged_state().graph, world.privileged_state().executor
    spots = {put.id: executor.position(put.id) for put in instruction.placements if put.id is not None}
    begun = time.perf_counter()
    agent.reset(observation, info)
    spent = time.perf_counter() - begun
    beliefs = agent.beliefs
    steps: list[Step] = []
    moments = [Moment(observation.observed, _seen(world))]
    stopped_by = ""
    while not stopped_by and (action := agent.act(observation, info)) is not None:
        observation, _, _, truncated, info = env.step(action)
        steps.append(step_record(action, info))
        observed: Observed = observation.observed
        rooms = dict.fromkeys(observed.layout.room_of(cell) for cell in info["route"])
        gone = tuple(room for room in rooms if room is not None)
        moments.append(Moment(observed, _seen(world), tuple(info["route"]), gone, tuple(info["seen"])))
        if steps[-1].outcome != "ok":
            stopped_by = "violation"
        elif truncated:
            stopped_by = "truncated"
    judgement, end = world.judge(), world.privileged_state().graph
    [who] = choose([agent.name], settings, planners=[planner] if planner else (), understanding="rules", prior=prior)
    episode = Episode(
        EpisodeKey("", who.config, instruction.id, seed), instruction.kind, who, code_version(), instruction
    )
    trace: AgentTrace = agent.trace
    outcome, failure = classify(stopped_by, judgement, trace.stopped)
    record = episode.record(
        outcome,
        failure,
        model=model.name if model is not None else "",
        decoding=dict(model.decoding) if model is not None else {},
        method=msgspec.to_builtins(agent.config),
        trace=trace,
        steps=tuple(steps),
        metres=round(judgement.metres, 3),
        seconds={"agent": round(spent, 6)},
        unmet=judgement.unmet,
        unsafe=judgement.unsafe,
        tasks_met=tuple(not unmet(task.parsed_goal(), end) for task in instruction.tasks),
    )
    env.close()
    return Drive(record, start, end, spots, beliefs, tuple(moments))


def _seen(world: GavelEnv) -> NDArray[np.bool_]:
    return world.privileged_state().executor.observed.seen
