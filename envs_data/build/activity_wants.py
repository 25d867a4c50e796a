"""From a goal with quantifiers to what has to be done: where each object goes, and which states it gets or loses.

A condition can be met in many ways (`exists`, `or`, `forn`, `forpairs`). `choices` walks it once and keeps the cheapest
ways, a beam of `BEAM`: every way is a set of wants that do not contradict each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec

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
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["BEAM", "Spot", "Wants", "about_nearness", "choices"]

BEAM = 16
COMBINATIONS = 120

Bound = Mapping[str, str]


class Spot(NamedTuple):
    """Where an object is to be: "on" or "in" an object, on the "floor" of a room, "beside" something on the floor."""

    how: str
    where: str


_STAY = Spot("stay", "")
_HOW = {Relation.ON_TOP: "on", Relation.INSIDE: "in", Relation.FLOOR: "floor"}
_HOLDS = {"on_top": "on", "inside": "in", WITHIN: "in", ON_FLOOR: "floor"}
_STATE_COST = 3
_MAKE: Mapping[Flag, str] = {Flag.COOKED: "cookable", Flag.HOT: "heatable", Flag.FROZEN: "freezable"}


class Wants(NamedTuple):
    """One way to meet a goal.

    Attributes:
        spots: object -> where it is to be ("stay": it must not be moved).
        states: (flag, object) -> the value it is to have.
        never: (how, object, holder) that must not come about.
        cost: roughly how much has to be done.
    """

    spots: Mapping[str, Spot]
    states: Mapping[tuple[Flag, str], bool]
    never: frozenset[tuple[str, str, str]]
    cost: int

    def at(self, obj: str, spot: Spot, cost: int) -> Wants:
        """Return the wants with an object's spot decided."""
        return self._replace(spots={**self.spots, obj: spot}, cost=self.cost + cost)

    def state(self, flag: Flag, obj: str, value: bool, cost: int) -> Wants:
        """Return the wants with a state decided."""
        return self._replace(states={**self.states, (flag, obj): value}, cost=self.cost + cost)


def choices(goal: Sequence[Formula], graph: SceneGraph, parking: Sequence[str]) -> list[Wants]:
    """Return ways to meet all conditions from `graph`, cheapest first; `parking`: surfaces for what is in the way."""
    walker = _Walker(graph, parking)
    ways = [Wants({}, {}, frozenset(), 0)]
    for condition in goal:
        ways = walker.walk(_nearness_last(condition), {}, True, ways)
    return ways


def _nearness_last(formula: Formula) -> Formula:
    """Return a condition with the parts of its conjunctions ordered: what is near what is decided last."""
    if isinstance(formula, And | Or):
        parts = tuple(map(_nearness_last, formula.parts))
        if isinstance(formula, And):
            parts = tuple(sorted(parts, key=about_nearness))
        return msgspec.structs.replace(formula, parts=parts)
    if isinstance(formula, Atom | Imply):
        return formula
    return msgspec.structs.replace(formula, body=_nearness_last(formula.body))


def about_nearness(formula: Formula) -> bool:
    """Return True if a condition speaks of what is next to or under what."""
    return any(asked.atom.predicate in ("next_to", "under") for asked in formula.asked())


def _best(ways: Iterable[Wants]) -> list[Wants]:
    return sorted(ways, key=lambda w: w.cost)[:BEAM]


