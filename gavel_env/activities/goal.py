"""The goal of an activity over the ids of a scene: quantified nodes of BDDL become conditions of the graph."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping

import msgspec

from gavel_env.activities.bddl import Node, synset_of
from gavel_env.activities.scope import GROUND, Ungroundable
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

__all__ = ["GoalReader", "substances_of", "with_variable"]

_ATOMS = {"ontop": "on_top", "nextto": "next_to", "toggled_on": "toggled", "covered": "dirty"}


def substances_of(node: Node, kinds: Mapping[str, str] | None = None) -> Iterator[str]:
    """Yield the synsets of the substances that a goal wants off."""
    kinds = {**(kinds or {}), **dict(node.variables)}
    if node.head == "covered":
        yield kinds.get(node.args[1], synset_of(node.args[1]))
    for part in node.parts:
        yield from substances_of(part, kinds)


def _stacked(goal: Node) -> frozenset[str]:
    """Return the synsets that the goal wants in something and also on or in something else."""
    holders: dict[str, set[tuple[str, str]]] = {}

    def walk(node: Node, kinds: Mapping[str, str]) -> None:
        kinds = {**kinds, **dict(node.variables)}
        if node.head in ("ontop", "inside"):
            a, b = (kinds.get(arg, synset_of(arg)) for arg in node.args)
            holders.setdefault(a, set()).add((node.head, b))
        for part in node.parts:
            if node.head != "not":
                walk(part, kinds)

    walk(goal, {})
    return frozenset(s for s, held in holders.items() if len(held) > 1 and any(how == "inside" for how, _ in held))


class GoalReader:
    """Turns a goal into a condition.

    Args:
        goal: as BDDL writes it.
        scope: object name -> id of its object, or of its room.
        things: synsets that are objects of the graph.
        rooms: ids of the rooms that floors stand for.
        members: synset -> ids of all its objects.
    """

    def __init__(
        self,
        goal: Node,
        scope: Mapping[str, str],
        things: Collection[str],
        rooms: Collection[str],
        members: Callable[[str], tuple[str, ...]],
    ) -> None:
        self.goal, self.scope, self.things, self.rooms, self.members = goal, scope, things, rooms, members
        self.kind_of = {obj: synset_of(name) for name, obj in scope.items()}
        self.stacked = _stacked(goal)

    def condition(self) -> Formula:
        """Return the goal as a condition.

        Raises:
            Ungroundable: it speaks of something that is not an object of a graph.
        """
        return self._formula(self.goal, {})

    def _formula(self, node: Node, bound: Mapping[str, str]) -> Formula:
        """Return a goal over ids; `bound`: variable -> what its places are written as."""
        parts = node.parts
        if node.head in ("and", "or"):
            inner = tuple(dict.fromkeys(self._formula(part, bound) for part in parts))
            if len(inner) == 1:
                return inner[0]
            return And(inner) if node.head == "and" else Or(inner)
        if node.head == "not":
            return Not(self._formula(parts[0], bound))
        if node.head == "imply":
            return Imply(self._formula(parts[0], bound), self._formula(parts[1], bound))
        if not node.variables:
            return self._atom(node, bound)
        return self._quantified(node, bound)

    def _quantified(self, node: Node, bound: Mapping[str, str]) -> Formula:
        (variable, synset), *rest = node.variables
        body = node.parts[0]
        if synset not in self.things:
            if synset not in GROUND:
                return self._formula(body, {**bound, variable: synset})
            rooms = dict.fromkeys(obj for name, obj in self.scope.items() if synset_of(name) == synset)
            each = tuple(self._formula(body, {**bound, variable: room}) for room in rooms)
            if len(each) == 1:
                return each[0]
            return Or(each) if node.head == "exists" else And(each)
        written = f"?{variable}".replace(".", "_")
        domain = self.members(synset)
        self.kind_of[written] = synset
        if not domain:
            raise Ungroundable(f"the goal speaks of {synset}, and there is none")
        if rest:
            other, other_synset = rest[0]
            other_written = f"?{other}".replace(".", "_")
            self.kind_of[other_written] = other_synset
            inner = self._formula(body, {**bound, variable: written, other: other_written})
            return ForPairs(written, domain, other_written, self.members(other_synset), inner)
        inner = self._formula(body, {**bound, variable: written})
        if node.head == "forn":
            return ForN(written, domain, inner, node.count)
        return ForAll(written, domain, inner) if node.head == "forall" else Exists(written, domain, inner)

    def _atom(self, node: Node, bound: Mapping[str, str]) -> Formula:
        name = _ATOMS.get(node.head, node.head)
        places = node.args[:1] if node.head == "covered" else node.args
        args = []
        for place in places:
            if place in bound:
                args.append(bound[place])
            elif place in self.scope:
                args.append(self.scope[place])
            else:
                raise Ungroundable(f"the goal speaks of {place}, which is not an object of a graph")
        if args[0] in self.rooms:
            raise Ungroundable(f"the goal is about a floor: {node}")
        if len(args) > 1 and args[1] in self.rooms:
            if name != "on_top":
                raise Ungroundable(f"{node}: only things on a floor can be said, not {node.head}")
            return Atom(ON_FLOOR, tuple(args))
        if name == "inside" and self.kind_of[args[0]] in self.stacked:
            name = WITHIN
        return Atom(name, tuple(args))


def with_variable(formula: Formula, piece: str, variable: str) -> Formula:
    """Return a condition with a variable in place of a piece, in atoms and in domains."""
    if isinstance(formula, Atom):
        return msgspec.structs.replace(formula, args=tuple(variable if a == piece else a for a in formula.args))
    if isinstance(formula, And | Or):
        return msgspec.structs.replace(
            formula, parts=tuple(with_variable(part, piece, variable) for part in formula.parts)
        )
    if isinstance(formula, Imply):
        return Imply(with_variable(formula.premise, piece, variable), with_variable(formula.body, piece, variable))
    if isinstance(formula, ForAll | Exists | ForN) and formula.domain == (piece,):
        inner = formula.body
        return with_variable(with_variable(inner, formula.variable, piece), piece, variable)
    return msgspec.structs.replace(formula, body=with_variable(formula.body, piece, variable))
