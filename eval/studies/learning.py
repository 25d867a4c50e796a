"""`python -m eval.studies.learning`: MaskablePPO learns a level of `Gavel-RL-v0`, beside masked random actions.

Needs the extra `[rl]`; a picture of the curves also needs `[plots]`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import gavel_env  # noqa: F401  # registers the environments
from gavel_env.envs.levels import LEVELS, LevelSplit
from gavel_env.errors import NotInstalled

__all__ = ["Learned", "Policy", "main", "masked_random", "solved_share", "train"]

Policy = Callable[[NDArray[np.float32], NDArray[np.bool_]], int]
"""From an observation and its mask to an action."""

_ENVS, _ROLLOUT, _WINDOW = 8, 128, 100


class Learned(NamedTuple):
    """What a training gave.

    Attributes:
        policy: takes the most probable of the allowed actions.
        curve: (steps so far, share of the last 100 episodes that succeeded), one point per rollout.
    """

    policy: Policy
    curve: tuple[tuple[int, float], ...]


def train(level: str = "easy", steps: int = 50_000, seed: int = 0) -> Learned:
    """Train MaskablePPO on the training instructions of a level, on one thread.

    Args:
        level: of `Gavel-RL-v0`.
        steps: environment steps, over all of eight environments.
        seed: of environments and weights.

    Raises:
        NotInstalled: the extra `[rl]` is not installed.
    """
    try:
        import torch
        from sb3_contrib import MaskablePPO
        from stable_baselines3.common.callbacks import BaseCallback
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError as error:
        raise NotInstalled(f"{error.name} is not installed; pip install 'gavel-env[rl]'") from error
    torch.set_num_threads(1)

    class Curve(BaseCallback):  # type: ignore[misc,unused-ignore]  # Any where it is not installed
        ended: list[bool]
        points: list[tuple[int, float]]

        def _on_training_start(self) -> None:
            self.ended, self.points = [], []

        def _on_step(self) -> bool:
            self.ended += [
                info["success"] for done, info in zip(self.locals["dones"], self.locals["infos"], strict=True) if done
            ]
            return True

        def _on_rollout_end(self) -> None:
            if self.ended:
                self.points.append((int(self.num_timesteps), float(np.mean(self.ended[-_WINDOW:]))))

    envs = make_vec_env("Gavel-RL-v0", n_envs=_ENVS, seed=seed, env_kwargs={"level": level})
    model = MaskablePPO(
        "MlpPolicy",
        envs,
        n_steps=_ROLLOUT,
        batch_size=256,
        n_epochs=6,
        learning_rate=1e-3,
        gamma=0.99,
        ent_coef=0.01,
        policy_kwargs={"net_arch": [128, 128]},
        seed=seed,
        device="cpu",
    )
    curve = Curve()
    model.learn(steps, callback=curve)

    def policy(observation: NDArray[np.float32], mask: NDArray[np.bool_]) -> int:
        return int(model.predict(observation, action_masks=mask, deterministic=True)[0])

    return Learned(policy, tuple(curve.points))


def masked_random(seed: int = 0) -> Policy:
    """Return the policy that takes any allowed action."""
    rng = np.random.default_rng(seed)
    return lambda _, mask: int(rng.choice(np.flatnonzero(mask)))


def solved_share(policy: Policy, level: str = "easy", split: LevelSplit = "test", seed: int = 0) -> float:
    """Return the share of the instructions of a level that a policy carries out, one episode each."""
    env = gym.make("Gavel-RL-v0", level=level, split=split)
    solved = []
    for instruction in env.get_wrapper_attr("instruction_ids"):
        observation, info = env.reset(seed=seed, options={"instruction": instruction})
        ended = False
        while not ended:
            action = policy(observation, info["action_mask"].astype(np.bool_))
            observation, _, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        solved.append(info["success"])
    return float(np.mean(solved))


def _picture(curves: Sequence[Sequence[tuple[int, float]]], random: float, level: str, path: Path) -> None:
    from eval.studies.plots import figure

    drawing, axes = figure()
    for seed, curve in enumerate(curves):
        steps, shares = zip(*curve, strict=True)
        axes.plot(steps, shares, label=f"MaskablePPO, seed {seed}")
    axes.axhline(random, color="0.5", linestyle="--", label="masked random actions")
    axes.set(xlabel="environment steps", ylabel="success, last 100 episodes", ylim=(0, 1.02), xlim=(0, None))
    axes.set_title(f"Gavel-RL-v0, level {level}")
    axes.legend(loc="lower right")
    drawing.savefig(path)


def main(argv: Sequence[str] | None = None) -> int:
    """Train, print the shares solved, and draw the curves.

    Args:
        argv: arguments after the program's name; None = those of the process.
    """
    parser = argparse.ArgumentParser(prog="python -m eval.studies.learning", description="MaskablePPO on a level.")
    parser.add_argument("--level", choices=list(LEVELS), default="easy")
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--seeds", type=int, default=1, help="trainings, with seeds 0, 1, …")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the curves")
    arguments = parser.parse_args(argv)
    random = solved_share(masked_random(), arguments.level)
    print(f"masked random actions: {random:.0%} of the test instructions of level {arguments.level}")
    curves = []
    for seed in range(arguments.seeds):
        learned = train(arguments.level, arguments.steps, seed)
        curves.append(learned.curve)
        share = solved_share(learned.policy, arguments.level)
        print(f"MaskablePPO, {arguments.steps:,} steps, seed {seed}: {share:.0%}", flush=True)
    if arguments.png is not None:
        _picture(curves, random, arguments.level, arguments.png)
    return 0


if __name__ == "__main__":
    sys.exit(main())
