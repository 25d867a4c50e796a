"""Belief-aware task ordering: h, A and J(sigma) of Eq. (5), minimised exactly.

Up to eight tasks every permutation is enumerated, as the paper does; beyond that the optimum comes from the Held-Karp
dynamic programme over subsets.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gavel_agents.ordering.cost import Place, TravelModel
from gavel_env.world_model.actions import Action

__all__ = ["Costs", "best_by_first_task", "expected_costs", "held_karp", "orderings"]

Floats = NDArray[np.float64]
ENUMERATED_TASKS = 8


@dataclass(frozen=True, eq=False)
class Costs:
    """The cost model of an ordering.

    Attributes:
        first_cost: (tasks,) h[j], expected metres of executing task j first.
        pairwise_cost: (tasks, tasks) A[i, j], expected metres of executing task j right after i; diagonal 0.
    """

    first_cost: Floats
    pairwise_cost: Floats

    def ordering_cost(self, order: Sequence[int]) -> float:
        """Return J(order) = h[first] + the sum of A over consecutive pairs, metres."""
        steps = sum(float(self.pairwise_cost[a, b]) for a, b in itertools.pairwise(order))
        return float(self.first_cost[order[0]]) + steps if order else 0.0


def expected_costs(
    travel: TravelModel,
    plans: Sequence[Sequence[Action]],
    start: Place,
    beliefs: Mapping[str, Floats],
    cells: Mapping[str, int],
) -> Costs:
    """Return (h, A) from O(N^2) belief-conditioned rollouts.

    Args:
        travel: the cost model of the house.
        plans: pi_i, one per remaining task.
        start: where the robot is.
        beliefs: node -> (rooms,) belief of what is not localised.
        cells: node -> map cell of what is.
    """
    firsts = [travel.rollout(plan, start, beliefs, cells) for plan in plans]
    pairwise = np.zeros((len(plans), len(plans)))
    for i, first in enumerate(firsts):
        for j, plan in enumerate(plans):
            if i != j:
                pairwise[i, j] = travel.rollout(plan, first.end, beliefs, cells, first.found, first.searched).metres
    return Costs(np.array([f.metres for f in firsts]), pairwise)


def orderings(costs: Costs) -> Iterator[tuple[int, ...]]:
    """Yield orderings by increasing J, ties in lexicographic order: Sort_J(Perm(U)).

    Beyond `ENUMERATED_TASKS` tasks only the optimum is followed by its neighbours (one task moved), by increasing J.
    """
    count = len(costs.first_cost)
    if count <= ENUMERATED_TASKS:
        candidates = _permutations(count)
        for row in np.argsort(_totals(costs, candidates), kind="stable"):
            yield tuple(int(i) for i in candidates[row])
        return
    best = held_karp(costs)
    yield best
    moved = {
        (*rest[:to], best[at], *rest[to:])
        for at in range(count)
        for rest in [best[:at] + best[at + 1 :]]
        for to in range(count)
    }
    yield from sorted(moved - {best}, key=lambda order: (round(costs.ordering_cost(order), 9), order))


def best_by_first_task(costs: Costs, size: int) -> list[tuple[int, ...]]:
    """Return the orderings of least J for every first task, as many for each, `size` in all or a few more.

    Beyond `ENUMERATED_TASKS` tasks, of those that `orderings` yields; a first task that none of them has is left out.
    """
    count = len(costs.first_cost)
    share = max(1, -(-size // max(1, count)))
    if count > ENUMERATED_TASKS:
        groups: dict[int, list[tuple[int, ...]]] = {}
        for order in orderings(costs):
            groups.setdefault(order[0], []).append(order)
        return [order for first in sorted(groups) for order in groups[first][:share]]
    candidates = _permutations(count)
    total = _totals(costs, candidates)
    best: list[tuple[int, ...]] = []
    for first in range(count):
        rows = np.nonzero(candidates[:, 0] == first)[0]
        chosen = rows[np.argsort(total[rows], kind="stable")[:share]]
        best += [tuple(int(i) for i in candidates[row]) for row in chosen]
    return best


def _totals(costs: Costs, candidates: NDArray[np.int64]) -> Floats:
    """Return J of (n, tasks) orderings to nine digits, so that sums in another order tie."""
    tasks = candidates.shape[1]
    total = costs.first_cost[candidates[:, 0]] if tasks else np.zeros(1)
    for p in range(1, tasks):
        total = total + costs.pairwise_cost[candidates[:, p - 1], candidates[:, p]]
    return np.round(total, 9)


@cache
def _permutations(count: int) -> NDArray[np.int64]:
    """Return (count!, count) permutations in lexicographic order."""
    return np.array(list(itertools.permutations(range(count))), dtype=np.int64).reshape(-1, count)


def held_karp(costs: Costs) -> tuple[int, ...]:
    """Return the ordering of minimum J by dynamic programming over subsets, O(N^2 2^N)."""
    count = len(costs.first_cost)
    if count == 0:
        return ()
    best: dict[tuple[int, int], tuple[float, int]] = {
        (1 << j, j): (float(costs.first_cost[j]), -1) for j in range(count)
    }
    for subset in range(1, 1 << count):
        for last in range(count):
            if not subset >> last & 1 or subset == 1 << last:
                continue
            rest = subset ^ (1 << last)
            best[subset, last] = min(
                (best[rest, i][0] + float(costs.pairwise_cost[i, last]), i) for i in range(count) if rest >> i & 1
            )
    subset = (1 << count) - 1
    last = min(range(count), key=lambda j: best[subset, j][0])
    order: list[int] = []
    while last >= 0:
        order.append(last)
        subset, last = subset ^ (1 << last), best[subset, last][1]
    return tuple(reversed(order))
