"""Goals as PDDL conditions over the household domain: quantifiers written out, and what is to be restored."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

from gavel_env.errors import NotExpressible
from gavel_env.world_model.conditions import (
    ON_FLOOR,
    WITHIN,
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
from gavel_env.world_model.goals import Designator, Goal, Predicate, fitting
from gavel_env.world_model.graph import Flag, SceneGraph

__all__ = ["Expression", "GoalWriter", "state_name"]

Expression: TypeAlias = tuple["str | Expression", ...]
"""A fact `("inside", "apple_0", "fridge_0")` or a condition over facts `("and", …)`, in names that PDDL can write."""

_MOST_CASES = 5_000
"""Cases that a count, or a subject that several things fit, may be written out into."""


def state_name(name: str) -> str:
    """Return the domain's name of a state: `open` is the action there."""
    return "opened" if name == Predicate.OPEN.value else name


class GoalWriter:
    """Writes a goal over the objects of one task."""

    def __init__(self, graph: SceneGraph, objects: set[str], written: Mapping[str, str]) -> None:
        self._graph, self._objects, self._written = graph, objects, written

    def expression(self, goal: Goal) -> Expression:
        """Return the whole goal."""
        conditions = [self._condition(c) for c in goal.conditions]
        return _all([self._literals(goal), *conditions, *self._restored(goal)])

    def _condition(self, condition: object) -> Expression:
        if not isinstance(condition, Formula):
            raise NotExpressible(f"condition {condition} is of a kind that is not written in PDDL")
        return self._formula(condition, {})

    def _fitting(self, text: str) -> list[str]:
        return [o for o in fitting(self._graph, Designator.parse(text)) if o in self._objects]

    def _literals(self, goal: Goal) -> Expression:
        """Return the literals; those of one subject speak of one thing, whichever fits."""
        subjects = dict.fromkeys(str(lit.subject) for lit in goal.literals if not lit.negated)
        options = [self._fitting(subject) for subject in subjects]
        if math.prod(map(len, options)) > _MOST_CASES:
            raise NotExpressible(f"{math.prod(map(len, options))} choices of what {', '.join(subjects)} may be")
        cases = []
        for chosen in itertools.product(*options):
            bound = dict(zip(subjects, chosen, strict=True))
            parts: list[Expression] = []
            for lit in goal.literals:
                names = [str(d) for d in (lit.subject, lit.object) if d is not None]
                atom = self._atom(lit.predicate.value, [bound.get(n, n) for n in names])
                parts.append(("not", atom) if lit.negated else atom)
            cases.append(_all(parts))
        return _any(cases)

    def _restored(self, goal: Goal) -> Iterator[Expression]:
        """Yield that what is shut, or off, at the start is so at the end, unless the goal wants it otherwise."""
        for o in sorted(self._objects):
            category = self._graph.category(o)
            for flag, counts in ((Flag.OPEN, category.openable), (Flag.TOGGLED, category.safety_critical)):
                if counts and o not in self._graph.flags[flag] and not goal.wants(flag, o, self._graph):
                    yield ("not", (state_name(flag.name.lower()), self._written[o]))

    def _atom(self, predicate: str, args: Sequence[str]) -> Expression:
        """Return that an atom is true of some things that fit its places."""
        subjects = self._fitting(args[0])
        if len(args) == 1:
            return _any([(state_name(predicate), self._written[s]) for s in subjects])
        if predicate in (Predicate.IN_ROOM.value, ON_FLOOR):
            rooms = [r.id for r in self._graph.world.rooms.values() if r.fits(args[1])]
            name = "in-room" if predicate == Predicate.IN_ROOM.value else "on-floor"
            return _any([(name, self._written[s], self._written[r]) for s in subjects for r in rooms])
        objects = self._fitting(args[1])
        return _any([self._relation(predicate, s, o) for s in subjects for o in objects if s != o])

    def _relation(self, predicate: str, a: str, b: str) -> Expression:
        x, y = self._written[a], self._written[b]
        if predicate == WITHIN:
            return ("exists", "?d", ("and", ("aboard", x, "?d"), ("inside", "?d", y)))
        if predicate in (Predicate.NEXT_TO.value, Predicate.UNDER.value):
            shared: list[Expression] = [
                ("exists", "?h", ("and", (held, x, "?h"), (held, y, "?h"))) for held in ("on-top", "inside")
            ]
            beside = _any([("next-to", x, y), *shared])
            if predicate == Predicate.NEXT_TO.value:
                return beside
            return _all([("clearance", y), ("lies", x), beside])
        return ("on-top" if predicate == Predicate.ON_TOP.value else predicate, x, y)

    def _formula(self, formula: Formula, bound: Mapping[str, str]) -> Expression:
        if isinstance(formula, Atom):
            return self._atom(formula.predicate, [bound.get(a, a) for a in formula.args])
        if isinstance(formula, Not):
            return ("not", self._formula(formula.body, bound))
        if isinstance(formula, And):
            return _all([self._formula(part, bound) for part in formula.parts])
        if isinstance(formula, Or):
            return _any([self._formula(part, bound) for part in formula.parts])
        if isinstance(formula, Imply):
            return _any([("not", self._formula(formula.premise, bound)), self._formula(formula.body, bound)])
        if isinstance(formula, ForPairs):
            return self._pairs(formula, bound)
        each = [self._formula(formula.body, {**bound, formula.variable: m}) for m in self._members(formula.domain)]
        if isinstance(formula, ForAll):
            return _all(each)
        return _any(each) if isinstance(formula, Exists) else _exactly(formula, each)

    def _members(self, domain: tuple[str, ...]) -> list[str]:
        return list(dict.fromkeys(obj for member in domain for obj in self._fitting(member)))

    def _pairs(self, formula: ForPairs, bound: Mapping[str, str]) -> Expression:
        """Return that as many members of each domain as the smaller has are in some pair."""
        firsts, seconds = self._members(formula.domain), self._members(formula.other_domain)

        def paired(a: str, b: str) -> Expression:
            return self._formula(formula.body, {**bound, formula.variable: a, formula.other_variable: b})

        sides = (
            [_any([paired(a, b) for b in seconds if a != b]) for a in firsts],
            [_any([paired(a, b) for a in firsts if a != b]) for b in seconds],
        )
        least = min(map(len, sides))
        parts = []
        for side in sides:
            _check_cases(len(side), least, formula)
            parts.append(_any([_all(chosen) for chosen in itertools.combinations(side, least)]))
        return _all(parts)


def _exactly(formula: ForN, each: Sequence[Expression]) -> Expression:
    """Return that exactly `count` of some conditions hold."""
    _check_cases(len(each), formula.count, formula)
    cases = []
    for chosen in itertools.combinations(range(len(each)), formula.count):
        cases.append(_all([e if i in chosen else ("not", e) for i, e in enumerate(each)]))
    return _any(cases)


def _check_cases(members: int, chosen: int, formula: Formula) -> None:
    if math.comb(members, chosen) > _MOST_CASES:
        raise NotExpressible(f"{math.comb(members, chosen)} cases of {formula}")


def _all(parts: Sequence[Expression]) -> Expression:
    return parts[0] if len(parts) == 1 else ("and", *parts)


def _any(parts: Sequence[Expression]) -> Expression:
    return parts[0] if len(parts) == 1 else ("or", *parts)
