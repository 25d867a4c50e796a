"""What sentences are made of: entities, phrases, and frames that hold a verb with what goes with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from gavel_agents.understanding.rules.nouns import kinds_of
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.ontology import Category

__all__ = ["Cycle", "Element", "Entity", "Frame", "Part", "Phrase", "Pronoun", "Room", "Separator", "There", "Unknown"]


class Entity(NamedTuple):
    """A noun phrase for a thing.

    Attributes:
        category: what it designates: a category, or a concept over several.
        room: type of the room that was said with it.
    """

    category: str
    room: str | None = None

    @property
    def kinds(self) -> tuple[Category, ...]:
        """The categories that it may be."""
        return kinds_of(self.category)

    @property
    def movable(self) -> bool:
        """True for what can be carried."""
        return self.kinds[0].graspable


class Unknown(NamedTuple):
    """A noun phrase that names nothing known."""

    words: str


class Pronoun(NamedTuple):
    """`it` and `them`, `both`, or `the whole thing`.

    Attributes:
        whole: the thing with what is on it.
        both: several things.
        weak: a word that often stands for nothing: `one`, `that`.
    """

    whole: bool = False
    both: bool = False
    weak: bool = False


class There(NamedTuple):
    """`there`."""


class Room(NamedTuple):
    """A room that stands for itself."""

    type: str


class Phrase(NamedTuple):
    """A prepositional phrase.

    Attributes:
        preposition: as in `Kind.PREPOSITION`, or "where" (the place of the target).
        target: what follows it.
        relative: it says where something is (`that's on …`).
        directional: it can only say where something goes (`into`, `to`).
    """

    preposition: str
    target: Entity | Room | Pronoun | There | Unknown
    relative: bool = False
    directional: bool = False


class Part(NamedTuple):
    """A word that stands alone: on, off, door."""

    word: str


class Cycle(NamedTuple):
    """`a wash`, `a spin`."""

    what: str


class Separator(NamedTuple):
    """`and`, a comma, `then`, ..., and where it stands in the sentence."""

    kind: Kind
    start: int = 0


Element = Entity | Pronoun | Phrase | Part | Cycle | Separator | Unknown


@dataclass
class Frame:
    """A verb and what goes with it.

    Attributes:
        verb: what it asks for.
        word: as it was said.
        mood: "do", "fact" or "wish".
        negated: it shall not be.
        marked: `make sure that` leads to it.
        elements: in the order said.
        before: the separators that lead to it.
        end: where it ends in the sentence.
        aside: it says why or when, and asks for nothing.
        told: someone tells it of the past.
        corrects: it replaces what was said just before.
        heading: a colon follows it: what comes next belongs to it.
        meantime: it only holds for a while: `park one of them there meanwhile`.
        start: where it starts in the text.
        definite: things that an article, a possessive or the like leads: not `while making tea`.
        several: groups of several kinds, with how many they are: `both bottles`.
        speaker: someone speaks of themselves, and of nothing past.
        done: how many of its elements stand before its participle: `the plates washed`.
    """

    verb: str = ""
    word: str = ""
    mood: str = "do"
    negated: bool = False
    marked: bool = False
    elements: list[Element] = field(default_factory=list)
    before: list[Kind] = field(default_factory=list)
    end: int = 0
    aside: bool = False
    told: bool = False
    corrects: bool = False
    heading: bool = False
    meantime: bool = False
    start: int = -1
    done: int = 0
    speaker: bool = False
    definite: set[Entity] = field(default_factory=set)
    several: dict[Entity, int] = field(default_factory=dict)

    def of(self, kind: type) -> list[Element]:
        """Return the elements of one type."""
        return [e for e in self.elements if isinstance(e, kind)]

    @property
    def empty(self) -> bool:
        """True if nothing but separators was said."""
        return not self.verb and all(isinstance(e, Separator) for e in self.elements)
