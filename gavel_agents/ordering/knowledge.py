"""What the agent knows when it orders tasks, as the cost models see it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.beliefs.belief import Belief
from gavel_agents.binding import Binder
from gavel_env.exchange import Observed
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Knowledge", "Spot", "knowledge", "localised"]

Floats = NDArray[np.float64]


class Spot(NamedTuple):
    """Where an observed instance is: metres, and its room."""

    x: float
    y: float
    room: str | None


class Knowledge(NamedTuple):
    """What the agent knows.

    Attributes:
        cell: flat map cell of the robot.
        seen: (height, width) bool, floor seen so far.
        searched: rooms searched completely.
        where: node -> every observed instance that going to it may come to; none: it has to be found.
        belief: node -> (rooms,) over `rooms`.
        root: node -> the node that says where it is; nodes of one root are in one place.
        rooms: ids of the rooms that beliefs are over.
        holding: node that is held, or None.
    """

    cell: int
    seen: NDArray[np.bool_]
    searched: frozenset[str]
    where: Mapping[str, Sequence[Spot]]
    belief: Mapping[str, Floats]
    root: Mapping[str, str]
    rooms: tuple[str, ...]
    holding: str | None


def knowledge(graph: SceneGraph, belief: Belief, binder: Binder, observed: Observed) -> Knowledge:
    """Return what is known of the nodes of the believed graph."""
    where: dict[str, list[Spot]] = {}
    root = {node: belief.root(node) for node in graph.world.nodes}
    for node in graph.world.nodes:
        found = binder.destinations(node, graph, observed) or binder.destinations(root[node], graph, observed)
        where[node] = [Spot(*observed.positions[i], observed.graph.room_of(i)) for i in found]
    return Knowledge(
        observed.cell, observed.seen, observed.searched, where, belief, root, belief.rooms, graph.holding
    )  # fmt: skip


def localised(graph: SceneGraph, binder: Binder, observed: Observed) -> dict[str, int]:
    """Return the map cells of what is localised: of several instances that a node may be, the nearest now."""
    cells: dict[str, int] = {}
    for node in graph.world.nodes:
        instance = binder.destination(node, graph, observed)
        if instance is not None and instance in observed.positions:
            x, y = observed.positions[instance]
            cell = observed.layout.nearest_reachable(x, y, observed.graph.room_of(instance))
            if cell is not None:
                cells[node] = cell
    return cells
