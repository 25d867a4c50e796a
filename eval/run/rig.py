"""The rig: environments and the agents' shared parts in one process, and the one function that runs an episode."""

from __future__ import annotations

import importlib
import os
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import msgspec

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from eval.records.schema import Contestant, EpisodeRecord, Step
from eval.records.scrub import describe_error, scrub
from eval.run.episodes import EnvironmentSettings, Episode, classify, step_record
from gavel_agents.agent import Agent, AgentTrace, Privileged
from gavel_agents.llm import ChatModel, load_model, tell
from gavel_agents.understanding import Understanding, load_understanding
from gavel_env.errors import BadPlugin, GavelError
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.goals import unmet

if TYPE_CHECKING:
    from gavel_env.envs.env import GavelEnv

__all__ = [
    "ENVIRONMENTS",
    "BadPlugin",
    "Rig",
    "import_plugins",
]


def import_plugins(plugins: Sequence[str]) -> None:
    """Import modules, whose import registers agents; modules in the working directory are found too.

    Raises:
        BadPlugin: a module cannot be imported.
    """
    if plugins and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # a console script, unlike `python -m`, does not look there
    for plugin in plugins:
        try:
            importlib.import_module(plugin)
        except ImportError as error:
            raise BadPlugin(f"plugin {plugin!r} cannot be imported: {error}") from error


ENVIRONMENTS: Mapping[str, str] = {
    "single": "Gavel-SingleTask-v0",
    "multi": "Gavel-MultiTask-v0",
    "behavior": "Gavel-Behavior-v0",
}
"""Kind of instruction -> id of its environment."""


class _Progress:
    """What an episode has come to so far; kept outside `Rig._play`, so that a crash leaves it to be recorded."""

    def __init__(self, model: ChatModel | None) -> None:
        self.model = model
        self.agent: Agent | None = None
        self.steps: list[Step] = []
        self.metres = 0.0
        self.started = False
        self.seconds = {"setup": 0.0, "agent": 0.0, "execute": 0.0}

    def fields(self) -> dict[str, Any]:
        """Return them as fields of a record."""
        trace = getattr(self.agent, "trace", None)
        config = getattr(self.agent, "config", None)
        return {
            "privileged": isinstance(self.agent, Privileged),
            "steps": tuple(self.steps),
            "metres": round(self.metres, 3),
            "seconds": {stage: round(spent, 6) for stage, spent in self.seconds.items()},
            "trace": trace if isinstance(trace, AgentTrace) else AgentTrace(),
            "model": self.model.name if self.model else "",
            "decoding": dict(self.model.decoding) if self.model else {},
            "method": msgspec.to_builtins(config) if isinstance(config, msgspec.Struct) else {},
        }


