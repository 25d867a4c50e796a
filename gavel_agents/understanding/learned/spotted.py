"""From text to what the network reads: tokens as numbers, with things, pieces and rooms in the place of their names.

A noun is told by what its kind can do (carried, opened, switched, put on, put in), never by which noun it is, so that
what is learnt of a mug holds for every other thing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.understanding.rules.clauses import Clauses
from gavel_agents.understanding.rules.elements import Entity
from gavel_agents.understanding.rules.english import could_act, could_name, is_english
from gavel_agents.understanding.rules.lexer import Token, tokens_of
from gavel_agents.understanding.rules.nouns import kinds_of, known_nouns, room_named, thing_named, words_of
from gavel_agents.understanding.rules.stream import CABINETS
from gavel_agents.understanding.rules.words import Kind
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import any_of, default_concepts
from gavel_env.world_model.ontology import Category

__all__ = ["FEATURES", "KINDS", "PAIR_FEATURES", "Mention", "Spotted", "pair_features", "spotted", "unknown_features"]

KINDS = ("", "top_cabinet", "bottom_cabinet", "bottom_cabinet_no_top")
"""What a word for a cabinet may be told to mean; the first: what the word says by itself."""
_TYPES = tuple(Kind)
_ABILITIES = ("graspable", "surface", "interior", "openable", "toggleable", "washes", "dries", "cookable")
_EXTRA = 25
FEATURES = len(_TYPES) + len(_ABILITIES) + _EXTRA + len(KINDS)
_STOPS = (Kind.STOP,)


class Mention(NamedTuple):
    """A token that names a thing, a piece of furniture or a room.

    Attributes:
        token: its place among the tokens.
        name: category, room type or concept; what it is told to be by the words around it is not in it.
        room: True for a room.
        movable: True for what is carried.
        cabinet: True if its kind is told by the words around it.
        wider: what else the word may mean ("sink" any sink), or "".
        exact: of a thing, the kind that the word means first, where it may mean several, or "".
    """

    token: int
    name: str
    text: str
    room: bool
    movable: bool
    cabinet: bool
    wider: str = ""
    exact: str = ""


class Spotted(NamedTuple):
    """A text as the network reads it.

    Attributes:
        tokens: of the text.
        mentions: in the order said.
        values: what each closed-class token does, as a string.
        features: of each token, (tokens, FEATURES).
        house: rooms by type, or None.
    """

    tokens: tuple[Token, ...]
    mentions: tuple[Mention, ...]
    values: tuple[str, ...]
    features: NDArray[np.float32]
    house: Counter[str] | None

    def named(self, mention: Mention, room: str | None, kind: str = "") -> str:
        """Return the name of what a mention designates in a room."""
        if kind or mention.room:
            return kind or mention.name
        named = known_nouns().get(words_of(mention.text))
        if named is None or mention.name not in (named.name, named.exact):
            return mention.name
        return thing_named(named, mention.text, room, self.house, alike=True)


def spotted(text: str, house: Counter[str] | None) -> Spotted:
    """Return a text as the network reads it.

    Raises:
        Abstention: a word could be one of several that are spelled alike.
    """
    tokens = tokens_of(text)
    stream = Clauses(tokens, house, None, [])
    mentions: list[Mention] = []
    rows, values = [], []
    skipped: set[int] = set()
    told: dict[int, int] = {}
    for index, token in enumerate(tokens):
        if token.kind not in (Kind.NOUN, Kind.ROOM) or index in skipped:
            continue
        stream.position = index + 1
        contained = stream.contained(token) if token.kind is Kind.NOUN else None
        if contained is not None:
            skipped.update(range(index + 1, stream.position))
            mentions.append(Mention(index, contained.category, token.text, False, contained.movable, False))
            continue
        mention = _mention(index, token, house)
        mentions.append(mention)
        if mention.cabinet:
            stream.position = index + 1
            told[index] = KINDS.index(kind) if (kind := stream.kind_of_cabinet(token)) in KINDS else 0
    mentions = _either_room(mentions, tokens)
    by_token = {m.token: m for m in mentions}
    for index, token in enumerate(tokens):
        named = by_token.get(index)
        rows.append(_features(token, named, told.get(index, 0), house, index in skipped))
        values.append("" if named else f"{token.kind.value}:{token.value}" if token.value else "")
    features = np.array(rows, dtype=np.float32).reshape(len(tokens), FEATURES)
    return Spotted(tuple(tokens), tuple(mentions), tuple(values), features, house)


def _mention(index: int, token: Token, house: Counter[str] | None) -> Mention:
    named = known_nouns()[words_of(token.text)]
    if named.kind is Kind.ROOM:
        name = room_named(named, house)
        here = house is None or any(house[r] for r in default_concepts().room_types(name))
        if here or not named.thing:
            return Mention(index, name, token.text, True, False, False)
        name = named.thing
    else:
        name = thing_named(named, token.text, None, house, alike=True)
    cabinet, movable = named.name in CABINETS, Entity(name).movable
    wider = named.name if named.exact == name != named.name and not cabinet and not movable else ""
    return Mention(index, name, token.text, False, movable, cabinet, wider, named.exact if movable else "")


_ALONGSIDE = {Kind.OR, Kind.COMMA, Kind.DETERMINER, Kind.PREPOSITION, Kind.POSSESSIVE, Kind.ADJECTIVE}


def _either_room(mentions: Sequence[Mention], tokens: Sequence[Token]) -> list[Mention]:
    """Return mentions with rooms of which any will do as one choice: `a sink, kitchen or bathroom`."""
    found = list(mentions)
    run, last = [0], None
    for at in range(1, len(found) + 1):
        mark = _between(tokens, found[at - 1], found[at]) if at < len(found) else None
        if mark is not None:
            run, last = [*run, at], mark
            continue
        if last is Kind.OR:
            name = any_of(*(found[index].name for index in run))
            for index in run:
                found[index] = found[index]._replace(name=name)
        run, last = [at], None
    return found


def _between(tokens: Sequence[Token], before: Mention, after: Mention) -> Kind | None:
    """Return what stands between two rooms of which either will do, if nothing else does: `or`, or a comma."""
    kinds = [token.kind for token in tokens[before.token + 1 : after.token]]
    marks = [kind for kind in kinds if kind in (Kind.OR, Kind.COMMA)]
    if not (before.room and after.room and marks and set(kinds) <= _ALONGSIDE):
        return None
    return Kind.OR if Kind.OR in marks else Kind.COMMA


def _features(
    token: Token, mention: Mention | None, told: int, house: Counter[str] | None, skipped: bool
) -> list[float]:
    row = [float(token.kind is kind) for kind in _TYPES]
    category: Category | None = None
    if mention is not None and not mention.room:
        kinds = kinds_of(mention.name)
        category = kinds[0]
        row += [float(any(getattr(kind, ability) for kind in kinds)) for ability in _ABILITIES]
    else:
        row += [0.0] * len(_ABILITIES)
    unknown = token.kind is Kind.UNKNOWN
    theme = default_vocabulary().movables.get(mention.name) if mention is not None else None
    extra = [
        float(mention is not None), float(mention is not None and mention.room),
        float(mention is not None and mention.movable), float(mention is not None and mention.cabinet),
        float(category is not None and category.heat is not None and not category.graspable),
        float(category is not None and category.cold is not None),
        float(mention is not None and mention.name == "electric_switch"),
        float(token.form == "s"), float(token.form == "ing"), float(token.form == "ed"), float(token.close),
        float(token.name), float(skipped), float(unknown and could_name(token.text)),
        float(unknown and could_act(token.text)), float(unknown and not is_english(token.text)),
        float(theme is not None and theme.theme in ("dish", "tray")),
        float(theme is not None and theme.theme == "laundry"),
        float(theme is not None and theme.theme in ("food", "hot_food", "drink", "pantry")),
        float(mention is not None and mention.room and house is not None and house[mention.name] == 1),
        float(mention is not None and mention.room and house is not None and house[mention.name] > 1),
        float(category is not None and not category.graspable and category.toggleable and not category.interior),
        float(token.text.startswith(("not ", "no "))), float(token.value in (":", ";")), float(token.value == "("),
    ]  # fmt: skip
    assert len(extra) == _EXTRA
    return (
        row + extra + [float(told == k) if mention is not None and mention.cabinet else 0.0 for k in range(len(KINDS))]
    )


def unknown_features(token: Token) -> NDArray[np.float32]:
    """Return the features that a token would have if its word named nothing known."""
    unknown = token._replace(kind=Kind.UNKNOWN, value="")
    return np.array(_features(unknown, None, 0, None, skipped=False), dtype=np.float32)


_DISTANCES = (-40, -25, -16, -11, -8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 8, 11, 16, 25, 40)
_MOST = 3
PAIR_FEATURES = len(_DISTANCES) + 1 + 4 * (_MOST + 1) + 3


def pair_features(read: Spotted) -> NDArray[np.float32]:
    """Return how each two mentions stand to each other, (mentions, mentions, PAIR_FEATURES)."""
    count = len(read.mentions)
    found = np.zeros((count, count, PAIR_FEATURES), dtype=np.float32)
    kinds = [token.kind for token in read.tokens]
    by_token = {m.token: m for m in read.mentions}
    marks = np.zeros((4, len(kinds) + 1), dtype=int)
    for at, kind in enumerate(kinds):
        mention = by_token.get(at)
        what = (
            kind is Kind.STOP, kind in (Kind.AND, Kind.COMMA, Kind.THEN),
            mention is not None and mention.movable, mention is not None and not mention.movable and not mention.room,
        )  # fmt: skip
        marks[:, at + 1] = marks[:, at] + np.array(what, dtype=int)
    for i, a in enumerate(read.mentions):
        for j, b in enumerate(read.mentions):
            if i == j:
                continue
            distance = b.token - a.token
            found[i, j, int(np.searchsorted(_DISTANCES, distance))] = 1
            low, high = min(a.token, b.token) + 1, max(a.token, b.token)
            between = np.minimum(marks[:, high] - marks[:, low], _MOST)
            for which, number in enumerate(between):
                found[i, j, len(_DISTANCES) + 1 + which * (_MOST + 1) + int(number)] = 1
            found[i, j, -3:] = (distance > 0, high == low, a.name == b.name)
    return found
