"""A state and a goal as a PDDL planning task over the lifted household domain (`household.pddl`), for ADL planners.

`pddl` exports one state in plain STRIPS, to check single steps; this is what a planner searches to the end. The domain
is a text of its own and shares no precondition or effect with `dynamics`; the tests hold the two to each other.

The goal is the task's own conditions, and that what the plan opens and switches on is shut and off at its end. Literals
of one subject that several things fit are met by one of them; quantifiers are written out over their members.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import NamedTuple, TypeAlias

from gavel_env.errors import NotExpressible
from gavel_env.world_model.actions import Action, Primitive
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
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Designator, Goal, Predicate, fitting
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["Expression", "PlanningTask", "household_domain", "planning_task", "state_of"]

_MOST_CASES = 5_000
"""Cases that a count, or a subject that several things fit, may be written out into."""


Expression: TypeAlias = tuple["str | Expression", ...]
"""A fact `("inside", "apple_0", "fridge_0")` or a condition over facts `("and", …)`, in names that PDDL can write."""


class PlanningTask(NamedTuple):
    """A planning task over the household domain.

    Attributes:
        things: PDDL name -> id of the graph.
        rooms: PDDL name -> room id.
        init: facts that hold in the state.
        goal: condition to be reached; `exists` has one variable, of things.
    """

    things: Mapping[str, str]
    rooms: Mapping[str, str]
    init: tuple[Expression, ...]
    goal: Expression

    @property
    def domain(self) -> str:
        """The domain, as PDDL."""
        return household_domain()

    @property
    def problem(self) -> str:
        """The problem, as PDDL."""
        objects = f"{' '.join(self.things)} - thing {' '.join(self.rooms)} - room"
        init = "\n  ".join(map(_written, self.init))
        return (
            f"(define (problem errand)\n(:domain household)\n(:objects {objects})\n"
            f"(:init\n  {init})\n(:goal {_written(self.goal)}))\n"
        )

    def action(self, name: str, arguments: Sequence[str]) -> Action:
        """Return the primitive that a step of a plan stands for; the last argument is the target."""
        primitive = Primitive[name.replace("-", "_").upper()]
        target = self.things[arguments[-1]] if primitive.takes_target else None
        return Action(primitive, target)


def _written(expression: Expression) -> str:
    """Return an expression in PDDL."""
    head, *rest = expression
    if head == "exists":
        return f"(exists ({rest[0]} - thing) {' '.join(_written(r) for r in rest[1:] if not isinstance(r, str))})"
    return f"({' '.join((str(head), *(r if isinstance(r, str) else _written(r) for r in rest)))})"


@cache
def household_domain() -> str:
    """Return the PDDL text of the household domain."""
    return (resources.files("gavel_env.world_model") / "household.pddl").read_text("utf-8")


def planning_task(
    graph: SceneGraph, goal: Goal, profile: Profile = Profile.PAPER, objects: Collection[str] | None = None
) -> PlanningTask:
    """Return the task of reaching a goal from a state.

    Args:
        graph: the state.
        goal: g.
        profile: rules profile.
        objects: ids to write, with all that holds them; default: all. Others are left out, as if they were not there.

    Raises:
        NotExpressible: a condition of the goal cannot be written.
    """
    kept = [o for o in graph.world.nodes if objects is None or o in objects]
    names = _names([*kept, *graph.world.rooms])
    written = {identifier: name for name, identifier in names.items()}
    init = tuple(
        (fact[0], *(written[a] for a in fact[1:])) for fact in (*_statics(graph, kept, profile), *state_of(graph, kept))
    )
    things = {written[o]: o for o in kept}
    rooms = {written[r]: r for r in graph.world.rooms}
    return PlanningTask(things, rooms, init, _Goal(graph, set(kept), written).expression(goal))


def _names(identifiers: Sequence[str]) -> dict[str, str]:
    """Return a PDDL name for every id: the id itself, without what PDDL cannot write."""
    names: dict[str, str] = {}
    for identifier in identifiers:
        name = re.sub(r"[^a-z0-9_-]", "-", identifier.lower())
        name = name if name[:1].isalpha() else f"x-{name}"
        while name in names:
            name += "-"
        names[name] = identifier
    return names


Fact = tuple[str, ...]


# --- the state -----------------------------------------------------------------------------------------------------


def _statics(graph: SceneGraph, objects: Sequence[str], profile: Profile) -> Iterator[Fact]:
    """Yield what things are, and what the rules profile allows."""
    if profile is Profile.PAPER:
        yield ("full-hand-may-operate",)
    for o in objects:
        node = graph.world.nodes[o]
        category = node.category
        heat, cold = category.heat, category.cold
        holds = {
            "fixed": node.fixed,
            "loose": category.liftable and not node.fixed,
            "surface": category.surface,
            "interior": category.interior,
            "floor-mounted": category.mount == "floor",
            "door": category.openable,
            "switch": category.toggleable,
            "needs-shut": category.requires_closed and category.openable,
            "clearance": category.clearance,
            "heats": heat is not None,
            "heats-on-top": heat is not None and not heat.requires_inside,
            "heats-when-shut": heat is not None and heat.requires_closed and category.openable,
            "freezes": cold is not None and cold.freezes and not cold.requires_toggled_on,
            "washes": category.washes,
            "dries": category.dries,
            "rinses": category.rinses,
            "wipes": category.wipes,
            "cookable": category.cookable,
            "heatable": category.heatable,
            "freezable": category.freezable,
        }
        yield from ((name, o) for name, value in holds.items() if value)


def state_of(graph: SceneGraph, objects: Sequence[str]) -> Iterator[Fact]:
    """Yield the facts of a state that can change, about some objects."""
    yield ("hand-empty",) if graph.holding is None else ("holding", graph.holding)
    if graph.robot_room is not None:
        yield ("robot-in", graph.robot_room)
    carried = set() if graph.holding is None else {graph.holding, *graph.descendants(graph.holding)}
    known = set(objects)
    for o in objects:
        support = graph.supports.get(o)
        if support is None or support.relation is Relation.FLOOR:
            yield ("lies", o)
        if support is not None and support.relation is Relation.FLOOR:
            yield ("on-floor", o, support.holder)
        if support is not None and support.relation <= Relation.INSIDE and support.holder in known:
            yield ("on-top" if support.relation is Relation.ON_TOP else "inside", o, support.holder)
        yield from (("aboard", o, o), ("rides", o, o))
        if not graph.world.nodes[o].fixed:
            yield from (("rides", o, holder) for holder in _carriers(graph, o) if holder in known)
        yield from (("aboard", o, holder) for _, holder in graph.holders(o) if holder in known)
        room = graph.room_of(o)
        if o in carried:
            yield ("carried", o)
        elif room is not None:
            yield ("in-room", o, room)
        if o in graph.near:
            yield ("near", o)
        if graph.is_shut(o):
            yield ("shut", o)
        yield from ((_state(flag.name.lower()), o) for flag in Flag if o in graph.flags[flag])
    for a, b in sorted(graph.next_to):
        if a in known and b in known:
            yield ("next-to", a, b)
            yield ("next-to", b, a)


def _carriers(graph: SceneGraph, obj: str) -> Iterator[str]:
    """Yield what holds a movable up, as far as the first fixed piece."""
    for _, holder in graph.holders(obj):
        yield holder
        if graph.world.nodes[holder].fixed:
            return


def _state(name: str) -> str:
    """Return the domain's name of a state: `open` is the action there."""
    return "opened" if name == Predicate.OPEN.value else name


# --- the goal ------------------------------------------------------------------------------------------------------


class _Goal:
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
                    yield ("not", (_state(flag.name.lower()), self._written[o]))

    def _atom(self, predicate: str, args: Sequence[str]) -> Expression:
        """Return that an atom is true of some things that fit its places."""
        subjects = self._fitting(args[0])
        if len(args) == 1:
            return _any([(_state(predicate), self._written[s]) for s in subjects])
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
