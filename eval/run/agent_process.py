"""Agents that are not this package's, each in a process of its own, so that nothing they do reaches anything but them.

The world stays with the runner. What crosses over is what an agent may know: observations one way, actions the other;
its model and its understanding are asked for it on this side. A crash, `sys.exit`, `os._exit`, a changed working
directory or a thread that never ends is that episode's, and what the agent prints goes to standard error.
"""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import queue
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, BinaryIO, NamedTuple, cast

import msgspec

from eval.records.scrub import describe_error
from eval.run.boundary import attempt
from gavel_agents.agent import Agent, AgentTrace, Privileged
from gavel_agents.llm import ChatModel, Completion, Prompt
from gavel_agents.understanding import Decomposition, Understanding
from gavel_agents.understanding.interface import Rooms
from gavel_env.errors import GavelError
from gavel_env.exchange import EnvAction
from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.ontology import Category, default_ontology

__all__ = ["IN_PROCESS", "AgentFailed", "AgentHost", "ForeignAgent", "Made", "in_process"]

_LENGTH = struct.Struct("<Q")
_MOST_BYTES = 1 << 30
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


class _Asked(NamedTuple):
    """What an agent wants of its model or its understanding."""

    what: str
    arguments: tuple[Any, ...]


class _Ended(NamedTuple):
    """What a call of the agent came to; `failed` is the class of what it raised, `trace` the agent's own."""

    value: Any
    failed: str = ""
    trace: Any = None


class Made(NamedTuple):
    """What came of making an agent: it is not known here, it sees hidden state, or it is ready."""

    known: bool
    privileged: bool = False


_OURS = (
    __name__,
    "gavel_agents.agent",
    "gavel_agents.llm.interface",
    "gavel_env.exchange",
    "gavel_env.frozen",
    "gavel_env.instructions.lookup",
    "gavel_env.world_model.",
)
"""Modules whose classes hold data and do nothing when they are made."""


class _Unpickler(pickle.Unpickler):
    """Reads what an agent's process sends: data of this project and of numpy, and no function but their makers'."""

    def find_class(self, module: str, name: str) -> Any:
        found = super().find_class(module, name) if _is_data(module, name) else None
        if found is None or (module.startswith(_OURS) and not isinstance(found, type) and name != "frozen"):
            raise pickle.UnpicklingError(f"an agent's process sent {module}.{name}")
        return found

    def persistent_load(self, name: Any) -> Category:
        return default_ontology()[str(name)]


def _is_data(module: str, name: str) -> bool:
    package = module.partition(".")[0]
    if package == "numpy":
        return name in ("ndarray", "dtype", "scalar", "_reconstruct", "_frombuffer")
    if package == "builtins":
        return name in ("set", "frozenset", "complex", "bytearray", "slice")
    if package == "msgspec":
        return name == "rebuild"
    return module.startswith(_OURS)


class _Pickler(pickle.Pickler):
    """Writes categories of the shipped ontology, of which every observation is full, by their names."""

    def persistent_id(self, thing: Any) -> str | None:
        if type(thing) is Category and default_ontology().get(thing.name) is thing:
            return thing.name
        return None


class _Observations(pickle.Unpickler):
    """Reads what the runner sends."""

    def persistent_load(self, name: Any) -> Category:
        return default_ontology()[name]


def _send(file: BinaryIO, message: Any) -> None:
    packed = io.BytesIO()
    _Pickler(packed, pickle.HIGHEST_PROTOCOL).dump(message)
    content = packed.getvalue()
    file.write(_LENGTH.pack(len(content)) + content)
    file.flush()


def _receive(file: BinaryIO) -> Any:
    """Return the next message.

    Raises:
        EOFError: there is none any more.
        pickle.UnpicklingError: it is none.
    """
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    if length > _MOST_BYTES:
        raise pickle.UnpicklingError(f"a message of {length} bytes")
    content = file.read(length)
    if len(content) < length:
        raise EOFError
    return _Unpickler(io.BytesIO(content)).load()


class AgentHost:
    """A process in which the agents of one contestant are made and run, one after the other."""

    def __init__(self, plugins: Sequence[str]) -> None:
        """Start the process.

        Args:
            plugins: modules whose import registers agents.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"import sys; from {__name__} import main; main(sys.argv[1:])", *plugins],
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
            _send(self._to, (what, arguments))
            while isinstance(message := _receive(self._back), _Asked):
                function = (asked or {})[message.what]
                try:
                    answer = _Ended(function(*message.arguments))
                except GavelError as error:
                    answer = _Ended(str(error), type(error).__name__)
                _send(self._to, ("answer", answer))
        except (OSError, EOFError) as error:
            self.close()
            code = self._process.returncode
            raise AgentFailed("agent_died", f"the agent's process ended with exit status {code}") from error
        except (pickle.UnpicklingError, AttributeError, ImportError, TypeError, ValueError, KeyError) as error:
            self.close()
            raise AgentFailed("agent_unreadable", f"what the agent's process sent cannot be read: {error}") from error
        if not isinstance(message, _Ended):
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

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self.host.show(info["observed"].layout)
        self._call("reset", observation, info)

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        """Return the next action."""
        action = self._call("act", observation, info)
        if action is not None and not isinstance(action, EnvAction):
            raise AgentFailed("TypeError", f"the agent returned {type(action).__name__}; expected EnvAction or None")
        prior = None if action is None else action.search_prior
        if action is None or not prior:
            return action
        return action._replace(search_prior={room: float(weight) for room, weight in prior.items()})

    def _call(self, what: str, observation: Any, info: dict[str, Any]) -> Any:
        sent = {**info, "observed": msgspec.structs.replace(info["observed"], layout=None)}
        try:
            return self.host.call(what, observation, sent, asked=self._asked)
        finally:
            trace = self.host.trace
            self.trace = trace if isinstance(trace, AgentTrace) else AgentTrace()


def _name_of(understanding: Understanding | None) -> str | None:
    return None if understanding is None else understanding.name


# --- the other side ------------------------------------------------------------------------------------------------


class _Runner:
    """The runner, as an agent's process sees it."""

    def __init__(self, to: BinaryIO, messages: queue.SimpleQueue[Any]) -> None:
        self._to, self.messages = to, messages

    def ask(self, what: str, *arguments: Any) -> Any:
        _send(self._to, _Asked(what, arguments))
        _, answer = self.messages.get()
        if answer.failed:
            raise _relayed(answer.failed, answer.value)
        return answer.value

    def tell(self, ended: _Ended) -> None:
        try:
            _send(self._to, ended)
        except (pickle.PicklingError, AttributeError, TypeError, RecursionError) as error:
            trace = ended.trace if isinstance(ended.trace, AgentTrace) else None
            said = _Ended(f"{type(error).__name__}: {error}", "Unencodable")
            with contextlib.suppress(pickle.PicklingError, AttributeError, TypeError, RecursionError):
                _send(self._to, said._replace(trace=trace))
                return
            _send(self._to, said)


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
            info["observed"] = msgspec.structs.replace(info["observed"], layout=self._layout)
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
        ended = _Ended(value) if error is None else _Ended(describe_error(error), type(error).__name__)
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
        head = back.read(_LENGTH.size)
        content = back.read(_LENGTH.unpack(head)[0]) if len(head) == _LENGTH.size else b""
        if not content:
            os._exit(0)
        messages.put(_Observations(io.BytesIO(content)).load())
