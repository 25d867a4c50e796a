"""Which words are English, and which could name a thing: what tells an aside from an order that has no reading."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources

__all__ = ["could_act", "could_name", "is_english", "is_past", "is_word", "stems"]


@cache
def _letters() -> Mapping[str, str]:
    """Return common words with what WordNet has them as: n, v, a, r; t = the noun names an artefact or food first."""
    packed = (resources.files("envs_data") / "english_words.txt.gz").read_bytes()
    return dict(line.split(" ", 1) for line in gzip.decompress(packed).decode().splitlines())


def stems(word: str) -> Iterator[str]:
    """Yield a word and what its endings may have been put to."""
    yield word
    for ending, stem in _ENDINGS:
        if word.endswith(ending) and len(word) > len(ending) + 1:
            yield word.removesuffix(ending) + stem
            if len(word) > len(ending) + 2 and not stem and word[-len(ending) - 1] == word[-len(ending) - 2]:
                yield word[: -len(ending) - 1]


_DRAWN_OUT = re.compile(r"(.)\1\1")
_SHORT = 3
"""Letters of the longest word that is passed over if it is none: `ugh`, `tsk`."""

_ENDINGS = (
    ("s", ""), ("es", ""), ("ies", "y"), ("ed", ""), ("ed", "e"), ("ied", "y"), ("ing", ""), ("ing", "e"), ("ly", ""),
    ("er", ""), ("er", "e"), ("est", ""), ("est", "e"), ("ier", "y"), ("iest", "y"), ("y", ""), ("y", "e"),
)  # fmt: skip


def is_english(word: str) -> bool:
    """Return whether a word, or what it is a form of, is in common use."""
    return any(stem in _letters() for stem in stems(word))


def is_word(word: str) -> bool:
    """Return whether a word, spelled as it is, is in common use: `cutting`, not `cuting` (though `cut` is one)."""
    return word in _letters()


def could_name(word: str) -> bool:
    """Return whether a word could name a thing of a household: a known artefact or food, or no English word at all."""
    known = [_letters()[stem] for stem in stems(word) if stem in _letters()]
    return "t" in known[0] if known else len(word) > _SHORT and not _DRAWN_OUT.search(word)


def is_past(word: str) -> bool:
    """Return whether a word is the past of a verb: `dragged`, `fell`."""
    return word.endswith("ed") or "p" in _letters().get(word, "")


def could_act(word: str) -> bool:
    """Return whether a word could be an order: a verb, or no English word at all."""
    known = [_letters()[stem] for stem in stems(word) if stem in _letters()]
    return not known or "v" in known[0]
