"""What no understanding may say, whoever it comes from."""

from __future__ import annotations

from collections.abc import Iterable

from gavel_agents.understanding.base import Abstention
from gavel_env.goals import Designator, Literal, Predicate

__all__ = ["check_possible"]


def check_possible(literals: Iterable[Literal], verb: str) -> None:
    """Refuse what cannot be: one thing in two places, or things that hold each other.

    Args:
        literals: what is said.
        verb: how an error says it: "is said to be", "shall be".

    Raises:
        Abstention: `contradiction`.
    """
    holders: dict[Designator, Designator] = {}
    for predicate, subject, target, _ in literals:
        if predicate not in (Predicate.ON_TOP, Predicate.INSIDE) or target is None:
            continue
        if holders.setdefault(subject, target) != target:
            raise Abstention("contradiction", f"{subject} {verb} both at {holders[subject]} and at {target}")
    for subject in holders:
        above, steps = holders.get(subject), 0
        while above is not None and above != subject and steps <= len(holders):
            above, steps = holders.get(above), steps + 1
        if above == subject:
            raise Abstention("contradiction", f"{subject} {verb} in or on itself")
