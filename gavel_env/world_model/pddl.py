"""Export of a state as grounded PDDL, so that other planners can check (and search) the transition model.

Written from the action table of docs/explanation/design.md, not from `dynamics`: it reads a graph's supports and
flags and the ontology, and shares no precondition or effect with the module that it checks.

The target is plain STRIPS, which every planner reads: no negative preconditions (a door is `open` or `shut`, the hand
holds something or is `hand-empty`) and no conditional effects. What depends on who holds whom is compiled in: every
operator is specialised by the support structure of the exported state and needs `(as-exported)`, which grasping and
putting down delete. A plan that is valid in the task is therefore valid in the world; after a grasp, release or
placement the state is exported anew to go on. Where an effect depends on doors, or on where the robot went last, there
is one operator per case; `action_of` gives the primitive that an operator stands for.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from gavel_env.errors import PddlNameError
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.graph import OWN_FLAGS, Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import Category
from gavel_env.world_model.own_actions_pddl import grounded_own_actions

__all__ = ["BOOKKEEPING", "PddlNameError", "PddlTask", "action_of", "export_pddl", "state_facts"]

BOOKKEEPING = ("as-exported", "at")
"""Predicates of the export that say nothing about the world."""

_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_NOWHERE = "nowhere"
_START = "start"
_SEPARATOR = "--"
_ARGUMENTS = "-and-"
_ARITIES = {
    "near": 1,
    "holding": 1,
    "hand-empty": 0,
    "shut": 1,
    "on-top": 2,
    "inside": 2,
    "on-floor": 2,
    "robot-in": 1,
    "next-to": 2,
    "as-exported": 0,
    "at": 1,
} | {flag.name.lower(): 1 for flag in Flag}


class PddlTask(NamedTuple):
    """A planning task in two PDDL texts."""

    domain: str
    problem: str


class _Operator(NamedTuple):
    """One STRIPS operator; every fact is a text such as `(near fridge_0)`."""

    action: Action
    needs: Sequence[str]
    adds: Iterable[str]
    deletes: Iterable[str] = ()


def _fact(predicate: str, *arguments: str) -> str:
    return f"({' '.join((predicate, *arguments))})"


def state_facts(graph: SceneGraph) -> frozenset[str]:
    """Return the state as ground facts, without the export's own bookkeeping."""
    facts = {_fact("near", o) for o in graph.near}
    facts.add(_fact("hand-empty") if graph.holding is None else _fact("holding", graph.holding))
    facts.add(_fact("robot-in", graph.robot_room or _NOWHERE))
    facts.update(_fact("next-to", a, b) for a, b in graph.next_to)
    for flag in Flag:
        facts.update(_fact(flag.name.lower(), o) for o in graph.flags[flag])
    for flag in OWN_FLAGS:
        facts.update(_fact(flag.name.lower(), o) for o in graph.world.nodes if graph.has(flag, o))
    for o, node in graph.world.nodes.items():
        if node.category.openable and o not in graph.flags[Flag.OPEN]:
            facts.add(_fact("shut", o))
        facts.update(_support_fact(graph, o))
    return frozenset(facts)


_SUPPORT_PREDICATES = {Relation.ON_TOP: "on-top", Relation.INSIDE: "inside", Relation.FLOOR: "on-floor"}


def _support_fact(graph: SceneGraph, o: str) -> list[str]:
    """Return the fact that says what holds `o`: none if it is held or its place is unknown."""
    support = graph.supports.get(o)
    if support is None or support.relation is Relation.HELD:
        return []
    return [_fact(_SUPPORT_PREDICATES[support.relation], o, support.holder)]


