"""What a plan's driving costs on a graph of one's own: given metres, straight lines, or room hops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import final

import networkx as nx

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import ROBOT, Relation, SceneGraph

__all__ = ["TravelCost", "travel_cost"]


@final
class TravelCost:
    """Believed cost of a plan's `NAVIGATE_TO` steps; a `CostFunction`.

    One unit serves a whole graph, whichever its layout allows:

    * metres along connections, if every connection of the graph has its distance; within a room, the straight line
      between two positions if both are known, else 0;
    * metres in straight lines, if the rooms are not connected by distances but everything that stands by itself has a
      position: a lower bound of what a robot drives;
    * rooms, otherwise: each connection that is crossed counts 1. Rooms that no connection joins are one hop apart.

    A thing is where its outermost holder is; what the plan moves counts where the plan has put it.

    Attributes:
        unit: "metres" or "rooms".
    """

    def __init__(self, graph: SceneGraph) -> None:
        world, layout = graph.world, graph.world.layout
        self._positions = layout.positions
        given = bool(layout.distances_m) and all(pair in layout.distances_m for pair in world.connections)
        alone = [o for o in world.nodes if _base(graph, o, {}) == o]
        self._lines = not given and bool(alone) and all(o in layout.positions for o in alone)
        self.unit = "metres" if given or self._lines else "rooms"
        self._metres = given
        ways: nx.Graph[str] = nx.Graph()
        ways.add_nodes_from(world.rooms)
        for a, b in sorted(world.connections):
            ways.add_edge(a, b, weight=layout.distances_m[(a, b)] if given else 1.0)
        self._ways = ways
        self._known: dict[str, dict[str, float]] = {}

    def __call__(self, graph: SceneGraph, plan: Sequence[Action]) -> float:
        """Return the cost of a plan from a graph; steps that name nothing known cost nothing."""
        room, place = graph.robot_room, ROBOT
        held, moved = graph.holding, dict[str, tuple[str | None, str | None]]()
        total = 0.0
        for action in plan:
            x = action.target
            if action.primitive is Primitive.RELEASE:
                if held is not None:
                    moved[held] = (None, room)
                held = None
            elif x is None or x not in graph.world.nodes:
                continue
            elif action.primitive is Primitive.NAVIGATE_TO:
                base = _base(graph, x, moved)
                there = _room(graph, base, moved)
                total += self._leg(room, place, there, base)
                room, place = there, base
            elif action.primitive is Primitive.GRASP:
                held = x
            elif action.primitive in (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE):
                if held is not None:
                    moved[held] = (x, None)
                held = None
        return total

    def _leg(self, room: str | None, place: str, there: str | None, base: str) -> float:
        line = self._line(place, base)
        if self._lines:
            return line
        if room == there:
            return line if self._metres else 0.0
        if room is None or there is None:
            return 0.0 if self._metres else 1.0
        if room not in self._known:
            self._known[room] = nx.single_source_dijkstra_path_length(self._ways, room, weight="weight")
        return self._known[room].get(there, math.inf if self._metres else 1.0)

    def _line(self, a: str, b: str) -> float:
        if a not in self._positions or b not in self._positions:
            return 0.0
        return math.dist(self._positions[a][:2], self._positions[b][:2])


def travel_cost(graph: SceneGraph) -> TravelCost:
    """Return what plans on a graph cost; for `validate`, `repair` and `verify`."""
    return TravelCost(graph)


def _base(graph: SceneGraph, obj: str, moved: dict[str, tuple[str | None, str | None]]) -> str:
    """Return the outermost thing that holds an object."""
    for _ in range(len(graph.world.nodes)):
        if obj in moved:
            holder = moved[obj][0]
        else:
            support = graph.supports.get(obj)
            holder = support.holder if support is not None and support.relation <= Relation.INSIDE else None
        if holder is None:
            break
        obj = holder
    return obj


def _room(graph: SceneGraph, base: str, moved: dict[str, tuple[str | None, str | None]]) -> str | None:
    return moved[base][1] if base in moved else graph.room_of(base)
