"""Wrappers: actions as text, flat actions with masks, and observations of fixed shape."""

from __future__ import annotations

import string
from collections.abc import Iterable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from gavel_env.envs.env import GavelEnv
from gavel_env.envs.spaces import NODE_COLUMNS, EdgeType, node_space
from gavel_env.errors import MalformedAction
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import first_violation
from gavel_env.world_model.narration import commands, nearest_commands
from gavel_env.world_model.ontology import default_ontology

__all__ = ["FlatActions", "PaddedGraph", "TextActions"]

_Step = tuple[Any, Any, bool, bool, dict[str, Any]]


def _base(env: gym.Env[Any, Any]) -> GavelEnv:
    base = env.unwrapped
    if not isinstance(base, GavelEnv):
        raise TypeError(f"this wrapper is for GavelEnv, not {type(base).__name__}")
    return base


class TextActions(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Takes actions as text: `NAVIGATE_TO(fridge)`, or whatever else `parse_action` reads.

    A text that is not an action is invalid like one on an unknown object; `info["refusal"]` says what is wrong with
    it, and `info["nearest_commands"]` which commands look like it.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)
        _base(env)
        self.action_space = spaces.Text(max_length=256, min_length=1, charset=string.printable)

    def step(self, action: str) -> _Step:
        """Run the action that a text says."""
        said: dict[str, Any] = {}
        try:
            sent = EnvAction.of(parse_action(action))
        except MalformedAction as error:
            base = _base(self.env)
            known = commands(base.observed.graph, base.profile)
            said = {"refusal": str(error), "nearest_commands": nearest_commands(action, known)}
            sent = EnvAction(Primitive.NAVIGATE_TO, "")
        observation, reward, terminated, truncated, info = self.env.step(sent)
        return observation, float(reward), terminated, truncated, {**info, **said}


