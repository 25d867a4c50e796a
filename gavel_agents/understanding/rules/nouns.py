"""Noun phrases: what each names, as one category or room type, or a concept that the house settles."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import NamedTuple

from gavel_agents.understanding.rules.words import Kind, word_lists
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.ontology import Category, category_of, default_ontology

__all__ = [
    "Named",
    "in_a_room",
    "kinds_of",
    "known_nouns",
    "leads_with_room",
    "only_led",
    "plurals",
    "room_named",
    "thing_named",
    "words_of",
]

_WORD = re.compile(r"[^\W_]+(?:'[^\W_]+)*'?")
_CONTRACTED = re.compile(r"'(?=(?:s|d|m|ve|ll|re)\b)")
_IRREGULAR: Mapping[str, str] = {
    "knife": "knives",
    "shelf": "shelves",
    "loaf": "loaves",
    "leaf": "leaves",
    "scarf": "scarves",
    "mouse": "mice",
    "man": "men",
    "child": "children",
}

# Of these, people who say no more mean the one that the vocabulary has; the other kinds have names of their own.
_FIRST = frozenset({"sink", "chair", "stool"})
_ALWAYS_FIRST = frozenset({"lower cabinet", "bottom cabinet"} | set(word_lists().nouns))

# What is switched on by the switch of a room; a lamp is called a lamp.
_SWITCHED = ("light", "ceiling light", "main light", "overhead light", "room light", "big light")

_NEVER_ROOMS = frozenset({"bath", "bar", "lab", "side", "store", "toilet", "hall tree", "shower"})
_NEVER_NOUNS = frozenset({"cycle", "cycles", "cabinet door", "cabinet doors"}) | frozenset(
    {"door", "doors", "floors", "walls", "floor", "wall", "lid", "drawer", "food", "dishes in question"}
)


class Named(NamedTuple):
    """What a phrase names.

    Attributes:
        kind: `Kind.NOUN` or `Kind.ROOM`.
        name: category or room type, or a concept.
        exact: the category or room type for which the vocabulary of the scenes has this very noun, or nothing.
        plural: it is the plural of a noun.
        thing: of a room's name, the thing that it names in a house without such a room (`closet`), or nothing.
    """

    kind: Kind
    name: str
    exact: str = ""
    plural: bool = False
    thing: str = ""


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a phrase as tokens are compared: lower case, hyphens as spaces, `'s` apart."""
    plain = re.sub("[‘’ʼ`´]", "'", text.lower())
    return tuple(w.removesuffix("'") or w for w in _CONTRACTED.sub(" '", plain).split() for w in _parts(w))


def _parts(word: str) -> list[str]:
    return [word] if word.startswith("'") else _WORD.findall(word)


def plurals(noun: str) -> Iterator[str]:
    """Yield plurals of a noun; of `bottle of milk`, `bottles of milk`."""
    head, of, rest = noun.partition(" of ")
    before, _, last = head.rpartition(" ")
    prefix = f"{before} " if before else ""
    if last in _IRREGULAR:
        yield f"{prefix}{_IRREGULAR[last]}{of}{rest}"
    elif last.endswith(("s", "sh", "ch", "x", "z")):
        yield f"{prefix}{last}es{of}{rest}"
    elif last.endswith("y") and last[-2:-1] not in "aeiou":
        yield f"{prefix}{last[:-1]}ies{of}{rest}"
    elif last.endswith("o"):
        yield f"{prefix}{last}es{of}{rest}"
        yield f"{prefix}{last}s{of}{rest}"
    else:
        yield f"{prefix}{last}s{of}{rest}"


def in_a_room(noun: str) -> bool:
    """Return whether a noun says the room of another one: the garden chair is the chair in the garden."""
    vocabulary = default_vocabulary()
    rooms = {word for words in vocabulary.rooms.values() for word in words}
    nouns = {word for words in vocabulary.furniture.values() for word in words.nouns}
    return any(noun.startswith(f"{room} ") and noun.removeprefix(f"{room} ") in nouns for room in rooms)


_ROOMS_OF_FURNITURE = ("kitchen", "bathroom", "bedroom", "living room", "dining room", "hall", "hallway", "study")


def leads_with_room(phrase: str, thing: str) -> bool:
    """Return whether a phrase for a piece of furniture only says the room of it: the kitchen table."""
    fixed = not kinds_of(thing)[0].graspable
    return fixed and any(phrase.startswith(f"{room} ") for room in _ROOMS_OF_FURNITURE)


