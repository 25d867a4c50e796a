"""Recorded actions, sent again: of agents that are not at hand, and to see what they saw."""

from __future__ import annotations

from collections import deque
from typing import Any

from eval.records.schema import EpisodeRecord, Step
from gavel_agents.agent import AgentTrace
from gavel_env.exchange import EnvAction, Observation
from gavel_env.world_model.actions import parse_action
from gavel_env.world_model.narration import look

__all__ = ["Playback", "PrivilegedPlayback", "playback"]


class Playback:
    """An agent that sends the actions of a record.

    Attributes:
        seen: what was observed before each action and after the last, in words.
    """

    def __init__(self, record: EpisodeRecord) -> None:
        self.name = record.contestant.agent
        self.trace = AgentTrace(stopped=record.trace.stopped)
        self.seen: list[str] = []
        self._left = deque(record.steps)

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Begin."""

    def act(self, observation: Observation, info: dict[str, Any]) -> EnvAction | None:
        """Return the next recorded action."""
        self.seen.append(look(observation.observed.graph))
        return _action(self._left.popleft()) if self._left else None


class PrivilegedPlayback(Playback):
    """Sends the recorded actions of an agent that saw the hidden state, and so knew every name."""

    def reveal(self, env: Any) -> None:
        """Make every object known, as it was."""
        env.unwrapped.reveal()


def playback(record: EpisodeRecord) -> Playback:
    """Return the agent that plays a record."""
    return (PrivilegedPlayback if record.contestant.privileged else Playback)(record)


def _action(step: Step) -> EnvAction:
    action = parse_action(step.action)
    return EnvAction(action.primitive, action.target, step.search_prior or None, step.other_than)
