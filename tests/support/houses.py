"""The instructions that the environment tests run, and how to run them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym

from gavel_env.envs.env import GavelEnv
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import Instruction, read_instructions
from gavel_env.world_model.actions import Action, parse_action
from gavel_env.world_model.ontology import category_of

FILE = Path(__file__).parents[1] / "data" / "instructions.jsonl"
INSTRUCTIONS = dict(read_instructions(FILE))

Stepped = tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]


def make(**kwargs: Any) -> gym.Env[Any, Any]:
    """Make the single-task environment on the tests' instructions."""
    return gym.make("Gavel-SingleTask-v0", **({"instructions": str(FILE)} | kwargs))


def start(instruction: str, seed: int = 0, **kwargs: Any) -> gym.Env[Any, Any]:
    """Make an environment and begin an instruction."""
    env = make(**kwargs)
    env.reset(seed=seed, options={"instruction": instruction})
    return env


def unwrapped(env: gym.Env[Any, Any]) -> GavelEnv:
    """Return what the wrappers are around."""
    found = env.unwrapped
    assert isinstance(found, GavelEnv)
    return found


def send(env: gym.Env[Any, Any], action: Action) -> EnvAction:
    """Return an action as one sends it who was told the room: by id if it is observed, else by category and room."""
    if action.target is None or action.target in unwrapped(env).observed.graph.world.nodes:
        return EnvAction.of(action)
    room = unwrapped(env).privileged_state().graph.room_of(action.target)
    return EnvAction(action.primitive, f"{category_of(action.target)}@{room}")


def by_reference(env: gym.Env[Any, Any], instruction: Instruction) -> Stepped:
    """Follow the reference plan until the episode ends."""
    last: Stepped | None = None
    for action in instruction.reference_plan():
        last = env.step(send(env, action))
        if last[2] or last[3]:
            break
    assert last is not None
    return last


def steps(env: gym.Env[Any, Any], *plan: str) -> Stepped:
    """Take steps given as text; return what the last one returned."""
    last: Stepped | None = None
    for text in plan:
        last = env.step(EnvAction.of(parse_action(text)))
    assert last is not None
    return last
