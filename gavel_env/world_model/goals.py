"""Goals g as partial graphs: literals over designators, and unmet(g, G).

A *designator* is an instance id (`fridge_0`), or a category or concept with an optional room: its id, its type or a
concept of that (`bottom_cabinet@private_office`, `any_cabinet@any_office`). Several names with `|` between them are
any of these (`desk|bed`, `any_table@kitchen|any_office`). Any instance that fits will do. Within one goal, literals
with the same subject speak of the same instance: "the pie is cooked and on the table" is not met by two pies. A negated
literal is about those same instances; where no positive literal speaks of its subject, it holds when no instance that
fits makes the literal true.
"""

from __future__ import annotations

import enum
import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, Protocol, TypeAlias

import msgspec

from gavel_env.errors import MalformedGoal, UnknownObject, nearest_names
from gavel_env.world_model.actions import normalise_name
from gavel_env.world_model.concepts import OR
from gavel_env.world_model.graph import Flag, Relation, Room, SceneGraph

__all__ = [
    "Condition",
    "Designator",
    "Goal",
    "GoalText",
    "Literal",
    "PREDICATES",
    "Predicate",
    "add_state",
    "as_goal",
    "check_goal",
    "fitting",
    "parse_goal",
    "parse_literal",
    "unmet",
]


class Predicate(enum.Enum):
    """Relations and states that a goal can ask for; the value is the text form."""

    ON_TOP = "on_top"
    INSIDE = "inside"
    UNDER = "under"
    NEXT_TO = "next_to"
    IN_ROOM = "in_room"
    OPEN = "open"
    TOGGLED = "toggled"
    COOKED = "cooked"
    WASHED = "washed"
    DRIED = "dried"
    HOT = "hot"
    FROZEN = "frozen"
    DIRTY = "dirty"

    @property
    def flag(self) -> Flag | None:
        """The unary flag that this predicate reads, or None for a relation."""
        return _FLAGS.get(self)

    @property
    def arity(self) -> int:
        """1 for a state, 2 for a relation."""
        return 1 if self in _FLAGS else 2


_FLAGS = {
    Predicate.OPEN: Flag.OPEN,
    Predicate.TOGGLED: Flag.TOGGLED,
    Predicate.COOKED: Flag.COOKED,
    Predicate.WASHED: Flag.WASHED,
    Predicate.DRIED: Flag.DRIED,
    Predicate.HOT: Flag.HOT,
    Predicate.FROZEN: Flag.FROZEN,
    Predicate.DIRTY: Flag.DIRTY,
}


class Designator(NamedTuple):
    """An instance id, or a category or concept with an optional room (id, type or concept)."""

    name: str
    room: str | None = None

    def __str__(self) -> str:
        return self.name if self.room is None else f"{self.name}@{self.room}"

    @classmethod
    def parse(cls, text: str) -> Designator:
        """Read `name` or `name@room`.

        Raises:
            MalformedGoal: empty name or room, also of one of several.
        """
        name, at, room = normalise_name(text).partition("@")
        if not all(name.split(OR)) or (at and not all(room.split(OR))):
            raise MalformedGoal(f"designator {text!r} needs the form name or name@room")
        return cls(name, room or None)


class Literal(NamedTuple):
    """One goal condition; `str(literal)` is the text form, `not open(fridge)`."""

    predicate: Predicate
    subject: Designator
    object: Designator | None = None
    negated: bool = False

    def __str__(self) -> str:
        arguments = str(self.subject) if self.object is None else f"{self.subject}, {self.object}"
        return f"{'not ' if self.negated else ''}{self.predicate.value}({arguments})"


class Condition(Protocol):
    """A condition beyond literals (the quantified goals of BEHAVIOR activities)."""

    def holds(self, graph: SceneGraph) -> bool:
        """Return whether the condition holds in `graph`."""
        ...

    def wants(self, flag: Flag, obj: str, graph: SceneGraph) -> bool:
        """Return whether the condition asks for `flag` on `obj`."""
        ...

    def text(self) -> str:
        """Return the condition in words."""
        ...


