"""The agent's side: a process that makes an agent and does what the runner asks."""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import queue
import threading
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, BinaryIO, cast

import msgspec

from eval.records.scrub import describe_error
from eval.run.boundary import attempt
from eval.run.foreign.wire import LENGTH, Asked, Ended, Made, Observations, send
from gavel_agents.agent import Agent, AgentTrace, Privileged
from gavel_agents.llm import Completion, Prompt
from gavel_agents.understanding import Decomposition
from gavel_agents.understanding.interface import Rooms
from gavel_env.errors import GavelError

__all__ = ["main"]


class _Runner:
    """The runner, as an agent's process sees it."""

    def __init__(self, to: BinaryIO, messages: queue.SimpleQueue[Any]) -> None:
        self._to, self.messages = to, messages

    def ask(self, what: str, *arguments: Any) -> Any:
        send(self._to, Asked(what, arguments))
        _, answer = self.messages.get()
        if answer.failed:
            raise _relayed(answer.failed, answer.value)
        return answer.value

    def tell(self, ended: Ended) -> None:
        try:
            send(self._to, ended)
        except (pickle.PicklingError, AttributeError, TypeError, RecursionError) as error:
            trace = ended.trace if isinstance(ended.trace, AgentTrace) else None
            said = Ended(f"{type(error).__name__}: {error}", "Unencodable")
            with contextlib.suppress(pickle.PicklingError, AttributeError, TypeError, RecursionError):
                send(self._to, said._replace(trace=trace))
                return
            send(self._to, said)


def _relayed(kind: str, text: str) -> GavelError:
    """Return an error of the runner's side, by the name of its class."""
    from gavel_env import errors

    found = getattr(errors, kind, GavelError)
    known = isinstance(found, type) and issubclass(found, GavelError)
    error: GavelError = GavelError.__new__(found if known else GavelError)
    error.args = (text,)
    return error


class _AskedModel:
    """The planner of an agent: asked on the runner's side."""

    def __init__(self, runner: _Runner, name: str, decoding: Mapping[str, str | float | int]) -> None:
        self.name, self.decoding = name, decoding
        self._runner = runner

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return cast("list[Completion]", self._runner.ask("complete", list(prompts)))


class _AskedUnderstanding:
    """The understanding of an agent: asked on the runner's side."""

    def __init__(self, runner: _Runner, name: str) -> None:
        self.name = name
        self._runner = runner

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        return cast("Decomposition", self._runner.ask("understand", text, rooms, answers))


class _Hosted:
    """The agent of this process, and the layout that it was shown last."""

    def __init__(self, runner: _Runner) -> None:
        self._runner = runner
        self._layout: Any = None
        self._layouts: dict[int, Any] = {}
        self.agent: Agent | None = None

    def answer(self, what: str, arguments: Any) -> Any:
        """Do what the runner asks, and return what it is told."""
        if what == "make":
            made, self.agent = _make(self._runner, *arguments)
            return made
        if what == "layout":
            number, shown = arguments
            self._layout = self._layouts.setdefault(number, shown)
        elif self.agent is not None:
            observation, info = arguments
            info["observed"] = observation.observed = msgspec.structs.replace(observation.observed, layout=self._layout)
            if what != "reset":
                return self.agent.act(observation, info)
            self.agent.reset(observation, info)
        return None

    def trace(self) -> Any:
        """Return the agent's trace, if it has one."""
        return getattr(self.agent, "trace", None)


def _serve(runner: _Runner) -> None:
    """Do what the runner asks until it asks no more."""
    hosted = _Hosted(runner)
    while True:
        what, arguments = runner.messages.get()
        value, error = attempt(partial(hosted.answer, what, arguments), through=())
        ended = Ended(value) if error is None else Ended(describe_error(error), type(error).__name__)
        trace, _ = attempt(hosted.trace, through=())
        runner.tell(ended._replace(trace=trace))


def _make(
    runner: _Runner,
    name: str,
    options: Mapping[str, Any],
    model: tuple[str, Mapping[str, str | float | int]] | None,
    understanding: str | None,
) -> tuple[Made, Agent | None]:
    import gavel_agents

    if name not in gavel_agents.agent_names():
        return Made(False), None
    agent = gavel_agents.make(
        name,
        planner=None if model is None else _AskedModel(runner, *model),
        understanding=None if understanding is None else _AskedUnderstanding(runner, understanding),
        **options,
    )
    return Made(True, isinstance(agent, Privileged)), agent


def main(plugins: Sequence[str]) -> None:
    """Run agents for the runner at the other end of standard input and output."""
    to, back = os.fdopen(os.dup(1), "wb"), os.fdopen(os.dup(0), "rb")
    os.dup2(2, 1)  # what agents print
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    messages: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(back, messages), daemon=True).start()
    runner = _Runner(to, messages)
    from eval.run.rig import import_plugins

    with contextlib.suppress(GavelError):  # the runner has imported them, and said so if one cannot be
        import_plugins(plugins)
    _serve(runner)


def _read(back: BinaryIO, messages: queue.SimpleQueue[Any]) -> None:
    """Take messages from the runner; when it has gone, whatever the agent is doing is over."""
    while True:
        head = back.read(LENGTH.size)
        content = back.read(LENGTH.unpack(head)[0]) if len(head) == LENGTH.size else b""
        if not content:
            os._exit(0)
        messages.put(Observations(io.BytesIO(content)).load())
