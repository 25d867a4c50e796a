"""What a text can be speaking of: the categories and rooms that any of its phrases may mean.

A model's understanding is held to this: what it names must be in the text. Phrases are the nouns of the vocabulary and
of the concepts, with their plurals; unlike in the rules, a phrase may have several meanings and phrases may overlap.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import NamedTuple

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.nouns import in_a_room, leads_with_room, plurals, words_of
from gavel_env.errors import nearest_names
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.ontology import default_ontology

__all__ = ["Mentions"]

_LONGEST_PHRASE = 9


class _Meaning(NamedTuple):
    """Categories and room types that a phrase may mean."""

    categories: frozenset[str] = frozenset()
    rooms: frozenset[str] = frozenset()

    def __or__(self, other: _Meaning) -> _Meaning:
        return _Meaning(self.categories | other.categories, self.rooms | other.rooms)


@cache
def _meanings() -> Mapping[tuple[str, ...], _Meaning]:
    vocabulary = default_vocabulary()
    table: dict[tuple[str, ...], _Meaning] = {}

    def add(phrases: Iterable[str], meaning: _Meaning) -> None:
        for phrase in phrases:
            for form in (phrase, *plurals(phrase)):
                words = words_of(form)
                table[words] = table.get(words, _Meaning()) | meaning

    for category in default_ontology():
        nouns = (*vocabulary.nouns(category), category.replace("_", " "))
        add((noun.lower() for noun in nouns), _Meaning(categories=frozenset({category})))
    concepts = default_concepts()
    for noun, name in concepts.thing_words.items():
        if words_of(noun) not in table and not leads_with_room(noun, name):
            add((noun,), _Meaning(categories=frozenset(concepts.categories(name))))
    for room, nouns in vocabulary.rooms.items():
        add((*nouns, room.replace("_", " ")), _Meaning(rooms=frozenset({room})))
    for noun, name in concepts.place_words.items():
        if not table.get(words_of(noun), _Meaning()).rooms:
            add((noun,), _Meaning(rooms=frozenset(concepts.room_types(name))))
    return table


class Mentions:
    """The categories and room types that one text may speak of.

    Attributes:
        categories, rooms: them, sorted.
        phrases: phrases of the text for things, words joined by `_` -> the categories that each may mean.
        room_phrases: its phrases for rooms.
    """

    def __init__(self, text: str) -> None:
        spoken = words_of(text)
        bare = tuple(word.removesuffix("'s").removesuffix("'") for word in spoken)
        spans = {
            (start, end, words[start:end])
            for words in (spoken, bare)
            for start in range(len(words))
            for end in range(start + 1, min(start + _LONGEST_PHRASE, len(words)) + 1)
            if words[start:end] in _meanings()
        }
        found = _Meaning()
        said: dict[str, frozenset[str]] = {}
        rooms_said = set[str]()
        for start, end, phrase in spans:
            longer = [around for a, b, around in spans if a <= start and end <= b and b - a > end - start]
            if not all(in_a_room(" ".join(around)) for around in longer):
                continue  # "coffee table" is not another table; "garden chair" may be the chair in the garden
            meant = _meanings()[phrase]
            found |= meant
            if meant.categories:
                said["_".join(phrase)] = meant.categories
            if meant.rooms:
                rooms_said.add("_".join(phrase))
        self.categories, self.rooms = (tuple(sorted(part)) for part in found)
        self.phrases = dict(sorted(said.items()))
        self.room_phrases = tuple(sorted(rooms_said))

    def designator(self, written: str) -> Designator:
        """Return what a written name designates: `fridge`, `lower cabinet`, `bed@bedroom`.

        Raises:
            Abstention: `unknown_name`, `ambiguous` or `not_in_text`.
        """
        name, at, room = written.partition("@")
        category = self._resolve(name, default_ontology(), 0)
        return Designator(category, self.room(room) if at else None)

    def room(self, written: str) -> str:
        """Return the type of a room by its type or a noun for it.

        Raises:
            Abstention: as `designator`.
        """
        return self._resolve(written, default_vocabulary().rooms, 1)

    def _resolve(self, written: str, known: Iterable[str], part: int) -> str:
        mentioned = (self.categories, self.rooms)[part]
        name = written.strip().lower().replace(" ", "_")
        if name in known:
            meant = frozenset({name})
        else:
            meant = _meanings().get(words_of(written.replace("_", " ")), _Meaning())[part]
            if not meant:
                near = nearest_names(name[:60], list(known), 1)
                raise Abstention("unknown_name", f"{written[:60]!r}" + (f" (near: {near[0]!r})" if near else ""))
        spoken_of = sorted(meant.intersection(mentioned))
        if not spoken_of:
            raise Abstention("not_in_text", f"the text speaks of no {written[:60]!r}")
        if len(spoken_of) > 1:
            raise Abstention("ambiguous", f"{written[:60]!r} may be any of {', '.join(spoken_of)}")
        return spoken_of[0]
