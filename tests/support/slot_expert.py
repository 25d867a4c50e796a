"""Follows reference plans through the slots of `Gavel-RL-v0`."""

from __future__ import annotations

from typing import Any

from support.houses import unwrapped

from gavel_env.envs.rl import SlotEnv
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.ontology import category_of


def follow(env: SlotEnv, instruction: str, rewards: list[float] | None = None) -> bool:
    """Carry out an instruction by its reference plan; what no slot stands for yet is come across while searching."""
    _, info = env.reset(seed=0, options={"instruction": instruction})
    for action in unwrapped(env).privileged_state().instruction.reference_plan():
        arrived = False
        while not arrived:
            choices = _slots_for(env, info, action.primitive, action.target)
            arrived = bool(choices)
            if not choices:
                choices = [i for i, s in enumerate(env.slots_now) if s.instance is None and info["action_mask"][i]]
                if not choices:
                    return False
            number = int(action.primitive if arrived else Primitive.NAVIGATE_TO) * env.slots + choices[0]
            _, reward, terminated, truncated, info = env.step(number)
            if rewards is not None:
                rewards.append(reward)
            if terminated or truncated:
                return bool(info["success"])
            if arrived and info["outcome"] != "ok":
                return False
    return False


def _slots_for(env: SlotEnv, info: dict[str, Any], primitive: Primitive, target: str | None) -> list[int]:
    """Return the slots that an action can be said with: the instance's own first, then the goal's of its category."""
    if target is None:
        return [0]
    fit = [
        (slot.instance != target, index)
        for index, slot in enumerate(env.slots_now)
        if slot.instance == target or (slot.designator is not None and slot.designator.name == category_of(target))
    ]
    return [index for _, index in sorted(fit) if info["action_mask"][int(primitive) * env.slots + index]]
