"""Concepts: what a word of people may mean, where the scenes know only kinds of it.

People say cabinet, lamp, bin and office; the houses have bottom_cabinet_no_top, standing_tv, public_trash_can and
private_office. A *concept* is a named set of categories (`any_cabinet`) or of room types (`any_office`). Its name may
stand wherever the name of a category or of a room does: `any_cabinet@kitchen`, `mug@any_office`,
`in_room(mug, any_office)`. The prefix keeps both apart: `fridge` stays the one category of that name, `any_sink` is
whatever people call a sink. Where either of several will do, `|` stands between them: `any_table@bedroom|any_office`.

The table is data (`envs_data/concepts.json`, docs/explanation/concepts.md): words and phrases in the singular, each
with what it names, and the concepts with their members, the one that people think of first in front.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import msgspec

from gavel_env.data import read_json, shipped_data
from gavel_env.errors import DataError, UnknownConcept

__all__ = [
    "OR",
    "PREFIX",
    "Concept",
    "Concepts",
    "Meaning",
    "any_of",
    "default_concepts",
    "in_words",
    "is_concept",
    "load_concepts",
    "normal_phrase",
    "singulars",
]

FORMAT = "gavel-concepts/1"
PREFIX = "any_"
OR = "|"
"""Between names of which any will do: `bedroom|any_office`."""


def is_concept(name: str) -> bool:
    """Return whether a name is of a concept (`any_cabinet`, `desk|bed`) rather than of one category or room type."""
    return name.startswith(PREFIX) or OR in name


def any_of(*names: str) -> str:
    """Return the name of any of several: `any_of("bedroom", "any_office")` is `bedroom|any_office`."""
    return OR.join(dict.fromkeys(part for name in names for part in name.split(OR)))


def in_words(name: str) -> str:
    """Return a name as people write it: `any_office` -> `office`, `desk|night_stand` -> `desk or night stand`."""
    return " or ".join(part.removeprefix(PREFIX).replace("_", " ") for part in name.split(OR))


class Concept(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A named set of categories or of room types.

    Attributes:
        members: what it stands for; the one that people think of first in front.
        also: what the word is stretched to where no member will do, best first. No part of the set: only
            `Concepts.narrow_room` and `narrow_thing` turn to it.
    """

    members: tuple[str, ...]
    also: tuple[str, ...] = ()


class Meaning(NamedTuple):
    """What a word or phrase names.

    Attributes:
        thing: a category or a concept over categories, or None.
        place: a room type or a concept over room types, or None.
    """

    thing: str | None = None
    place: str | None = None


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format: str
    provenance: str
    things: dict[str, Concept]
    places: dict[str, Concept]
    thing_words: dict[str, str]
    place_words: dict[str, str]
    plurals: dict[str, str]


_APOSTROPHES = str.maketrans("", "", "'’`´")
_GAPS = re.compile(r"[\s_\-]+")


def normal_phrase(phrase: str) -> str:
    """Return a phrase as the table writes it: `Kids'_Room` -> `kids room`."""
    return _GAPS.sub(" ", phrase.translate(_APOSTROPHES).lower()).strip()


