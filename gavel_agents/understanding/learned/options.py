"""What a text may be asking for: for each thing its possible places, for each piece its possible states."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from gavel_agents.understanding.learned.spotted import KINDS, Mention, Spotted
from gavel_agents.understanding.rules.nouns import kinds_of
from gavel_env.world_model.goals import Predicate

__all__ = ["STATES", "WISHES", "Group", "Place", "able", "groups", "kinds_for", "places_for", "rooms_of"]

STATES = (Predicate.WASHED, Predicate.DRIED, Predicate.COOKED)
WISHES = (None, (Predicate.TOGGLED, False), (Predicate.TOGGLED, True), (Predicate.OPEN, False), (Predicate.OPEN, True))
"""What may be wished of a piece, as predicate and whether it is negated."""


class Group(NamedTuple):
    """Mentions of the same movable thing, as indices of mentions."""

    name: str
    mentions: tuple[int, ...]


class Place(NamedTuple):
    """A mention that something may go to: its index, and 0 = on top, 1 = inside (or in a room)."""

    mention: int
    inside: int


def groups(read: Spotted) -> list[Group]:
    """Return the movable things that a text names, in the order first named."""
    found: dict[str, list[int]] = {}
    for index, mention in enumerate(read.mentions):
        if mention.movable:
            found.setdefault(mention.name, []).append(index)
    return [Group(name, tuple(mentions)) for name, mentions in found.items()]


@cache
def able(name: str, what: str) -> bool:
    """Return whether any kind of a thing has an ability: `surface`, `interior`, `toggleable`, `openable`."""
    return any(getattr(kind, what) for kind in kinds_of(name))


def places_for(read: Spotted, group: Group) -> list[Place]:
    """Return where a thing may go, or may be said to be."""
    found = []
    for index, mention in enumerate(read.mentions):
        if mention.name == group.name:
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
    """Return the kinds that a mention may be told to be; "" is what it says by itself."""
    return KINDS if mention.cabinet else ("",)


def rooms_of(read: Spotted) -> Iterator[int]:
    """Yield the indices of rooms."""
    yield from (index for index, mention in enumerate(read.mentions) if mention.room)
