"""Goal conditions with quantifiers, as BEHAVIOR's activities have them.

A condition has two forms. The text form (`condition_text`) is BDDL's, with the members of a quantifier's domain in
place of its type: `(forall (?x apple_0 apple_1) (exists (?y bottom_cabinet@kitchen) (inside ?x ?y)))`. The JSON form
is the same tree as tagged objects, decoded by msgspec into the frozen structs below:
`{"is":"forall","variable":"?x","domain":[...],"body":{...}}`.
Members of a domain, and places of an atom that are not variables, are designators: any instance that fits one counts.

The meanings are those of bddl 3.6.0: `forn` holds if exactly `count` members do, `forpairs` if at least as many members
of each domain as the smaller one has are in some pair.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple, Protocol, TypeAlias, cast

import msgspec

from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting, unmet
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = [
    "ON_FLOOR",
    "PREDICATES",
    "WITHIN",
    "And",
    "Asked",
    "Atom",
    "Exists",
    "ForAll",
    "ForN",
    "ForPairs",
    "Formula",
    "Imply",
    "Not",
    "Or",
    "conjuncts",
    "plain_literals",
]

ON_FLOOR = "on_floor"
"""on_floor(x, room): x lies on the floor of the room; literals do not have this predicate."""

WITHIN = "within"
"""within(x, y): x is inside y, or on or in something that is; what BEHAVIOR's `inside` comes to."""

PREDICATES: Mapping[str, int] = {p.value: p.arity for p in Predicate} | {ON_FLOOR: 2, WITHIN: 2}
"""Name of every predicate that an atom can have, and its number of places."""

Bound = Mapping[str, str]
Domains = Mapping[str, tuple[str, ...]]


class Asked(NamedTuple):
    """An atom as it occurs in a condition.

    Attributes:
        atom: the atom.
        positive: False under an odd number of negations.
        domains: domain of every variable around it.
    """

    atom: Atom
    positive: bool
    domains: Domains


class _Evaluated(Protocol):
    """What every kind of condition brings itself."""

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return the truth value under a binding of the variables."""
        ...

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield every atom with its polarity and the domains around it."""
        ...


class _Condition(msgspec.Struct, frozen=True, tag_field="is", forbid_unknown_fields=True):
    """What all conditions share; implements `goals.Condition`."""

    def text(self: _Evaluated) -> str:
        """Return the condition as it is told to planners: `each A of apple_0, apple_1: inside(A, fridge_0)`."""
        return _told(cast("Formula", self), {})

    def holds(self: _Evaluated, graph: SceneGraph) -> bool:
        """Return whether the condition holds in `graph`."""
        return self.value(graph, {})

    def wants(self: _Evaluated, flag: Flag, obj: str, graph: SceneGraph) -> bool:
        """Return whether the condition somewhere asks for `flag` on `obj`."""
        for atom, positive, domains in self.asked():
            if positive and atom.predicate == flag.name.lower():
                members = domains.get(atom.args[0], (atom.args[0],))
                if any(obj in fitting(graph, Designator.parse(member)) for member in members):
                    return True
        return False


class Atom(_Condition, frozen=True, tag="atom"):
    """A predicate and its places, each a variable (`?x`) or a designator."""

    predicate: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        return f"({' '.join((self.predicate, *self.args))})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether some instances that fit make it true."""
        args = [bound.get(a, a) for a in self.args]
        if self.predicate == ON_FLOOR:
            return any(_on_floor(graph, obj, args[1]) for obj in fitting(graph, Designator.parse(args[0])))
        if self.predicate == WITHIN:
            containers = fitting(graph, Designator.parse(args[1]))
            return any(_is_within(graph, obj, containers) for obj in fitting(graph, Designator.parse(args[0])))
        return not unmet(Goal((literal_of(self.predicate, args),)), graph)

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield itself."""
        yield Asked(self, positive, domains or {})


class Not(_Condition, frozen=True, tag="not"):
    """Negation."""

    body: Formula

    def __str__(self) -> str:
        return f"(not {self.body})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return the opposite of the body's value."""
        return not self.body.value(graph, bound)

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the body's atoms, turned round."""
        return self.body.asked(not positive, domains)


