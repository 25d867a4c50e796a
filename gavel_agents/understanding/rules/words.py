"""Closed-class words of the rules understanding: what every word other than a noun does in an instruction.

The words are data (`words.toml`, beside this module); the longest phrase wins.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources

import msgspec

__all__ = ["Kind", "closed_words", "verb_forms", "word_lists"]


class Kind(enum.Enum):
    """What a token does."""

    NOUN = "noun"
    ROOM = "room"
    VERB = "verb"  # value: what it asks for (`verb_words`)
    FACT = "fact"  # states where something is
    WISH = "wish"  # states where something shall be
    MARK = "mark"  # what follows shall come true
    PREPOSITION = "preposition"  # value: on, in, to, from, out, off, through, with, under, beside
    RELATIVE = "relative"  # that's, which is
    PRONOUN = "pronoun"  # value: it, whole
    QUANTIFIER = "quantifier"  # both, all three
    COUNT = "count"  # more than one of a kind: refused
    DETERMINER = "determiner"
    AND = "and"
    COMMA = "comma"
    STOP = "stop"  # ; : dash
    THEN = "then"
    ALSO = "also"
    NOT = "not"
    THERE = "there"
    WHERE = "where"
    PARTICLE = "particle"
    ADJECTIVE = "adjective"  # value: what a wish for it asks for, or ""
    SWAPPED = "swapped"  # trade places, the other way round
    SAME = "same"  # do the same for
    CYCLE = "cycle"  # a wash, a spin, a cycle; value: WASH, DRY, TURN
    DOOR = "door"
    SUBJECT = "subject"  # i, we, he, someone: who tells of something
    ASIDE = "aside"  # because, so that I can, before, in case: what follows says why or when
    IF = "if"
    OR = "or"
    CORRECTION = "correction"  # no wait, I mean: what follows replaces what was said
    ARROW = "arrow"  # ->: what follows is where it goes
    POSSESSIVE = "possessive"  # 's
    REQUEST = "request"  # please, could you: what follows is asked for
    SPOT = "spot"  # by the window: where something is, as no data can tell
    FILLER = "filler"  # says nothing about what shall be
    UNKNOWN = "unknown"


class _Phrases(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    kind: Kind
    said: tuple[str, ...]
    value: str = ""


class _Lists(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Single words.

    Attributes:
        doubling: verbs that double their last letter.
        told: verbs by which someone tells where a thing is: `Tom dropped it on the sofa`.
        persons: who may do something, other than the speaker.
        only_led: nouns that are nouns only after an article or the like.
        alike: nouns of things that several categories are, which people do not tell apart by the noun.
        named_first: words that may be verbs and yet name a thing at the start of a note: `whisk: in the sink`.
    """

    doubling: frozenset[str]
    told: frozenset[str]
    only_led: frozenset[str]
    alike: frozenset[str]
    named_first: frozenset[str]
    persons: frozenset[str]


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table of words.

    Attributes:
        phrases: by what they do.
        verbs, phrasal_verbs: by what they ask for.
        irregular: verb -> forms that the rules of spelling do not give.
        lists: single words.
        chat: spellings of chats and phones -> the words.
        languages: language -> words that tell it from English.
        nouns, rooms: words for things and rooms beside those of the concepts, with what they name.
    """

    phrases: tuple[_Phrases, ...]
    verbs: Mapping[str, tuple[str, ...]]
    phrasal_verbs: Mapping[str, tuple[str, ...]]
    irregular: Mapping[str, tuple[str, ...]]
    lists: _Lists
    chat: Mapping[str, str]
    languages: Mapping[str, frozenset[str]]
    nouns: Mapping[str, str]
    rooms: Mapping[str, str]


@cache
def word_lists() -> Words:
    """Return the table, read once."""
    return msgspec.toml.decode((resources.files(__package__) / "words.toml").read_bytes(), type=Words)


@cache
def closed_words() -> Mapping[tuple[str, ...], tuple[Kind, str]]:
    """Return every closed-class phrase, as its words, with what it does; an earlier meaning wins over a later one."""
    table: dict[tuple[str, ...], tuple[Kind, str]] = {}
    for group in word_lists().phrases:
        for phrase in group.said:
            table.setdefault(tuple(phrase.split()), (group.kind, group.value))
    for phrase, meaning in _verb_phrases():
        table.setdefault(tuple(phrase.split()), (Kind.VERB, meaning))
    return table


@cache
def verb_forms(verb: str) -> tuple[str, ...]:
    """Return a verb's forms: base, third person, past and -ing."""
    words = word_lists()
    stem = verb + verb[-1] if verb in words.lists.doubling else verb
    dropped = verb[:-1] if verb.endswith("e") else stem
    sibilant = verb.endswith(("s", "sh", "ch", "x", "z"))
    third, past = verb + ("es" if sibilant else "s"), dropped + "ed"
    if verb.endswith("y") and verb[-2] not in "aeiou":
        third, past = verb[:-1] + "ies", verb[:-1] + "ied"
    return tuple(dict.fromkeys((verb, third, past, dropped + "ing", *words.irregular.get(verb, ()))))


def _verb_phrases() -> Iterator[tuple[str, str]]:
    """Yield every verb in every form, with what it asks for."""
    words = word_lists()
    for meaning, verbs in words.verbs.items():
        for verb in verbs:
            for form in verb_forms(verb):
                yield form, meaning
    for meaning, phrases in words.phrasal_verbs.items():
        for phrase in phrases:
            first, _, rest = phrase.partition(" ")
            forms = verb_forms(first) if rest and "'" not in first and len(first) > 2 else (first,)
            for form in forms:
                yield f"{form} {rest}".strip(), meaning
