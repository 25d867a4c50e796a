"""Agents that misbehave, one way each; importing this module registers them."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import time
from typing import Any

import numpy as np

import gavel_agents
from gavel_agents.agent import AgentTrace
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Primitive


class Fair:
    """Goes to a fridge and ends."""

    name = "fair"

    def __init__(self, *, understanding: Any = None, planner: Any = None) -> None:
        self.understanding, self.planner = understanding, planner
        self.trace = AgentTrace()

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        self.trace = AgentTrace(attempts=1, stopped=f"working in {os.getcwd()}")
        self._left = 1

    def act(self, observation: Any, info: dict[str, Any]) -> Any:
        self._left -= 1
        return EnvAction(Primitive.NAVIGATE_TO, "bed") if self._left >= 0 else None


class Peeking(Fair):
    """Looks for placements, reference plans and environments in everything that it can reach."""

    name = "peeking"

    def act(self, observation: Any, info: dict[str, Any]) -> Any:
        import gc

        from gavel_env.envs.env import GavelEnv
        from gavel_env.instructions.record import Instruction
        from gavel_env.sim.episode import Episode

        kinds = (GavelEnv, Instruction, Episode)
        self.understanding.understand(info["observed"].instruction)
        found = [type(thing).__name__ for thing in gc.get_objects() if isinstance(thing, kinds)]
        self.trace.stopped = f"found {sorted(set(found))}"
        return None


class Numpy(Fair):
    """Answers in numpy's numbers."""

    name = "numpy"

    def act(self, observation: Any, info: dict[str, Any]) -> Any:
        action = super().act(observation, info)
        rooms = info["observed"].graph.world.rooms
        return action and action._replace(search_prior={room: np.float32(0.5) for room in rooms})


def _class(name: str, when: str, what: Any) -> type[Fair]:
    def method(self: Fair, *given: Any) -> Any:
        return what(self, *given)

    return type(name.title(), (Fair,), {"name": name, when: method})


class Stop(BaseException):
    """Derives from nothing that is usually caught."""


def raising(error: BaseException) -> Any:
    def call(*_: Any, **__: Any) -> Any:
        raise error

    return call


def lingering(*_: Any) -> None:
    threading.Thread(target=time.sleep, args=(600,), daemon=False).start()


def printing(*_: Any) -> None:
    print("agent,of,doom")  # noqa: T201
    os.write(1, b"written,to,one\n")


def moving(self: Fair, *_: Any) -> None:
    os.chdir("/")
    self._left = 0


MISDEEDS = {
    "scalar": ("act", lambda self, *_: setattr(self.trace, "expected_m", np.float64(1.5))),
    "exits": ("act", lambda *_: sys.exit(0)),
    "dies": ("act", lambda *_: os._exit(0)),
    "interrupts": ("act", raising(KeyboardInterrupt())),
    "cancels": ("act", raising(asyncio.CancelledError())),
    "stops": ("reset", raising(Stop("base"))),
    "moves": ("reset", moving),
    "prints": ("act", printing),
    "lingers": ("act", lingering),
    "answers": ("act", lambda *_: "NAVIGATE_TO(bed)"),
    "unpicklable": ("act", lambda *_: lambda: None),
    "recursive": ("act", lambda self, *given: self.act(*given)),
    "surrogate": ("act", raising(ValueError("half \ud800"))),
    "constructor": ("__init__", raising(ZeroDivisionError("in the constructor"))),
    "nan": ("act", lambda self, *_: setattr(self, "trace", AgentTrace(expected_m=float("nan"), order=[None]))),  # type: ignore[list-item]
    "untraced": ("act", lambda self, *_: setattr(type(self), "trace", property(raising(ValueError("no trace"))))),
    "changes": ("act", lambda self, observation, info: info["observed"].graph.world.rooms.clear()),
}

NAMES = ("fair", "peeking", "numpy", *MISDEEDS)

_AGENTS: list[type[Fair]] = [Fair, Peeking, Numpy, *(_class(name, *misdeed) for name, misdeed in MISDEEDS.items())]
for _agent in _AGENTS:
    gavel_agents.register(_agent.name, _agent)
