"""What an episode looked like while it ran, for the report: where things were, what was believed, what became true.

Only changes are kept, so that a record stays small. Nothing here reaches an agent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from eval.records.schema import Scenery
from gavel_env.world_model.goals import Goal, unmet

if TYPE_CHECKING:
    from gavel_env.envs.env import GavelEnv

__all__ = ["Watcher"]

_LEAST = 0.005
"""Beliefs below this are not shown."""


class Watcher:
    """Looks at an episode's hidden world and at its agent's beliefs, step by step."""

    def __init__(self, env: GavelEnv) -> None:
        """Take in how the episode starts."""
        state = env.privileged_state()
        self._env = env
        self._goal = state.instruction.goal()
        names = list(state.graph.world.nodes)
        placed = names[len(names) - len(state.instruction.placements) :]
        self._start = _rounded(*state.floor.points(np.array([state.cell]))[0])
        self._things = {obj: _rounded(*state.executor.position(obj)) for obj in placed}
        self._met: list[tuple[int, tuple[int, ...]]] = []
        self._beliefs: list[tuple[int, str, dict[str, float]]] = []
        self._believed: dict[str, dict[str, float]] = {}
        self._steps = 0
        self._look()

    def before(self, agent: object) -> None:
        """Take in what an agent believes before its next action, if it says so."""
        beliefs: Any = getattr(agent, "beliefs", None)
        if not isinstance(beliefs, Mapping):
            return
        for node, rooms in beliefs.items():
            shown = {room: round(float(p), 2) for room, p in rooms.items() if p >= _LEAST}
            if self._believed.get(node) != shown:
                self._believed[node] = shown
                self._beliefs.append((self._steps, node, shown))
        for node in [node for node in self._believed if node not in beliefs]:
            del self._believed[node]
            self._beliefs.append((self._steps, node, {}))

    def after(self) -> None:
        """Take in what the action has made true."""
        self._steps += 1
        self._look()

    def _look(self) -> None:
        graph = self._env.privileged_state().graph
        met = tuple(i for i, literal in enumerate(self._goal.literals) if not unmet(Goal((literal,)), graph))
        if not self._met or self._met[-1][1] != met:
            self._met.append((self._steps, met))

    def scenery(self) -> Scenery:
        """Return what was seen."""
        return Scenery(
            self._start, self._things, tuple(map(str, self._goal.literals)), tuple(self._met), tuple(self._beliefs)
        )


def _rounded(x: float, y: float) -> tuple[float, float]:
    return round(float(x), 2), round(float(y), 2)
