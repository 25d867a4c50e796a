"""Decisions by simulation: which order of the remaining tasks, and which room a search begins in.

Every order of a short list is driven in some of the worlds, the better ones in all of them. The list has the best
orders by J for each first task, since only the first task is committed to. A search that comes back after every room
needs no more than its first room: the others are decided when it has come back.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gavel_agents.ordering.knowledge import Knowledge
from gavel_agents.ordering.simulator import Simulator, legs_of
from gavel_env.exchange import EnvAction, ReturnWhen
from gavel_env.world_model.actions import Action

__all__ = ["Candidate", "SHORTLIST", "ranked_orders", "returning_search"]

SHORTLIST = 24
"""Orders on the short list, the same number for each first task."""

FIRST_WORLDS = 8
FINALISTS = 4
"""Every order is driven in the first worlds, so many of them in all. Larger numbers drive no fewer metres."""

ROOMS = 5
"""Rooms in which a search may begin, by probability per metre."""


class Candidate(NamedTuple):
    """An order of tasks and the metres that it is expected to take."""

    order: tuple[int, ...]
    metres: float


def ranked_orders(
    simulator: Simulator,
    known: Knowledge,
    plans: Sequence[Sequence[Action]],
    orders: Sequence[tuple[int, ...]],
    finalists: int | None = None,
) -> list[Candidate]:
    """Return orders by increasing expected metres; ties as they come.

    Args:
        simulator: of the house.
        known: what the agent knows.
        plans: pi_i, one per remaining task.
        orders: to be compared.
        finalists: how many of them are driven in all worlds; default `FINALISTS`. The others keep what the first
            worlds say.
    """
    things = list(known.belief)
    worlds = simulator.worlds(things, known)
    legs = legs_of(plans, {thing: i for i, thing in enumerate(things)}, known.holding)
    table = np.array(orders, np.int16).reshape(len(orders), -1)
    count = len(worlds.places)
    finalists = FINALISTS if finalists is None else finalists
    few = count if len(orders) <= finalists else min(FIRST_WORLDS, count)
    metres = simulator.metres(worlds, legs, table, span=(0, few)).sum(axis=1)
    best = np.argsort(metres, kind="stable")
    expected = metres / few
    if few < count:
        final = best[:finalists]
        rest = simulator.metres(worlds, legs, table[final], span=(few, count)).sum(axis=1)
        expected[final] = (metres[final] + rest) / count
        best[:finalists] = final[np.argsort(expected[final], kind="stable")]
    return [Candidate(orders[i], float(expected[i])) for i in best]


def returning_search(
    simulator: Simulator,
    known: Knowledge,
    search: EnvAction,
    plans: Sequence[Sequence[Action]],
    wanted: Sequence[str],
) -> EnvAction:
    """Return a search that begins in the best room and comes back to be decided again.

    Args:
        simulator: of the house.
        known: what the agent knows.
        search: a `NavigateTo` something that has to be found.
        plans: what is left of the present task's plan, its first step the search; then those of the other tasks in
            their order.
        wanted: designators of what else the search should come back for.
    """
    when = ReturnWhen(tuple(wanted), room_done=True)
    target = plans[0][0].target
    things = list(known.belief)
    worlds = simulator.worlds(things, known)
    rooms = simulator.rooms_worth(worlds, things.index(target or ""))[:ROOMS]
    if len(rooms) < 2:
        return search._replace(return_when=when)
    legs = legs_of(plans, {thing: i for i, thing in enumerate(things)}, known.holding)
    orders = np.tile(np.arange(len(plans), dtype=np.int16), (len(rooms), 1))
    metres = simulator.metres(worlds, legs, orders, np.array(rooms, np.int16)).mean(axis=1)
    best = simulator.layout.room_ids[rooms[int(np.argmin(metres))]]
    prior = search.search_prior or {}
    return search._replace(search_prior={**prior, best: 1.0 + max(prior.values(), default=0.0)}, return_when=when)
