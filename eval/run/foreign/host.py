"""The runner's side of an agent in another process."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO, cast

import msgspec

from eval.run.foreign import guest
from eval.run.foreign.wire import Asked, Ended, Made, receive, send
from gavel_agents.agent import AgentTrace
from gavel_agents.llm import ChatModel
from gavel_agents.understanding import Understanding
from gavel_env.errors import GavelError
from gavel_env.exchange import EnvAction, Observation
from gavel_env.house.floor_map import FloorMap

__all__ = ["IN_PROCESS", "AgentFailed", "AgentHost", "ForeignAgent", "in_process"]

IN_PROCESS = "GAVEL_AGENTS_IN_PROCESS"
"""Environment variable: with `1`, agents of others run in the runner's own process, as this package's do."""


def in_process() -> bool:
    """Return whether agents of others are to run in the runner's own process."""
    return os.environ.get(IN_PROCESS) == "1"


class AgentFailed(Exception):
    """An agent raised in its process, or its process ended.

    Attributes:
        kind: class of the error, or `agent_died`.
        described: the traceback, for the record.
    """

    def __init__(self, kind: str, described: str) -> None:
        self.kind, self.described = kind, described
        super().__init__(described)


class AgentHost:
    """A process in which the agents of one contestant are made and run, one after the other."""

    def __init__(self, plugins: Sequence[str]) -> None:
        """Start the process.

        Args:
            plugins: modules whose import registers agents.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"import sys; from {guest.__name__} import main; main(sys.argv[1:])", *plugins],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)},
        )
        self.trace: Any = None
        self._layouts: list[FloorMap] = []
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._back = cast("BinaryIO", self._process.stdin), cast("BinaryIO", self._process.stdout)

    def call(self, what: str, *arguments: Any, asked: Mapping[str, Any] | None = None) -> Any:
        """Have something done and return what it came to; what the agent asks meanwhile is answered.

        Args:
            what: name of the call.
            arguments: of the call.
            asked: functions that the agent may ask for, by name.

        Raises:
            AgentFailed: it raised, or the process has ended.
        """
        if not self.alive:
            raise AgentFailed("agent_died", f"the agent's process ended with exit status {self._process.poll()}")
        try:
            send(self._to, (what, arguments))
            while isinstance(message := receive(self._back), Asked):
                function = (asked or {})[message.what]
                try:
                    answer = Ended(function(*message.arguments))
                except GavelError as error:
                    answer = Ended(str(error), type(error).__name__)
                send(self._to, ("answer", answer))
        except (OSError, EOFError) as error:
            self.close()
            code = self._process.returncode
            raise AgentFailed("agent_died", f"the agent's process ended with exit status {code}") from error
        except (pickle.UnpicklingError, AttributeError, ImportError, TypeError, ValueError, KeyError) as error:
            self.close()
            raise AgentFailed("agent_unreadable", f"what the agent's process sent cannot be read: {error}") from error
        if not isinstance(message, Ended):
            self.close()
            raise AgentFailed("agent_unreadable", f"the agent's process sent {type(message).__name__}")
        self.trace = message.trace
        if message.failed:
            raise AgentFailed(message.failed, str(message.value))
        return message.value

    def show(self, layout: FloorMap) -> None:
        """Give a house's map to the agent; it keeps every map, with what it has measured there, for later episodes.

        Raises:
            AgentFailed: the process has ended.
        """
        number = next((i for i, known in enumerate(self._layouts) if known is layout), len(self._layouts))
        if number == len(self._layouts):
            self._layouts.append(layout)
            self.call("layout", number, layout)
        else:
            self.call("layout", number, None)

    def close(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            self._to.close()
        if self._process.poll() is None:
            try:
                self._process.wait(0.2)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._process.wait()
        self._back.close()

    @property
    def alive(self) -> bool:
        """Whether it can be given another episode."""
        return self._process.poll() is None and not self._to.closed


class ForeignAgent:
    """An agent in another process, as the runner sees it.

    Attributes:
        name: registered name.
        trace: what the agent noted, as of the last call.
    """

    def __init__(
        self, host: AgentHost, name: str, model: ChatModel | None, understanding: Understanding | None
    ) -> None:
        self.name = name
        self.trace = AgentTrace()
        self.host = host
        self._about = (None if model is None else (model.name, dict(model.decoding)), _name_of(understanding))
        self._asked: dict[str, Any] = {}
        if model is not None:
            self._asked["complete"] = model.complete
        if understanding is not None:
            self._asked["understand"] = lambda text, rooms, answers: understanding.understand(
                text, rooms=rooms, answers=answers
            )

    def make(self, options: Mapping[str, Any]) -> Made:
        """Have the agent made, with options of `gavel_agents.make`.

        Raises:
            AgentFailed: it raised.
        """
        made = self.host.call("make", self.name, dict(options), *self._about, asked=self._asked)
        return made if isinstance(made, Made) else Made(False)

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self.host.show(observation.observed.layout)
        self._call("reset", observation, info)

    def act(self, observation: Observation, info: dict[str, Any]) -> EnvAction | None:
        """Return the next action."""
        action = self._call("act", observation, info)
        if action is not None and not isinstance(action, EnvAction):
            raise AgentFailed("TypeError", f"the agent returned {type(action).__name__}; expected EnvAction or None")
        prior = None if action is None else action.search_prior
        if action is None or not prior:
            return action
        return action._replace(search_prior={room: float(weight) for room, weight in prior.items()})

    def _call(self, what: str, observation: Observation, info: dict[str, Any]) -> Any:
        seen = Observation(observation, msgspec.structs.replace(observation.observed, layout=None))
        try:
            return self.host.call(what, seen, {**info, "observed": None}, asked=self._asked)
        finally:
            trace = self.host.trace
            self.trace = trace if isinstance(trace, AgentTrace) else AgentTrace()


def _name_of(understanding: Understanding | None) -> str | None:
    return None if understanding is None else understanding.name
