"""What no understanding may say, whoever it comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from gavel_agents.understanding.interface import Abstention
from gavel_env.world_model.concepts import default_concepts
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


_NEEDS: Mapping[Predicate, tuple[str, Callable[[Category], bool]]] = {
    Predicate.ON_TOP: ("cannot_hold", lambda holder: holder.surface),
    Predicate.INSIDE: ("cannot_hold", lambda holder: holder.interior),
    Predicate.TOGGLED: ("cannot_switch", lambda switched: switched.toggleable),
    Predicate.OPEN: ("cannot_open", lambda opened: opened.openable),
    Predicate.WASHED: ("cannot_process", lambda thing: thing.washable),
    Predicate.DRIED: ("cannot_process", lambda thing: thing.washable),
    Predicate.COOKED: ("cannot_process", lambda food: food.cookable),
}


def can_be(state: Predicate, category: Category) -> bool:
    """Return whether things of a category can be in a state, as far as it takes something that not all have."""
    return state not in _NEEDS or _NEEDS[state][1](category)


def check_capable(literals: Iterable[Literal]) -> None:
    """Refuse what a thing's kind rules out: on top of what has no surface, switched on without a switch.

    Raises:
        Abstention: `cannot_hold`, `cannot_switch`, `cannot_open`, `cannot_process`, `cannot_move`.
    """
    for literal in literals:
        if literal.predicate in _NEEDS:
            reason, able = _NEEDS[literal.predicate]
            thing = literal.object or literal.subject
            if not any(map(able, _kinds(thing))):
                raise Abstention(reason, f"{thing} in {literal}")
        if literal.object is not None and not any(kind.liftable for kind in _kinds(literal.subject)):
            raise Abstention("cannot_move", f"{literal.subject} in {literal}")


def _kinds(designator: Designator) -> list[Category]:
    ontology = default_ontology()
    return [ontology[category] for category in default_concepts().categories(category_of(designator.name))]