class Goal(msgspec.Struct, frozen=True):
    """A conjunction of literals, and of further conditions if the task has any."""

    literals: tuple[Literal, ...] = ()
    conditions: tuple[Condition, ...] = ()

    def __or__(self, other: Goal) -> Goal:
        """Return the union of two goals, each literal once: g = g_1 U g_2."""
        literals = tuple(dict.fromkeys((*self.literals, *other.literals)))
        return Goal(literals, (*self.conditions, *other.conditions))

    def wants(self, flag: Flag, obj: str, graph: SceneGraph) -> bool:
        """Return whether the goal asks for `flag` on `obj` (then safety does not forbid it)."""
        return any(
            lit.predicate.flag == flag and not lit.negated and obj in fitting(graph, lit.subject)
            for lit in self.literals
        ) or any(condition.wants(flag, obj, graph) for condition in self.conditions)

    @property
    def subjects(self) -> frozenset[Designator]:
        """obj(g): the designators that literals speak of first."""
        return frozenset(lit.subject for lit in self.literals)

    def text(self) -> tuple[str, ...]:
        """Return the literals in text form, and the conditions in words."""
        return (*(str(lit) for lit in self.literals), *(condition.text() for condition in self.conditions))


_LITERAL = re.compile(
    r"\s*+(not\s++|!\s*+|~\s*+)?+([A-Za-z_]++)\s*+\(([^(),]*+)(?:,([^(),]*+))?+\)\s*+\Z",
)
PREDICATES: dict[str, Predicate] = {p.value: p for p in Predicate} | {
    "ontop": Predicate.ON_TOP,
    "on": Predicate.ON_TOP,
    "in": Predicate.INSIDE,
    "object_inside": Predicate.INSIDE,
    "nextto": Predicate.NEXT_TO,
    "room_inside": Predicate.IN_ROOM,
    "inroom": Predicate.IN_ROOM,
    "toggled_on": Predicate.TOGGLED,
}


def add_state(predicate: Predicate, flag: Flag) -> None:
    """Let goals ask for a state of one's own; `own_actions.own_state` is what users call."""
    _FLAGS[predicate] = flag
    PREDICATES[predicate.value] = predicate


def parse_literal(text: str) -> Literal:
    """Read one literal, such as `on_top(apple, kitchen_table)` or `not open(fridge@kitchen)`.

    Raises:
        MalformedGoal: with the text, and what is wrong with it.
    """
    if not isinstance(text, str):
        raise MalformedGoal(f"goal literal {text!r} is not text")
    match = _LITERAL.match(text)
    if match is None or not match.group(3).strip() or not (match.group(4) or "x").strip():
        raise MalformedGoal(
            f"goal {text[:80]!r} is not a literal; write predicate(subject) or predicate(subject, object)"
        )
    negation, name, subject, second = match.groups()
    predicate = PREDICATES.get(name.lower())
    if predicate is None:
        near = nearest_names(name.lower(), PREDICATES)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(p.value for p in Predicate)}"
        raise MalformedGoal(f"unknown predicate {name!r} in goal {text!r}; {hint}")
    count = 1 if second is None else 2
    if count != predicate.arity:
        raise MalformedGoal(f"{predicate.value} in goal {text!r} takes {predicate.arity} argument(s), not {count}")
    obj = None if second is None else Designator.parse(second)
    return Literal(predicate, Designator.parse(subject), obj, negation is not None)


GoalText: TypeAlias = "Goal | Literal | str | Iterable[str | Literal]"
"""What is taken as a goal wherever one is asked for: see `as_goal`."""

_JOINS = re.compile(r"(?<=\))\s*(?:,|;|&+|\n|\band\b)\s*", re.IGNORECASE)


def parse_goal(literals: str | Iterable[str]) -> Goal:
    """Read a goal from its literals in text form: a list of them, or one text with commas, `and` or `&` between them.

    Raises:
        MalformedGoal: as `parse_literal`.
    """
    texts = [part for part in _JOINS.split(literals) if part.strip()] if isinstance(literals, str) else literals
    return Goal(tuple(parse_literal(text) for text in texts))


def as_goal(goal: GoalText) -> Goal:
    """Return a goal that is given as one, as text (`"on_top(vial, rack), not dirty(vial)"`), or as literals.

    Raises:
        MalformedGoal: as `parse_literal`; or nothing is asked for.
    """
    if isinstance(goal, Goal):
        return goal
    if isinstance(goal, Literal):
        return Goal((goal,))
    if isinstance(goal, str):
        read = parse_goal(goal)
    else:
        try:
            read = Goal(tuple(part if isinstance(part, Literal) else parse_literal(part) for part in goal))
        except TypeError:
            raise MalformedGoal(f"goal {goal!r} is not text, a list of texts or a Goal") from None
    if not read.literals:
        raise MalformedGoal("the goal asks for nothing; write predicate(subject) or predicate(subject, object)")
    return read


