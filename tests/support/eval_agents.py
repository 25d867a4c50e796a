"""Small agents for tests of the runner; importing this module registers them (`--plugin tests.support.eval_agents`)."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

import gavel_agents
from gavel_agents.agent import AgentTrace
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Action, Primitive


class Teacher:
    """Follows the reference plan as written; privileged, since reference plans name hidden instances."""

    name = "teacher"

    def __init__(self, **_: Any) -> None:
        self.trace = AgentTrace()

    def reveal(self, env: Any) -> None:
        self.instruction = env.reveal().instruction

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        self.trace = AgentTrace(seconds={"plan": 0.5}, attempts=2)
        self._plan = list(self.instruction.reference_plan())

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        return EnvAction.of(self._plan.pop(0)) if self._plan else None


class Lazy(Teacher):
    """Does nothing on every other letter: ends at once where the instruction's sentence has an odd length."""

    name = "lazy"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        if self.stays():
            self._plan = []

    def stays(self) -> bool:
        return len(self.instruction.text) % 2 == 1


class Slow(Teacher):
    """Sleeps before every episode."""

    name = "slow"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        time.sleep(float(os.environ.get("GAVEL_TEST_SLEEP", "0.3")))


class Crashing(Teacher):
    """Raises after its first action; the message quotes an environment variable."""

    name = "crashing"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        if info["steps"]:
            raise ZeroDivisionError(f"the key is {os.environ.get('GAVEL_TEST_API_KEY', '')}")
        return super().act(observation, info)


class Exiting(Lazy):
    """Calls `sys.exit` where the lazy one does nothing."""

    name = "exiting"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        if self.stays():
            raise SystemExit(3)
        return super().act(observation, info)


class Killed(Lazy):
    """Its process dies where the lazy one does nothing."""

    name = "killed"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        if self.stays():
            os.kill(os.getpid(), signal.SIGKILL)
        return super().act(observation, info)


class Vanishing(Lazy):
    """Its process ends without a word, and as if all were well, where the lazy one does nothing."""

    name = "vanishing"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        if self.stays():
            os._exit(0)
        return super().act(observation, info)


class Hanging(Lazy):
    """Never answers where the lazy one does nothing."""

    name = "hanging"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        while self.stays():
            time.sleep(0.05)
        return super().act(observation, info)


class Dawdling(Teacher):
    """Takes a second for every action."""

    name = "dawdling"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        time.sleep(1.0)
        return super().act(observation, info)


class Sloppy(Teacher):
    """Leaves out everything after its first OPEN or TOGGLE_ON."""

    name = "sloppy"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        opening = {Primitive.OPEN, Primitive.TOGGLE_ON}
        at = next((i for i, action in enumerate(self._plan) if action.primitive in opening), len(self._plan) - 1)
        self._plan = self._plan[: at + 1]


class Untidy(Teacher):
    """Never shuts anything."""

    name = "untidy"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        self._plan = [action for action in self._plan if action.primitive is not Primitive.CLOSE]


class Clumsy(Teacher):
    """Releases what it does not hold."""

    name = "clumsy"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        self._plan[0] = Action(Primitive.RELEASE)


class Circling(Teacher):
    """Drives between its first two targets for ever."""

    name = "circling"

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        return EnvAction.of(self._plan[0])


class Refusing(Teacher):
    """Says that it does not understand."""

    name = "refusing"

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        super().reset(observation, info)
        self._plan = []
        self.trace.stopped = "not understood: unknown_word: frobnicator"


class Asking:
    """Somebody's own planner: asks its model for a plan of its own wording, and follows the first task of it."""

    name = "asking"

    def __init__(self, *, understanding: Any, model: Any = None, seed: int = 0, **options: Any) -> None:
        self._inner = gavel_agents.make("llm-only", understanding=understanding, model=model, seed=seed, **options)
        self.trace = AgentTrace()

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        self._inner.reset(observation, info)
        self.trace = self._inner.trace  # type: ignore[attr-defined]

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        return self._inner.act(observation, info)


AGENTS = (
    Teacher, Lazy, Slow, Crashing, Exiting, Killed, Vanishing, Hanging, Dawdling, Sloppy, Untidy, Clumsy, Circling,
    Refusing, Asking,
)  # fmt: skip

for _agent in AGENTS:
    gavel_agents.register(_agent.name, _agent)