class _Structure:
    """The support structure of one state, read from `supports` alone."""

    def __init__(self, graph: SceneGraph) -> None:
        self.graph = graph
        self.objects = sorted(graph.world.nodes)
        self.held = next((o for o in self.objects if self._relation(o) is Relation.HELD), None)
        self.held_up_by: dict[str, list[str]] = {}
        for o in self.objects:
            if self._relation(o) in (Relation.ON_TOP, Relation.INSIDE):
                self.held_up_by.setdefault(graph.supports[o].holder, []).append(o)

    def _relation(self, o: str) -> Relation | None:
        support = self.graph.supports.get(o)
        return None if support is None else support.relation

    def category(self, o: str) -> Category:
        return self.graph.world.nodes[o].category

    def fixed(self, o: str) -> bool:
        return self.graph.world.nodes[o].fixed

    def chain(self, o: str) -> Iterator[tuple[Relation, str]]:
        """Yield what holds `o`, from the inside out."""
        while self._relation(o) in (Relation.ON_TOP, Relation.INSIDE):
            relation, holder = self.graph.supports[o]
            yield relation, holder
            o = holder

    def aboard(self, o: str) -> Iterator[str]:
        """Yield the movables on or in `o`, and on or in those."""
        for item in self.held_up_by.get(o, ()):
            if not self.fixed(item):
                yield item
                yield from self.aboard(item)

    def room(self, o: str) -> str | None:
        """Return the room that `o` stands in; None if unknown or held."""
        base = [o, *(holder for _, holder in self.chain(o))][-1]
        support = self.graph.supports.get(base)
        return support.holder if support is not None and support.relation is Relation.FLOOR else None

    def carried(self, o: str) -> bool:
        """Return whether the robot carries `o`, by itself or aboard what it holds."""
        return self.held is not None and (o == self.held or o in self.aboard(self.held))

    def reached_from(self, o: str) -> set[str]:
        """Return what is near once the robot went to `o`."""
        reached = {o, *self.aboard(o), *(holder for _, holder in self.chain(o))}
        if self.held is not None:
            reached |= {self.held, *self.aboard(self.held)}
        return reached

    def accessible(self, o: str) -> list[str]:
        """Return the facts that say that no container around `o` is shut."""
        return [_fact("open", h) for relation, h in self.chain(o) if relation is Relation.INSIDE and self._door(h)]

    def _door(self, o: str) -> bool:
        return self.category(o).openable

    def freezes(self, o: str) -> bool:
        """Return whether `o` freezes what is in it, without being switched on."""
        cold = self.category(o).cold
        return cold is not None and cold.freezes and not cold.requires_toggled_on

    def doors_within(self, o: str) -> list[str]:
        """Return the lidded movables directly on or in `o` that hold something inside."""
        return self.doors_among([d for d in self.held_up_by.get(o, ()) if not self.fixed(d)])

    def doors_among(self, objects: Sequence[str]) -> list[str]:
        """Return those of the objects that have a lid and hold something inside."""
        return [
            d
            for d in objects
            if self._door(d) and any(self._relation(i) is Relation.INSIDE for i in self.held_up_by.get(d, ()))
        ]

    def exposed(self, o: str, is_open: Mapping[str, bool]) -> list[str]:
        """Return what is directly on `o`, or in it if its lid does not cover it."""
        below = self.held_up_by.get(o, ())
        return [i for i in below if self._relation(i) is Relation.ON_TOP or is_open.get(o, True)]

    def treated(self, o: str, is_open: Mapping[str, bool], *, inside_only: bool) -> list[str]:
        """Return the contents that an appliance acts on: direct ones, and one level down unless under a lid."""
        found: list[str] = []
        for item in self.held_up_by.get(o, ()):
            if self.fixed(item) or (inside_only and self._relation(item) is not Relation.INSIDE):
                continue
            found += [item, *self.exposed(item, is_open)]
        return found


def _cases(doors: Sequence[str]) -> Iterator[tuple[dict[str, bool], list[str]]]:
    """Yield every combination of open and shut doors, with the facts that say so."""
    for values in itertools.product((True, False), repeat=len(doors)):
        case = dict(zip(doors, values, strict=True))
        yield case, [_fact("open" if is_open else "shut", d) for d, is_open in case.items()]


_EXPORTED = _fact("as-exported")
_EMPTY = _fact("hand-empty")


def _navigations(s: _Structure) -> Iterator[_Operator]:
    everything = [_fact("near", o) for o in s.objects]
    rooms = [_fact("robot-in", r) for r in (*s.graph.world.rooms, _NOWHERE)]
    places = [_fact("at", o) for o in (*s.objects, _START)]
    for x in s.objects:
        needs = [_EXPORTED, *s.accessible(x)]
        action = Action(Primitive.NAVIGATE_TO, x)
        if x == s.held:
            yield _Operator(action, needs, ())
        else:
            adds = [_fact("at", x), *(_fact("near", o) for o in sorted(s.reached_from(x)))]
            deletes = everything + places
            if not s.carried(x):
                adds.append(_fact("robot-in", s.room(x) or _NOWHERE))
                deletes = deletes + rooms
            yield _Operator(action, needs, adds, deletes)


