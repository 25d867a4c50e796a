"""What no understanding may say, whoever it comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from gavel_agents.understanding.interface import Abstention
from gavel_env.world_model.concepts import default_concepts, in_words
from gavel_env.world_model.goals import Designator, Literal, Predicate
from gavel_env.world_model.ontology import Category, category_of, default_ontology

__all__ = ["can_be", "check_capable", "check_possible"]


def check_possible(literals: Iterable[Literal], verb: str) -> None:
    """Refuse what cannot be: one thing in two places, or things that hold each other.

    Args:
        literals: what is said.
        verb: how an error says it: "is said to be", "should be".

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


class _Need(NamedTuple):
    """What a state or relation takes: the reason of a refusal, what has it, and what to say of what has not."""

    reason: str
    able: Callable[[Category], bool]
    why: str


_NEEDS: Mapping[Predicate, _Need] = {
    Predicate.ON_TOP: _Need("cannot_hold", lambda holder: holder.surface, "nothing can be put on the {}"),
    Predicate.INSIDE: _Need("cannot_hold", lambda holder: holder.interior, "nothing can be put in the {}"),
    Predicate.TOGGLED: _Need("cannot_switch", lambda piece: piece.toggleable, "the {} cannot be switched on or off"),
    Predicate.OPEN: _Need("cannot_open", lambda piece: piece.openable, "the {} cannot be opened or shut"),
    Predicate.WASHED: _Need("cannot_process", lambda thing: thing.washable, "the {} cannot be washed"),
    Predicate.DRIED: _Need("cannot_process", lambda thing: thing.washable, "the {} cannot be dried"),
    Predicate.COOKED: _Need("cannot_process", lambda food: food.cookable, "the {} cannot be heated"),
}


def can_be(state: Predicate, category: Category) -> bool:
    """Return whether things of a category can be in a state, as far as it takes something that not all have."""
    return state not in _NEEDS or _NEEDS[state].able(category)


def check_capable(literals: Iterable[Literal]) -> None:
    """Refuse what a thing's kind rules out: on top of what has no surface, switched on without a switch.

    Raises:
        Abstention: `cannot_hold`, `cannot_switch`, `cannot_open`, `cannot_process`, `cannot_move`.
    """
    for literal in literals:
        if literal.predicate in _NEEDS:
            need, thing = _NEEDS[literal.predicate], literal.object or literal.subject
            if not any(map(need.able, _kinds(thing))):
                raise Abstention(need.reason, need.why.format(_words(thing)))
        if literal.object is not None and not any(kind.liftable for kind in _kinds(literal.subject)):
            raise Abstention("cannot_move", f"the {_words(literal.subject)} cannot be carried")


def _words(designator: Designator) -> str:
    return in_words(category_of(designator.name))


def _kinds(designator: Designator) -> list[Category]:
    ontology = default_ontology()
    return [ontology[category] for category in default_concepts().categories(category_of(designator.name))]
