"""What an agent is given: the observed part of the world, and how it asks for an action.

Nothing here mentions an object that has not been observed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import SceneGraph

__all__ = ["EnvAction", "Observed"]


class EnvAction(NamedTuple):
    """An action as agents send it.

    Attributes:
        primitive: which one.
        target: an observed instance id, or a designator to go and find (`fridge`, `bottom_cabinet@private_office`, or a
            concept, of which any category will do: `any_cabinet@any_office`).
        search_prior: room id -> weight, the order in which rooms are searched; None = nearest first.
        other_than: observed ids that a designator does not mean, such as those that another task has already used.
    """

    primitive: Primitive
    target: str | None = None
    search_prior: Mapping[str, float] | None = None
    other_than: tuple[str, ...] = ()

    @classmethod
    def of(cls, action: Action, search_prior: Mapping[str, float] | None = None) -> EnvAction:
        """Return the action with a search prior."""
        return cls(action.primitive, action.target, search_prior)


class Observed(msgspec.Struct, frozen=True):
    """The agent's view after a step.

    Attributes:
        instruction: the sentence(s) to carry out.
        graph: the hidden graph projected to what has been observed (an observed thing's holders are observed too).
        layout: the map of rooms, walls and openings, known from the start.
        positions: observed id -> (x, y) of what holds it up, metres.
        cell: flat map cell of the robot.
        heading_deg: its heading, degrees clockwise from x.
        searched: rooms that have been searched completely.
        metres: driven so far.
        outcome: "ok", or the violation kind of the last action; "" before the first.
        reached: instance that the last `NavigateTo` reached, or None.
    """

    instruction: str
    graph: SceneGraph
    layout: FloorMap
    positions: Mapping[str, tuple[float, float]]
    cell: int
    heading_deg: float
    searched: frozenset[str]
    metres: float
    outcome: str
    reached: str | None
