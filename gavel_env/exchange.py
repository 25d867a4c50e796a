"""What an agent is given: the observed part of the world, and how it asks for an action.

Nothing here mentions an object that has not been observed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from gavel_env.errors import BadObservation
from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import SceneGraph

__all__ = ["EnvAction", "Observation", "Observed", "ReturnWhen", "view"]


class ReturnWhen(NamedTuple):
    """When a `NavigateTo` that searches comes back before it has found anything, so that the agent can decide again.

    What the search is for goes before: once it is in sight, the robot drives to it.

    Attributes:
        seen: designators; the search ends where an instance that fits one of them comes into sight.
        room_done: the search ends after every room that it has searched in vain, if another is left to search.
    """

    seen: tuple[str, ...] = ()
    room_done: bool = False


class EnvAction(NamedTuple):
    """An action as agents send it.

    Attributes:
        primitive: which one.
        target: an observed instance id, or a designator to go and find (`fridge`, `bottom_cabinet@private_office`, or a
            concept, of which any category will do: `any_cabinet@any_office`).
        search_prior: room id -> weight, the order in which rooms are searched; None = nearest first.
        other_than: observed ids that a designator does not mean, such as those that another task has already used.
        return_when: when a search comes back early; None = never.
    """

    primitive: Primitive
    target: str | None = None
    search_prior: Mapping[str, float] | None = None
    other_than: tuple[str, ...] = ()
    return_when: ReturnWhen | None = None

    @classmethod
    def of(cls, action: Action, search_prior: Mapping[str, float] | None = None) -> EnvAction:
        """Return the action with a search prior."""
        return cls(action.primitive, action.target, search_prior)


class Observed(msgspec.Struct, frozen=True, eq=False):
    """The agent's view after a step.

    Attributes:
        instruction: the sentence(s) to carry out.
        graph: the hidden graph projected to what has been observed (an observed thing's holders are observed too).
        layout: the map of rooms, walls and openings, known from the start.
        positions: observed id -> (x, y) of what holds it up, metres.
        cell: flat map cell of the robot.
        heading_deg: its heading, degrees clockwise from x.
        seen: (height, width) bool, floor of the layout's grid that has been seen, read-only.
        searched: rooms that have been searched completely.
        metres: driven so far.
        outcome: "ok", or the violation kind of the last action; "" before the first.
        reached: instance that the last `NavigateTo` reached; None if its search came back early.
    """

    instruction: str
    graph: SceneGraph
    layout: FloorMap
    positions: Mapping[str, tuple[float, float]]
    cell: int
    heading_deg: float
    seen: NDArray[np.bool_]
    searched: frozenset[str]
    metres: float
    outcome: str
    reached: str | None

    def __eq__(self, other: object) -> bool:
        """Return whether all fields are equal, the arrays cell by cell."""
        if not isinstance(other, Observed):
            return NotImplemented
        mine, others = msgspec.structs.astuple(self), msgspec.structs.astuple(other)
        return all(np.array_equal(a, b) if a is self.seen else a == b for a, b in zip(mine, others, strict=True))

    __hash__ = None  # type: ignore[assignment]


class Observation(dict[str, Any]):
    """What `reset` and `step` return: arrays by key for learners, and the same view in names for agents that plan.

    Wrappers that replace the arrays return a plain dict, without `observed`.

    Attributes:
        observed: the view that the arrays encode.
    """

    __slots__ = ("observed",)

    def __init__(self, arrays: Mapping[str, Any], observed: Observed) -> None:
        super().__init__(arrays)
        self.observed = observed

    def __reduce__(self) -> tuple[type[Observation], tuple[dict[str, Any], Observed]]:
        """Return how to make it again: from a plain dict and the view."""
        return Observation, (dict(self), self.observed)


def view(observation: object) -> Observed:
    """Return the view in names of an observation.

    Raises:
        BadObservation: it has none.
    """
    if isinstance(observation, Observation):
        return observation.observed
    raise BadObservation(
        f"an agent takes the gavel_env.Observation that reset and step return; got {type(observation).__name__}"
        " (did a wrapper replace it?)"
    )