def _with_apostrophes(phrase: str) -> Iterator[str]:
    """Yield a phrase of the concepts with the apostrophe that it was stripped of: `childrens room`."""
    first, gap, rest = phrase.partition(" ")
    if gap and first.endswith("s") and "'" not in phrase:
        yield f"{first[:-1]}'s {rest}"


@cache
def known_nouns() -> Mapping[tuple[str, ...], Named]:
    """Return every noun phrase with what it names."""
    vocabulary, ontology, concepts = default_vocabulary(), default_ontology(), default_concepts()
    table: dict[tuple[str, ...], Named] = {}
    several: dict[tuple[str, ...], Named] = {}

    def add(noun: str, named: Named, *, plural: bool = True) -> None:
        if noun in _NEVER_NOUNS:
            return
        for spelled in (noun, *_with_apostrophes(noun)):
            table.setdefault(words_of(spelled), named)
        for form in plurals(noun) if plural else ():
            for spelled in (form, *_with_apostrophes(form)):
                several.setdefault(words_of(spelled), named._replace(plural=True))

    for room, nouns in vocabulary.rooms.items():
        for noun in nouns:
            meant = concepts.meaning(noun)
            add(noun.lower(), Named(Kind.ROOM, meant.place or room, room))
    for noun, name in word_lists().rooms.items():
        add(noun, Named(Kind.ROOM, name))
    for noun, name in word_lists().nouns.items():
        add(noun, Named(Kind.NOUN, name, name))
    for noun in _SWITCHED:
        add(noun, Named(Kind.NOUN, "electric_switch"))
    for group in (vocabulary.movables, vocabulary.furniture):
        for category, entry in group.items():
            for noun in map(str.lower, entry.nouns):
                if not in_a_room(noun):
                    meant_thing = concepts.meaning(noun).thing or category
                    named = Named(Kind.NOUN, meant_thing, category)
                    add(noun, named, plural=not vocabulary.is_plural(category))
    for phrase, place in concepts.place_words.items():
        if phrase not in _NEVER_ROOMS:
            add(phrase, Named(Kind.ROOM, place))
    for phrase, thing in concepts.thing_words.items():
        key = words_of(phrase)
        if key in table and table[key].kind is Kind.ROOM:
            table[key] = table[key]._replace(thing=thing)
        elif not (in_a_room(phrase) or leads_with_room(phrase, thing)):
            add(phrase, Named(Kind.NOUN, thing))
    for name in ontology:
        phrase = name.replace("_", " ")
        if not in_a_room(phrase):
            add(phrase, Named(Kind.NOUN, concepts.meaning(phrase).thing or name))
    return {**several, **table}


def only_led(words: Iterable[str]) -> bool:
    """Return whether a phrase is a noun only after an article or the like."""
    said = " ".join(words)
    return any(stem in word_lists().lists.only_led for stem in (said, said.removesuffix("s"), said.removesuffix("es")))


@cache
def _alike() -> frozenset[str]:
    nouns = word_lists().lists.alike
    return nouns.union(*(plurals(noun) for noun in nouns))


def thing_named(named: Named, text: str, room: str | None, house: Counter[str] | None, *, alike: bool = False) -> str:
    """Return the name of what a phrase for a thing designates.

    What is carried about and has a name of its own is that; a piece of furniture may be any of its concept, for which
    kinds a house has is not known. Only where people name the other kinds differently it is the first of them, unless
    the one room that it is said to be in may have just another.

    Args:
        named: what the phrase can name.
        text: the phrase.
        room: said with it, or None.
        house: how many rooms of each type the house has, or None if it is not known.
        alike: of things that people do not tell apart by the noun (`cutting board`), any may be meant.
    """
    if not named.exact or named.kind is Kind.ROOM:
        return named.thing or named.name
    first = text in _FIRST and (room is None or house is None or house[room] != 1)
    if house is None or first or text in _ALWAYS_FIRST:
        return named.exact
    if kinds_of(named.exact)[0].graspable:
        return named.name if alike and text in _alike() else named.exact
    return named.name


def room_named(named: Named, house: Counter[str] | None) -> str:
    """Return the room type, or the concept of several, that a room's name comes to in a house."""
    if house is None:
        return named.exact or named.name
    return default_concepts().narrow_room(named.name, house)


@cache
def kinds_of(name: str) -> tuple[Category, ...]:
    """Return the categories that a designator's name stands for."""
    names = default_concepts().categories(category_of(name))
    return tuple(default_ontology()[category] for category in names)
