"""The methods of the comparison: one pipeline, eight configurations (Sec. "Compared Methods").

`llm+p` is the baseline of the paper's related work (Liu et al., 2023): what was understood goes to a classical planner.
`oracle` is the ninth; it plans nothing and is a class of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import msgspec

__all__ = ["METHODS", "MethodConfig"]


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
    """

    source: Literal["model", "classical", "edits"] = "model"
    attempts: int = 1
    feedback: bool = False
    repair: bool = False
    order: Literal["written", "once", "every_task"] = "written"
    belief: Literal["none", "argmax", "full"] = "none"


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
}