class FlatActions(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Takes actions as `MultiDiscrete([9, targets])` and says in `info` which are allowed.

    Targets are the nodes of the observed graph, then the categories. The masks come from the agent's own world model on
    what was observed: a node is allowed if the preconditions hold there, a category for `NavigateTo` always.
    Whether a route leads there, or a search will find anything, no mask can say.

    `info["action_mask"]`: (9 + targets,) int8, the masks of the two parts one after the other, as MaskablePPO wants
    them (`action_masks()` returns the same as bool). `info["joint_mask"]`: (9, targets) int8, the allowed pairs.

    Args:
        env: a `GavelEnv`, wrapped or not.
        categories: the categories that can be targets; default: all.
    """

    def __init__(self, env: gym.Env[Any, Any], categories: Iterable[str] | None = None) -> None:
        chosen = None if categories is None else tuple(categories)
        RecordConstructorArgs.__init__(self, categories=chosen)
        gym.Wrapper.__init__(self, env)
        base = _base(env)
        ontology = default_ontology()
        self.categories = tuple(ontology) if chosen is None else tuple(ontology[name].name for name in chosen)
        self._nodes = base.max_nodes
        self.action_space = spaces.MultiDiscrete([len(Primitive), self._nodes + len(self.categories)])
        self._joint = np.zeros((len(Primitive), self._nodes + len(self.categories)), np.int8)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, self._with_masks(info)

    def step(self, action: NDArray[np.int64]) -> _Step:
        """Run a primitive on a target, both by index."""
        primitive, target = Primitive(int(action[0])), int(action[1])
        name = self._name(target) if primitive.takes_target else None
        observation, reward, terminated, truncated, info = self.env.step(EnvAction(primitive, name))
        return observation, float(reward), terminated, truncated, self._with_masks(info)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return (9 + targets,) bool: the masks of primitive and target, one after the other."""
        return np.concatenate([self._joint.any(axis=1), self._joint.any(axis=0)])

    def sample_mask(self) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
        """Return the masks as `action_space.sample(mask=...)` takes them."""
        mask = self.action_masks().astype(np.int8)
        return mask[: len(Primitive)], mask[len(Primitive) :]

    def _name(self, target: int) -> str:
        if target >= self._nodes:
            return self.categories[target - self._nodes]
        return _base(self.env).node_name(target) or f"node_{target}"

    def _with_masks(self, info: dict[str, Any]) -> dict[str, Any]:
        base = _base(self.env)
        graph = base.observed.graph
        joint = np.zeros_like(self._joint)
        joint[Primitive.NAVIGATE_TO, self._nodes :] = 1
        first = 1 + len(graph.world.rooms)
        near = graph.near if graph.holding is None else graph.near | {graph.holding}
        for index, obj in enumerate(graph.world.nodes, start=first):
            for primitive in Primitive if obj in near else (Primitive.NAVIGATE_TO,):
                if primitive.takes_target:
                    action = Action(primitive, obj)
                    joint[primitive, index] = first_violation(graph, action, base.profile) is None
        joint[Primitive.RELEASE, 0] = graph.holding is not None
        self._joint = joint
        return {**info, "action_mask": self.action_masks().astype(np.int8), "joint_mask": joint}


class PaddedGraph(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Replaces `graph` by arrays of fixed shape, so that vector environments can share memory.

    | key | space | meaning |
    |---|---|---|
    | `nodes` | `Box(max_nodes, columns)` float32 | rows of the graph's nodes, then zeros |
    | `node_mask` | `MultiBinary(max_nodes)` | 1 = a node |
    | `edges` | `MultiDiscrete(max_edges, 3)` int64 | relation, source node, target node; then zeros |
    | `edge_mask` | `MultiBinary(max_edges)` | 1 = an edge |

    `info["observed"]` is left out: it would be copied between processes in every step.

    Args:
        env: a `GavelEnv` with the Graph observation, wrapped or not.
        max_edges: default: four per node.
        keep_observed: leave `info["observed"]` in.
    """

    def __init__(self, env: gym.Env[Any, Any], max_edges: int | None = None, *, keep_observed: bool = False) -> None:
        RecordConstructorArgs.__init__(self, max_edges=max_edges, keep_observed=keep_observed)
        gym.Wrapper.__init__(self, env)
        self.max_nodes = _base(env).max_nodes
        self.max_edges = 4 * self.max_nodes if max_edges is None else max_edges
        self._keep_observed = keep_observed
        inner = env.observation_space
        if not isinstance(inner, spaces.Dict) or "graph" not in inner.spaces:
            raise TypeError("PaddedGraph needs an environment with observation='graph'")
        parts = {name: space for name, space in inner.spaces.items() if name != "graph"}
        self.observation_space = spaces.Dict(
            {
                **parts,
                "nodes": node_space(self.max_nodes, self.max_nodes),
                "node_mask": spaces.MultiBinary(self.max_nodes),
                "edges": spaces.MultiDiscrete(
                    np.tile([len(EdgeType), self.max_nodes, self.max_nodes], (self.max_edges, 1))
                ),
                "edge_mask": spaces.MultiBinary(self.max_edges),
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._pad(observation), self._strip(info)

    def step(self, action: Any) -> _Step:
        """Run one primitive."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._pad(observation), float(reward), terminated, truncated, self._strip(info)

    def _strip(self, info: dict[str, Any]) -> dict[str, Any]:
        if self._keep_observed:
            return info
        return {name: value for name, value in info.items() if name != "observed"}

    def _pad(self, observation: dict[str, Any]) -> dict[str, Any]:
        graph = observation["graph"]
        padded = {name: value for name, value in observation.items() if name != "graph"}
        count, edges = len(graph.nodes), min(len(graph.edges), self.max_edges)
        nodes = np.zeros((self.max_nodes, len(NODE_COLUMNS)), np.float32)
        nodes[:count] = graph.nodes
        table = np.zeros((self.max_edges, 3), np.int64)
        table[:edges, 0] = graph.edges[:edges]
        table[:edges, 1:] = graph.edge_links[:edges]
        return {
            **padded,
            "nodes": nodes,
            "node_mask": (np.arange(self.max_nodes) < count).astype(np.int8),
            "edges": table,
            "edge_mask": (np.arange(self.max_edges) < edges).astype(np.int8),
        }