def _grasps(s: _Structure) -> Iterator[_Operator]:
    for x in s.objects:
        if s.category(x).liftable and not s.fixed(x):
            apart = [_fact("next-to", a, b) for a, b in sorted(s.graph.next_to) if x in (a, b)]
            yield _Operator(
                Action(Primitive.GRASP, x),
                [_EXPORTED, _EMPTY, _fact("near", x), *s.accessible(x)],
                [_fact("holding", x)],
                [_EXPORTED, _EMPTY, *_support_fact(s.graph, x), *apart],
            )


def _releases(s: _Structure) -> Iterator[_Operator]:
    held = s.held
    if held is None:
        return
    for place in (_START, *s.objects):
        if place == held:
            continue
        near = s.graph.near if place == _START else s.reached_from(place)
        beside = [
            o
            for o in sorted(near)
            if o != held
            and s.category(o).mount == "floor"
            and (o not in s.graph.supports or s.graph.supports[o].relation is Relation.FLOOR)
        ]
        pairs = [_fact("next-to", *sorted((held, o))) for o in beside]
        for room in (*s.graph.world.rooms, _NOWHERE):
            down = [] if room == _NOWHERE else [_fact("on-floor", held, room)]
            yield _Operator(
                Action(Primitive.RELEASE),
                [_EXPORTED, _fact("holding", held), _fact("at", place), _fact("robot-in", room)],
                [_EMPTY, *down, *pairs],
                [_EXPORTED, _fact("holding", held)],
            )


