"""Expected travel: C_srch, C_loc and belief-conditioned rollouts (Sec. "Belief-Aware Task Ordering").

Only the known layout is used (rooms, walls, openings). A place of the robot is a map cell, or a distribution over rooms
when a rollout has gone to something whose room is uncertain; distances from a distribution are expectations.

A rollout is conditioned on what it will have seen: it carries the probability that each room will have been searched,
so that the next object is either known by then or not there (the update Upsilon, in expectation and room by room as if
independent). And a drive ends within reach of the object, not on top of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["COVERAGE_WIDTH_M", "PAPER_COVERAGE_WIDTH_M", "Place", "Search", "TaskCost", "TravelModel", "travel_model"]

Floats = NDArray[np.float64]
_NEGLIGIBLE = 1e-9

COVERAGE_WIDTH_M = 5.9
"""w_cov of the default executor and camera: `gavel eval coverage`, in houses that no benchmark uses."""

PAPER_COVERAGE_WIDTH_M = 1.2
"""w_cov that the paper states for its own executor."""


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
    """What executing one task's plan is expected to take.

    Attributes:
        metres: expected.
        end: where it ends.
        found: nodes that will have been found.
        searched: (rooms,) probability that a room will have been searched.
    """

    metres: float
    end: Place
    found: frozenset[str]
    searched: Floats


class Search(NamedTuple):
    """What going to an unlocalised object is expected to take, and to leave searched: (rooms,) probabilities."""

    metres: float
    searched: Floats


class TravelModel:
    """The cost model over one known layout.

    Attributes:
        rooms: ids of the rooms the robot can enter; every belief vector is over these, in this order.
        room_m: (rooms, rooms) D(r, r') in metres.
        search_m: (rooms,) s(r) = A_trav(r) / w_cov in metres.
        reach_m: how far from an object the drive to it ends.
    """

    def __init__(
        self,
        layout: FloorMap,
        coverage_width_m: float = COVERAGE_WIDTH_M,
        found_fraction: float = 0.5,
        *,
        as_printed: bool = False,
    ) -> None:
        """Measure a layout.

        Args:
            layout: the known layout.
            coverage_width_m: w_cov, effective width that the sensor covers.
            found_fraction: eta, expected fraction of a room searched before the object is seen.
            as_printed: the paper's formulas to the letter: a rollout forgets which rooms it has searched, and a drive
                ends on top of the object.
        """
        self.layout = layout
        self.found_fraction = found_fraction
        self._as_printed = as_printed
        self.rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
        self.index = {room: i for i, room in enumerate(self.rooms)}
        self.room_m = np.array([[layout.room_distance(a, b) or 0.0 for b in self.rooms] for a in self.rooms])
        self.search_m = np.array([layout.traversable_m2(r) for r in self.rooms]) / coverage_width_m
        self.reach_m = 0.0 if as_printed else layout.robot.reach_m
        self._nothing = np.zeros(len(self.rooms))
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
        """Return C_srch(x, o; B): expected metres until an unlocalised object is found, nothing being searched yet.

        Args:
            start: where the search begins.
            belief: (rooms,) b_o; rooms of belief 0 are not candidates.
        """
        return self.search(start, belief, self._nothing).metres

    def search(self, start: Place, belief: Floats, searched: Floats) -> Search:
        """Return C_srch(x, o; B) where rooms may have been searched by then, and what will be searched afterwards.

        An object in a searched room is known and driven to. Otherwise the searched rooms are left out, and the others
        are searched by decreasing belief; distance breaks ties.

        Args:
            start: where the search begins.
            belief: (rooms,) b_o; rooms of belief 0 are not candidates.
            searched: (rooms,) probability that a room has been searched; all 0 gives the paper's formula.
        """
        belief = belief / belief.sum()
        known = belief * searched
        unknown = belief - known
        missing = float(unknown.sum())
        metres = float(known @ start.to_rooms_m)
        if missing <= _NEGLIGIBLE:
            return Search(metres, searched)
        order = np.lexsort((start.to_rooms_m, -unknown))
        order = order[unknown[order] > 0.0]
        travelled = 0.0  # expected, as are the distances from `here`: rooms already searched are not gone to
        here = start.to_rooms_m
        for room in order:
            leg, search, skipped = float(here[room]), float(self.search_m[room]), float(searched[room])
            metres += float(unknown[room]) * (travelled + leg + self.found_fraction * search)
            travelled += (1.0 - skipped) * (leg + search)
            here = skipped * here + (1.0 - skipped) * self.room_m[room] if skipped else self.room_m[room]
        shown = np.zeros(len(self.rooms))
        after = missing - np.cumsum(unknown[order])  # probability that the object is in a later room
        shown[order] = np.maximum(after, 0.0) + self.found_fraction * unknown[order]
        return Search(metres, searched + (1.0 - searched) * shown)

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
        searched: Floats | None = None,
    ) -> TaskCost:
        """Return the expected cost of driving a plan.

        Args:
            plan: the task's actions; only `NavigateTo` costs metres.
            start: where the robot begins.
            beliefs: node -> (rooms,) belief, for nodes that are not localised.
            cells: node -> map cell, for nodes that are.
            found: nodes that will have been found before this plan begins.
            searched: (rooms,) probability that a room will have been searched before, beyond what `beliefs` tell.
        """
        metres = 0.0
        here = start
        seen = set(found)
        searched = self._nothing if searched is None else searched
        for action in plan:
            target = action.target
            if action.primitive is not Primitive.NAVIGATE_TO or target is None:
                continue
            if target in cells:
                leg = self.known_cost(here, cells[target])
                here = self.at(cells[target])
            elif target in beliefs:
                belief = beliefs[target]
                if target in seen:
                    leg = float(here.to_rooms_m @ belief)
                else:
                    leg, after = self.search(here, belief, searched)
                    searched = searched if self._as_printed else after
                    seen.add(target)
                here = self.among(belief)
            else:
                continue
            metres += max(0.0, leg - self.reach_m)
        return TaskCost(metres, here, frozenset(seen), searched)


def travel_model(layout: FloorMap, cost: str, coverage_width_m: float | None = None) -> TravelModel:
    """Return the model behind J for a cost: "paper" as printed, otherwise with what rollouts carry.

    Args:
        layout: the known layout.
        cost: as in `gavel_agents.methods.MethodConfig`; "simulated" needs J for its short list.
        coverage_width_m: w_cov; default: the paper's for "paper", else as measured.
    """
    as_printed = cost == "paper"
    default_m = PAPER_COVERAGE_WIDTH_M if as_printed else COVERAGE_WIDTH_M
    width_m = default_m if coverage_width_m is None else coverage_width_m
    return TravelModel(layout, width_m, as_printed=as_printed)
