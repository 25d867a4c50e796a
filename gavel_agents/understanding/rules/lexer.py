"""From text to tokens: the longest known phrase wins; a word that is not known is repaired, or marked as unknown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from gavel_agents.understanding.rules.english import is_english, is_word
from gavel_agents.understanding.rules.nouns import known_nouns, only_led, plurals, words_of
from gavel_agents.understanding.rules.spelling import Speller, distance
from gavel_agents.understanding.rules.words import Kind, closed_words, word_lists

__all__ = ["Token", "tokens_of"]


class Token(NamedTuple):
    """A known phrase, an unknown word, or a mark.

    Attributes:
        kind: what it does.
        value: of a noun, its designator's name; else a sub-kind.
        text: its words.
        form: of a verb: "ing", "ed" or "base"; of a noun, "s" if it is a plural.
        start, end: where it stands in the text.
        close: no mark stands between it and the token before.
        name: it is written with a capital inside a sentence.
    """

    kind: Kind
    value: str
    text: str
    form: str = ""
    start: int = 0
    end: int = 0
    close: bool = True
    name: bool = False


class _Piece(NamedTuple):
    word: str
    start: int
    end: int
    close: bool
    name: bool


_WORD = re.compile(r"[^\W_]+(?:'[^\W_]+)*'?")
_CONTRACTED = ("'s", "'d", "'m", "'ve", "'ll", "'re")
_BULLET = re.compile(r"^[ \t]*(?:[-–—*•·>#+▪●○◦☐✓✔]+|\[[ xX]?\]|[(\[]?(?:\d{1,2}|[a-hA-H])[.):\]])[ \t]+", re.MULTILINE)
_INLINE_NUMBER = re.compile(r"(?:(?<=\s)|^)[(]?\d{1,2}[.)](?=\s)|(?<=\s)\([a-h]\)(?=\s)")
_MARKS: tuple[tuple[re.Pattern[str], Kind, str], ...] = (
    (re.compile(r"-+>|=+>|→|➜|➔|⇒|⟶|»|(?<=\s)>+(?=\s)|(?<=\s)=(?=\s)"), Kind.ARROW, "->"),
    (re.compile(r"\.{2,}"), Kind.COMMA, ","),
    (re.compile(r"[.!?](?=\W|$)|[\n\r\u2028]"), Kind.STOP, "."),
    (re.compile(r"[;•·|]"), Kind.STOP, ";"),
    (re.compile(r":"), Kind.STOP, ":"),
    (re.compile(r"[—–]|(?<=\s)-+(?=\s)"), Kind.STOP, "-"),
    (re.compile(r"[(\[]"), Kind.COMMA, "("),
    (re.compile(r"[)\]]"), Kind.COMMA, ")"),
    (re.compile(r","), Kind.COMMA, ","),
    (re.compile(r"/"), Kind.OR, "/"),
    (re.compile(r"[&+]"), Kind.AND, "&"),
)


def _split(word: str) -> tuple[str, ...]:
    """Return a word with contractions and chat spellings written out."""
    said = word_lists().chat.get(word)
    if said is not None:
        return tuple(said.split())
    for ending in _CONTRACTED:
        if word.endswith(ending) and len(word) > len(ending):
            return (*_split(word.removesuffix(ending)), ending)
    return (word.removesuffix("'") or word,)


def _pieces(text: str) -> Iterator[_Piece | Token]:
    """Yield the words and marks of a text."""
    text = _INLINE_NUMBER.sub(lambda m: ";" + " " * (len(m.group()) - 1), _BULLET.sub(_line, text))
    shouted = sum(c.isupper() for c in text) > sum(c.islower() for c in text)
    end, close, first = 0, False, True
    for match in _WORD.finditer(text):
        for mark in _marks(text, end, match.start()):
            yield mark
            close, first = False, first or mark.kind is Kind.STOP
        word = match.group()
        name = word[0].isupper() and not first and not shouted
        for part in _split(word.lower()):
            yield _Piece(part, match.start(), match.end(), close, name)
            close = True
        end, close, first = match.end(), True, False
    yield from _marks(text, end, len(text))


def _line(bullet: re.Match[str]) -> str:
    """Return what stands for a bullet: a stop, so that each item is a sentence."""
    return ";" + " " * (len(bullet.group()) - 1)


def _marks(text: str, start: int, end: int) -> Iterator[Token]:
    """Yield the marks between two words."""
    position = start
    while position < end:
        if text[position] == " ":
            position += 1
            continue
        for pattern, kind, value in _MARKS:
            found = pattern.match(text, position, len(text))
            if found is not None and found.end() <= end:
                yield Token(kind, value, value, "", position, position, close=False)
                position = found.end()
                break
        else:
            position += 1


def tokens_of(text: str) -> list[Token]:
    """Return the tokens of a readable text.

    Raises:
        Abstention: a word could be one of several that are spelled alike.
    """
    tokens: list[Token] = []
    run: list[_Piece] = []
    for piece in _pieces(text):
        if isinstance(piece, Token):
            _read_run(run, tokens)
            run = []
            tokens.append(piece)
        else:
            run.append(piece)
    _read_run(run, tokens)
    return _told(_persons(_determined(tokens)))


def _persons(tokens: Sequence[Token]) -> list[Token]:
    """Return the tokens with `the guest wanted` as someone who does something."""
    read = list(tokens)
    for index, (token, following) in enumerate(pairwise(tokens)):
        before, after = tokens[index - 1] if index else None, tokens[index + 2] if index + 2 < len(tokens) else None
        marked = before is not None and before.kind is Kind.COMMA and following.kind is Kind.COMMA
        named = after is not None and after.kind in (Kind.PREPOSITION, Kind.DETERMINER, Kind.NOUN)
        led = before is not None and before.kind is Kind.COMMA and following.kind in (Kind.DETERMINER, Kind.NOUN)
        if (token.text == "no" and marked and named) or (token.text == "sorry" and (led or (marked and named))):
            read[index] = token._replace(kind=Kind.CORRECTION)  # in the hall, no, in the kitchen
        person = token.text in word_lists().lists.persons and token.kind in (Kind.UNKNOWN, Kind.FILLER, Kind.NOUN)
        acts = following.kind is Kind.VERB and following.form != "base"
        if person and following.close and (acts or following.kind is Kind.UNKNOWN):
            read[index] = token._replace(kind=Kind.SUBJECT, value="")
    return read


_POINTING = frozenset(["this", "that", "these", "those", "one", "its", "either"])
_EACH = frozenset({"each", "every", "every single", "each and every"})


def _determined(tokens: Sequence[Token]) -> list[Token]:
    """Return the tokens with `this` before a noun as a determiner."""
    read = list(tokens)
    for index, (token, following) in enumerate(pairwise(tokens)):
        after = tokens[index + 2] if index + 2 < len(tokens) else None
        opened = following.value in ("OPEN", "CLOSE") and after is not None and after.kind is Kind.NOUN
        noun = following.close and (following.kind in (Kind.NOUN, Kind.ADJECTIVE, Kind.ROOM) or opened)
        if noun and token.text in _EACH:
            read[index] = token._replace(kind=Kind.COUNT, value=token.text)
        elif noun and token.text in _POINTING and token.kind is not Kind.DETERMINER:
            read[index] = token._replace(kind=Kind.DETERMINER, value="")
    return read


class _Entry(NamedTuple):
    words: tuple[str, ...]
    noun: Token | None
    closed: Token | None


@cache
def _phrases() -> Mapping[str, tuple[_Entry, ...]]:
    """Return every known phrase by its first word, the longest first."""
    nouns = known_nouns()
    closed = {words_of(" ".join(said)): meant for said, meant in closed_words().items()}
    table: dict[str, list[_Entry]] = {}
    for words in {**nouns, **closed}:
        noun = nouns.get(words)
        entry = _Entry(
            words,
            None if noun is None else Token(noun.kind, noun.name, " ".join(words), "s" if noun.plural else ""),
            _closed_token(words, *closed[words]) if words in closed else None,
        )
        table.setdefault(words[0] if words else "", []).append(entry)
    return {first: tuple(sorted(entries, key=lambda e: -len(e.words))) for first, entries in table.items()}


def _closed_token(words: tuple[str, ...], kind: Kind, value: str) -> Token:
    return Token(kind, value, " ".join(words), _verb_form(words[0]) if kind is Kind.VERB else "")


def _verb_form(first: str) -> str:
    if first.endswith("ing") and first != "bring":
        return "ing"
    past = ("ed", "put", "set", "left", "kept", "shut", "laid", "stuck", "hung", "frozen", "taken", "brought", "found")
    return "ed" if first.endswith(past) else "base"


@cache
def _speller() -> Speller:
    words = {word for entries in _phrases().values() for entry in entries for word in entry.words}
    return Speller(word for word in words if word.isalpha())


_ACTING = (Kind.VERB, Kind.WISH)
_COMPLETED = (Kind.NOUN, Kind.UNKNOWN, Kind.FILLER)
_LEADS = (Kind.DETERMINER, Kind.ADJECTIVE, Kind.ROOM, Kind.QUANTIFIER, Kind.COUNT, Kind.POSSESSIVE)
_ARGUMENT = (*_LEADS, Kind.VERB, Kind.PREPOSITION)


def _read_run(pieces: Sequence[_Piece], tokens: list[Token]) -> None:
    """Add the tokens of words that no mark parts."""
    position = 0
    words = [piece.word for piece in pieces]
    for index, (word, following) in enumerate(pairwise(words)):
        if word == "2" and any(e.closed and e.closed.kind in _ACTING for e in _phrases().get(following, ())):
            words[index] = "to"
    while position < len(words):
        before = tokens[-1] if tokens and pieces[position].close else None
        count, token = _longest(words, position, before)
        if token is None:
            repaired = _repair(words, position, pieces[position].name)
            if repaired:
                words[position : position + 1] = repaired[0]
                first = pieces[position]
                pieces = [*pieces[:position], *([first] * len(repaired[0])), *pieces[position + 1 :]]
                if repaired[1]:
                    del words[position + len(repaired[0])]
                    pieces = [*pieces[: position + len(repaired[0])], *pieces[position + len(repaired[0]) + 1 :]]
                count, token = _longest(words, position, before)
        if token is None:
            word = words[position]
            token = Token(Kind.COUNT, word, word) if word.isdigit() else Token(Kind.UNKNOWN, word, word)
            count = 1
        longer = _completed(words, position, count) if token.kind in _COMPLETED else None
        if longer is not None:
            count, token = longer
        first, last = pieces[position], pieces[position + count - 1]
        tokens.append(token._replace(start=first.start, end=last.end, close=first.close, name=first.name))
        position += count


def _completed(words: Sequence[str], start: int, count: int) -> tuple[int, Token] | None:
    """Return the longer phrase whose last word was misspelled: `pasta sever`."""
    said = tuple(words[start : start + count])
    following = words[start + count] if start + count < len(words) else ""
    if len(following) < _LEAST or any(e.words == (following,) for e in _phrases().get(following, ())):
        return None
    for entry in _phrases().get(words[start], ()):
        longer = len(entry.words) == count + 1 and entry.words[:count] == said
        if longer and entry.noun is not None and distance(entry.words[-1], following) == 1:
            return count + 1, entry.noun
    return None


_LEAST = 4
"""Letters of the shortest word that is repaired."""


def _longest(words: Sequence[str], start: int, before: Token | None) -> tuple[int, Token | None]:
    """Return how many words the longest known phrase at `start` has, and its token."""
    if words[start] == "'s":
        return 1, _short_is(words, start, before)
    for entry in _phrases().get(words[start], ()):
        count = len(entry.words)
        if count > 1 and tuple(words[start : start + count]) != entry.words:
            continue
        if entry.closed is not None and entry.closed.kind is Kind.FILLER and _leads_noun(words, start, count):
            continue
        alone = (before is None and start == 0 and count == len(words)) or _stands_first(words, start + count, before)
        if entry.noun is not None and entry.closed is None and only_led(entry.words) and not (_led(before) or alone):
            return count, Token(Kind.FILLER, "", " ".join(entry.words))
        if entry.noun is None or entry.closed is None:
            return count, entry.noun or entry.closed
        return count, entry.noun if _is_noun(words, start + count, entry, before) else entry.closed
    return 0, None


def _leads_noun(words: Sequence[str], start: int, count: int) -> bool:
    """Return whether the end of a phrase begins a noun that goes on: `a little train` is not `a little`."""
    after = [e.words for e in _phrases().get(words[start + 1], ()) if e.noun is not None] if count == 2 else []
    return any(len(noun) > 1 and tuple(words[start + 1 : start + 1 + len(noun)]) == noun for noun in after)


def _stands_first(words: Sequence[str], after: int, before: Token | None) -> bool:
    """Return whether a word is the first of a note, and what follows says where: `jam in the cabinet`."""
    following = words[after] if after < len(words) else ""
    return (before is None or before.kind in _OPENING) and following in _WHERE


_OPENING = (Kind.AND, Kind.ALSO, Kind.THEN, Kind.FACT)
_WHERE = frozenset(["in", "on", "from", "to", "into", "onto", "inside", "and", "n", "out", "off", "goes", "belongs"])


def _led(before: Token | None) -> bool:
    return before is not None and (before.kind in _ARGUMENT or before.text == "no")


def _is_noun(words: Sequence[str], after: int, entry: _Entry, before: Token | None) -> bool:
    """Return whether a word that may be a noun or do something (`watch`, `can`, `light`) is a noun here."""
    assert entry.closed is not None
    following = words[after] if after < len(words) else ""
    if entry.words in (("lights",), ("light",)) and (following in _LIT or (before and before.text in _POINTING)):
        return True  # lights on
    if " ".join(entry.words) in word_lists().lists.named_first and (before is None or before.kind is Kind.FACT):
        return following in _WHERE or (not following and entry.closed.kind is Kind.VERB)
    if before is None:
        return False
    if before.kind is Kind.AND and entry.closed.kind is Kind.FILLER:
        return True  # bread and honey
    if before.kind is Kind.DETERMINER and before.text in ("that", "this", "its") and entry.closed.kind is not Kind.VERB:
        return False
    if entry.closed.kind is Kind.VERB and before.kind in _ARGUMENT and before.value != "to":
        return not (before.kind is Kind.VERB and entry.closed.form != "base")
    return before.kind in _LEADS and before.kind is not Kind.ROOM


_LIT = frozenset(
    ["on", "off", "out", "needs", "should", "is", "in", "of", "at", "was", "shall", "still", "must", "stays"]
)


def _short_is(words: Sequence[str], start: int, before: Token | None) -> Token:
    """Return what `'s` does: `the mug's on the desk`, `the mug's handle`."""
    following = words[start + 1] if start + 1 < len(words) else ""
    entry = next((e for e in _phrases().get(following, ()) if len(e.words) == 1), None)
    states = (Kind.PREPOSITION, Kind.NOT, Kind.ADJECTIVE, Kind.PARTICLE, Kind.THERE, Kind.FILLER, Kind.DETERMINER)
    if following.endswith("ing") and before is not None and before.kind in (Kind.NOUN, Kind.PRONOUN, Kind.UNKNOWN):
        return Token(Kind.FACT, "", "is")  # the phone's ringing
    is_state = entry is not None and entry.closed is not None and entry.closed.kind in states and entry.noun is None
    if is_state and before is not None and before.kind in (Kind.NOUN, Kind.PRONOUN):
        return Token(Kind.FACT, "", "is")
    return Token(Kind.POSSESSIVE, "", "'s")


def _repair(words: Sequence[str], at: int, name: bool) -> tuple[list[str], bool] | None:
    """Return the words that a word was meant to be, and whether the next one was part of it."""
    word, following = words[at], words[at + 1] if at + 1 < len(words) else ""
    if following and following.isalpha() and (word + following) in _phrases():
        return [word + following], True
    first = _first_mended(word, following)
    if first is not None:
        return [first], False
    split = _speller().split(word)
    if split:
        near = _speller().nearest(word)
        slip = len(near) == 1 and distance(word, near[0]) == 1 and not is_english(word)
        return ([near[0]] if slip else list(split)), False  # pinapple, not pin apple
    for plural in plurals(word.removesuffix("s")) if word.endswith("s") and len(word) > _LEAST else ():
        if plural in _phrases():
            return [plural], False  # strawberrys
    shorter = re.sub(r"(.)\1{2,}", r"\1\1", word)
    single = re.sub(r"(.)\1+", r"\1", shorter)
    for candidate in (shorter, single) if shorter != word or not is_english(word) else ():
        if candidate != word and candidate in _phrases():
            return [candidate], False
    if not name and not is_word(word):
        doubled = {twice for i in range(len(word)) if _named(twice := word[: i + 1] + word[i:])}
        if len(doubled) == 1:
            return [doubled.pop()], False  # hamer, though it may be a form of ham
    if is_english(word) or len(word) < _LEAST or word.isdigit() or name:
        return None
    near = _speller().nearest(word)
    if len(near) > 1 and len({_named(w) for w in near} - {""}) == 1 and all(map(_named, near)):
        near = near[:1]  # two spellings of one noun
    if len(near) > 1:  # the coffe table
        near = tuple(w for w in near if any(e.words[:2] == (w, following) for e in _phrases().get(w, ())))
    return ([near[0]], False) if len(near) == 1 else None


def _first_mended(word: str, following: str) -> str | None:
    """Return what the first word of a noun was meant to be, though its stem is a word: `cuting board`."""
    if len(word) <= _LEAST or is_word(word):
        return None
    near = {first for first in _firsts().get(following, ()) if first[0] == word[0] and distance(first, word) == 1}
    return near.pop() if len(near) == 1 else None


@cache
def _firsts() -> Mapping[str, frozenset[str]]:
    """Return the first words of the nouns of two words, by the second."""
    table: dict[str, set[str]] = {}
    for first, entries in _phrases().items():
        for entry in entries:
            if entry.noun is not None and len(entry.words) == 2:
                table.setdefault(entry.words[1], set()).add(first)
    return {second: frozenset(firsts) for second, firsts in table.items()}


def _named(word: str) -> str:
    """Return what a word by itself is the noun of, or nothing."""
    return next((e.noun.value for e in _phrases().get(word, ()) if len(e.words) == 1 and e.noun is not None), "")


def _told(tokens: list[Token]) -> list[Token]:
    """Return the tokens with `Tom left` and `I put` as one that tells where something is."""
    read: list[Token] = []
    for token in tokens:
        if token.kind in (Kind.VERB, Kind.UNKNOWN) and token.text in word_lists().lists.told and token.close:
            back = len(read) - 1
            while (
                back >= 0 and read[back].kind is Kind.FILLER and read[back + 1 if back + 1 < len(read) else back].close
            ):
                back -= 1
            teller = read[back] if back >= 0 else None
            if teller is not None and _tells(teller, token, read[back - 1] if back else None):
                relative = back > 0 and teller.close and read[back - 1].kind is Kind.NOUN
                del read[back + 1 :]
                kind = Kind.RELATIVE if relative else Kind.FACT
                read[back] = teller._replace(kind=kind, value="told", text=f"{teller.text} {token.text}", end=token.end)
                continue
        read.append(token)
    return read


_PAST_ONLY = frozenset(["left", "forgot", "dropped", "abandoned", "misplaced", "stood", "hung", "hid"])


def _tells(teller: Token, verb: Token, before: Token | None) -> bool:
    if teller.kind is Kind.SUBJECT:
        return True
    person = teller.kind is Kind.UNKNOWN and (before is None or before.kind not in (Kind.NOUN, Kind.VERB))
    return (person or teller.text in ("you", "they")) and verb.text in _PAST_ONLY
