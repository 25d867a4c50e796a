"""GAVEL's environments: household instructions in real, partially observed BEHAVIOR-1K houses.

Importing this package registers `Gavel-SingleTask-v0`, `Gavel-MultiTask-v0` and `Gavel-Behavior-v0` with Gymnasium.
Everything else is loaded when it is first used, so that the import stays light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from gavel_env.actions import Action, Primitive, parse_action
    from gavel_env.config import RobotConfig
    from gavel_env.dynamics import Profile, Violation, ViolationKind
    from gavel_env.env import GavelEnv
    from gavel_env.episode import Judgement
    from gavel_env.errors import GavelError
    from gavel_env.goals import Goal, parse_goal, unmet
    from gavel_env.graph import SceneGraph
    from gavel_env.instructions import Instruction, read_instructions
    from gavel_env.observed import EnvAction, Observed
    from gavel_env.pddl import export_pddl
    from gavel_env.rewards import RewardWeights
    from gavel_env.scenes import load_scene, scene_names
    from gavel_env.wrappers import FlatActions, PaddedGraph, TextActions

__all__ = [
    "Action",
    "EnvAction",
    "FlatActions",
    "GavelEnv",
    "GavelError",
    "Goal",
    "Instruction",
    "Judgement",
    "Observed",
    "PaddedGraph",
    "Primitive",
    "Profile",
    "RewardWeights",
    "RobotConfig",
    "SceneGraph",
    "TextActions",
    "Violation",
    "ViolationKind",
    "export_pddl",
    "load_scene",
    "parse_action",
    "parse_goal",
    "read_instructions",
    "scene_names",
    "unmet",
]

_HOME = {
    "Action": "actions",
    "EnvAction": "observed",
    "FlatActions": "wrappers",
    "GavelEnv": "env",
    "GavelError": "errors",
    "Goal": "goals",
    "Instruction": "instructions",
    "Judgement": "episode",
    "Observed": "observed",
    "PaddedGraph": "wrappers",
    "Primitive": "actions",
    "Profile": "dynamics",
    "RewardWeights": "rewards",
    "RobotConfig": "config",
    "SceneGraph": "graph",
    "TextActions": "wrappers",
    "Violation": "dynamics",
    "ViolationKind": "dynamics",
    "export_pddl": "pddl",
    "load_scene": "scenes",
    "parse_action": "actions",
    "parse_goal": "goals",
    "read_instructions": "instructions",
    "scene_names": "scenes",
    "unmet": "goals",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its module on first use."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


register(
    id="Gavel-SingleTask-v0",
    entry_point="gavel_env.env:GavelEnv",
    max_episode_steps=200,
    kwargs={"instructions": "single"},
)
register(
    id="Gavel-MultiTask-v0",
    entry_point="gavel_env.env:GavelEnv",
    max_episode_steps=500,
    kwargs={"instructions": "multi"},
)
register(
    id="Gavel-Behavior-v0",
    entry_point="gavel_env.env:GavelEnv",
    max_episode_steps=500,
    kwargs={"instructions": "behavior", "max_nodes": 4096},
)
