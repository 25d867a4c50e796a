"""The action space, and the way between its numbers and the names of an `EnvAction`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces

from gavel_env.envs.graph_encoder import GraphEncoder
from gavel_env.envs.spaces import MAX_ROOMS
from gavel_env.errors import BadAction, nearest_names
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.ontology import Ontology

__all__ = ["ActionCodec", "BadAction", "Decoded"]


class Decoded(NamedTuple):
    """An action in names, and the rooms whose instances its designator does not mean."""

    action: EnvAction
    excluded_rooms: frozenset[str] = frozenset()


class ActionCodec:
    """Dict(primitive, target, search_prior) to names and back.

    Args:
        ontology: the category vocabulary.
        max_nodes: targets below it are nodes of the observed graph, those from it on are categories.

    Attributes:
        space: the action space.
    """

    def __init__(self, ontology: Ontology, max_nodes: int) -> None:
        self._index = ontology.index
        self._categories = tuple(ontology)
        self._max_nodes = max_nodes
        self.space = spaces.Dict(
            {
                "primitive": spaces.Discrete(len(Primitive)),
                "search_prior": spaces.Box(-1.0, 1.0, (MAX_ROOMS,), np.float64),
                "target": spaces.Discrete(max_nodes + len(self._categories)),
            }
        )

    def encode(self, action: EnvAction, nodes: GraphEncoder) -> dict[str, Any]:
        """Return the action in the form of the space; a room in its target becomes negative weights of the others.

        Raises:
            BadAction: the target is neither an observed id nor a category, a weight is not a weight, or the action has
                `other_than` or `return_when`.
        """
        for name in ("other_than", "return_when"):
            if getattr(action, name):
                raise BadAction(f"the action space cannot say `{name}`; pass the EnvAction itself to step")
        weights = np.zeros(MAX_ROOMS)
        prior = action.search_prior or {}
        most = max((1.0, *prior.values()))
        for room, weight in prior.items():
            if room not in nodes.rooms or not 0.0 <= weight < np.inf:
                raise BadAction(f"search_prior[{room!r}] = {weight!r}; rooms: {', '.join(nodes.rooms)}; weights >= 0")
            weights[nodes.node[room] - 1] = weight / most
        target = 0
        if action.primitive.takes_target:
            target = self._target(action.target or "", nodes, weights)
        return {"primitive": int(action.primitive), "search_prior": weights, "target": target}

    def _target(self, target: str, nodes: GraphEncoder, weights: np.ndarray[Any, Any]) -> int:
        node = nodes.node.get(target)
        if node is not None:
            return node
        name, _, room = target.partition("@")
        category = self._index.get(name)
        if category is None:
            if is_concept(name):
                raise BadAction(f"the action space cannot say the concept {name!r}; pass the EnvAction itself to step")
            near = ", ".join(nearest_names(target, [*nodes.node, *self._categories])) or "none"
            raise BadAction(f"target {target!r} is neither an observed id nor a category; nearest: {near}")
        if room:
            fits = nodes.fits_room(Designator(name, room))
            weights[: len(fits)][~fits] = -1.0
        return self._max_nodes + category

    def decode(self, action: Any, nodes: GraphEncoder) -> Decoded:
        """Return the action in names.

        Raises:
            BadAction: it has not the form of the space.
        """
        try:
            primitive = Primitive(int(action["primitive"]))
            target = int(action["target"])
            weights = np.asarray(action["search_prior"], np.float64)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise BadAction(
                f"action {action!r:.200} is neither an EnvAction nor a dict of primitive, target and search_prior"
            ) from error
        if weights.shape != (MAX_ROOMS,) or not 0 <= target < self._max_nodes + len(self._categories):
            raise BadAction(f"action target {target}, search_prior of shape {weights.shape} is not in the action space")
        if not primitive.takes_target:
            return Decoded(EnvAction(primitive))
        if target < self._max_nodes:
            return Decoded(EnvAction(primitive, nodes.name(target) or f"node_{target}"))
        name = self._categories[target - self._max_nodes]
        if not weights.any():
            return Decoded(EnvAction(primitive, name))
        by_room = dict(zip(nodes.rooms, weights.tolist(), strict=False))
        prior: Mapping[str, float] = {room: weight for room, weight in by_room.items() if weight > 0.0}
        excluded = frozenset(room for room, weight in by_room.items() if weight < 0.0)
        if excluded and (room := nodes.common_name([r for r in nodes.rooms if r not in excluded])) is not None:
            return Decoded(EnvAction(primitive, f"{name}@{room}", prior))
        return Decoded(EnvAction(primitive, name, prior), excluded)
