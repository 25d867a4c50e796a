"""From text to tokens: the longest known phrase wins, and a word that is not known ends the reading."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.nouns import IRREGULAR_PLURALS, ROOM_SYNONYMS, SYNONYMS, VAGUE
from gavel_agents.understanding.rules.words import CHAT_STARTS, Kind, closed_words
from gavel_env.errors import nearest_names
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.ontology import default_ontology

__all__ = ["Spoken", "Token", "in_a_room", "known_nouns", "plurals", "sentences_of", "words_of"]

_MOST_CHARACTERS = 4000
_LONGEST_PHRASE = 9


class Token(NamedTuple):
    """A known phrase.

    Attributes:
        kind: what it does.
        value: category, room type or sub-kind.
        text: its words.
        form: of a verb: "ing", "ed" or "base".
        start, end: where it stands in its sentence.
    """

    kind: Kind
    value: str
    text: str
    form: str = ""
    start: int = 0
    end: int = 0


class _Piece(NamedTuple):
    word: str
    start: int
    end: int


_WORD = re.compile(r"[^\W_]+(?:'[^\W_]+)?'?")
_BULLET = re.compile(r"^\s*(?:[-*•]+|\(?\d{1,2}[.)])\s+", re.MULTILINE)
_END = re.compile(r"[.!?\n]+")
_MARK = re.compile(r"[,;:()—–]|\s-\s")


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a phrase as the lexer compares them: lower case, hyphens as spaces."""
    return tuple(_WORD.findall(_plain(text)))


def _plain(text: str) -> str:
    text = unicodedata.normalize("NFKC", text).lower()
    text = re.sub(r"[‘’ʼ`´]", "'", text)
    return re.sub(r"(?<=\w)-(?=\w)", " ", text)


def plurals(noun: str) -> Iterator[str]:
    """Yield plurals of a noun; of `bottle of milk`, `bottles of milk`."""
    head, of, rest = noun.partition(" of ")
    before, _, last = head.rpartition(" ")
    prefix = f"{before} " if before else ""
    if last in IRREGULAR_PLURALS:
        yield f"{prefix}{IRREGULAR_PLURALS[last]}{of}{rest}"
    elif last.endswith(("s", "sh", "ch", "x", "z")):
        yield f"{prefix}{last}es{of}{rest}"
    elif last.endswith("y") and last[-2:-1] not in "aeiou":
        yield f"{prefix}{last[:-1]}ies{of}{rest}"
    else:
        yield f"{prefix}{last}s{of}{rest}"


def in_a_room(noun: str) -> bool:
    """Return whether a noun says the room of another one: the garden chair is the chair in the garden."""
    vocabulary = default_vocabulary()
    rooms = {word for words in vocabulary.rooms.values() for word in words}
    nouns = {word for words in vocabulary.furniture.values() for word in words.nouns}
    return any(noun.startswith(f"{room} ") and noun.removeprefix(f"{room} ") in nouns for room in rooms)


@cache
def known_nouns() -> Mapping[tuple[str, ...], tuple[Kind, str]]:
    """Return every noun phrase with its category or room type; a vague noun has the categories it could mean."""
    vocabulary, ontology = default_vocabulary(), default_ontology()
    table: dict[tuple[str, ...], tuple[Kind, str]] = {}

    def add(noun: str, kind: Kind, value: str, *, plural: bool = True) -> None:
        for form in (noun, *(plurals(noun) if plural else ())):
            table.setdefault(words_of(form), (kind, value))

    for group in (vocabulary.movables, vocabulary.furniture):
        for category, entry in group.items():
            for noun in entry.nouns:
                if not in_a_room(noun.lower()):
                    add(noun.lower(), Kind.NOUN, category, plural=not vocabulary.is_plural(category))
    for room, nouns in vocabulary.rooms.items():
        for noun in nouns:
            add(noun.lower(), Kind.ROOM, room, plural=False)
    for noun, room in ROOM_SYNONYMS.items():
        add(noun, Kind.ROOM, room, plural=False)
    for noun, category in SYNONYMS.items():
        add(noun, Kind.NOUN, category)
    for noun, categories in VAGUE.items():
        add(noun, Kind.NOUN, "|".join(categories))
    for name in ontology:
        if not in_a_room(name.replace("_", " ")):
            add(name.replace("_", " "), Kind.NOUN, name)
    return table


def _verb_form(words: tuple[str, ...]) -> str:
    first = words[0]
    if first.endswith("ing") and first not in ("bring",):
        return "ing"
    return "ed" if first.endswith(("ed", "put", "set", "left", "kept", "shut", "laid", "stuck")) else "base"


class Spoken(NamedTuple):
    """A sentence.

    Attributes:
        text: as it was written, to which the tokens' places refer.
        tokens: what it says; none if it asks for nothing.
        opened: a remark that asks for nothing leads to it.
    """

    text: str
    tokens: list[Token]
    opened: bool