class Concepts:
    """The table of words and concepts.

    Attributes:
        things: concepts over categories, by name; a lone category that has an `also` stands under its own name.
        places: likewise over room types.
        thing_words, place_words: phrase in the singular (`normal_phrase`) -> what it names.
        plurals: irregular plural of a single word -> its singular.
        provenance: where the table comes from.
    """

    def __init__(
        self,
        things: Mapping[str, Concept],
        places: Mapping[str, Concept],
        thing_words: Mapping[str, str],
        place_words: Mapping[str, str],
        plurals: Mapping[str, str],
        provenance: str = "",
    ) -> None:
        self.things = MappingProxyType(dict(things))
        self.places = MappingProxyType(dict(places))
        self.thing_words = MappingProxyType(dict(thing_words))
        self.place_words = MappingProxyType(dict(place_words))
        self.plurals = MappingProxyType(dict(plurals))
        self.provenance = provenance

    # --- words ---------------------------------------------------------------------------------------------------

    def meaning(self, phrase: str) -> Meaning:
        """Return what a word or phrase names, singular or plural, in any case; both parts None if nothing."""
        return Meaning(self._named(phrase, self.thing_words), self._named(phrase, self.place_words))

    def _named(self, phrase: str, words: Mapping[str, str]) -> str | None:
        forms = tuple(singulars(normal_phrase(phrase), self.plurals))
        for form in forms:
            if form in words:
                return words[form]
        joined = self._joined_things if words is self.thing_words else self._joined_places
        return next((joined[key] for form in forms if (key := form.replace(" ", "")) in joined), None)

    @cached_property
    def _joined_things(self) -> Mapping[str, str]:
        return _joined(self.thing_words)

    @cached_property
    def _joined_places(self) -> Mapping[str, str]:
        return _joined(self.place_words)

    def words(self, name: str) -> tuple[str, ...]:
        """Return the phrases that name a category, room type or concept, in alphabetical order."""
        return self._words.get(name, ())

    @cached_property
    def _words(self) -> Mapping[str, tuple[str, ...]]:
        found: dict[str, set[str]] = {}
        for words in (self.thing_words, self.place_words):
            for phrase, name in words.items():
                found.setdefault(name, set()).add(phrase)
        return {name: tuple(sorted(phrases)) for name, phrases in found.items()}

    # --- sets ----------------------------------------------------------------------------------------------------

    def categories(self, name: str) -> tuple[str, ...]:
        """Return the categories that a name stands for: those of a concept, or the category itself.

        Raises:
            UnknownConcept: the table has no concept of this name.
        """
        return self._members(name, self.things)

    def room_types(self, name: str) -> tuple[str, ...]:
        """Return the room types that a name stands for: those of a concept, or the type itself.

        Raises:
            UnknownConcept: the table has no concept of this name.
        """
        return self._members(name, self.places)

    def _members(self, name: str, table: Mapping[str, Concept]) -> tuple[str, ...]:
        if not is_concept(name):
            return (name,)
        if OR in name:
            return tuple(dict.fromkeys(m for part in name.split(OR) for m in self._members(part, table)))
        if name not in table:
            raise UnknownConcept(name, table)
        return table[name].members

    def of_category(self, category: str) -> frozenset[str]:
        """Return the concepts that a category belongs to."""
        return self._of_category.get(category, frozenset())

    def of_room_type(self, room_type: str) -> frozenset[str]:
        """Return the concepts that a room type belongs to."""
        return self._of_room_type.get(room_type, frozenset())

    @cached_property
    def _of_category(self) -> Mapping[str, frozenset[str]]:
        return _inverted(self.things)

    @cached_property
    def _of_room_type(self) -> Mapping[str, frozenset[str]]:
        return _inverted(self.places)

    # --- narrowing -----------------------------------------------------------------------------------------------

    def narrow_room(self, name: str, room_types: Collection[str]) -> str:
        """Return what a room's name comes to in a house whose room types are known.

        One member in the house: that type. Several: the concept, for any of them will do. None: the first that the word
        is stretched to and that the house has ("the bedroom" is the child's room where there is no other), else the
        name as it is. So is one of several (`bedroom|any_office`), for each of them will do.

        Raises:
            UnknownConcept: the table has no concept of this name.
        """
        if OR in name:
            return name
        return _narrowed(name, self.room_types(name), self.places.get(name), frozenset(room_types).__contains__)

    def narrow_thing(self, name: str, able: Callable[[str], bool]) -> str:
        """Return what the name of a thing comes to where only some categories will do.

        As `narrow_room`: what cannot do what is asked of it cannot be meant ("put it *in* the bedside table").

        Args:
            name: category or concept.
            able: whether things of a category could be what is asked.

        Raises:
            UnknownConcept: the table has no concept of this name.
        """
        return _narrowed(name, self.categories(name), self.things.get(name), able)

    # --- users' own ----------------------------------------------------------------------------------------------

    def extended(self, words: Mapping[str, Sequence[str]] = {}, members: Mapping[str, Sequence[str]] = {}) -> Concepts:
        """Return the table with categories of one's own.

        Args:
            words: category -> words for it. A word that is taken names both from then on, as a concept.
            members: concept -> categories that join it (`{"any_bath": ("birthing_pool",)}`); new concepts are made.
        """
        things, thing_words = dict(self.things), dict(self.thing_words)
        for name, categories in members.items():
            if not is_concept(name):
                raise UnknownConcept(name, things, f"members (concepts begin with {PREFIX!r})")
            old = things.get(name, Concept(()))
            things[name] = Concept(tuple(dict.fromkeys((*old.members, *categories))), old.also)
            thing_words.setdefault(normal_phrase(name.removeprefix(PREFIX)), name)
        for category, phrases in words.items():
            for phrase in (category, *phrases):
                key = normal_phrase(phrase)
                known = thing_words.get(key)
                if known is None or known == category:
                    thing_words[key] = category
                    continue
                name = known if is_concept(known) else PREFIX + key.replace(" ", "_")
                old = things.get(name, Concept(() if is_concept(known) else (known,)))
                things[name] = Concept(tuple(dict.fromkeys((*old.members, category))), old.also)
                thing_words[key] = name
        return Concepts(things, self.places, thing_words, self.place_words, self.plurals, self.provenance)


