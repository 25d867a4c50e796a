"""What a goal asks for in one state, as ground wishes: quantifiers and choices settled by what is cheapest from there.

A goal's designators and quantifiers leave open which instances are meant. A search needs a number of steps to go, so
here every choice is made for the moment: of the instances that fit, of the branches of an `or`, of the members of an
`exists`, the cheapest by an estimate that the caller gives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from gavel_env.world_model.conditions import (
    ON_FLOOR,
    And,
    Atom,
    Exists,
    ForAll,
    Formula,
    ForN,
    ForPairs,
    Imply,
    Not,
    Or,
)
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Unplannable", "Wish", "literals_of", "wishes"]


class Unplannable(Exception):
    """A goal asks for something that no planner here can express; the message says what."""


class Wish(NamedTuple):
    """A ground condition: `predicate(subject, object)` shall hold, or not.

    Attributes:
        predicate: name of a goal predicate, or `on_floor`, `within`.
        subject: instance id.
        object: instance id, a room for `in_room` and `on_floor`, or None.
        negated: whether it shall not hold.
    """

    predicate: str
    subject: str
    object: str | None = None
    negated: bool = False

    def holds(self, graph: SceneGraph) -> bool:
        """Return whether the wish is fulfilled."""
        args = (self.subject,) if self.object is None else (self.subject, self.object)
        return Atom(self.predicate, args).value(graph, {}) != self.negated


Price = Callable[[Wish], float]
"""Estimated primitives until a wish holds."""

Chosen = tuple[Wish, ...]


def wishes(goal: Goal, graph: SceneGraph, price: Price) -> Chosen:
    """Return the ground wishes whose fulfilment meets the goal, the cheapest from this state by `price`.

    Raises:
        Unplannable: something that a condition speaks of is not there, or its kind is not known here.
    """
    chosen: dict[Wish, None] = {}
    bound: dict[Designator, str] = {}
    for literal in goal.literals:
        if not literal.negated and literal.subject not in bound:
            about = [lit for lit in goal.literals if lit.subject == literal.subject]
            bound[literal.subject] = _cheapest_subject(about, graph, price)
    for literal in goal.literals:
        chosen.update(dict.fromkeys(_of_literal(literal, graph, bound, price)))
    for condition in goal.conditions:
        if not isinstance(condition, Formula):
            raise Unplannable(f"the condition {condition.text()!r} is of a kind that is not known here")
        chosen.update(dict.fromkeys(_of(condition, graph, {}, True, price)))
    return tuple(chosen)


def _cheapest_subject(about: Sequence[Literal], graph: SceneGraph, price: Price) -> str:
    fits = fitting(graph, about[0].subject)
    if not fits:
        raise Unplannable(f"nothing known fits {about[0].subject}")
    if len(fits) == 1:
        return fits[0]

    def total(subject: str) -> float:
        bound = {about[0].subject: subject}
        return sum(price(wish) for lit in about for wish in _of_literal(lit, graph, bound, price))

    return min(fits, key=total)


def _of_literal(literal: Literal, graph: SceneGraph, bound: Mapping[Designator, str], price: Price) -> Chosen:
    name = literal.predicate.value
    subjects = (bound[literal.subject],) if literal.subject in bound else fitting(graph, literal.subject)
    if literal.object is None:
        return _settled([(Wish(name, s, None, literal.negated),) for s in subjects], literal.negated, price, literal)
    if literal.predicate is Predicate.IN_ROOM:
        objects: tuple[str, ...] = (str(literal.object),)
    else:
        objects = (bound[literal.object],) if literal.object in bound else fitting(graph, literal.object)
    found = [(Wish(name, s, o, literal.negated),) for s in subjects for o in objects if s != o]
    return _settled(found, literal.negated, price, literal)


def _settled(found: Sequence[Chosen], all_of_them: bool, price: Price, what: object) -> Chosen:
    """Return all of some alternatives, or the cheapest."""
    if all_of_them:
        return tuple(wish for part in found for wish in part)
    if not found:
        raise Unplannable(f"nothing known fits {what}")
    return min(found, key=lambda part: sum(map(price, part)))


# --- quantified conditions -----------------------------------------------------------------------------------------


def _of(formula: Formula, graph: SceneGraph, bound: Mapping[str, str], positive: bool, price: Price) -> Chosen:
    """Return the wishes of a condition, or of its opposite."""
    if isinstance(formula, Not):
        return _of(formula.body, graph, bound, not positive, price)
    if isinstance(formula, Atom):
        return _of_atom(formula, graph, bound, positive, price)
    if isinstance(formula, And | Or):
        parts = [(part, positive) for part in formula.parts]
        return _parts(parts, graph, bound, isinstance(formula, And) == positive, price)
    if isinstance(formula, Imply):
        return _parts([(formula.premise, not positive), (formula.body, positive)], graph, bound, not positive, price)
    if isinstance(formula, ForAll | Exists):
        each = [_member(formula, member, graph, bound, positive, price) for member in _domain(graph, formula.domain)]
        return _settled(each, isinstance(formula, ForAll) == positive, price, formula)
    if isinstance(formula, ForN):
        return _of_count(formula, graph, bound, positive, price)
    return _of_pairs(formula, graph, bound, positive, price)


def _parts(
    parts: Sequence[tuple[Formula, bool]], graph: SceneGraph, bound: Mapping[str, str], every: bool, price: Price
) -> Chosen:
    return _settled([_of(part, graph, bound, positive, price) for part, positive in parts], every, price, "or")


def _member(
    formula: ForAll | Exists | ForN,
    member: str,
    graph: SceneGraph,
    bound: Mapping[str, str],
    positive: bool,
    price: Price,
) -> Chosen:
    return _of(formula.body, graph, {**bound, formula.variable: member}, positive, price)


def _of_atom(atom: Atom, graph: SceneGraph, bound: Mapping[str, str], positive: bool, price: Price) -> Chosen:
    args = [bound.get(a, a) for a in atom.args]
    subjects = fitting(graph, Designator.parse(args[0]))
    if len(args) == 1:
        found = [(Wish(atom.predicate, s, None, not positive),) for s in subjects]
        return _settled(found, not positive, price, atom)
    if atom.predicate in (ON_FLOOR, Predicate.IN_ROOM.value):
        objects: tuple[str, ...] = (args[1],)
    else:
        objects = fitting(graph, Designator.parse(args[1]))
    found = [(Wish(atom.predicate, s, o, not positive),) for s in subjects for o in objects if s != o]
    return _settled(found, not positive, price, atom)


def _of_count(formula: ForN, graph: SceneGraph, bound: Mapping[str, str], positive: bool, price: Price) -> Chosen:
    if not positive:
        raise Unplannable(f"a negated count: {formula}")
    members = _domain(graph, formula.domain)
    if len(members) < formula.count:
        raise Unplannable(f"{formula.count} of {len(members)}: {formula}")
    yes = {m: _member(formula, m, graph, bound, True, price) for m in members}
    cheapest = sorted(members, key=lambda m: sum(map(price, yes[m])))
    no = [_member(formula, m, graph, bound, False, price) for m in cheapest[formula.count :]]
    return tuple(w for part in (*(yes[m] for m in cheapest[: formula.count]), *no) for w in part)


def _of_pairs(formula: ForPairs, graph: SceneGraph, bound: Mapping[str, str], positive: bool, price: Price) -> Chosen:
    """Pair every member of the smaller domain with one of the other, the cheapest pairs first."""
    if not positive:
        raise Unplannable(f"negated pairs: {formula}")
    firsts, seconds = _domain(graph, formula.domain), _domain(graph, formula.other_domain)
    pairs = {
        (a, b): _of(formula.body, graph, {**bound, formula.variable: a, formula.other_variable: b}, True, price)
        for a in firsts
        for b in seconds
        if a != b
    }
    chosen: list[Wish] = []
    left_firsts, left_seconds = set(firsts), set(seconds)
    for a, b in sorted(pairs, key=lambda pair: sum(map(price, pairs[pair]))):
        if a in left_firsts and b in left_seconds:
            left_firsts.discard(a)
            left_seconds.discard(b)
            chosen += pairs[a, b]
    return tuple(dict.fromkeys(chosen))


def _domain(graph: SceneGraph, domain: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(obj for member in domain for obj in fitting(graph, Designator.parse(member))))


def literals_of(goal: Goal) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield (predicate, what may stand at its places) of everything that a goal speaks of, negations aside."""
    for literal in goal.literals:
        yield literal.predicate.value, tuple(str(d) for d in (literal.subject, literal.object) if d is not None)
    for condition in goal.conditions:
        for atom, _, domains in condition.asked() if isinstance(condition, Formula) else ():
            yield atom.predicate, tuple(name for a in atom.args for name in domains.get(a, (a,)))
