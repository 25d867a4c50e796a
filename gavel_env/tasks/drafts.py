"""A draft: what one instruction has used so far, and the draws that keep it consistent.

Within an instruction no two errands share an object, every movable category stands for one instance in the whole house,
and no furniture category is referred to in two rooms. A container with a door that is named as a source is the only
instance that fits its designator.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from functools import lru_cache
from hashlib import blake2b
from typing import Literal, NamedTuple

import numpy as np

from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.placements import House, Piece, Place, pick

__all__ = ["Draft", "PlaceTest", "Reference", "Split", "Stated", "Thing", "pair_split"]

Split = Literal["benchmark", "validation", "train"]
Stated = Literal["no", "support", "room"]

# Shares of all pairs of categories, in percent: no pair occurs in the sentences of two splits.
_PAIR_SHARES: tuple[tuple[Split, int], ...] = (("benchmark", 46), ("validation", 14), ("train", 40))


@lru_cache(maxsize=200_000)
def pair_split(a: str, b: str) -> Split:
    """Return the split that a pair of categories belongs to, by a hash of their names."""
    digest = blake2b("|".join(sorted((a, b))).encode(), digest_size=4).digest()
    percent = int.from_bytes(digest, "big") % 100
    for split, share in _PAIR_SHARES:
        if percent < share:
            return split
        percent -= share
    raise AssertionError(percent)


class Reference(NamedTuple):
    """A piece of furniture as the sentence names it: with its room (type) or without."""

    piece: Piece
    room: str | None

    def __str__(self) -> str:
        category = self.piece.category
        return category if self.room is None else f"{category}@{self.room}"


class Thing(NamedTuple):
    """A movable of the instruction.

    Attributes:
        category: its category, unique in the house.
        id: its instance id.
        start: where it is at the start.
        stated: whether the sentence says where it is: not at all, the support, or the room.
        source: how the sentence names the support, if it does.
    """

    category: str
    id: str
    start: Place
    stated: Stated = "no"
    source: Reference | None = None

    def relation(self) -> str | None:
        """Return the stated relation in text form, or None."""
        if self.stated == "room":
            return f"in_room({self.category}, {self.start.room_type})"
        if self.source is not None:
            return f"{'inside' if self.start.relation == 'in' else 'on_top'}({self.category}, {self.source})"
        return None


PlaceTest = Callable[[Place], bool]


class Draft:
    """The random draws of one instruction.

    Attributes:
        house: where it plays.
        rng: source of randomness.
        split: pairs of categories are drawn from this split only; None = from all.
        say_room: probability that a reference says its room where both are possible.
        surprise: probability that a thing starts on any open support alike, whatever the evidence says.
        things: movables placed so far.
        references: furniture referred to so far, by category.
    """

    def __init__(
        self,
        house: House,
        rng: np.random.Generator,
        *,
        split: Split | None = None,
        say_room: float = 0.46,
        surprise: float = 0.1,
    ) -> None:
        self.house = house
        self.rng = rng
        self.split = split
        self.say_room = say_room
        self.surprise = surprise
        self.things: list[Thing] = []
        self.references: dict[str, Reference] = {}

    def pairs_fit(self, categories: Iterable[str]) -> bool:
        """Return whether every pair of these categories belongs to the draft's split."""
        if self.split is None:
            return True
        names = sorted(set(categories))
        return all(pair_split(a, b) == self.split for i, a in enumerate(names) for b in names[i + 1 :])

    def category(self, themes: Iterable[Theme], beside: Iterable[str] = ()) -> str | None:
        """Draw a movable category of the themes that is not used yet and pairs with `beside`, or None."""
        words, wanted, others = self.house.vocabulary.movables, set(themes), tuple(beside)
        used = {thing.category for thing in self.things}
        options = [
            c
            for c in self.house.movables
            if words[c].theme in wanted
            and c not in used
            and (self.split is None or all(pair_split(c, o) == self.split for o in others if o != c))
        ]
        return pick(self.rng, options) if options else None

    def refer(self, piece: Piece, *, source: bool = False) -> Reference | None:
        """Return how the sentence names a piece, or None if it cannot be named unambiguously.

        A destination may be any instance that fits. A source must be unique under its designator if it has a door,
        and its room must be clear if it has none.
        """
        house, category = self.house, piece.category
        known = self.references.get(category)
        if known is not None:
            if known.piece.room != piece.room or (source and not self._clear(piece, known.room)):
                return None
            return Reference(piece, known.room)
        if source and not self._clear(piece, None):
            if not self._clear(piece, piece.room_type):
                return None
            return Reference(piece, piece.room_type)
        say = self.rng.random() < self.say_room
        if not source and not say and len(set(house.rooms_with(category))) > 3:
            say = True  # "the chair" of a house with chairs everywhere wants its room
        return Reference(piece, piece.room_type if say else None)

    def _clear(self, piece: Piece, room_type: str | None) -> bool:
        rooms = self.house.rooms_with(piece.category, room_type)
        if self.house.ontology[piece.category].has_door:
            return len(rooms) == 1
        return len(set(rooms)) == 1

    def note(self, *references: Reference | None) -> bool:
        """Keep references of a finished errand; return False if two of them clash."""
        for reference in references:
            if reference is None:
                continue
            known = self.references.setdefault(reference.piece.category, reference)
            if known.piece.room != reference.piece.room or known.room != reference.room:
                return False
        return True

    def start(self, category: str, test: PlaceTest) -> Place | None:
        """Draw where a movable starts among the places that pass the test, or None if evidence knows none of them."""
        places, weights = self.house.places(category)
        options = [(p, w) for p, w in zip(places, weights, strict=True) if w > 0 and test(p)]
        if not options:
            return None
        if self.rng.random() < self.surprise:
            anywhere = [p for p, _ in options if p.relation == "on"]
            if anywhere:
                return pick(self.rng, anywhere)
        return pick(self.rng, [p for p, _ in options], [w for _, w in options])

    def destination(self, categories: Iterable[str], test: PlaceTest, but: Collection[str] = ()) -> Place | None:
        """Draw a place where all of the movable categories may well be put, or None.

        Args:
            categories: of the movables.
            test: of the place.
            but: furniture categories that will not do.
        """
        house, names = self.house, tuple(categories)
        tables = [house.places(c, as_goal=True) for c in names]
        options: list[tuple[Place, float]] = []
        for index, place in enumerate(tables[0][0]):
            weight = min(table[1][index] for table in tables)
            if weight > 0 and place.piece is not None and place.piece.category not in but and test(place):
                options.append((place, weight**0.5))
        options = [(p, w) for p, w in options if p.piece and all(self.pairs_fit((n, p.piece.category)) for n in names)]
        return pick(self.rng, [p for p, _ in options], [w for _, w in options]) if options else None

    def nearest(self, reference: Reference, things: Iterable[Thing]) -> Reference:
        """Return the reference with the piece, of those that fit it, to which the things are carried the least."""
        known = self.references.get(reference.piece.category)
        if known is not None:
            return reference._replace(piece=known.piece)
        house, starts = self.house, [t.start for t in things]
        options = [
            p for p in house.pieces if p.category == reference.piece.category and reference.room in (None, p.room_type)
        ]
        return reference._replace(piece=min(options, key=lambda p: (sum(house.travel_m(s, p) for s in starts), p.id)))

    def thing(self, category: str, start: Place, *, say: float = 0.35, say_room_only: float = 0.12) -> Thing | None:
        """Return the movable at its start, with what the sentence will say of it; None if that cannot be said.

        Args:
            category: of the movable.
            start: where it starts; behind a door it must be said.
            say: probability that the support is said.
            say_room_only: probability that only the room is said.
        """
        shut = self.house.shuts(start)
        draw = self.rng.random()
        stated: Stated = "support" if draw < say else "room" if draw < say + say_room_only else "no"
        if shut:
            stated = "support"
        if stated == "support" and start.relation == "floor":
            stated = "room"
        source: Reference | None = None
        if stated == "support":
            assert start.piece is not None
            source = self.refer(start.piece, source=True)
            if source is not None and not self.pairs_fit((category, start.piece.category)):
                source = None
            if source is None:
                if shut:
                    return None
                stated = "no"
        return Thing(category, f"{category}_0", start, stated, source)
