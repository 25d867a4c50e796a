"""Expected metres by simulation: worlds drawn from B_t, in which a robot drives, sees in passing and searches.

J(sigma) adds expectations of legs that know nothing of each other. Here an order of tasks is carried out in worlds
drawn from the belief, on the sight points of the known layout, and its cost is the mean of the metres driven. Every
order is driven in the same worlds (common random numbers), so that differences between orders are far more certain than
their costs. The agent's own knowledge is all that goes in: layout, belief, what was observed, the floor that was seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.ordering.cost import COVERAGE_WIDTH_M
from gavel_agents.ordering.knowledge import Knowledge
from gavel_env.house.floor_map import FloorMap
from gavel_env.house.sight_points import SightPoints, Words, bits, sight_points
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["Legs", "Simulator", "Worlds", "legs_of"]

Floats = NDArray[np.float64]

WORLDS = 64


class Worlds(NamedTuple):
    """Worlds that agree with what is known.

    Attributes:
        places: (worlds, things) int16 sight point where each thing is.
        choices: (n,) int16 sight points of the instances that localised things may be, thing after thing.
        choice_starts: (things + 1,) where each thing's `choices` begin; none: it has to be found.
        weights: (things, rooms) belief over the map's rooms, by which a search goes.
        searched: (rooms,) rooms searched already.
        seen: (words,) floor seen already.
        start: sight point of the robot.
    """

    places: NDArray[np.int16]
    choices: NDArray[np.int16]
    choice_starts: NDArray[np.int32]
    weights: Floats
    searched: NDArray[np.bool_]
    seen: Words
    start: int


class Legs(NamedTuple):
    """What plans drive and carry.

    Attributes:
        legs: (legs, 3) int16 kind (`rollout_kernels`) and two things.
        starts: (tasks + 1,) where each task's legs begin.
    """

    legs: NDArray[np.int16]
    starts: NDArray[np.int32]


class Simulator:
    """Simulated rollouts over one known layout.

    Args:
        layout: the known layout.
        seed: of the worlds.
        worlds: how many.
    """

    def __init__(self, layout: FloorMap, seed: int = 0, worlds: int = WORLDS) -> None:
        self.layout = layout
        self.points: SightPoints = sight_points(layout)
        self._seed = seed
        self._count = worlds
        self._effort_m = np.array([layout.traversable_m2(room) for room in layout.room_ids]) / COVERAGE_WIDTH_M
        self._numbers: dict[int, Floats] = {}

    def worlds(self, things: Sequence[str], known: Knowledge) -> Worlds:
        """Draw worlds from the belief.

        Args:
            things: nodes that plans go to.
            known: what the agent knows.
        """
        points, layout = self.points, self.layout
        seen = bits(known.seen.ravel()[points.cells])
        hidden: NDArray[np.bool_] = np.logical_not((points.reveals & seen).any(axis=1))
        columns = [layout.room_index[room] for room in known.rooms]
        places = np.zeros((self._count, len(things)), np.int16)
        weights = np.zeros((len(things), len(layout.room_ids)))
        choices: list[int] = []
        starts = [0]
        drawn: dict[str, NDArray[np.int16]] = {}
        for i, thing in enumerate(things):
            weights[i, columns] = known.belief[thing]
            there = known.where.get(thing, ())
            choices += [points.nearest(layout, x, y, room) for x, y, room in there]
            starts.append(len(choices))
            if not there:
                root = known.root.get(thing, thing)
                if root not in drawn:
                    drawn[root] = self._draw(weights[i], hidden, len(drawn))
                places[:, i] = drawn[root]
        searched = np.array([room in known.searched for room in layout.room_ids])
        return Worlds(
            places,
            np.array(choices, np.int16),
            np.array(starts, np.int32),
            weights,
            searched,
            seen,
            points.standing(layout, known.cell),
        )

    def _draw(self, belief: Floats, hidden: NDArray[np.bool_], number: int) -> NDArray[np.int16]:
        """Draw a place per world: a room by belief and unseen share, then any of its points that hides something."""
        rooms = self.points.room
        size = np.bincount(rooms, minlength=belief.size)
        each = (belief / np.maximum(size, 1))[rooms]
        mass = np.where(hidden, each, 0.0)
        if mass.sum() <= 0.0:  # nothing is hidden where it is believed to be
            mass = each
        if mass.sum() <= 0.0:
            mass = np.ones(len(rooms))
        order = np.argsort(rooms, kind="stable")
        edges = np.cumsum(mass[order])
        at = np.searchsorted(edges, self._uniform(number) * edges[-1], side="right")
        places: NDArray[np.int16] = order[np.minimum(at, len(order) - 1)].astype(np.int16)
        return places

    def _uniform(self, number: int) -> Floats:
        """Return (worlds,) stratified random numbers of a thing: one in each of as many equal parts of [0, 1)."""
        if number not in self._numbers:
            rng = np.random.default_rng([self._seed, number])
            self._numbers[number] = (rng.permutation(self._count) + rng.random(self._count)) / self._count
        return self._numbers[number]

    def rooms_worth(self, worlds: Worlds, thing: int) -> list[int]:
        """Return the rooms in which a search for a thing can begin, by probability per metre."""
        enterable = self.points.entry[worlds.start] >= 0
        rooms = np.nonzero((worlds.weights[thing] > 0.0) & ~worlds.searched & enterable)[0]
        unseen = (self.points.floor[rooms] & ~worlds.seen).any(axis=1)
        rooms = rooms[unseen] if unseen.any() else rooms
        metres = self.points.metres[worlds.start, self.points.entry[worlds.start, rooms]] + self._effort_m[rooms]
        return [int(room) for room in rooms[np.argsort(-worlds.weights[thing, rooms] / (metres + 0.5), kind="stable")]]

    def metres(
        self,
        worlds: Worlds,
        legs: Legs,
        orders: NDArray[np.int16],
        first_rooms: NDArray[np.int16] | None = None,
        span: tuple[int, int] | None = None,
    ) -> Floats:
        """Return (orders, worlds) metres of carrying out each order in each world of a range."""
        from gavel_agents.ordering import rollout_kernels

        first, last = span or (0, len(worlds.places))
        if first_rooms is None:
            first_rooms = np.full(len(orders), -1, np.int16)
        robot = self.layout.robot
        return rollout_kernels.rollouts(
            self.points, worlds, legs, orders, first_rooms, first, last, robot.camera_every_m,
            robot.searched_share,
        )  # fmt: skip


def legs_of(plans: Iterable[Sequence[Action]], things: Mapping[str, int], holding: str | None) -> Legs:
    """Return the legs of plans.

    Args:
        plans: one per task.
        things: node -> its position among the things of the worlds; steps on other nodes cost nothing.
        holding: node that is held before each plan.
    """
    from gavel_agents.ordering.rollout_kernels import GO, PUT_AT, PUT_HERE

    legs: list[tuple[int, int, int]] = []
    starts = [0]
    for plan in plans:
        held = holding
        for primitive, target, *_ in plan:
            thing = things.get(target or "", -1)
            if primitive is Primitive.NAVIGATE_TO and thing >= 0:
                legs.append((GO, thing, -1))
            elif primitive is Primitive.GRASP:
                held = target
            elif primitive in (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE, Primitive.RELEASE):
                if held is not None and held in things:
                    kind = PUT_HERE if primitive is Primitive.RELEASE or thing < 0 else PUT_AT
                    legs.append((kind, things[held], thing))
                held = None
        starts.append(len(legs))
    return Legs(np.array(legs, np.int16).reshape(-1, 3), np.array(starts, np.int32))
