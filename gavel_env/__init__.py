"""GAVEL's environments: household instructions in real, partially observed BEHAVIOR-1K houses.

Importing this package registers `Gavel-SingleTask-v0`, `Gavel-MultiTask-v0`, `Gavel-Behavior-v0` and `Gavel-RL-v0`.
Everything else is loaded when it is first used, so that the import stays light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from gavel_env.envs.env import GavelEnv
    from gavel_env.envs.pyg import observation_to_pyg
    from gavel_env.envs.rewards import RewardWeights
    from gavel_env.envs.rl import SlotEnv
    from gavel_env.envs.text_game import TextGame
    from gavel_env.envs.wrappers import FlatActions, PaddedGraph, TextActions
    from gavel_env.errors import GavelError
    from gavel_env.exchange import EnvAction, Observation, Observed, ReturnWhen
    from gavel_env.house.robot_config import RobotConfig
    from gavel_env.house.scenes import load_scene, scene_names
    from gavel_env.instructions.record import Instruction, read_instructions
    from gavel_env.sim.episode import Judgement
    from gavel_env.world_model.actions import Action, Primitive, parse_action
    from gavel_env.world_model.dynamics import Profile, Violation, ViolationKind
    from gavel_env.world_model.goals import Goal, parse_goal, unmet
    from gavel_env.world_model.graph import Flag, Node, Relation, Room, SceneGraph, Support, World
    from gavel_env.world_model.layout import Layout
    from gavel_env.world_model.ontology import Category, Ontology, default_ontology
    from gavel_env.world_model.own_actions import OwnAction, own_state, register_action, unregister_action
    from gavel_env.world_model.pddl import export_pddl
    from gavel_env.world_model.travel import travel_cost
    from gavel_env.world_model.verdict import Verdict, validate

__all__ = [
    "Action",
    "Category",
    "EnvAction",
    "Flag",
    "FlatActions",
    "GavelEnv",
    "GavelError",
    "Goal",
    "Instruction",
    "Judgement",
    "Layout",
    "Node",
    "Observation",
    "Observed",
    "Ontology",
    "OwnAction",
    "PaddedGraph",
    "Primitive",
    "Profile",
    "Relation",
    "ReturnWhen",
    "RewardWeights",
    "RobotConfig",
    "Room",
    "SceneGraph",
    "SlotEnv",
    "Support",
    "TextActions",
    "TextGame",
    "Verdict",
    "Violation",
    "ViolationKind",
    "World",
    "default_ontology",
    "export_pddl",
    "load_scene",
    "observation_to_pyg",
    "own_state",
    "parse_action",
    "parse_goal",
    "read_instructions",
    "register_action",
    "scene_names",
    "travel_cost",
    "unmet",
    "unregister_action",
    "validate",
]

_HOME = {
    "Action": "world_model.actions",
    "Category": "world_model.ontology",
    "EnvAction": "exchange",
    "Flag": "world_model.graph",
    "FlatActions": "envs.wrappers",
    "GavelEnv": "envs.env",
    "GavelError": "errors",
    "Goal": "world_model.goals",
    "Instruction": "instructions.record",
    "Judgement": "sim.episode",
    "Layout": "world_model.layout",
    "Node": "world_model.graph",
    "Observation": "exchange",
    "Observed": "exchange",
    "Ontology": "world_model.ontology",
    "OwnAction": "world_model.own_actions",
    "PaddedGraph": "envs.wrappers",
    "Primitive": "world_model.actions",
    "Profile": "world_model.dynamics",
    "Relation": "world_model.graph",
    "ReturnWhen": "exchange",
    "RewardWeights": "envs.rewards",
    "RobotConfig": "house.robot_config",
    "Room": "world_model.graph",
    "SceneGraph": "world_model.graph",
    "SlotEnv": "envs.rl",
    "Support": "world_model.graph",
    "TextActions": "envs.wrappers",
    "TextGame": "envs.text_game",
    "Verdict": "world_model.verdict",
    "Violation": "world_model.dynamics",
    "ViolationKind": "world_model.dynamics",
    "World": "world_model.graph",
    "default_ontology": "world_model.ontology",
    "export_pddl": "world_model.pddl",
    "load_scene": "house.scenes",
    "observation_to_pyg": "envs.pyg",
    "own_state": "world_model.own_actions",
    "parse_action": "world_model.actions",
    "parse_goal": "world_model.goals",
    "read_instructions": "instructions.record",
    "register_action": "world_model.own_actions",
    "scene_names": "house.scenes",
    "travel_cost": "world_model.travel",
    "unmet": "world_model.goals",
    "unregister_action": "world_model.own_actions",
    "validate": "world_model.verdict",
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
    entry_point="gavel_env.envs.env:GavelEnv",
    max_episode_steps=200,
    kwargs={"instructions": "single"},
)
register(
    id="Gavel-MultiTask-v0",
    entry_point="gavel_env.envs.env:GavelEnv",
    max_episode_steps=500,
    kwargs={"instructions": "multi"},
)
register(
    id="Gavel-Behavior-v0",
    entry_point="gavel_env.envs.env:GavelEnv",
    max_episode_steps=500,
    kwargs={"instructions": "behavior", "max_nodes": 4096},
)
register(id="Gavel-RL-v0", entry_point="gavel_env.envs.rl:make_rl")
