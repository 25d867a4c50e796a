"""What a sentence names: nouns of the vocabulary found in a text, and checks of spelling and articles."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.phrases import indefinite
from gavel_env.tasks.templates import default_templates, expand
from gavel_env.world_model.goals import Predicate, parse_literal

__all__ = ["Mention", "article_errors", "mentions", "rooms_named", "sentence_faults", "unknown_words"]


class Mention(NamedTuple):
    """A noun in a text."""

    category: str
    start: int
    noun: str


@cache
def _nouns() -> tuple[re.Pattern[str], dict[str, str], re.Pattern[str], dict[str, str]]:
    vocabulary = default_vocabulary()
    names = {
        noun.lower(): category
        for table in (vocabulary.movables, vocabulary.furniture)
        for category, words in table.items()
        for noun in words.nouns
    }
    rooms = {noun.lower(): kind for kind, nouns in vocabulary.rooms.items() for noun in nouns}
    return _pattern(names), names, _pattern(rooms), rooms


def _pattern(names: dict[str, str]) -> re.Pattern[str]:
    longest_first = sorted(names, key=lambda n: (-len(n), n))
    return re.compile(r"(?<![\w-])(" + "|".join(map(re.escape, longest_first)) + r")(?![\w-])", re.IGNORECASE)


# A noun counts where a determiner leads to it: `watch`, `letter` or `iron` as verbs do not.
_LED = re.compile(r"\b(the|a|an|some|both)\s+([\w'’-]+\s+){0,3}$", re.IGNORECASE)


def mentions(text: str) -> list[Mention]:
    """Return the categories that a text names, in order; the longest noun wins."""
    pattern, names, rooms, _ = _nouns()
    blank = rooms.sub(lambda m: "_" * len(m.group()), text)
    return [
        Mention(names[m.group(1).lower()], m.start(), m.group(1))
        for m in pattern.finditer(blank)
        if _LED.search(text[: m.start()])
    ]


def rooms_named(text: str) -> list[str]:
    """Return the room types that a text names, in order."""
    _, _, pattern, rooms = _nouns()
    return [rooms[m.group(1).lower()] for m in pattern.finditer(text)]


def sentence_faults(text: str, wanted: Iterable[tuple[Sequence[str], Sequence[str]]]) -> Iterator[str]:
    """Yield what a text fails to name, or names beyond what is meant.

    Args:
        text: the text.
        wanted: (object designators, stated relations) of each task.
    """
    wanted = list(wanted)
    designators = [name.partition("@") for objects, _ in wanted for name in objects]
    categories, named = {category for category, _, _ in designators}, {m.category for m in mentions(text)}
    if missing := sorted(categories - named):
        yield f"does not name {', '.join(missing)}: {text!r}"
    if extra := sorted(named - categories):
        yield f"names also {', '.join(extra)}: {text!r}"
    literals = [parse_literal(relation) for _, relations in wanted for relation in relations]
    rooms = {room for _, _, room in designators if room}
    rooms |= {str(lit.object) for lit in literals if lit.predicate is Predicate.IN_ROOM}
    if rooms != set(rooms_named(text)):
        yield f"names the rooms {sorted(set(rooms_named(text)))}, means {sorted(rooms)}: {text!r}"


@cache
def _known_words() -> frozenset[str]:
    vocabulary, templates = default_vocabulary(), default_templates()
    texts: list[str] = [noun for nouns in vocabulary.rooms.values() for noun in nouns]
    for table in (vocabulary.movables, vocabulary.furniture):
        texts += [noun for words in table.values() for noun in words.nouns]
    for splits in templates.clauses.values():
        texts += [t for group in splits.values() for line in group for t in expand(line)]
    texts += [w for group in templates.wrappers.values() for w in group]
    for join in templates.joins.values():
        texts += [*join.openers, *join.next, *(part for pair in join.separators for part in pair)]
    texts.append("is are has have belongs belong needs need goes go ends end gets get it them they that's that are")
    texts.append("in on into inside onto top of from out off to then also and switch turn the a an some")
    return frozenset(word for text in texts for word in _words(re.sub(r"\{\w+\}", " ", text)))


def _words(text: str) -> Iterator[str]:
    yield from (word.lower() for word in re.findall(r"[A-Za-zÀ-ÿ'’-]+", text))


def unknown_words(text: str) -> list[str]:
    """Return the words that neither the vocabulary nor the templates contain: misspellings."""
    known = _known_words()
    return [word for word in _words(text) if word not in known]


def article_errors(text: str) -> list[str]:
    """Return every `a` or `an` that does not suit the sound that follows."""
    found = re.findall(r"\b(an?) ([A-Za-z][\w-]*)", text)
    return [f"{article} {word}" for article, word in found if indefinite(word) != f"{article} {word}"]
