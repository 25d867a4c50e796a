"""A simulated robot on sight points, compiled by numba: it drives, sees in passing and searches as the executor does.

Sets of points are bits of 64-bit words (`gavel_env.house.sight_points`); `seen` is the floor seen so far, changed in
place. Import this module only inside functions: it loads numba (about half a second).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.kernels.compiling import compiled, inner

if TYPE_CHECKING:
    from gavel_agents.ordering.simulator import Legs, Worlds
    from gavel_env.house.sight_points import SightPoints

__all__ = ["GO", "PUT_AT", "PUT_HERE", "rollouts"]

Words = NDArray[np.uint64]

GO, PUT_AT, PUT_HERE = 0, 1, 2
"""Kinds of legs: go to thing a; thing a is now where thing b is; thing a is now where the robot is."""

_ONE = np.uint64(1)


@inner
def _has(words: Words, point: int) -> bool:
    return bool(words[point >> 6] >> np.uint64(point & 63) & _ONE)


@inner
def _meet(a: Words, b: Words) -> bool:
    for k in range(a.size):  # noqa: SIM110  numba compiles no generator
        if a[k] & b[k]:
            return True
    return False


@inner
def _add(seen: Words, more: Words) -> None:
    for k in range(seen.size):
        seen[k] |= more[k]


@inner
def _count(word: np.uint64) -> int:
    """Return how many bits are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inner
def _drive(points: SightPoints, start: int, goal: int, aim: int, place: int, every_m: float, seen: Words) -> int:
    """Drive to a point with a picture every `every_m`; return where the drive ends.

    It ends early once a picture shows the point `aim` (if not -1) or what is at the point `place` (if not -1).
    """
    at = start
    since_m = 0.0
    while at != goal:
        onward = points.onward[at, goal]
        since_m += points.metres[at, onward]
        heading = points.heading[at, onward]
        at = onward
        if since_m >= every_m - 1e-6:
            since_m = 0.0
            _add(seen, points.ahead[at, heading])
            if aim >= 0 and _has(seen, aim):
                break
            if place >= 0 and _meet(points.reveals[place], seen):
                break
    return at


@inner
def _nearest_of(points: SightPoints, here: int, words: Words, otherwise: int) -> int:
    """Return the point of a set that is nearest to drive to; `otherwise` if the set is empty."""
    best, best_m = otherwise, np.inf
    for k in range(words.size):
        left = words[k]
        point = 64 * k
        while left:
            if left & _ONE and points.metres[here, point] < best_m:
                best, best_m = point, points.metres[here, point]
            left >>= _ONE
            point += 1
    return best


@inner
def _nearest_unseen(points: SightPoints, room: int, here: int, searched_share: float, seen: Words) -> int:
    """Return the unseen point of a room to look at next; -1 when the room counts as searched."""
    floor = points.floor[room]
    best, best_m, unseen, total, hiding = -1, np.inf, 0, 0, False
    for k in range(floor.size):
        total += _count(floor[k])
        left = floor[k] & ~seen[k]
        bit = 0
        while left:
            if left & _ONE:
                point = 64 * k + bit
                unseen += 1
                hiding = hiding or not _meet(points.reveals[point], seen)
                if points.metres[here, point] < best_m:
                    best, best_m = point, points.metres[here, point]
            left >>= _ONE
            bit += 1
    if not hiding and unseen <= (1.0 - searched_share) * total:
        return -1
    return best


@inner
def _search_room(
    points: SightPoints, room: int, here: int, place: int, every_m: float, searched_share: float, seen: Words
) -> tuple[float, int]:
    """Search a room until what is at a point is seen or the room is searched; return the metres and where it ends."""
    metres = 0.0
    if not _meet(points.floor[room], seen):
        end = _drive(points, here, points.entry[here, room], -1, place, every_m, seen)
        metres += points.metres[here, end]
        here = end
        if not _meet(points.reveals[place], seen):
            _add(seen, points.around[here])
    while not _meet(points.reveals[place], seen):
        aim = _nearest_unseen(points, room, here, searched_share, seen)
        if aim < 0:
            break
        view = _nearest_of(points, here, points.close[aim], points.stand[aim])
        end = _drive(points, here, view, aim, place, every_m, seen)
        metres += points.metres[here, end]
        here = end
        if not _meet(points.reveals[place], seen):
            _add(seen, points.around[here])
            seen[aim >> 6] |= _ONE << np.uint64(aim & 63)  # what stays dark from close by is given up
    return metres, here


