"""The rig: environments and the agents' shared parts in one process, and the one function that runs an episode."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
import threading
import time
import weakref
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from importlib import metadata
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import gymnasium as gym
import msgspec

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from eval.records.conversations import Exchange
from eval.records.encoding import sound
from eval.records.schema import Contestant, EpisodeRecord, Scenery, Step
from eval.records.scrub import describe_error, scrub
from eval.run.boundary import attempt
from eval.run.episodes import EnvironmentSettings, Episode, classify, step_record
from eval.run.foreign.host import AgentFailed, AgentHost, ForeignAgent, in_process
from eval.run.misreading import misread
from eval.run.planners import EpisodeModel, Planners, usage
from eval.run.watching import Watcher
from gavel_agents.agent import Agent, AgentTrace, Privileged
from gavel_agents.llm import ChatModel, tell
from gavel_agents.llm.sharing import SharingModel
from gavel_agents.methods import METHODS
from gavel_agents.understanding import ModelUnderstanding, Understanding, load_understanding
from gavel_env.errors import BadPlugin, GavelError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.goals import unmet

if TYPE_CHECKING:
    from gavel_env.envs.env import GavelEnv

__all__ = [
    "ENVIRONMENTS",
    "BadPlugin",
    "Finished",
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
        except (Exception, SystemExit) as error:
            raise BadPlugin(f"plugin {plugin!r} cannot be imported: {type(error).__name__}: {error}") from error


ENVIRONMENTS: Mapping[str, str] = {
    "single": "Gavel-SingleTask-v0",
    "multi": "Gavel-MultiTask-v0",
    "behavior": "Gavel-Behavior-v0",
}
"""Kind of instruction -> id of its environment."""


class Finished(NamedTuple):
    """An episode that has ended.

    Attributes:
        record: of it; `calls` are filled in by whoever stores the exchanges.
        exchanges: every call of a model, in order.
    """

    record: EpisodeRecord
    exchanges: tuple[Exchange, ...] = ()


class _Progress:
    """What an episode has come to so far; kept outside `Rig._play`, so that a crash leaves it to be recorded."""

    def __init__(self) -> None:
        self.model: ChatModel | None = None
        self.exchanges: list[Exchange] = []
        self.agent: Agent | None = None
        self.steps: list[Step] = []
        self.watcher: Watcher | None = None
        self.metres = 0.0
        self.started = False
        self.seconds = {"setup": 0.0, "agent": 0.0, "execute": 0.0}

    def fields(self) -> dict[str, Any]:
        """Return them as fields of a record."""
        trace = getattr(self.agent, "trace", None)
        config = getattr(self.agent, "config", None)
        trace = trace if isinstance(trace, AgentTrace) else AgentTrace()
        if self.exchanges:  # they hold the answers
            trace = msgspec.structs.replace(trace, completions=[])
        return {
            "privileged": isinstance(self.agent, Privileged),
            "steps": tuple(self.steps),
            "scenery": self.watcher.scenery() if self.watcher else Scenery(),
            "metres": round(self.metres, 3),
            "seconds": {stage: round(spent, 6) for stage, spent in self.seconds.items()},
            "trace": trace,
            "usage": usage(self.exchanges),
            "model": self.model.name if self.model else "",
            "decoding": dict(self.model.decoding) if self.model else {},
            "method": msgspec.to_builtins(config) if isinstance(config, msgspec.Struct) else {},
        }

    def fields_if_any(self) -> dict[str, Any]:
        """Return them, or nothing if the agent raises when it is asked for its trace."""
        return attempt(self.fields)[0] or {}


_USUAL_NODES, _MANY_NODES = 512, 8192


def _most_nodes(instruction: Instruction) -> int:
    """Return `max_nodes` of the environment for an instruction: the usual one wherever the scene fits into it."""
    try:
        scene = load_scene(instruction.scene)
    except GavelError:  # `reset` says what is wrong with it
        return _USUAL_NODES
    nodes = 1 + len(scene.rooms) + len(scene.furniture) + len(scene.items) + len(instruction.placements)
    return _USUAL_NODES if nodes <= _USUAL_NODES else _MANY_NODES


@cache
def _offered() -> frozenset[str]:
    """Return the names of agents that installed packages offer; looked up once, since that reads all their metadata."""
    return frozenset(entry.name for entry in metadata.entry_points(group="gavel.agents"))


def _close_all(hosts: Mapping[str, list[AgentHost]]) -> None:
    for idle in hosts.values():
        for host in idle:
            host.close()


class Rig:
    """Runs episodes; builds environments and what agents share (models, understandings, priors) once.

    Several threads may run episodes of one rig at the same time, once `check` has returned.
    """

    def __init__(self, settings: EnvironmentSettings, plugins: Sequence[str] = (), connections: int = 1) -> None:
        """Import the plugins, whose import registers agents.

        Args:
            settings: of the environments.
            plugins: modules.
            connections: calls of each language model under way at the same time.

        Raises:
            BadPlugin: a module cannot be imported.
        """
        import_plugins(plugins)
        self.settings = settings
        self._planners = Planners(connections)
        self._turn = threading.Lock()
        self._beginning = threading.Lock()
        self._idle: dict[tuple[str, int], list[gym.Env[Any, Any]]] = {}
        self._understandings: dict[str, Understanding] = {}
        self._plugins = tuple(plugins)
        self._hosts: dict[str, list[AgentHost]] = {}
        self._here = {*METHODS, "oracle", "react"}
        weakref.finalize(self, _close_all, self._hosts)

    def check(self, episodes: Iterable[Episode]) -> None:
        """Build every contestant's agent once, so that what can never run is said before anything runs.

        Raises:
            GavelError: an agent, planner, understanding or prior is not known or not usable.
        """
        seen = set()
        for episode in episodes:
            if episode.instruction is not None and episode.contestant.config not in seen:
                seen.add(episode.contestant.config)
                make = partial(self.agent, episode.contestant, episode.instruction, episode.key.seed)
                agent, _ = attempt(make, through=(GavelError, KeyboardInterrupt))  # its own episodes will say the rest
                if agent is not None:
                    self._dismiss(agent, episode.contestant.agent)

    def warm(self, episodes: Iterable[Episode]) -> None:
        """Begin an episode of every kind in this thread: what is loaded or compiled at first use is so from here on."""
        seen = set()
        for episode in episodes:
            if episode.instruction is not None and episode.kind not in seen:
                seen.add(episode.kind)
                env = self._take_environment(episode.kind, episode.instruction)
                with contextlib.suppress(GavelError):  # said when its own turn comes
                    env.reset(seed=episode.key.seed, options={"instruction": episode.instruction})
                self._give_back(episode.kind, env)

    def load(self, planner: str) -> ChatModel | None:
        """Return the model of a spec, which all episodes share; None for an empty one.

        Raises:
            GavelError: the spec, or what it needs.
        """
        return self._planners.load(planner)

    def agent(
        self, contestant: Contestant, instruction: Instruction, seed: int, exchanges: list[Exchange] | None = None
    ) -> Agent:
        """Return a fresh agent, so that no episode depends on which ones ran before it.

        Args:
            contestant: which agent, with what.
            instruction: that it will be given; only the reference understanding looks into it.
            seed: of the agent and of the model's sampling.
            exchanges: to which every call of a model is appended.

        Raises:
            GavelError: the contestant's agent, planner, understanding or prior is not known or not usable.
        """
        exchanges = [] if exchanges is None else exchanges
        planner = self.load(contestant.planner)
        model = None if planner is None else EpisodeModel(planner, exchanges)
        if self._elsewhere(contestant.agent):
            foreign = self._foreign(contestant, instruction, seed, model, exchanges)
            if foreign is not None:
                return foreign
        return gavel_agents.make(
            contestant.agent,
            understanding=self._understanding(contestant, instruction, model, exchanges),
            planner=model,
            prior=contestant.prior or "choice",
            profile=self.settings.profile,
            cost=contestant.cost or None,
            seed=seed,
        )

    def _elsewhere(self, agent: str) -> bool:
        """Return whether an agent is not this package's, and another process can find it."""
        return agent not in self._here and not in_process() and (bool(self._plugins) or agent in _offered())

    def _foreign(
        self,
        contestant: Contestant,
        instruction: Instruction,
        seed: int,
        model: ChatModel | None,
        exchanges: list[Exchange],
    ) -> ForeignAgent | None:
        """Return an agent in a process of its own; None if it has to be in this one.

        Raises:
            AgentFailed: it raised while it was made.
        """
        name = contestant.agent
        with self._turn:
            idle = self._hosts.setdefault(name, [])
            host = idle.pop() if idle else None
        host = host or AgentHost(self._plugins)
        understanding = self._understanding(contestant, instruction, model, exchanges)
        agent = ForeignAgent(host, name, model, understanding)
        options = {
            "prior": contestant.prior or "choice",
            "profile": self.settings.profile,
            "seed": seed,
            "cost": contestant.cost or None,
        }
        try:
            made = agent.make(options)
        except AgentFailed:
            host.close()
            raise
        if made.known and not made.privileged:
            return agent
        host.close()
        self._here.add(name)  # it sees the hidden state, or was registered by other means than a plug-in
        return None

    def _dismiss(self, agent: Agent | None, name: str, *, fit: bool = True) -> None:
        """Keep the process of an agent for the next one of its kind, or end it if something went wrong there."""
        if isinstance(agent, ForeignAgent):
            if fit and agent.host.alive:
                with self._turn:
                    self._hosts[name].append(agent.host)
            else:
                agent.host.close()

    def _understanding(
        self, contestant: Contestant, instruction: Instruction, model: ChatModel | None, exchanges: list[Exchange]
    ) -> Understanding | None:
        """Return the understanding of a contestant; the reference looks at one instruction, others at none."""
        name = contestant.understanding
        if not name:
            return None
        if name == "reference":
            return load_understanding(name, [instruction])
        if name == "llm":
            return load_understanding(name, model=model)
        with self._turn:
            if name not in self._understandings:
                loaded = load_understanding(name)
                self._understandings[name] = (
                    loaded.asking(SharingModel) if isinstance(loaded, ModelUnderstanding) else loaded
                )
            found = self._understandings[name]
        return found.asking(lambda m: EpisodeModel(m, exchanges)) if isinstance(found, ModelUnderstanding) else found

    def _take_environment(self, kind: str, instruction: Instruction) -> gym.Env[Any, Any]:
        """Return an environment that no other episode has; as many are made as episodes are under way at once."""
        options = {"max_nodes": _most_nodes(instruction), **self.settings.options}
        with self._turn:
            idle = self._idle.setdefault((kind, options["max_nodes"]), [])
            if idle:
                return idle.pop()
        return gym.make(
            ENVIRONMENTS[kind],
            max_episode_steps=self.settings.max_steps,
            disable_env_checker=True,
            instructions=[instruction],
            profile=self.settings.profile,
            on_violation="terminate",
            terminate_on_success=False,
            **options,
        )

    def _give_back(self, kind: str, env: gym.Env[Any, Any]) -> None:
        with self._turn:
            self._idle[kind, cast("GavelEnv", env.unwrapped).max_nodes].append(env)

    def run(self, episode: Episode, timeout_s: float | None = None) -> Finished:
        """Run one episode and return its record; whatever happens, there is one.

        Args:
            episode: what to run.
            timeout_s: seconds after which the episode ends between two actions.
        """
        if episode.instruction is None:
            return Finished(sound(episode.record("rejected", error=scrub(episode.rejected))))
        progress = _Progress()
        record, error = attempt(partial(self._play, episode, episode.instruction, progress, timeout_s))
        if record is None:
            assert error is not None
            self._dismiss(progress.agent, episode.contestant.agent, fit=False)
            fields = progress.fields_if_any()
            if isinstance(error, GavelError) and not progress.started:
                record = episode.record("rejected", error=scrub(str(error)), **fields)
            elif isinstance(error, AgentFailed):
                record = episode.record("error", f"error:{error.kind}", error=scrub(error.described), **fields)
            else:
                name = type(error).__name__
                record = episode.record("error", f"error:{name}", error=describe_error(error), **fields)
        return Finished(sound(record), tuple(progress.exchanges))

    def _play(
        self, episode: Episode, instruction: Instruction, progress: _Progress, timeout_s: float | None
    ) -> EpisodeRecord:
        progress.model = self.load(episode.contestant.planner)
        tell(progress.model, instruction)
        clock = time.perf_counter
        begun = clock()
        with self._beginning:  # one by one, so that the first calls go out while others are still set up
            env = self._take_environment(episode.kind, instruction)
            observation, info = env.reset(seed=episode.key.seed, options={"instruction": instruction})
        progress.started = True
        contestant = episode.contestant
        agent = progress.agent = self.agent(contestant, instruction, episode.key.seed, progress.exchanges)
        if isinstance(agent, Privileged):
            agent.reveal(env.unwrapped)
        entered = clock()
        progress.seconds["setup"] = entered - begun
        agent.reset(observation, info)
        env_world = cast("GavelEnv", env.unwrapped)
        progress.watcher = watcher = Watcher(env_world)
        stopped_by = ""
        while not stopped_by:
            action = agent.act(observation, info)
            asked = clock()
            progress.seconds["agent"] += asked - entered
            if action is None:
                break
            watcher.before(agent)
            sent = clock()
            observation, _, _, truncated, info = env.step(action)
            returned = clock()
            progress.seconds["execute"] += returned - sent
            progress.metres = float(info["metres"])
            step = step_record(action, info)
            progress.steps.append(step)
            watcher.after()
            entered = clock()
            if step.outcome != "ok":
                stopped_by = "violation"
            elif truncated:
                stopped_by = "truncated"
            elif timeout_s is not None and returned - begun > timeout_s:
                stopped_by = "timeout"
        judgement = env_world.judge()
        hidden = env_world.privileged_state().graph
        fields = progress.fields()
        outcome, failure = classify(stopped_by, judgement, fields["trace"].stopped)
        own = contestant.understanding not in ("", "reference")
        record = episode.record(
            outcome,
            failure,
            unmet=judgement.unmet,
            unsafe=judgement.unsafe,
            tasks_met=tuple(not unmet(task.parsed_goal(), hidden) for task in instruction.tasks),
            misread=misread(fields["trace"], instruction) if own and fields["trace"].tasks else (),
            **fields,
        )
        self._dismiss(agent, contestant.agent)
        self._give_back(episode.kind, env)  # one in which something raised is not used again
        return record
