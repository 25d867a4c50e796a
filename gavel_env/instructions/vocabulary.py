"""The words of the benchmarks: what movables, furniture and rooms are called, and what each piece is used for.

Data: `envs_data/vocabulary.json` (docs/howto/instructions.md). Every noun names one category only, so that a
sentence says which category it means.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Literal

import msgspec

from gavel_env.data import read_json, shipped_data

__all__ = ["FurnitureWords", "MovableWords", "Theme", "Use", "Vocabulary", "default_vocabulary"]

FORMAT = "gavel-vocabulary/1"

Theme = Literal["dish", "tray", "laundry", "hot_food", "food", "drink", "pantry", "office", "toy", "bath", "household"]
Use = Literal["on", "in", "run", "switch"]


class MovableWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A movable category: its nouns (the first is the usual one), its theme, and whether its noun is a plural."""

    nouns: tuple[str, ...]
    theme: Theme
    plural: bool = False


class FurnitureWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A furniture category.

    Attributes:
        nouns: what people call it, the usual one first.
        uses: what the benchmarks use it for: put on, put in, run, switch on.
        suits: themes of what is plausibly put there; empty = any.
    """

    nouns: tuple[str, ...]
    uses: tuple[Use, ...]
    suits: tuple[Theme, ...] = ()


class Vocabulary(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole table, by category; `rooms` by room type."""

    format: str
    provenance: str
    movables: Mapping[str, MovableWords]
    furniture: Mapping[str, FurnitureWords]
    rooms: Mapping[str, tuple[str, ...]]

    def nouns(self, category: str) -> tuple[str, ...]:
        """Return the nouns of a movable or piece of furniture; of others, the name with spaces."""
        words = self.movables.get(category) or self.furniture.get(category)
        return words.nouns if words else (category.replace("_", " "),)

    def room_nouns(self, room_type: str) -> tuple[str, ...]:
        """Return the nouns of a room type."""
        return self.rooms.get(room_type, (room_type.replace("_", " "),))

    def is_plural(self, category: str) -> bool:
        """Return whether the noun is a plural (`the jeans`)."""
        words = self.movables.get(category)
        return words is not None and words.plural


@cache
def default_vocabulary() -> Vocabulary:
    """Return the shipped vocabulary.

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    return read_json(shipped_data("vocabulary.json"), Vocabulary, "vocabulary file", version=FORMAT)
