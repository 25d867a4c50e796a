"""Typing errors in known words: one slip in short words, two in long ones, and only if one word alone is that near."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

__all__ = ["Speller", "distance"]

_LONG = 7


def distance(a: str, b: str) -> int:
    """Return how many letters must be changed, left out, added or swapped with the next to make one word the other."""
    rows = [list(range(len(b) + 1))]
    for i, x in enumerate(a, start=1):
        row = [i]
        for j, y in enumerate(b, start=1):
            row.append(min(rows[-1][j] + 1, row[-1] + 1, rows[-1][j - 1] + (x != y)))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                row[-1] = min(row[-1], rows[-2][j - 2] + 1)
        rows.append(row)
    return rows[-1][-1]


def _shorter(word: str) -> Iterator[str]:
    """Yield a word, and it without each of its letters: words one slip apart share one of these."""
    yield word
    for index in range(len(word)):
        yield word[:index] + word[index + 1 :]


def _undoubled(word: str, known: str) -> bool:
    """Return whether a word lacks one of two equal letters: `hamer`."""
    return any(word[:i] + word[i - 1 :] == known for i in range(1, len(word) + 1))


def _left_out(word: str, known: str) -> bool:
    """Return whether a word lacks one letter: `dumplng`."""
    return any(known[:i] + known[i + 1 :] == word for i in range(len(known)))


class Speller:
    """Finds the known word that a misspelled one was meant to be."""

    def __init__(self, words: Iterable[str]) -> None:
        self._words = frozenset(words)
        self._near: dict[str, list[str]] = {}
        for word in sorted(self._words):
            if len(word) >= 4:
                for form in set(_shorter(word)):
                    self._near.setdefault(form, []).append(word)

    def nearest(self, word: str) -> tuple[str, ...]:
        """Return the known words that are nearest, if they are near enough."""
        most = 2 if len(word) >= _LONG else 1
        found: dict[str, int] = {}
        for form in _shorter(word):
            for known in self._near.get(form, ()):
                if known not in found:
                    found[known] = distance(word, known) + (known[0] != word[0])
        near = sorted((steps, known) for known, steps in found.items() if steps <= most)
        swapped = [known for steps, known in near if sorted(known) == sorted(word)]
        if len(swapped) == 1:
            return (swapped[0],)  # letters in another order are the likeliest slip
        best = [known for steps, known in near if steps == near[0][0]]
        for slip in (_undoubled, _left_out):  # the next likeliest
            slipped = [known for known in best if slip(word, known)]
            if len(slipped) == 1:
                return (slipped[0],)
        return tuple(best)

    def split(self, word: str) -> tuple[str, str] | None:
        """Return the two known words that were written as one (`livingroom`), if it is not a word itself."""
        if word in self._words or len(word) < 7:
            return None
        for cut in range(3, len(word) - 2):
            if word[:cut] in self._words and word[cut:] in self._words:
                return word[:cut], word[cut:]
        return None
