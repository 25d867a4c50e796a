"""What may be read at all: text of a bearable length, in English."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.words import word_lists

__all__ = ["MOST_CHARACTERS", "readable"]

MOST_CHARACTERS = 4000

_NOT_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f\x7f\ufffd{}\\]|<[/\w]")
_SCRIPTS: Mapping[str, str] = {
    "CJK": "Chinese",
    "HIRAGANA": "Japanese",
    "KATAKANA": "Japanese",
    "HANGUL": "Korean",
    "CYRILLIC": "Russian or another language in Cyrillic letters",
    "GREEK": "Greek",
    "ARABIC": "Arabic",
    "HEBREW": "Hebrew",
    "DEVANAGARI": "Hindi",
    "THAI": "Thai",
}
_SHARED = frozenset(
    {"a", "i", "in", "is", "e", "o", "do", "en", "was", "on", "no", "the", "te", "die", "den", "as", "de"}
)
_LETTERS = re.compile(r"[^\W\d_]+(?:'[^\W\d_]+)?")
_ENGLISH = frozenset(
    {"the", "a", "an", "and", "to", "of", "in", "on", "is", "it", "my", "your", "please", "put", "take", "that", "from"}
    | {"with", "into", "for", "i", "you", "this", "should", "can", "could"}
)


def readable(text: str) -> str:
    """Return a text in its compatible Unicode form.

    Raises:
        Abstention: `empty`, `too_long`, `not_text` or `foreign`.
    """
    if len(text) > MOST_CHARACTERS:
        raise Abstention("too_long", f"{len(text)} characters; at most {MOST_CHARACTERS}")
    if not text.strip():
        raise Abstention("empty", "nothing is said")
    plain = unicodedata.normalize("NFKC", text)
    plain = re.sub("[‘’ʼ`´]", "'", plain).replace("…", "... ")
    strange = _NOT_TEXT.search(plain)
    if strange is not None:
        raise Abstention("not_text", f"cannot read {strange.group()[:20]!r}")
    if len(plain) > MOST_CHARACTERS:
        raise Abstention("too_long", f"{len(plain)} characters; at most {MOST_CHARACTERS}")
    language = _foreign(plain)
    if language:
        raise Abstention("foreign", f"this reads as {language}; only English is understood")
    return plain


def _foreign(text: str) -> str:
    """Return the language that a text is in if that is not English, or nothing."""
    letters = [c for c in text if c.isalpha()]
    other = Counter(
        script for c in letters if ord(c) > 0x24F for script in _SCRIPTS if unicodedata.name(c, "").startswith(script)
    )
    if letters and sum(other.values()) * 2 > len(letters):
        if other["HIRAGANA"] + other["KATAKANA"]:
            return "Japanese"
        return _SCRIPTS[other.most_common(1)[0][0]]
    words = [word.lower() for word in _LETTERS.findall(text)]
    english = sum(word in _ENGLISH for word in words)
    scores = {
        language: (sum(w in stops and w not in _SHARED for w in words), sum(w in stops for w in words))
        for language, stops in word_lists().languages.items()
    }
    language, (own, all_of_it) = max(scores.items(), key=lambda item: (item[1], item[0]))
    return language if own >= 2 and all_of_it > english else ""