class Rig:
    """Runs episodes; builds environments and what agents share (models, understandings, priors) once."""

    def __init__(self, settings: EnvironmentSettings, plugins: Sequence[str] = ()) -> None:
        """Import the plugins, whose import registers agents.

        Raises:
            BadPlugin: a module cannot be imported.
        """
        import_plugins(plugins)
        self.settings = settings
        self._environments: dict[str, gym.Env[Any, Any]] = {}
        self._models: dict[str, ChatModel] = {}
        self._understandings: dict[tuple[str, str], Understanding] = {}

    def check(self, episodes: Iterable[Episode]) -> None:
        """Build every contestant's agent once, so that what can never run is said before anything runs.

        Raises:
            GavelError: an agent, planner, understanding or prior is not known or not usable.
        """
        seen = set()
        for episode in episodes:
            if episode.instruction is not None and episode.contestant.config not in seen:
                seen.add(episode.contestant.config)
                self.agent(episode.contestant, episode.instruction, episode.key.seed)

    def agent(self, contestant: Contestant, instruction: Instruction, seed: int) -> Agent:
        """Return a fresh agent, so that no episode depends on which ones ran before it.

        Raises:
            GavelError: the contestant's agent, planner, understanding or prior is not known or not usable.
        """
        return gavel_agents.make(
            contestant.agent,
            understanding=self._understanding(contestant, instruction),
            planner=self._model(contestant.planner),
            prior=contestant.prior or "choice",
            profile=self.settings.profile,
            seed=seed,
        )

    def _understanding(self, contestant: Contestant, instruction: Instruction) -> Understanding | None:
        """Return the understanding of a contestant; the reference looks at one instruction, others at none."""
        name, model = contestant.understanding, self._model(contestant.planner)
        if not name:
            return None
        if name == "reference":
            return load_understanding(name, [instruction])
        asked = (name, contestant.planner if name == "llm" else "")
        if asked not in self._understandings:
            self._understandings[asked] = load_understanding(name, model=model)
        return self._understandings[asked]

    def _model(self, planner: str) -> ChatModel | None:
        if planner and planner not in self._models:
            self._models[planner] = load_model(planner)
        return self._models.get(planner)

    def _environment(self, kind: str, instruction: Instruction) -> gym.Env[Any, Any]:
        """Return the environment of a kind, made at its first episode."""
        if kind not in self._environments:
            self._environments[kind] = gym.make(
                ENVIRONMENTS[kind],
                max_episode_steps=self.settings.max_steps,
                disable_env_checker=True,
                instructions=[instruction],
                profile=self.settings.profile,
                on_violation="terminate",
                terminate_on_success=False,
                **self.settings.options,
            )
        return self._environments[kind]

    def run(self, episode: Episode, timeout_s: float | None = None) -> EpisodeRecord:
        """Run one episode and return its record; whatever happens, there is one.

        Args:
            episode: what to run.
            timeout_s: seconds after which the episode ends between two actions.
        """
        if episode.instruction is None:
            return episode.record("rejected", error=scrub(episode.rejected))
        model = self._model(episode.contestant.planner)
        tell(model, episode.instruction)
        progress = _Progress(model)
        try:
            return self._play(episode, episode.instruction, progress, timeout_s)
        except (Exception, SystemExit) as error:  # noqa: BLE001  the episode boundary: one crash must not end the run
            self._environments.pop(episode.kind, None)
            if isinstance(error, GavelError) and not progress.started:
                return episode.record("rejected", error=scrub(str(error)), **progress.fields())
            name = type(error).__name__
            return episode.record("error", f"error:{name}", error=describe_error(error), **progress.fields())

    def _play(
        self, episode: Episode, instruction: Instruction, progress: _Progress, timeout_s: float | None
    ) -> EpisodeRecord:
        clock = time.perf_counter
        begun = clock()
        env = self._environment(episode.kind, instruction)
        observation, info = env.reset(seed=episode.key.seed, options={"instruction": instruction})
        progress.started = True
        agent = progress.agent = self.agent(episode.contestant, instruction, episode.key.seed)
        if isinstance(agent, Privileged):
            agent.reveal(env.unwrapped)
        entered = clock()
        progress.seconds["setup"] = entered - begun
        agent.reset(observation, info)
        stopped_by = ""
        while not stopped_by:
            action = agent.act(observation, info)
            asked = clock()
            progress.seconds["agent"] += asked - entered
            if action is None:
                break
            observation, _, _, truncated, info = env.step(action)
            entered = clock()
            progress.seconds["execute"] += entered - asked
            progress.metres = float(info["metres"])
            step = step_record(action, info)
            progress.steps.append(step)
            if step.outcome != "ok":
                stopped_by = "violation"
            elif truncated:
                stopped_by = "truncated"
            elif timeout_s is not None and entered - begun > timeout_s:
                stopped_by = "timeout"
        env_world = cast("GavelEnv", env.unwrapped)
        judgement = env_world.judge()
        hidden = env_world.privileged_state().graph
        fields = progress.fields()
        outcome, failure = classify(stopped_by, judgement, fields["trace"].stopped)
        return episode.record(
            outcome,
            failure,
            unmet=judgement.unmet,
            unsafe=judgement.unsafe,
            tasks_met=tuple(not unmet(task.parsed_goal(), hidden) for task in instruction.tasks),
            **fields,
        )
