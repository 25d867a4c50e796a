"""Quantified conditions as literals: what must be made true, of the things at hand, so that a condition holds.

Repair knows rules for literals. A condition that does not hold is replaced by the literals that make it true with the
fewest changes of the state where the plan ends; of equal choices, what the plan names comes first. Conditions are
grounded one by one: two that pull the same thing apart are left to the model.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from gavel_env.world_model.conditions import (
    ON_FLOOR,
    WITHIN,
    And,
    Atom,
    ForAll,
    Formula,
    ForN,
    ForPairs,
    Imply,
    Not,
    Or,
    literal_of,
)
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.verdict import Verdict

__all__ = ["grounded"]


class _Way(NamedTuple):
    """One way to make a formula true or false: `missing` of its literals do not hold, `unnamed` the plan leaves out."""

    missing: int
    unnamed: int
    literals: tuple[Literal, ...]


_DONE = _Way(0, 0, ())


def grounded(goal: Goal, verdict: Verdict) -> Goal:
    """Return a goal of literals alone that implies `goal` as far as its conditions can be grounded.

    Args:
        goal: g.
        verdict: says where the plan ends, and which names it uses.
    """
    grounding = _Grounding(verdict.end, frozenset(a.target for a in verdict.plan if a.target is not None))
    literals = dict.fromkeys(goal.literals)
    for condition in goal.conditions:
        way = grounding.way(condition, True, {}) if isinstance(condition, Formula) else None
        if way is not None:
            literals.update(dict.fromkeys(way.literals))
    return Goal(tuple(literals))


class _Grounding:
    def __init__(self, graph: SceneGraph, named: frozenset[str]) -> None:
        self._graph = graph
        self._named = named

    def way(self, formula: Formula, wanted: bool, bound: Mapping[str, str]) -> _Way | None:
        """Return the best way to give a formula the wanted truth value, or None if literals cannot say any."""
        if isinstance(formula, Atom):
            return self._atom(formula, wanted, bound)
        if isinstance(formula, Not):
            return self.way(formula.body, not wanted, bound)
        if isinstance(formula, Imply):
            ways = (self.way(formula.premise, not wanted, bound), self.way(formula.body, wanted, bound))
            return _best(ways) if wanted else _all(ways)
        if isinstance(formula, And | Or):
            parts = (self.way(part, wanted, bound) for part in formula.parts)
            return _all(parts) if isinstance(formula, And) == wanted else _best(parts)
        if isinstance(formula, ForPairs):
            return self._pairs(formula, bound) if wanted else None
        members = tuple(self._members(formula.domain))
        if isinstance(formula, ForN):
            return self._count(formula, members, bound) if wanted else None
        bodies = (self.way(formula.body, wanted, {**bound, formula.variable: member}) for member in members)
        return _all(bodies) if isinstance(formula, ForAll) == wanted else _best(bodies)

    def _members(self, domain: Iterable[str]) -> Iterator[str]:
        yield from dict.fromkeys(obj for member in domain for obj in fitting(self._graph, Designator.parse(member)))

    def _atom(self, atom: Atom, wanted: bool, bound: Mapping[str, str]) -> _Way | None:
        if atom.value(self._graph, bound) == wanted:
            kept = atom.predicate not in (ON_FLOOR, WITHIN)
            return _DONE._replace(literals=(self._literal(atom, wanted, bound),)) if kept else _DONE
        if atom.predicate == ON_FLOOR or (atom.predicate == WITHIN and not wanted):
            return None
        literal = self._literal(atom, wanted, bound)
        if wanted and literal.predicate is Predicate.NEXT_TO and self._may_be_beside(literal):
            return _DONE
        ends = [str(end) for end in (literal.subject, literal.object) if end is not None]
        if literal.object is not None and ends[0] == ends[1]:
            return None
        unnamed = sum(end not in self._named for end in ends)
        by_appliance = literal.predicate.flag not in (None, Flag.OPEN, Flag.TOGGLED)  # perhaps one that nobody named
        return _Way(1, unnamed + 2 * by_appliance, (literal,))

    def _literal(self, atom: Atom, wanted: bool, bound: Mapping[str, str]) -> Literal:
        predicate = Predicate.INSIDE.value if atom.predicate == WITHIN else atom.predicate
        return literal_of(predicate, [bound.get(arg, arg) for arg in atom.args], not wanted)

    def _may_be_beside(self, literal: Literal) -> bool:
        """Return whether one stands on or in a piece, and nobody knows whether the other does too."""
        a, b = (self._graph.supports.get(str(end)) for end in (literal.subject, literal.object))
        known = a or b
        return (a is None) != (b is None) and known is not None and known.relation <= Relation.INSIDE

    def _count(self, formula: ForN, members: tuple[str, ...], bound: Mapping[str, str]) -> _Way | None:
        """Make as many members meet the body as are wanted: those for which least is missing."""
        ways = {}
        for member in members:
            around = {**bound, formula.variable: member}
            ways[member] = self.way(formula.body, True, around), self.way(formula.body, False, around)
        able = [(way, member) for member, (way, _) in ways.items() if way is not None]
        able.sort(key=lambda entry: entry[0][:2])
        chosen = {member for _, member in able[: formula.count]}
        if len(chosen) < formula.count:
            return None
        return _all(yes if member in chosen else no for member, (yes, no) in ways.items())

    def _pairs(self, formula: ForPairs, bound: Mapping[str, str]) -> _Way | None:
        """Give every member of the smaller domain a partner of its own, those first for which least is missing."""
        firsts, seconds = tuple(self._members(formula.domain)), tuple(self._members(formula.other_domain))
        found = []
        for a in firsts:
            for b in seconds:
                way = self.way(formula.body, True, {**bound, formula.variable: a, formula.other_variable: b})
                if a != b and way is not None:
                    found.append((way, a, b))
        found.sort(key=lambda entry: entry[0][:2])
        pairs: dict[str, str] = {}
        chosen: list[_Way] = []
        for way, a, b in found:
            if a not in pairs and b not in pairs.values():
                pairs[a] = b
                chosen.append(way)
        return _all(chosen) if len(chosen) == min(len(firsts), len(seconds)) else None


def _best(ways: Iterable[_Way | None]) -> _Way | None:
    return min((way for way in ways if way is not None), key=lambda way: way[:2], default=None)


def _all(ways: Iterable[_Way | None]) -> _Way | None:
    missing = unnamed = 0
    literals: dict[Literal, None] = {}
    for way in ways:
        if way is None:
            return None
        missing, unnamed = missing + way.missing, unnamed + way.unnamed
        literals.update(dict.fromkeys(way.literals))
    return _Way(missing, unnamed, tuple(literals))