def _frozen(s: _Structure, objects: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the facts that freezing the objects adds and deletes: what is frozen is not hot."""
    able = [o for o in objects if s.category(o).freezable]
    return [_fact("frozen", o) for o in able], [_fact("hot", o) for o in able]


def _placements(s: _Structure) -> Iterator[_Operator]:
    held = s.held
    if held is None:
        return
    for y in s.objects:
        if s.carried(y):
            continue
        needs = [_EXPORTED, _fact("holding", held), _fact("near", y), *s.accessible(y)]
        deletes = [_EXPORTED, _fact("holding", held)]
        if s.category(y).surface:
            wiped = [_fact("dirty", y)] if s.category(held).wipes else []
            added = [_EMPTY, _fact("on-top", held, y)]
            yield _Operator(Action(Primitive.PLACE_ON_TOP, y), needs, added, deletes + wiped)
        if not s.category(y).interior:
            continue
        if s.category(y).openable:
            needs = [*needs, _fact("open", y)]
        doorless = s.freezes(y) and not s.category(y).openable
        for case, facts in _cases([*s.doors_within(y), *s.doors_among([held])] if doorless else ()):
            chilled = [*s.treated(y, case, inside_only=True), held, *s.exposed(held, case)] if doorless else []
            frozen, cooled = _frozen(s, chilled)
            added = [_EMPTY, _fact("inside", held, y), *frozen]
            yield _Operator(Action(Primitive.PLACE_INSIDE, y), [*needs, *facts], added, deletes + cooled)


def _doors(s: _Structure, hand: list[str]) -> Iterator[_Operator]:
    for y in s.objects:
        category = s.category(y)
        if not category.openable:
            continue
        needs = [_EXPORTED, _fact("near", y), *s.accessible(y), *hand]
        switched_off = [_fact("toggled", y)] if category.requires_closed else []
        yield _Operator(Action(Primitive.OPEN, y), needs, [_fact("open", y)], [_fact("shut", y), *switched_off])
        freezes = s.freezes(y)
        for case, facts in _cases(s.doors_within(y) if freezes else ()):
            frozen, cooled = _frozen(s, s.treated(y, case, inside_only=True) if freezes else ())
            added, gone = [_fact("shut", y), *frozen], [_fact("open", y), *cooled]
            yield _Operator(Action(Primitive.CLOSE, y), [*needs, *facts], added, gone)


def _switches(s: _Structure, hand: list[str]) -> Iterator[_Operator]:
    for y in s.objects:
        category = s.category(y)
        if not category.toggleable:
            continue
        needs = [_EXPORTED, _fact("near", y), *s.accessible(y), *hand]
        yield _Operator(Action(Primitive.TOGGLE_OFF, y), needs, (), [_fact("toggled", y)])
        if category.requires_closed and category.openable:
            needs = [*needs, _fact("shut", y)]
        confers = category.heat is not None or category.washes or category.dries or category.rinses
        doors = s.doors_within(y) if confers else []
        if category.heat is not None and category.heat.requires_closed and category.openable:
            doors = [y, *doors]
        for case, facts in _cases(doors):
            adds, deletes = _conferred(s, y, case)
            yield _Operator(Action(Primitive.TOGGLE_ON, y), [*needs, *facts], [_fact("toggled", y), *adds], deletes)


def _conferred(s: _Structure, y: str, is_open: Mapping[str, bool]) -> tuple[list[str], list[str]]:
    """Return the facts that switching `y` on adds and deletes, its doors being as `is_open` says."""
    category = s.category(y)
    adds: list[str] = []
    deletes: list[str] = []
    heat = category.heat
    if heat is not None and not (heat.requires_closed and is_open.get(y, False)):
        for o in s.treated(y, is_open, inside_only=heat.requires_inside):
            adds += [_fact("cooked", o)] * s.category(o).cookable + [_fact("hot", o)] * s.category(o).heatable
            deletes += [_fact("frozen", o)] * s.category(o).heatable
    within = s.treated(y, is_open, inside_only=True)
    if category.washes:
        adds += [_fact("washed", o) for o in within]
    if category.washes or category.rinses:
        deletes += [_fact("dirty", o) for o in within]
    if category.dries:
        adds += [_fact("dried", o) for o in within]
    return adds, deletes


def _own(s: _Structure) -> Iterator[_Operator]:
    for step in grounded_own_actions(s.graph, s.objects):
        open_first = [fact for o in step.accessible for fact in s.accessible(o)]
        yield _Operator(step.action, [_EXPORTED, *step.needs, *open_first], step.adds, step.deletes)


def export_pddl(graph: SceneGraph, profile: Profile = Profile.PAPER) -> PddlTask:
    """Return the state and everything that can be done next as a PDDL task.

    Args:
        graph: the state; its objects become the task's objects. Grounding grows with their number, so restrict the
            graph to the objects of interest for quick work.
        profile: rules profile; `OMNIGIBSON` asks for an empty hand at doors and switches.

    Returns:
        The domain and problem texts. The goal is the exported state's own `(as-exported)`: the task is for stepping.

    Raises:
        PddlNameError: an object or room has a name that PDDL cannot write.
    """
    for name in (*graph.world.nodes, *graph.world.rooms):
        if not _NAME.fullmatch(name) or _SEPARATOR in name or _ARGUMENTS in name or name in (_NOWHERE, _START):
            raise PddlNameError(f"{name!r} is not a PDDL name; names match {_NAME.pattern} without {_SEPARATOR!r}")
    s = _Structure(graph)
    hand = [_EMPTY] if profile is Profile.OMNIGIBSON else []
    operators = [
        *_navigations(s),
        *_grasps(s),
        *_releases(s),
        *_placements(s),
        *_doors(s, hand),
        *_switches(s, hand),
        *_own(s),
    ]
    constants = " ".join((*s.objects, *sorted(graph.world.rooms), _NOWHERE, _START))
    arities = _ARITIES | {flag.name.lower(): 1 for flag in OWN_FLAGS}
    predicates = " ".join(f"({name}{''.join(f' ?x{i}' for i in range(n))})" for name, n in arities.items())
    actions = "\n".join(_write(index, operator) for index, operator in enumerate(operators))
    domain = (
        f"(define (domain gavel)\n(:requirements :strips)\n(:constants {constants})\n"
        f"(:predicates {predicates})\n{actions})\n"
    )
    init = "\n".join(sorted((*state_facts(graph), _EXPORTED, _fact("at", _START))))
    problem = f"(define (problem state)\n(:domain gavel)\n(:init\n{init})\n(:goal (and {_EXPORTED})))\n"
    return PddlTask(domain, problem)


def _write(index: int, operator: _Operator) -> str:
    added = list(dict.fromkeys(operator.adds))
    gone = dict.fromkeys(fact for fact in operator.deletes if fact not in set(added))
    effects = " ".join((*added, *(f"(not {fact})" for fact in gone)))
    name = _SEPARATOR.join(
        (operator.action.primitive.name.lower(), _ARGUMENTS.join(operator.action.arguments), str(index))
    )
    needs = " ".join(operator.needs)
    return f"(:action {name}\n:parameters ()\n:precondition (and {needs})\n:effect (and {effects}))"


def action_of(operator: str) -> Action:
    """Return the primitive that an operator of an export stands for, by the operator's name."""
    primitive, target, _ = operator.strip("()").split(_SEPARATOR)
    first, *others = target.split(_ARGUMENTS)
    return Action(Primitive[primitive.upper()], first or None, tuple(others))
