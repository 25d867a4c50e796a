"""What the network is trained to say of a text: which of its options are what was meant, in that house."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple, TypeVar

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.learned.options import (
    NO_ROOM,
    STATES,
    WISHES,
    Group,
    groups,
    kinds_for,
    members,
    own_kinds,
    piece_of,
    places_for,
    rooms_for,
)
from gavel_agents.understanding.learned.spotted import Mention, Spotted, spotted
from gavel_agents.understanding.pairs import Denotes, Extent, Sample
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import Designator, Literal, Predicate, fitting, parse_literal
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.ontology import category_of

__all__ = ["Choice", "Example", "example_of"]

Choice = tuple[int, int, int, int]
"""Mention of a place, inside or not, index of its kind, index of its room (`options.NO_ROOM`: none)."""


_Found = TypeVar("_Found")


class Item(NamedTuple):
    """A thing with where it shall go, where it is said to be, what it shall become, and how many are meant."""

    group: Group
    to: frozenset[Choice]
    origin: frozenset[Choice]
    told_origin: bool
    states: tuple[int, int, int]
    number: int


class Wish(NamedTuple):
    """Any one of some (mention, kind, room) shall have a wish."""

    any_of: frozenset[tuple[int, int, int]]
    wish: int


class Example(NamedTuple):
    """A text with what is meant. `whole` is False where the options cannot say all of it."""

    id: str
    read: Spotted
    items: tuple[Item, ...]
    wishes: tuple[Wish, ...]
    whole: bool


class _House:
    """What names denote in the house of a sample, or by themselves."""

    def __init__(self, sample: Sample) -> None:
        self.graph: SceneGraph | None = None
        self.house: Counter[str] | None = None
        if sample.instruction is not None:
            scene = load_scene(sample.instruction.scene)
            self.graph = instruction_graph(scene, sample.instruction)
            self.house = Counter(room.type for room in scene.rooms)
        self._known: dict[str, frozenset[str]] = {}

    def of(self, name: str, room: str | None = None) -> frozenset[str]:
        key = f"{name}@{room}" if room else name
        if key not in self._known:
            if self.graph is None:
                self._known[key] = frozenset({key})
            else:
                self._known[key] = frozenset(fitting(self.graph, Designator(name, room))) or frozenset({key})
        return self._known[key]

    def rooms(self, name: str) -> frozenset[str]:
        if self.graph is None:
            return frozenset({name})
        return frozenset(r.id for r in self.graph.world.rooms.values() if r.fits(name)) or frozenset({name})


def _same(name: str, meant: str) -> bool:
    return bool(members(name) & members(meant))


def _bounds(house: _House, sample: Sample) -> list[tuple[Literal, Denotes]]:
    found = []
    for task in sample.tasks:
        for index, text in enumerate(task.goal):
            literal = parse_literal(text)
            if index < len(task.denotes) and len(task.denotes) == len(task.goal):
                found.append((literal, task.denotes[index]))
                continue
            found.append((literal, _exactly(house, literal)))
    return found


def _exactly(house: _House, literal: Literal) -> Denotes:
    subject = _extent(house, literal.subject)
    target = Extent()
    if literal.object is not None and literal.predicate is Predicate.IN_ROOM:
        rooms = house.rooms(str(literal.object))
        target = Extent(rooms, rooms)
    elif literal.object is not None:
        target = _extent(house, literal.object)
    return Denotes((literal.predicate.value,), subject, target, literal.negated)


def _extent(house: _House, designator: Designator) -> Extent:
    """Return what a name denotes at least, and at most: people may use a wider word for it, not another room."""
    least = house.of(designator.name, designator.room)
    wider = default_concepts().of_category(category_of(designator.name)) if house.graph is not None else ()
    alike = (house.of(concept, designator.room) for concept in wider)
    return Extent(least, least.union(*(found for found in alike if least <= found)))


def _within(found: frozenset[str], bound: Extent) -> bool:
    return bound.least <= found <= bound.most


def _choices(house: _House, read: Spotted, group: Group, bound: Denotes, *, loose: bool = False) -> frozenset[Choice]:
    """Return the places that a bound may mean: those that mean just it by what is said, if there are any."""
    found: dict[Choice, int] = {}
    for place, inside in places_for(read, group):
        mention = read.mentions[place]
        if mention.room:
            if "in_room" in bound.predicates and house.rooms(mention.name) & bound.object.most:
                found[place, inside, 0, NO_ROOM] = 0
            continue
        if ("inside" if inside else "on_top") not in bound.predicates:
            continue
        for kind, room, denoted in _denoted(house, read, mention):
            if loose and denoted & bound.object.most and kind < own_kinds(mention) and room >= NO_ROOM:
                found[place, inside, kind, room] = 0
            elif (rank := _rank(denoted, bound.object, mention, kind, room)) is not None:
                found[place, inside, kind, room] = rank
    return _first(found)


def _denoted(house: _House, read: Spotted, mention: Mention) -> Iterator[tuple[int, int, frozenset[str]]]:
    """Yield for each kind and room that may be told of a mention what it then denotes."""
    for which, kind in enumerate(kinds_for(mention)):
        for room, type_ in rooms_for(read, mention):
            piece = piece_of(read, mention, type_, kind)
            yield which, room, house.of(piece.name, piece.room)


def _rank(denoted: frozenset[str], bound: Extent, mention: Mention, kind: int, room: int) -> int | None:
    """Return how readily something is said in this way, 0 first, or None if it does not mean what is meant.

    Just that by what is named; by a kind that no word names; more or less that by what is named; in a room that no
    word names.
    """
    exact, unnamed = denoted == bound.least, room < NO_ROOM
    told = kind >= own_kinds(mention)
    if exact:
        return (4 if told else 3) if unnamed else int(told)
    return 2 if not unnamed and not told and _within(denoted, bound) else None


def _first(found: Mapping[_Found, int]) -> frozenset[_Found]:
    first = min(found.values(), default=0)
    return frozenset(one for one, rank in found.items() if rank == first)


def example_of(sample: Sample) -> Example | None:
    """Return a sample as an example, or None if its words cannot be read at all."""
    house = _House(sample)
    try:
        read = spotted(sample.text, house.house)
    except Abstention:
        return None
    whole = True
    meant = _bounds(house, sample)
    told = [parse_literal(text) for task in sample.tasks for text in task.relations]
    unsaid = sample.instruction is not None and sample.split == "train"
    things = groups(read)
    to: dict[str, frozenset[Choice]] = {}
    states: dict[str, list[int]] = {g.name: [0, 0, 0] for g in things}
    count: Counter[tuple[str, str]] = Counter()
    wishes: list[Wish] = []
    for literal, bound in meant:
        fit = [g for g in things if _fits(house, g, literal, bound)]
        if literal.predicate in (Predicate.ON_TOP, Predicate.INSIDE, Predicate.IN_ROOM):
            chosen = {g.name: c for g in fit if (c := _choices(house, read, g, bound))}
            if not chosen:
                whole = False
                continue
            exact = [n for n in chosen if not n.startswith("any_")] or list(chosen)
            name = exact[0]
            before = to.get(name)
            both = chosen[name] if before is None else before & chosen[name]
            whole = whole and bool(both)
            to[name] = both or chosen[name]
            count[name, "place"] += 1
        elif literal.predicate in STATES and not literal.negated:
            if not fit:
                whole = False
                continue
            states[fit[0].name][STATES.index(literal.predicate)] = 1
            count[fit[0].name, literal.predicate.value] += 1
        elif (literal.predicate, literal.negated) in WISHES:
            any_of = _pieces(house, read, bound)
            whole = whole and bool(any_of)
            if any_of:
                wishes.append(Wish(any_of, WISHES.index((literal.predicate, literal.negated))))
        else:
            whole = False
    origins: dict[str, frozenset[Choice]] = {}
    if unsaid:
        ends = {choice[0] for choices in to.values() for choice in choices}
        origins = {g.name: _starts(house, read, g, sample) for g in things}
    for literal in told:
        for g in things:
            if _same(g.name, literal.subject.name):
                found = _choices(house, read, g, _exactly(house, literal), loose=True)
                if found:
                    origins[g.name] = found
    several: Counter[str] = Counter()
    for (name, _), number in count.items():
        several[name] = max(several[name], number)
    items = tuple(
        Item(
            g, to.get(g.name, frozenset()),
            frozenset() if unsaid and any(c[0] in ends for c in origins[g.name]) else origins.get(g.name, frozenset()),
            bool(origins[g.name]) if unsaid else any(_same(g.name, literal.subject.name) for literal in told),
            (states[g.name][0], states[g.name][1], states[g.name][2]), max(1, min(3, several[g.name])),
        )
        for g in things
    )  # fmt: skip
    return Example(sample.id, read, items, tuple(wishes), whole and bool(meant))


def _starts(house: _House, read: Spotted, group: Group, sample: Sample) -> frozenset[Choice]:
    """Return what the text may say of where a thing starts, if only where it does start is known."""
    assert sample.instruction is not None
    assert house.graph is not None
    found: set[Choice] = set()
    for placement in sample.instruction.placements:
        if not _same(group.name, placement.category):
            continue
        if placement.relation == "floor":
            room, pieces = placement.target, frozenset[Choice]()
        else:
            here = Extent(frozenset({placement.target}), frozenset({placement.target}))
            predicate = "on_top" if placement.relation == "on" else "inside"
            pieces = _choices(house, read, group, Denotes((predicate,), Extent(), here), loose=True)
            room = house.graph.room_of(placement.target) or ""
        in_room = Denotes(("in_room",), Extent(), Extent(frozenset({room}), frozenset({room})))
        found |= pieces or _choices(house, read, group, in_room)
    return frozenset(found)


def _fits(house: _House, group: Group, literal: Literal, bound: Denotes) -> bool:
    if not _same(group.name, literal.subject.name):
        return False
    return house.graph is None or bool(house.of(group.name) & bound.subject.most)


def _pieces(house: _House, read: Spotted, bound: Denotes) -> frozenset[tuple[int, int, int]]:
    found: dict[tuple[int, int, int], int] = {}
    for index, mention in enumerate(read.mentions):
        if (mention.movable or mention.room) and "toggled" not in bound.predicates:
            continue
        for kind, room, denoted in _denoted(house, read, mention):
            if (rank := _rank(denoted, bound.subject, mention, kind, room)) is not None:
                found[index, kind, room] = rank
    of_things = {one: rank for one, rank in found.items() if not read.mentions[one[0]].room}
    return _first(of_things or found)
