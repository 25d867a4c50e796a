"""The methods of the comparison: one pipeline, ten configurations (Sec. "Compared Methods").

`llm+p` is the baseline of the paper's related work (Liu et al., 2023): what was understood goes to a classical planner.
`gavel-plus` goes beyond the paper: it decides by simulated worlds, and its searches come back to be decided again.
`oracle` plans nothing and is a class of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

import msgspec

from gavel_env.errors import BadOption

__all__ = ["COSTS", "METHODS", "Cost", "MethodConfig"]

Cost = Literal["paper", "carried", "simulated"]
COSTS: tuple[Cost, ...] = get_args(Cost)


class MethodConfig(msgspec.Struct, frozen=True, kw_only=True):
    """What distinguishes a method.

    Attributes:
        source: where plans come from: proposals of the language model, a classical planner, or graph edits from the
            goal alone.
        attempts: T, calls of the language model at most (0 for graph edits).
        feedback: return unresolved verdicts to the model.
        repair: apply model-derived edits to a proposal.
        order: execute tasks as written, in the best order found once, or reordered after every task.
        belief: what the cost model sees: nothing, the most likely room, or the full distribution.
        cost: what orders are compared by: J as the paper prints it, J of rollouts that carry what they have searched
            (`gavel_agents.ordering.cost`), or simulated worlds (`gavel_agents.ordering.simulator`).
        rooms: searches go through the rooms by belief, or begin in the room that simulation finds best, come back
            after every room and when something else that is wanted has come into sight, and are decided again.
    """

    source: Literal["model", "classical", "edits"] = "model"
    attempts: int = 1
    feedback: bool = False
    repair: bool = False
    order: Literal["written", "once", "every_task"] = "written"
    belief: Literal["none", "argmax", "full"] = "none"
    cost: Cost = "carried"
    rooms: Literal["believed", "simulated"] = "believed"

    def with_cost(self, name: str, cost: str | None) -> MethodConfig:
        """Return the configuration with another cost; a method that does not order has none to change.

        Args:
            name: of the method, for errors.
            cost: one of `COSTS`; None = its own.

        Raises:
            BadOption: an unknown cost, or one that the method does not go by.
        """
        if cost is not None and cost not in COSTS:
            raise BadOption(f"cost is {cost!r}; known: {', '.join(map(repr, COSTS))}")
        if self.rooms == "simulated" and cost not in (None, "simulated"):
            raise BadOption(f"agent {name!r} decides by simulated worlds; cost={cost!r} is for the other methods")
        if cost is None or self.order == "written":
            return self
        return msgspec.structs.replace(self, cost=cost)


MAX_ATTEMPTS = 5

METHODS: Mapping[str, MethodConfig] = {
    "llm-only": MethodConfig(),
    "sayplan": MethodConfig(attempts=MAX_ATTEMPTS, feedback=True),
    "llm+p": MethodConfig(source="classical"),
    "epog": MethodConfig(source="edits", attempts=0, order="once", belief="argmax"),
    "gavel-basic": MethodConfig(repair=True),
    "gavel-map": MethodConfig(attempts=MAX_ATTEMPTS, feedback=True, repair=True, order="once", belief="argmax"),
    "gavel-static": MethodConfig(attempts=MAX_ATTEMPTS, feedback=True, repair=True, order="once", belief="full"),
    "gavel-full": MethodConfig(attempts=MAX_ATTEMPTS, feedback=True, repair=True, order="every_task", belief="full"),
    "gavel-static-plus": MethodConfig(
        attempts=MAX_ATTEMPTS, feedback=True, repair=True, order="once", belief="full", cost="simulated"
    ),
    "gavel-plus": MethodConfig(
        attempts=MAX_ATTEMPTS,
        feedback=True,
        repair=True,
        order="every_task",
        belief="full",
        cost="simulated",
        rooms="simulated",
    ),
}
