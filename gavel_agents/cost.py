"""Expected travel: C_srch, C_loc and belief-conditioned rollouts (Sec. "Belief-Aware Task Ordering").

Only the known layout is used (rooms, walls, openings). A place of the robot is a map cell, or a distribution over rooms
when a rollout has gone to something whose room is uncertain; distances from a distribution are expectations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gavel_env.actions import Action, Primitive
from gavel_env.geometry import FloorMap

__all__ = ["Place", "TaskCost", "TravelModel"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Place:
    """Where the robot is in a rollout.

    Attributes:
        to_rooms_m: (rooms,) expected metres to the representative point of every reachable room.
        cell: the map cell, if it is certain.
        belief: (rooms,) probabilities, if it is not.
    """

    to_rooms_m: Floats
    cell: int | None = None
    belief: Floats | None = None


@dataclass(frozen=True)
class TaskCost:
    """What executing one task's plan is expected to take, where it ends, and what it will have found."""

    metres: float
    end: Place
    found: frozenset[str]


class TravelModel:
    """The cost model over one known layout.

    Attributes:
        rooms: ids of the rooms the robot can enter; every belief vector is over these, in this order.
        room_m: (rooms, rooms) D(r, r') in metres.
        search_m: (rooms,) s(r) = A_trav(r) / w_cov in metres.
    """

    def __init__(self, layout: FloorMap, coverage_width_m: float = 1.2, found_fraction: float = 0.5) -> None:
        """Measure a layout.

        Args:
            layout: the known layout.
            coverage_width_m: w_cov, effective width that the sensor covers (the paper: 1.2 m).
            found_fraction: eta, expected fraction of a room searched before the object is seen.
        """
        self.layout = layout
        self.found_fraction = found_fraction
        self.rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
        self.index = {room: i for i, room in enumerate(self.rooms)}
        self.room_m = np.array([[layout.room_distance(a, b) or 0.0 for b in self.rooms] for a in self.rooms])
        self.search_m = np.array([layout.traversable_m2(r) for r in self.rooms]) / coverage_width_m
        self._places: dict[int, Place] = {}
        self._between_m: dict[tuple[int, int], float] = {}

    def at(self, cell: int) -> Place:
        """Return the place of a reachable map cell."""
        if cell not in self._places:
            to_rooms_m = np.array([self.layout.distance_to_room(cell, r) or 0.0 for r in self.rooms])
            self._places[cell] = Place(to_rooms_m, cell=cell)
        return self._places[cell]

    def among(self, belief: Floats) -> Place:
        """Return the place of a robot that has gone to something with this belief, (rooms,)."""
        return Place(belief @ self.room_m, belief=belief)

    def search_cost(self, start: Place, belief: Floats) -> float:
        """Return C_srch(x, o; B): expected metres until an unlocalised object is found.

        Rooms are searched by decreasing belief; distance breaks ties.

        Args:
            start: where the search begins.
            belief: (rooms,) b_o; rooms of belief 0 are no candidates.
        """
        order = np.lexsort((start.to_rooms_m, -belief))
        order = order[belief[order] > 0.0]
        travelled = 0.0
        expected = 0.0
        here = start.to_rooms_m
        for room in order:
            travelled += float(here[room])
            search = float(self.search_m[room])
            expected += float(belief[room]) * (travelled + self.found_fraction * search)
            travelled += search
            here = self.room_m[room]
        return expected / float(belief[order].sum())

    def known_cost(self, start: Place, cell: int) -> float:
        """Return C_loc(q, o) = d_nav(q, p_o): metres to a localised object's map cell."""
        if start.cell is not None:
            ends = (min(start.cell, cell), max(start.cell, cell))
            if ends not in self._between_m:
                self._between_m[ends] = self.layout.distance(ends[0], ends[1:]) or 0.0
            return self._between_m[ends]
        assert start.belief is not None
        return float(start.belief @ self.at(cell).to_rooms_m)

    def rollout(
        self,
        plan: Iterable[Action],
        start: Place,
        beliefs: Mapping[str, Floats],
        cells: Mapping[str, int],
        found: frozenset[str] = frozenset(),
    ) -> TaskCost:
        """Return the expected cost of driving a plan.

        Args:
            plan: the task's actions; only `NavigateTo` costs metres.
            start: where the robot begins.
            beliefs: node -> (rooms,) belief, for nodes that are not localised.
            cells: node -> map cell, for nodes that are.
            found: nodes that will have been found before this plan begins.
        """
        metres = 0.0
        here = start
        seen = set(found)
        for action in plan:
            target = action.target
            if action.primitive is not Primitive.NAVIGATE_TO or target is None:
                continue
            if target in cells:
                metres += self.known_cost(here, cells[target])
                here = self.at(cells[target])
            elif target in beliefs:
                belief = beliefs[target]
                if target in seen:
                    metres += float(here.to_rooms_m @ belief)
                else:
                    metres += self.search_cost(here, belief)
                    seen.add(target)
                here = self.among(belief)
        return TaskCost(metres, here, frozenset(seen))
