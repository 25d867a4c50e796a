"""The little English that texts of activities need: commands, plurals, lists."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = ["imperative", "joined", "plural", "title_of"]

# Verbs whose stem is not simply the word without "ing".
_VERBS = {
    "boxing": "box", "doing": "do", "emptying": "empty", "laying": "lay", "drying": "dry", "paying": "pay",
    "tidying": "tidy", "buying": "buy", "carrying": "carry", "mopping": "mop", "getting": "get", "putting": "put",
    "setting": "set", "shopping": "shop", "stripping": "strip", "rinsing": "rinse", "moving": "move",
    "arranging": "arrange", "rearranging": "rearrange", "composting": "compost", "assembling": "assemble",
    "recycling": "recycle", "re-shelving": "re-shelve", "scrubbing": "scrub", "spring": "spring", "setup": "set up",
    "hiding": "hide", "repairs": "make repairs", "preparing": "prepare",
}  # fmt: skip
_WITH_E = (
    "at", "iz", "iv", "ec", "os", "ov", "us", "ac", "ak", "id", "ar", "or", "erv", "ap", "ut", "yc", "av", "ot",
)  # fmt: skip
_ODD = {
    "knife": "knives", "shelf": "shelves", "bookshelf": "bookshelves", "loaf": "loaves", "half": "halves",
    "mouse": "mice", "potato": "potatoes", "tomato": "tomatoes", "scarf": "scarves",
}  # fmt: skip
_WITHOUT_E = ("treat", "clear", "heat", "sort")


def imperative(word: str) -> str:
    """Return a gerund as a command: `putting` -> `put`; other words as they are."""
    if word in _VERBS:
        return _VERBS[word]
    if not word.endswith("ing"):
        return word
    stem = word[:-3]
    return stem + "e" if stem.endswith(_WITH_E) and not stem.endswith(_WITHOUT_E) else stem


def title_of(activity: str) -> str:
    """Return an activity's name as a sentence without its full stop: `putting_away_toys` -> `Put away toys`."""
    words = re.sub(r"\b(de|re)_", r"\1-", activity).replace("_s_", "'s_").split("_")
    words[0] = imperative(words[0])
    title = re.sub(r"\ba (?=[aeiouAEIOU]|LED)", "an ", " ".join(words))
    return title[:1].upper() + title[1:]


def plural(noun: str) -> str:
    """Return the plural of a noun phrase: `box of candy` -> `boxes of candy`."""
    head, of, rest = noun.partition(" of ")
    before, space, word = head.rpartition(" ")
    if word in _ODD:
        word = _ODD[word]
    elif word.endswith(("ss", "us", "x", "ch", "sh", "z")):
        word += "es"
    elif word.endswith("y") and word[-2:-1] not in "aeiou":
        word = word[:-1] + "ies"
    elif not word.endswith("s"):
        word += "s"
    return before + space + word + of + rest


def joined(clauses: Sequence[str], comma: str, word: str = "and") -> str:
    """Return `a, b and c`."""
    if len(clauses) < 2:
        return "".join(clauses)
    last = f"{comma.rstrip()} {word} " if comma.strip() == ";" else f" {word} "
    return f"{comma.join(clauses[:-1])}{last}{clauses[-1]}"