def sentences_of(text: str) -> Iterator[Spoken]:
    """Yield the sentences of a text.

    Raises:
        Abstention: empty, too long, no text, or an unknown word.
    """
    if not text.strip():
        raise Abstention("empty", "nothing is said")
    if len(text) > _MOST_CHARACTERS:
        raise Abstention("too_long", f"{len(text)} characters; at most {_MOST_CHARACTERS}")
    first = True
    for part in _END.split(_BULLET.sub("\n", unicodedata.normalize("NFKC", text))):
        plain = _plain(part)
        if plain.strip().isdigit():
            continue  # the number of a list
        said = list(_sentence(plain))
        tokens = _without_small_talk(said, plain, first)
        for token in tokens:
            if token.kind is Kind.UNKNOWN:
                raise Abstention("unknown_word", _with_hint(token.text))
        if said or _WORD.search(plain):
            yield Spoken(
                part if len(part) == len(plain) else plain, tokens, len(tokens) < len(said) or _has_heading(tokens)
            )
            first = first and not any(t.kind in _NAMES for t in tokens)


def _has_heading(tokens: list[Token]) -> bool:
    """Return whether a known phrase such as `a few things to do` leads to a colon."""
    return bool(tokens) and tokens[0].kind is Kind.STOP


# Categories of structure whose names mean the doors of furniture here.
_NEVER_NOUNS = frozenset({("door",), ("doors",), ("floors",), ("walls",)})
_NAMES = (Kind.NOUN, Kind.ROOM)


def _without_small_talk(tokens: list[Token], sentence: str, first: bool) -> list[Token]:
    """Return the tokens without a remark that asks for nothing: what leads to a colon, or a whole first sentence."""
    opening = _WORD.match(sentence.lstrip(" \"'(“"))
    if opening is None or opening.group() not in CHAT_STARTS:
        return tokens
    colon = next((i for i, t in enumerate(tokens) if t.kind is Kind.STOP and t.value == ":"), None)
    remark = tokens[:colon] if colon is not None else tokens
    if any(t.kind in (*_NAMES, Kind.NOT) for t in remark) or (colon is None and not first):
        return tokens
    return tokens[colon + 1 :] if colon is not None else []


def _with_hint(word: str) -> str:
    near = nearest_names(word[:40], [" ".join(words) for words in known_nouns()], 1)
    return f"{word[:40]!r} (did you mean {near[0]!r}?)" if near else repr(word[:40])


def _sentence(sentence: str) -> Iterator[Token]:
    pieces = [_Piece(m.group(), m.start(), m.end()) for m in _WORD.finditer(sentence)]
    strange = re.sub(r"[\s,;:()\"'“”—–-]", "", _WORD.sub("", sentence))
    if strange:
        raise Abstention("not_text", f"cannot read {strange[:20]!r}")
    position, last_end, led = 0, 0, False
    while position < len(pieces):
        for mark in _MARK.findall(sentence[last_end : pieces[position].start]):
            yield Token(Kind.COMMA if mark in ",()" else Kind.STOP, mark.strip(), mark, "", last_end, last_end)
        count, token = _longest(pieces, position, sentence, led=led)
        if token.kind is not Kind.FILLER:
            led = token.kind in (Kind.DETERMINER, Kind.ADJECTIVE, Kind.ROOM, Kind.QUANTIFIER)
            yield token._replace(start=pieces[position].start, end=pieces[position + count - 1].end)
        position += count
        last_end = pieces[position - 1].end


def _longest(pieces: list[_Piece], start: int, sentence: str, *, led: bool) -> tuple[int, Token]:
    """Return how many words the longest known phrase at `start` has, and its token.

    Args:
        pieces: the words of the sentence.
        start: index of the first word.
        sentence: for the marks between words, which no phrase may span.
        led: a determiner leads here, so that `watch` is a noun.
    """
    nouns, closed = known_nouns(), closed_words()
    for count in range(min(_LONGEST_PHRASE, len(pieces) - start), 0, -1):
        part = pieces[start : start + count]
        if any(_MARK.search(sentence[a.end : b.start]) for a, b in pairwise(part)):
            continue
        words = tuple(p.word for p in part)
        bare = (*words[:-1], words[-1].removesuffix("'s").removesuffix("'"))
        noun = nouns.get(words) or nouns.get(bare)
        if noun and words not in _NEVER_NOUNS and (led or words not in closed):
            return count, Token(noun[0], noun[1], " ".join(words))
        if words in closed:
            kind, value = closed[words]
            return count, Token(kind, value, " ".join(words), _verb_form(words) if kind is Kind.VERB else "")
    word = pieces[start].word
    if word.isdigit():
        return 1, Token(Kind.DETERMINER if word == "1" else Kind.COUNT, "", word)
    return 1, Token(Kind.UNKNOWN, word, word)
