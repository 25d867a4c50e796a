"""A situation in which tasks are ordered, and what its cost says of their orders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.ordering.cost import Place, TravelModel
from gavel_agents.ordering.decision import SHORTLIST, Candidate, ranked_orders
from gavel_agents.ordering.knowledge import Knowledge
from gavel_agents.ordering.order import Costs, best_by_first_task, expected_costs, orderings
from gavel_agents.ordering.simulator import Simulator
from gavel_env.world_model.actions import Action

__all__ = ["Situation"]

Floats = NDArray[np.float64]


class Situation(NamedTuple):
    """What orders of the remaining tasks are compared in.

    Attributes:
        plans: pi_i, one per remaining task.
        travel: the model behind J.
        start: where the robot is.
        beliefs: node -> (rooms,) belief of what is not localised.
        cells: node -> map cell of what is.
        simulator: decides instead of J, if there is one.
        known: what it needs to know.
    """

    plans: Sequence[Sequence[Action]]
    travel: TravelModel
    start: Place
    beliefs: Mapping[str, Floats]
    cells: Mapping[str, int]
    simulator: Simulator | None = None
    known: Knowledge | None = None

    def pairwise(self) -> Costs:
        """Return (h, A) of J."""
        return expected_costs(self.travel, self.plans, self.start, self.beliefs, self.cells)

    def candidates(self) -> Iterator[Candidate]:
        """Yield orders by increasing cost: all of them by J, a short list by simulation."""
        costs = self.pairwise()
        if self.simulator is None or self.known is None:
            return (Candidate(order, costs.ordering_cost(order)) for order in orderings(costs))
        orders = best_by_first_task(costs, SHORTLIST)
        return iter(ranked_orders(self.simulator, self.known, self.plans, orders))

    def expected_m(self, orders: Sequence[tuple[int, ...]]) -> list[float]:
        """Return the metres that some orders are expected to take."""
        if self.simulator is None or self.known is None:
            costs = self.pairwise()
            return [costs.ordering_cost(order) for order in orders]
        metres = dict(ranked_orders(self.simulator, self.known, self.plans, orders, finalists=len(orders)))
        return [metres[order] for order in orders]

    def sequential_m(self, order: Sequence[int]) -> float:
        """Return J's rollout through a whole order at once: each task from where and with what the ones before left.

        The pairwise sum is its approximation: A[i, j] knows nothing of the tasks before i.
        """
        metres, here, found, searched = 0.0, self.start, frozenset[str](), None
        for task in order:
            done = self.travel.rollout(self.plans[task], here, self.beliefs, self.cells, found, searched)
            metres, here, found, searched = metres + done.metres, done.end, done.found, done.searched
        return metres