class And(_Condition, frozen=True, tag="and"):
    """Conjunction."""

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return f"(and {' '.join(map(str, self.parts))})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether all parts hold."""
        return all(part.value(graph, bound) for part in self.parts)

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the parts' atoms."""
        for part in self.parts:
            yield from part.asked(positive, domains)


class Or(_Condition, frozen=True, tag="or"):
    """Disjunction."""

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return f"(or {' '.join(map(str, self.parts))})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether a part holds."""
        return any(part.value(graph, bound) for part in self.parts)

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the parts' atoms."""
        for part in self.parts:
            yield from part.asked(positive, domains)


class Imply(_Condition, frozen=True, tag="imply"):
    """Implication."""

    premise: Formula
    body: Formula

    def __str__(self) -> str:
        return f"(imply {self.premise} {self.body})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether the premise fails or the body holds."""
        return not self.premise.value(graph, bound) or self.body.value(graph, bound)

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the atoms of both, those of the premise turned round."""
        yield from self.premise.asked(not positive, domains)
        yield from self.body.asked(positive, domains)


class _Quantified(_Condition, frozen=True):
    variable: str
    domain: tuple[str, ...]
    body: Formula

    def values(self, graph: SceneGraph, bound: Bound) -> Iterator[bool]:
        """Yield the body's value for every member of the domain."""
        for member in _members(graph, self.domain):
            yield self.body.value(graph, {**bound, self.variable: member})

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the body's atoms."""
        return self.body.asked(positive, {**(domains or {}), self.variable: self.domain})

    def _tail(self) -> str:
        return f"({' '.join((self.variable, *self.domain))}) {self.body})"


class ForAll(_Quantified, frozen=True, tag="forall"):
    """The body holds for every member."""

    def __str__(self) -> str:
        return f"(forall {self._tail()}"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether all members do."""
        return all(self.values(graph, bound))


class Exists(_Quantified, frozen=True, tag="exists"):
    """The body holds for some member."""

    def __str__(self) -> str:
        return f"(exists {self._tail()}"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether some member does."""
        return any(self.values(graph, bound))


class ForN(_Quantified, frozen=True, tag="forn"):
    """The body holds for exactly `count` members."""

    count: int

    def __str__(self) -> str:
        return f"(forn ({self.count}) {self._tail()}"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether exactly `count` members do."""
        return sum(self.values(graph, bound)) == self.count


class ForPairs(_Condition, frozen=True, tag="forpairs"):
    """Every member of the smaller domain has a partner in the other, and as many of the other have one."""

    variable: str
    domain: tuple[str, ...]
    other_variable: str
    other_domain: tuple[str, ...]
    body: Formula

    def __str__(self) -> str:
        first, second = (self.variable, *self.domain), (self.other_variable, *self.other_domain)
        return f"(forpairs ({' '.join(first)}) ({' '.join(second)}) {self.body})"

    def value(self, graph: SceneGraph, bound: Bound) -> bool:
        """Return whether enough members of both domains have a partner."""
        firsts, seconds = _members(graph, self.domain), _members(graph, self.other_domain)
        pairs = [
            (a, b)
            for a in firsts
            for b in seconds
            if a != b and self.body.value(graph, {**bound, self.variable: a, self.other_variable: b})
        ]
        least = min(len(firsts), len(seconds))
        return len({a for a, _ in pairs}) >= least and len({b for _, b in pairs}) >= least

    def asked(self, positive: bool = True, domains: Domains | None = None) -> Iterator[Asked]:
        """Yield the body's atoms."""
        around = {**(domains or {}), self.variable: self.domain, self.other_variable: self.other_domain}
        return self.body.asked(positive, around)


Formula: TypeAlias = Atom | Not | And | Or | Imply | ForAll | Exists | ForN | ForPairs


def _members(graph: SceneGraph, domain: tuple[str, ...]) -> tuple[str, ...]:
    """Return the instances that fit a domain, each once."""
    return tuple(dict.fromkeys(obj for member in domain for obj in fitting(graph, Designator.parse(member))))