def _joined(words: Mapping[str, str]) -> Mapping[str, str]:
    """Return phrases without spaces, where only one thing is written so: `tshirt`, `trashcan`, `livingroom`."""
    found: dict[str, str | None] = {}
    for phrase, name in words.items():
        key = phrase.replace(" ", "")
        found[key] = name if found.get(key, name) == name else None
    return {key: name for key, name in found.items() if name is not None}


def _narrowed(name: str, members: Sequence[str], entry: Concept | None, possible: Callable[[str], bool]) -> str:
    left = [member for member in members if possible(member)]
    if not left and entry is not None:
        left = [member for member in entry.also if possible(member)][:1]
    return left[0] if len(left) == 1 else name


def _inverted(table: Mapping[str, Concept]) -> Mapping[str, frozenset[str]]:
    found: dict[str, set[str]] = {}
    for name, concept in table.items():
        for member in concept.members if is_concept(name) else ():
            found.setdefault(member, set()).add(name)
    return {member: frozenset(names) for member, names in found.items()}


_ENDINGS = (("ves", "f"), ("ves", "fe"), ("ies", "y"), ("ses", "s"), ("xes", "x"), ("ches", "ch"), ("shes", "sh"),
            ("oes", "o"), ("s", ""))  # fmt: skip
_SHORTEST = 3
_TAIL = re.compile(r" (?:of|under|beneath|below|over|above|on|in|at|for|with)(?: .*)?$")


def singulars(phrase: str, plurals: Mapping[str, str] = MappingProxyType({})) -> Iterator[str]:
    """Yield a phrase as it is, then what may be its singular, likeliest first.

    The last word changes, or the last before a preposition: `tins of beans` are one `tin of beans`.

    Args:
        phrase: as `normal_phrase` gives it.
        plurals: irregular plural -> singular.
    """
    yield phrase
    tail = _TAIL.search(phrase)
    if tail is not None:
        for form in _singular_forms(phrase[: tail.start()], plurals):
            yield form + tail.group()
    yield from _singular_forms(phrase, plurals)


def _singular_forms(phrase: str, plurals: Mapping[str, str]) -> Iterator[str]:
    head, gap, last = phrase.rpartition(" ")
    if last in plurals:
        yield head + gap + plurals[last]
    for plural, singular in _ENDINGS:
        if last.endswith(plural) and not last.endswith("ss") and len(last) >= len(plural) + _SHORTEST - 1:
            yield head + gap + last.removesuffix(plural) + singular


def load_concepts(path: Path | None = None) -> Concepts:
    """Read and validate a table of concepts (default: the shipped one).

    Raises:
        DataError: missing file, invalid content or another format version; a word that names a concept which the table
            does not have, or a concept without members.
    """
    source = path or shipped_data("concepts.json")
    table = read_json(source, _File, "concepts file", version=FORMAT)
    for kind, concepts, words in (
        ("things", table.things, table.thing_words),
        ("places", table.places, table.place_words),
    ):
        _check(f"concepts file {source}, {kind}", concepts, words)
    return Concepts(table.things, table.places, table.thing_words, table.place_words, table.plurals, table.provenance)


def _check(place: str, concepts: Mapping[str, Concept], words: Mapping[str, str]) -> None:
    for name, concept in concepts.items():
        if len(concept.members) < 2 and concept.members != (name,):
            raise DataError(f"{place}: the concept {name!r} has fewer than two members")
        if nested := [member for member in (*concept.members, *concept.also) if is_concept(member)]:
            raise DataError(f"{place}: {name!r} holds the concept {nested[0]!r}; members are not concepts")
    for word, name in words.items():
        if is_concept(name) and name not in concepts:
            raise DataError(f"{place}: the word {word!r} names {name!r}, which is not there")
        if word != normal_phrase(word):
            raise DataError(f"{place}: the word {word!r} should be written {normal_phrase(word)!r}")


@cache
def default_concepts() -> Concepts:
    """Return the shipped table, loaded once."""
    return load_concepts()
