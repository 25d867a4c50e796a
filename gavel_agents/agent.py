"""What an agent is, and what it leaves behind for the records."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import msgspec

from gavel_env.exchange import EnvAction, Observation

__all__ = ["Agent", "AgentTrace", "Privileged", "TaskTrace", "says_valid", "stage"]


class TaskTrace(msgspec.Struct, kw_only=True):
    """One task in a trace.

    Attributes:
        text: the task's sentence.
        goal: its goal literals as understood.
        objects: what it speaks of, as understood.
        relations: locations that it states, as understood.
        proposed: the plan of the proposal, as text actions.
        proposed_verdict: "valid", or the first thing that is wrong with the proposal before any repair.
        plan: the plan after repair; what is executed.
        edits: what repair did, one line per edit.
        verdict: "valid", or the first thing that is wrong with `plan`. After it, in brackets, that the answer
            was cut and what of it looked like a step and could not be read; see `says_valid`.
        unread: those pieces of the answer.
    """

    text: str
    goal: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    relations: tuple[str, ...] = ()
    proposed: tuple[str, ...] = ()
    proposed_verdict: str = ""
    plan: tuple[str, ...] = ()
    edits: tuple[str, ...] = ()
    verdict: str = ""
    unread: tuple[str, ...] = ()


def says_valid(verdict: str) -> bool:
    """Return whether a verdict of a `TaskTrace` says that the plan as read is valid."""
    return verdict.partition(" [")[0] == "valid"


class AgentTrace(msgspec.Struct, kw_only=True):
    """What an agent thought during one episode; goes into the episode's record.

    Attributes:
        tasks: per task, in the order written, as the last attempt left them.
        earlier: the tasks of every attempt before the last.
        attempts: calls of the planner.
        order: indices of the tasks in the order executed.
        expected_m: J of the first ordering chosen, metres; None if the method does not order.
        seconds: seconds by stage (understand, plan, repair, validate, order); planning time is their sum.
        prompt_tokens, completion_tokens: totals over the attempts.
        prompts: SHA-256 (16 digits) of every prompt.
        completions: the raw answers. A run moves them to its conversations, where the record's `calls` lead.
        cut: attempts, from 0, whose answer the backend cut (at the most tokens, or by a content filter).
        stopped: why the agent ended early, or empty.
    """

    tasks: list[TaskTrace] = []
    earlier: list[list[TaskTrace]] = []
    attempts: int = 0
    order: list[int] = []
    expected_m: float | None = None
    seconds: dict[str, float] = {}
    prompt_tokens: int = 0
    completion_tokens: int = 0
    prompts: list[str] = []
    completions: list[str] = []
    cut: list[int] = []
    stopped: str = ""


@runtime_checkable
class Agent(Protocol):
    """A policy that the eval runner steps through an environment."""

    name: str

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Begin an episode with what `env.reset` returned."""
        ...

    def act(self, observation: Observation, info: dict[str, Any]) -> EnvAction | None:
        """Return the next action, or None when done."""
        ...


@runtime_checkable
class Privileged(Protocol):
    """An agent that may see the hidden state (the oracle alone); declared, so that every table can say so."""

    def reveal(self, env: Any) -> None:
        """Take what it needs from the environment's one privileged call."""
        ...


class stage:
    """Adds the seconds of a block to a stage of the trace."""

    def __init__(self, trace: AgentTrace, name: str, clock: Callable[[], float] = time.perf_counter) -> None:
        self._trace, self._name, self._clock = trace, name, clock

    def __enter__(self) -> None:
        self._start = self._clock()

    def __exit__(self, *_: object) -> None:
        spent = self._clock() - self._start
        self._trace.seconds[self._name] = self._trace.seconds.get(self._name, 0.0) + spent