def _on_floor(graph: SceneGraph, obj: str, room: str) -> bool:
    support = graph.supports.get(obj)
    if support is None or support.relation is not Relation.FLOOR:
        return False
    return graph.world.rooms[support.holder].fits(room)


def _is_within(graph: SceneGraph, obj: str, containers: tuple[str, ...]) -> bool:
    return any(relation is Relation.INSIDE and holder in containers for relation, holder in graph.holders(obj))


_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


def _told(formula: Formula, names: Mapping[str, str]) -> str:
    """Return a condition in words, its variables named by letters or, where only one thing can be meant, by that."""
    if isinstance(formula, Atom):
        return f"{formula.predicate}({', '.join(names.get(a, a) for a in formula.args)})"
    if isinstance(formula, Not):
        return f"not {_enclosed(formula.body, names)}"
    if isinstance(formula, And | Or):
        return (" and " if isinstance(formula, And) else " or ").join(_enclosed(part, names) for part in formula.parts)
    if isinstance(formula, Imply):
        return f"if {_enclosed(formula.premise, names)} then {_enclosed(formula.body, names)}"
    if isinstance(formula, ForPairs):
        a, b = _letter(names, 0), _letter(names, 1)
        body = _told(formula.body, {**names, formula.variable: a, formula.other_variable: b})
        return f"pair off {a} of {_listed(formula.domain)} with {b} of {_listed(formula.other_domain)}: {body}"
    if isinstance(formula, ForAll | Exists) and len(formula.domain) == 1:
        return _told(formula.body, {**names, formula.variable: formula.domain[0]})
    letter = _letter(names, 0)
    how = "each" if isinstance(formula, ForAll) else "some"
    if isinstance(formula, ForN):
        how = f"exactly {formula.count}"
    return f"{how} {letter} of {_listed(formula.domain)}: {_told(formula.body, {**names, formula.variable: letter})}"


def _enclosed(formula: Formula, names: Mapping[str, str]) -> str:
    told = _told(formula, names)
    simple = isinstance(formula, Atom) or (isinstance(formula, Not) and isinstance(formula.body, Atom))
    return told if simple else f"({told})"


def _listed(domain: tuple[str, ...]) -> str:
    return ", ".join(domain)


def _letter(names: Mapping[str, str], further: int) -> str:
    used = sum(len(name) == 1 for name in names.values())
    return _LETTERS[(used + further) % len(_LETTERS)]


def literal_of(predicate: str, args: list[str] | tuple[str, ...], negated: bool = False) -> Literal:
    """Return an atom without variables as a goal literal."""
    second = Designator.parse(args[1]) if len(args) > 1 else None
    return Literal(Predicate(predicate), Designator.parse(args[0]), second, negated)


def conjuncts(formula: Formula) -> Iterator[Formula]:
    """Yield the parts of nested conjunctions, in order."""
    if isinstance(formula, And):
        for part in formula.parts:
            yield from conjuncts(part)
    else:
        yield formula


def plain_literals(formula: Formula) -> tuple[Literal, ...] | None:
    """Return a condition as goal literals if it is a conjunction of them (and of `forall` over them), else None."""
    found: list[Literal] = []
    for part in conjuncts(formula):
        if isinstance(part, ForAll):
            inner = plain_literals(part.body)
            if inner is None:
                return None
            members = [Designator.parse(member) for member in part.domain]
            found.extend(_renamed(literal, part.variable, member) for member in members for literal in inner)
            continue
        atom, negated = (part.body, True) if isinstance(part, Not) else (part, False)
        if not isinstance(atom, Atom) or atom.predicate in (ON_FLOOR, WITHIN):
            return None
        args = [Designator(a) if a.startswith("?") else Designator.parse(a) for a in atom.args]
        found.append(Literal(Predicate(atom.predicate), args[0], args[1] if len(args) > 1 else None, negated))
    return tuple(dict.fromkeys(found))


def _renamed(literal: Literal, variable: str, member: Designator) -> Literal:
    subject = member if literal.subject.name == variable else literal.subject
    second = member if literal.object is not None and literal.object.name == variable else literal.object
    return literal._replace(subject=subject, object=second)