def check_goal(goal: Goal, graph: SceneGraph) -> None:
    """Check that every literal of a goal speaks of something that the graph has.

    Raises:
        UnknownObject: with the nearest names.
    """
    world = graph.world
    rooms = {r.id for r in world.rooms.values()} | {r.type for r in world.rooms.values()}
    for literal in goal.literals:
        several = (d.room for d in (literal.subject, literal.object) if d and d.room and OR in d.room)
        for room in (room for stated in several for room in stated.split(OR)):
            if not any(known.fits(room) for known in world.rooms.values()):
                raise UnknownObject(room, rooms, f"the goal {literal}")
        for designator in (literal.subject, literal.object):
            if designator is None or fitting(graph, designator):
                continue
            if literal.predicate is Predicate.IN_ROOM and designator is literal.object:
                if not any(room.fits(str(designator)) for room in world.rooms.values()):
                    raise UnknownObject(str(designator), rooms, f"the goal {literal}")
                continue
            if designator.room is not None and world.instances(designator.name):
                continue
            raise UnknownObject(str(designator), {*world.nodes, *world.by_category}, f"the goal {literal}")


def fitting(graph: SceneGraph, designator: Designator) -> tuple[str, ...]:
    """Return the instances that fit a designator, in the graph's order."""
    world = graph.world
    text = str(designator)
    if text in world.nodes:
        return (text,)
    name, room = designator
    if name in world.nodes:
        candidates: tuple[str, ...] = (name,)
    else:
        candidates = world.instances(name)
    if room is None:
        return candidates
    return tuple(c for c in candidates if _in_room(graph, c, room))


def _in_room(graph: SceneGraph, obj: str, room: str) -> bool:
    where = graph.room_of(obj)
    if where is None:
        stated = graph.world.nodes[obj].stated_room
        return stated is not None and Room(stated, stated).fits(room)
    return graph.world.rooms[where].fits(room)


def _on_top(graph: SceneGraph, a: str, b: str) -> bool:
    return graph.supports.get(a) == (Relation.ON_TOP, b)


def _inside(graph: SceneGraph, a: str, b: str) -> bool:
    return graph.supports.get(a) == (Relation.INSIDE, b)


_RELATIONS: Mapping[Predicate, Callable[[SceneGraph, str, str], bool]] = {
    Predicate.ON_TOP: _on_top,
    Predicate.INSIDE: _inside,
    Predicate.UNDER: lambda graph, a, b: graph.beneath(a, b),
    Predicate.NEXT_TO: lambda graph, a, b: graph.beside(a, b),
}


def _true_for(graph: SceneGraph, literal: Literal, subject: str, bound: Mapping[Designator, str]) -> bool:
    """Return whether the literal (negation aside) is true of `subject`."""
    flag = _FLAGS.get(literal.predicate)
    if flag is not None:
        return graph.has(flag, subject)
    assert literal.object is not None
    if literal.predicate is Predicate.IN_ROOM:
        return _in_room(graph, subject, str(literal.object))
    related = _RELATIONS[literal.predicate]
    if literal.object in bound:
        return related(graph, subject, bound[literal.object])
    return any(related(graph, subject, other) for other in fitting(graph, literal.object))


def _holds(graph: SceneGraph, literal: Literal, bound: Mapping[Designator, str]) -> bool:
    if literal.subject in bound:
        return _true_for(graph, literal, bound[literal.subject], bound) != literal.negated
    return any(_true_for(graph, literal, s, bound) for s in fitting(graph, literal.subject)) != literal.negated


_MOST_BINDINGS = 20_000


def unmet(goal: GoalText, graph: SceneGraph) -> tuple[Literal | Condition, ...]:
    """Return the conditions of `goal` that do not hold in `graph`, in the order written; empty = the goal is met.

    Subjects with several fitting instances are bound to the instances that leave the fewest literals unmet (the first
    such binding in graph order; at most 20,000 bindings are tried).
    """
    goal = as_goal(goal)
    positive = dict.fromkeys(lit.subject for lit in goal.literals if not lit.negated)
    choices = {d: found for d in positive if (found := fitting(graph, d))}
    open_choices = {d: found for d, found in choices.items() if len(found) > 1}
    bound = {d: found[0] for d, found in choices.items()}
    missing = _missing(goal, graph, bound)
    if missing and open_choices:
        for combination in itertools.islice(itertools.product(*open_choices.values()), 1, _MOST_BINDINGS):
            tried = bound | dict(zip(open_choices, combination, strict=True))
            left = _missing(goal, graph, tried)
            if len(left) < len(missing):
                missing = left
                if not missing:
                    break
    others = tuple(c for c in goal.conditions if not c.holds(graph))
    return (*missing, *others)


def _missing(goal: Goal, graph: SceneGraph, bound: Mapping[Designator, str]) -> tuple[Literal, ...]:
    return tuple(lit for lit in goal.literals if not _holds(graph, lit, bound))