@inner
def _next_room(points: SightPoints, here: int, weights: NDArray[np.float64], searched: NDArray[np.bool_]) -> int:
    """Return the room to search next, by weight, then distance; -1 if none is left."""
    best, best_m = -1, np.inf
    for room in range(weights.size):
        if weights[room] <= 0.0 or searched[room] or points.entry[here, room] < 0:
            continue
        metres = points.metres[here, points.entry[here, room]]
        if best < 0 or weights[room] > weights[best] or (weights[room] == weights[best] and metres < best_m):
            best, best_m = room, metres
    return best


@compiled
def rollouts(
    points: SightPoints,
    worlds: Worlds,
    legs: Legs,
    orders: NDArray[np.int16],
    first_rooms: NDArray[np.int16],
    first_world: int,
    last_world: int,
    every_m: float,
    searched_share: float,
) -> NDArray[np.float64]:
    """Return the metres of carrying out every order in every world of a range.

    Args:
        points: of the map.
        worlds: where things are, and what is known of it.
        legs: of every task.
        orders: (orders, tasks) tasks in the order of execution; -1 ends an order early.
        first_rooms: (orders,) room in which the order's first search begins; -1 = as any other search.
        first_world: range of worlds.
        last_world: its end, exclusive.
        every_m: metres between two pictures.
        searched_share: share of a room's floor that must be seen for it to count as searched.

    Returns:
        (orders, worlds of the range) metres.
    """
    metres = np.zeros((orders.shape[0], last_world - first_world))
    place = np.empty(worlds.places.shape[1], np.int16)
    found = np.empty(place.size, np.bool_)
    seen = np.empty_like(worlds.seen)
    searched = np.empty_like(worlds.searched)
    for o in range(orders.shape[0]):
        for w in range(first_world, last_world):
            place[:] = worlds.places[w]
            found[:] = False
            seen[:] = worlds.seen
            searched[:] = worlds.searched
            here = worlds.start
            total = 0.0
            forced = first_rooms[o]
            for task in orders[o]:
                if task < 0:
                    break
                for leg in range(legs.starts[task], legs.starts[task + 1]):
                    kind, a, b = legs.legs[leg, 0], legs.legs[leg, 1], legs.legs[leg, 2]
                    if kind == PUT_AT:
                        place[a], found[a] = place[b], True
                        continue
                    if kind == PUT_HERE:
                        place[a], found[a] = here, True
                        continue
                    if not found[a]:
                        found[a] = True
                        first, last = worlds.choice_starts[a], worlds.choice_starts[a + 1]
                        if last > first:
                            best_m = np.inf
                            for k in range(first, last):
                                choice = worlds.choices[k]
                                if points.metres[here, choice] < best_m:
                                    place[a], best_m = choice, points.metres[here, choice]
                        else:
                            while not _meet(points.reveals[place[a]], seen):
                                room = forced
                                forced = -1
                                if room < 0:
                                    room = _next_room(points, here, worlds.weights[a], searched)
                                if room < 0:
                                    break
                                driven, here = _search_room(points, room, here, place[a], every_m, searched_share, seen)
                                total += driven
                                if not _meet(points.reveals[place[a]], seen):
                                    searched[room] = True
                    stance = _nearest_of(points, here, points.reach[place[a]], points.stand[place[a]])
                    end = _drive(points, here, stance, -1, -1, every_m, seen)
                    total += points.metres[here, end]
                    here = end
                    _add(seen, points.around[here])
                forced = -1 if total > 0.0 else forced
            metres[o, w - first_world] = total
    return metres
