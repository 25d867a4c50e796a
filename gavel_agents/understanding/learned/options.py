"""What a text may be asking for: for each thing its possible places, for each piece its possible states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from gavel_agents.understanding.learned.spotted import KINDS, Mention, Spotted
from gavel_agents.understanding.rules.nouns import kinds_of
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import Designator, Predicate
from gavel_env.world_model.ontology import category_of

__all__ = [
    "MOST_KINDS",
    "NO_ROOM",
    "STATES",
    "UNNAMED_ROOMS",
    "WISHES",
    "Group",
    "Place",
    "able",
    "groups",
    "kinds_for",
    "members",
    "own_kinds",
    "piece_of",
    "places_for",
    "rooms_for",
    "rooms_of",
    "unnamed_rooms",
    "wishes_for",
]

STATES = (Predicate.WASHED, Predicate.DRIED, Predicate.COOKED)
WISHES = (None, (Predicate.TOGGLED, False), (Predicate.TOGGLED, True), (Predicate.OPEN, False), (Predicate.OPEN, True))
"""What may be wished of a piece, as predicate and whether it is negated."""


MOST_KINDS = 8
"""Most kinds that a mention may be told to be."""
UNNAMED_ROOMS = (
    "bathroom", "bedroom", "childs_room", "corridor", "dining_room", "garage", "garden", "kitchen", "living_room",
    "private_office", "shared_office", "playroom", "storage_room", "utility_room", "television_room", "entryway",
    "break_room", "lobby", "closet", "pantry_room", "exercise_room", "meeting_room",
)  # fmt: skip
"""Rooms that may be meant though no word names them: `her bed`, `by the front door`, `the dining table`."""
NO_ROOM = -1
"""Index of no room; the rooms of a text have those of their mentions, `UNNAMED_ROOMS` come before it: -2, -3, ..."""


class Group(NamedTuple):
    """Mentions of the same movable thing, as indices of mentions."""

    name: str
    mentions: tuple[int, ...]


class Place(NamedTuple):
    """A mention that something may go to: its index, and 0 = on top, 1 = inside (or in a room)."""

    mention: int
    inside: int


def groups(read: Spotted) -> list[Group]:
    """Return the movable things that a text names, in the order first named.

    A wider word, or one for what holds it, speaks of the one thing that it may mean: `the coffee cup ... the cup`,
    `mayonnaise ... the bottle`. So does the last word of its name: `the baking sheet ... the sheet`.
    """
    found: dict[str, list[int]] = {}
    for index, mention in enumerate(read.mentions):
        if mention.movable:
            found.setdefault(mention.name, []).append(index)
    for name in list(found):
        same = [other for other in found if other != name and _shortens(read, found[name], found[other])]
        if len(same) == 1:
            found[same[0]] = sorted(found[same[0]] + found.pop(name))
    for name in sorted(found, key=lambda name: -len(members(name))):
        holder = read.mentions[found[name][0]].text.split()[-1].removesuffix("s")
        same = [o for o in found if o != name and (members(o) & members(name) or _comes_in(o, holder))]
        if len(same) == 1 and len(members(same[0])) < len(members(name)):
            found[same[0]] = sorted(found[same[0]] + found.pop(name))
    return sorted((Group(name, tuple(mentions)) for name, mentions in found.items()), key=lambda group: group.mentions)


def _shortens(read: Spotted, later: Sequence[int], first: Sequence[int]) -> bool:
    """Return whether a thing is called by one word, the last one of what a thing before it is called."""
    words = {read.mentions[index].text.removesuffix("s") for index in later}
    name = read.mentions[first[0]].text.split()
    return later[0] > first[0] and len(name) > 1 and words == {name[-1].removesuffix("s")}


_HOLDERS = frozenset({"bag", "bottle", "box", "can", "carton", "jar", "tube"})


@cache
def _comes_in(name: str, holder: str) -> bool:
    """Return whether a thing may be told by what holds it."""
    return holder in _HOLDERS and any(c.startswith(f"{holder}_of_") or c.endswith(f"_{holder}") for c in members(name))


@cache
def members(name: str) -> frozenset[str]:
    """Return the categories that a name may mean."""
    return frozenset(default_concepts().categories(category_of(name)))


@cache
def able(name: str, what: str) -> bool:
    """Return whether any kind of a thing has an ability: `surface`, `interior`, `toggleable`, `openable`."""
    return any(getattr(kind, what) for kind in kinds_of(name))


def places_for(read: Spotted, group: Group) -> list[Place]:
    """Return where a thing may go, or may be said to be."""
    found = []
    for index, mention in enumerate(read.mentions):
        if index in group.mentions:
            continue
        if mention.room:
            found.append(Place(index, 1))
            continue
        if able(mention.name, "surface") or mention.cabinet:
            found.append(Place(index, 0))
        if able(mention.name, "interior"):
            found.append(Place(index, 1))
    return found


def kinds_for(mention: Mention) -> tuple[str, ...]:
    """Return the kinds that a mention may be told to be, at most `MOST_KINDS`; "" is what it says by itself."""
    return _kinds_for(mention.name, mention.wider, mention.cabinet, mention.movable or mention.room)


@cache
def _kinds_for(name: str, wider: str, cabinet: bool, one: bool) -> tuple[str, ...]:
    if one:
        return ("",)
    said = KINDS if cabinet else ("", wider) if wider else ("",)
    known = default_vocabulary().furniture
    others = (c for c in default_concepts().categories(wider or name) if c in known and c not in (name, *said))
    return (*said, *others)[:MOST_KINDS]


def own_kinds(mention: Mention) -> int:
    """Return how many of the kinds of a mention its word names by itself; the others are told by what is said of it."""
    return len(KINDS) if mention.cabinet else 1 + bool(mention.wider)


def wishes_for(mention: Mention) -> tuple[int, ...]:
    """Return the indices of the wishes that a mention may have; a room's light may be wished on or off."""
    return (0, 1, 2) if mention.room else tuple(range(len(WISHES)))


def piece_of(read: Spotted, mention: Mention, room: str | None, kind: str = "") -> Designator:
    """Return what a wish about a mention is about: the piece, or the switch of a room's light."""
    if mention.room:
        return Designator("electric_switch", mention.name)
    return Designator(read.named(mention, room, kind), room)


def rooms_for(read: Spotted, mention: Mention) -> list[tuple[int, str | None]]:
    """Return the rooms that a piece may be said to stand in, as indices and types."""
    if mention.room or mention.movable:
        return [(NO_ROOM, None)]
    return [(NO_ROOM, None), *rooms_of(read), *unnamed_rooms(read)]


def rooms_of(read: Spotted) -> list[tuple[int, str]]:
    """Return the rooms that a text names, as indices of mentions and types."""
    return [(index, mention.name) for index, mention in enumerate(read.mentions) if mention.room]


def unnamed_rooms(read: Spotted) -> list[tuple[int, str]]:
    """Return the rooms of the house that may be meant though the text does not name them."""
    named = {type_ for m in read.mentions if m.room for type_ in default_concepts().room_types(m.name)}
    house = read.house or Counter[str]()
    return [(-2 - k, r) for k, r in enumerate(UNNAMED_ROOMS) if house[r] and r not in named]
