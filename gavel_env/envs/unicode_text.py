"""A text space for what people write: any Unicode text up to a length; `spaces.Text` needs a list of characters."""

from __future__ import annotations

import string
from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from gymnasium.spaces import Text

__all__ = ["UnicodeText", "is_unicode"]

_CODE_POINTS = 0x110000
_SAMPLED = tuple(string.printable)


def is_unicode(text: str) -> bool:
    """Return whether a text can be encoded: lone surrogates, halves of a character, cannot."""
    return not any("\ud800" <= character <= "\udfff" for character in text)


class _Characters(Sequence[str]):
    """Every code point, by number."""

    def __len__(self) -> int:
        return _CODE_POINTS

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        return [chr(i) for i in range(*index.indices(_CODE_POINTS))] if isinstance(index, slice) else chr(index)

    def __contains__(self, character: object) -> bool:
        return isinstance(character, str) and len(character) == 1 and is_unicode(character)


class UnicodeText(Text):
    """Texts of at most `max_length` characters. Samples are ASCII; a flattened text is its code points."""

    def __init__(self, max_length: int, *, min_length: int = 0, seed: int | np.random.Generator | None = None) -> None:
        super().__init__(max_length, min_length=min_length, charset=string.printable, seed=seed)

    def sample(self, mask: Any = None, probability: Any = None) -> str:
        """Return a random text of printable ASCII.

        Raises:
            ValueError: a mask or probabilities are given; a million characters have none.
        """
        if mask is not None or probability is not None:
            raise ValueError("a UnicodeText is sampled without mask and probabilities")
        length = int(self.np_random.integers(self.min_length, self.max_length + 1))
        return "".join(_SAMPLED[i] for i in self.np_random.integers(len(_SAMPLED), size=length))

    def contains(self, x: Any) -> bool:
        """Return whether `x` is a text that fits and can be encoded."""
        return isinstance(x, str) and self.min_length <= len(x) <= self.max_length and is_unicode(x)

    @property
    def character_set(self) -> Any:
        """Every character."""
        return _Characters()

    @property
    def character_list(self) -> Any:
        """Every character, by code point."""
        return _Characters()

    def character_index(self, char: str) -> np.int32:
        """Return the code point."""
        return np.int32(ord(char))

    def __repr__(self) -> str:
        return f"UnicodeText({self.min_length}, {self.max_length})"

    __hash__ = Text.__hash__

    def __eq__(self, other: object, /) -> bool:
        return isinstance(other, UnicodeText) and (self.min_length, self.max_length) == (
            other.min_length,
            other.max_length,
        )