class _Walker:
    def __init__(self, graph: SceneGraph, parking: Sequence[str]) -> None:
        self.graph = graph
        self.parking = parking

    def walk(self, formula: Formula, bound: Bound, positive: bool, ways: list[Wants]) -> list[Wants]:
        """Return the ways extended so that the condition has the truth value `positive`."""
        if isinstance(formula, Atom):
            args = tuple(bound.get(a, a) for a in formula.args)
            return _best(w for way in ways for w in self._atom(formula.predicate, args, positive, way))
        if isinstance(formula, Not):
            return self.walk(formula.body, bound, not positive, ways)
        if isinstance(formula, Imply):
            return self.walk(Or((Not(formula.premise), formula.body)), bound, positive, ways)
        if isinstance(formula, And | Or):
            pairs = [(part, bound) for part in formula.parts]
            return self._each(pairs, positive, ways, isinstance(formula, And) == positive)
        if isinstance(formula, ForAll | Exists):
            pairs = [(formula.body, {**bound, formula.variable: member}) for member in formula.domain]
            return self._each(pairs, positive, ways, isinstance(formula, ForAll) == positive)
        if isinstance(formula, ForN):
            return self._counted(formula, bound, ways) if positive else []
        return self._paired(formula, bound, ways) if positive else []

    def _each(
        self, parts: Sequence[tuple[Formula, Bound]], positive: bool, ways: list[Wants], together: bool
    ) -> list[Wants]:
        """Extend the ways by all parts one after the other, or by any one of them."""
        if together:
            for part, bound in parts:
                ways = self.walk(part, bound, positive, ways)
            return ways
        return _best(w for part, bound in parts for w in self.walk(part, bound, positive, ways))

    def _counted(self, formula: ForN, bound: Bound, ways: list[Wants]) -> list[Wants]:
        found: list[Wants] = []
        subsets = itertools.combinations(formula.domain, formula.count)
        for chosen in itertools.islice(subsets, COMBINATIONS):
            extended = ways
            for member in formula.domain:
                inner = {**bound, formula.variable: member}
                extended = self.walk(formula.body, inner, member in chosen, extended)
            found.extend(extended)
        return _best(found)

    def _paired(self, formula: ForPairs, bound: Bound, ways: list[Wants]) -> list[Wants]:
        swap = len(formula.domain) > len(formula.other_domain)
        few, many = (formula.other_domain, formula.domain) if swap else (formula.domain, formula.other_domain)
        names = (formula.other_variable, formula.variable) if swap else (formula.variable, formula.other_variable)
        paired: list[tuple[Wants, frozenset[str]]] = [(way, frozenset()) for way in ways]
        for member in few:
            grown: list[tuple[Wants, frozenset[str]]] = []
            for way, used in paired:
                for partner in many:
                    if partner in used or partner == member:
                        continue
                    inner = {**bound, names[0]: member, names[1]: partner}
                    grown += [(w, used | {partner}) for w in self.walk(formula.body, inner, True, [way])]
            paired = sorted(grown, key=lambda pair: pair[0].cost)[:BEAM]
        return [way for way, _ in paired]

    # --- atoms ---------------------------------------------------------------------------------------------------

    def _atom(self, predicate: str, args: tuple[str, ...], positive: bool, way: Wants) -> Iterator[Wants]:
        obj = args[0]
        if len(args) == 1:
            yield from self._state(Flag[predicate.upper()], obj, positive, way)
            return
        other = args[1]
        if not positive:
            yield from self._not_there(predicate, obj, other, way)
        elif predicate == "next_to":
            yield from self._beside(obj, other, way)
            yield from self._beside(other, obj, way)
        elif predicate == "under":
            if self.graph.category(other).clearance:
                yield from self._drop_by(obj, other, way)
        elif predicate == WITHIN:
            yield from self._within_then(obj, other, way)
        else:
            yield from self._at(obj, Spot(_HOLDS[predicate], other), way)

    def _state(self, flag: Flag, obj: str, value: bool, way: Wants) -> Iterator[Wants]:
        decided = way.states.get((flag, obj))
        if decided is not None:
            if decided == value:
                yield way
            return
        category = self.graph.category(obj)
        now = self.graph.has(flag, obj)
        possible = now == value
        if not possible and flag is Flag.OPEN:
            possible = category.openable
        elif not possible and flag is Flag.TOGGLED:
            possible = category.toggleable
        elif not possible and flag is Flag.DIRTY:
            possible = not value
        elif not possible:
            made = _MAKE.get(flag)
            possible = made is not None and (value or flag is not Flag.COOKED) and bool(getattr(category, made))
        if possible:
            yield way.state(flag, obj, value, 0 if now == value else _STATE_COST)

    def _now(self, obj: str) -> Spot | None:
        support = self.graph.supports.get(obj)
        return None if support is None else Spot(_HOW[support.relation], support.holder)

    def _movable(self, obj: str) -> bool:
        node = self.graph.world.nodes[obj]
        return node.category.liftable and not node.fixed

    def _holds(self, spot: Spot) -> bool:
        if spot.how in ("floor", "beside"):
            return True
        category = self.graph.category(spot.where)
        return category.surface if spot.how == "on" else category.interior

    def _at(self, obj: str, spot: Spot, way: Wants) -> Iterator[Wants]:
        """Put `obj` at a spot, if nothing speaks against it."""
        decided = way.spots.get(obj)
        if decided == spot:
            yield way
            return
        if decided is not None and decided.how == "beside" and spot.how == "floor":
            if self._room_then(decided.where, way) == spot.where:
                yield way
            return
        if decided == _STAY and self._now(obj) == spot:
            yield way
            return
        if decided is not None or (spot.how, obj, spot.where) in way.never or obj == spot.where:
            return
        if self._now(obj) == spot:
            yield way.at(obj, spot, 0)
        elif self._movable(obj) and self._holds(spot) and not self._within(spot.where, obj, way):
            yield way.at(obj, spot, 2 + self._effort(spot))

    def _within_then(self, obj: str, container: str, way: Wants) -> Iterator[Wants]:
        """Bring `obj` into a container, or what it is to stand on or be in."""
        spot, now = way.spots.get(obj), self._now(obj)
        then = now if spot == _STAY else spot
        if then is not None:
            if then.how in ("on", "in"):
                yield from [way] if then == Spot("in", container) else self._within_then(then.where, container, way)
            return
        yield from self._at(obj, Spot("in", container), way)
        if now is not None and now.how in ("on", "in") and self._movable(now.where):
            yield from self._within_then(now.where, container, way.at(obj, _STAY, 0))

    def _effort(self, spot: Spot) -> int:
        return int(spot.how == "in" and self.graph.category(spot.where).openable)

    def _within(self, holder: str, obj: str, way: Wants) -> bool:
        """Return whether `holder` would itself be on or in `obj`."""
        for _ in range(len(way.spots) + 2):
            spot = way.spots.get(holder) or (self._now(holder) if holder in self.graph.world.nodes else None)
            if spot is None or spot.how not in ("on", "in"):
                return False
            if spot.where == obj:
                return True
            holder = spot.where
        return True

    def _spot_then(self, obj: str, way: Wants) -> Spot | None:
        spot = way.spots.get(obj)
        return self._now(obj) if spot is None or spot == _STAY else spot

    def _room_then(self, obj: str, way: Wants) -> str | None:
        """Return the room that an object will be in."""
        for _ in range(len(way.spots) + 8):
            spot = self._spot_then(obj, way)
            if spot is None or spot.how == "floor":
                return None if spot is None else spot.where
            obj = spot.where
        return None

    def _on_floor_then(self, obj: str, way: Wants) -> bool:
        spot = self._spot_then(obj, way)
        return spot is not None and spot.how in ("floor", "beside") and self.graph.category(obj).mount == "floor"

    def _beside(self, mover: str, other: str, way: Wants) -> Iterator[Wants]:
        """Bring `mover` beside `other`: into the same holder, or onto the floor next to it."""
        both = (way.spots.get(mover), way.spots.get(other))
        free = both[0] is None or both[0] == _STAY
        if self.graph.beside(mover, other) and free and (both[1] is None or both[1] == _STAY):
            yield way.at(mover, _STAY, 0).at(other, _STAY, 0)
            return
        then = self._spot_then(other, way)
        if then is not None and then.how in ("on", "in"):
            held = way if both[1] is not None else way.at(other, then, 0)
            yield from self._at(mover, then, held)
        yield from self._drop_by(mover, other, way)

    def _drop_by(self, mover: str, other: str, way: Wants) -> Iterator[Wants]:
        """Put `mover` onto the floor beside `other`."""
        if not self._on_floor_then(other, way):
            return
        spot, decided = Spot("beside", other), way.spots.get(mover)
        if decided is not None and decided.how == "floor" and self._room_then(other, way) == decided.where:
            way = way._replace(spots={k: v for k, v in way.spots.items() if k != mover}, cost=way.cost - 2)
            if not self._movable(mover):
                return
        held = way if other in way.spots or self.graph.world.nodes[other].fixed else way.at(other, _STAY, 0)
        yield from self._at(mover, spot, held)

    def _not_there(self, predicate: str, obj: str, other: str, way: Wants) -> Iterator[Wants]:
        """Keep or bring `obj` away from `other`."""
        how = _HOLDS.get(predicate, "beside")
        barred = way._replace(never=way.never | {(how, obj, other)})
        decided = way.spots.get(obj)
        if decided is not None:
            then = self._now(obj) if decided == _STAY else decided
            if then != Spot(how, other):
                yield barred
            return
        there = self.graph.beside(obj, other) if how == "beside" else self._now(obj) == Spot(how, other)
        if not there:
            yield barred
            return
        found = False
        for piece in self.parking:
            if piece not in (other, obj):
                for parked in self._at(obj, Spot("on", piece), barred):
                    found = True
                    yield parked
        room = self.graph.room_of(obj)
        if found or room is None:
            return
        for floor in [room] if how != "floor" else sorted(self.graph.world.rooms):
            if floor != other:
                yield from self._at(obj, Spot("floor", floor), barred)
