"""Lines of the bench: what others' environments cost in the same run, and Gymnasium alone."""

from __future__ import annotations

import time
from importlib.util import find_spec
from typing import Any

from eval.studies.bench_world import still_steps
from eval.studies.measuring import Measurement, Samples, timed
from gavel_env.errors import NotInstalled

__all__ = ["PEERS"]


def _minigrid() -> Samples:
    import gymnasium as gym

    try:
        import minigrid  # noqa: F401  (registers its environments)
    except ImportError:
        raise NotInstalled("minigrid is not installed; the extra [dev] has it") from None
    env: Any = gym.make("MiniGrid-DoorKey-8x8-v0", disable_env_checker=True)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(300):
        actions = [env.action_space.sample() for _ in range(20)]
        begun = time.perf_counter()
        ended = False
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            ended = ended or terminated or truncated
            if terminated or truncated:
                break
        else:
            yield (time.perf_counter() - begun) / len(actions)
        if ended:
            env.reset()


def _nothing() -> Samples:
    """Step an environment that does nothing: what Gymnasium's own wrappers take."""
    import gymnasium as gym

    class Empty(gym.Env[Any, Any]):
        observation_space = gym.spaces.Discrete(2)
        action_space = gym.spaces.Discrete(2)

        def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
            return 0, {}

        def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
            return 0, 0.0, False, False, {}

    env = gym.wrappers.TimeLimit(gym.wrappers.OrderEnforcing(Empty()), 10**9)
    env.reset()
    for _ in range(100):
        yield timed(lambda: env.step(0), 200)


def _cart_pole() -> Samples:
    import gymnasium as gym

    env: Any = gym.make("CartPole-v1", disable_env_checker=True)
    for seed in range(300):
        env.reset(seed=seed)
        yield timed(lambda: env.step(0), 5)


def _pddlgym() -> Samples:
    """Step pddlgym's Blocks by random valid actions, which are drawn beforehand."""
    if find_spec("pddlgym") is None:
        raise NotInstalled("needs pddlgym")
    import pddlgym

    env = pddlgym.make("PDDLEnvBlocks-v0")
    observation, _ = env.reset()
    for _ in range(300):
        action = env.action_space.sample(observation)
        begun = time.perf_counter()
        observation = env.step(action)[0]
        yield time.perf_counter() - begun


def _against_minigrid() -> Samples:
    """Step a door and MiniGrid in turn; a sample is how many times as long MiniGrid takes."""
    for ours, theirs in zip(still_steps("graph"), _minigrid(), strict=False):
        yield theirs / ours


PEERS: tuple[Measurement, ...] = (
    Measurement("step of an empty environment (Gymnasium's floor)", "/s", None, _nothing),
    Measurement("step of CartPole", "/s", None, _cart_pole),
    Measurement("step of pddlgym Blocks", "/s", None, _pddlgym),
    Measurement("step of MiniGrid DoorKey-8x8", "/s", None, _minigrid),
    Measurement("Graph step against MiniGrid DoorKey, in turn", "×", 5.0, _against_minigrid),
)
