"""Word pieces: how words become numbers, by greedy longest match against a vocabulary (WordPiece)."""

from __future__ import annotations

import re
from collections.abc import Mapping

__all__ = ["END", "SIGNS", "START", "UNKNOWN", "Pieces"]

SIGNS = PADDING, UNKNOWN, START, END = "[PAD]", "[UNK]", "[CLS]", "[SEP]"
"""The first pieces of a vocabulary; none of them stands for letters."""
_WORDS = re.compile(r"\w+|[^\w\s]")
_MOST = 6
"""Pieces that are kept of one token: longer words than this are names and slips."""


class Pieces:
    """A vocabulary of word pieces; a piece that goes on with a word begins with `##`."""

    def __init__(self, vocabulary: Mapping[str, int]) -> None:
        self.vocabulary = vocabulary
        self._known: dict[str, tuple[int, ...]] = {}

    def of(self, text: str) -> tuple[int, ...]:
        """Return the numbers of the pieces of a few words; at least one, at most six."""
        found = self._known.get(text)
        if found is None:
            every = [piece for word in _WORDS.findall(text.lower()) for piece in self._of_word(word)]
            found = self._known[text] = tuple(every[:_MOST]) or (self.vocabulary[UNKNOWN],)
        return found

    def _of_word(self, word: str) -> list[int]:
        pieces, start = [], 0
        while start < len(word):
            for end in range(len(word), start, -1):
                piece = self.vocabulary.get(("##" if start else "") + word[start:end])
                if piece is not None:
                    pieces.append(piece)
                    start = end
                    break
            else:
                return [self.vocabulary[UNKNOWN]]
        return pieces
