"""JSON values in a model's answer, and what is nearly JSON: single quotes, trailing commas, Python's constants.

Reading is bounded: by `_MOST_TRIES` and `_MOST_TRIED` characters for beginnings that turn out to be no value, by
`_DEEPEST` for what stands in one another. An answer that needs more is read line by line.
"""

from __future__ import annotations

import json
import re
from typing import Any, Final

__all__ = ["values_in"]

_MOST_TRIES: Final = 1_000
_MOST_TRIED: Final = 400_000
_MOST_TOKENS: Final = 60_000
_DEEPEST: Final = 32
_BRACKET = re.compile(r"[\[{]")
_TOKEN = re.compile(
    r"""\s*+(?:(?P<mark>[][{}(),:])|(?P<string>"(?:[^"\\]|\\.)*+"|'(?:[^'\\]|\\.)*+')"""
    r"""|(?P<number>-?\d{1,40}+(?:\.\d{1,40}+)?+(?:[eE][+-]?\d{1,3}+)?+)(?![\w.])|(?P<word>[A-Za-z]++))""",
    re.DOTALL,
)
_ESCAPE = re.compile(r"\\(u[0-9a-fA-F]{4}|x[0-9a-fA-F]{2}|.)", re.DOTALL)
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "\n": ""}
_WORDS = {"True": True, "true": True, "False": False, "false": False, "None": None, "null": None}
_CLOSING = {"[": "]", "{": "}", "(": ")"}


def values_in(text: str) -> list[tuple[Any, int]]:
    """Return the lists and objects of a text, outermost ones alone, each with its length in characters."""
    decoder = json.JSONDecoder()
    tokens = _Tokens(text)
    values: list[tuple[Any, int]] = []
    at = tries = tried = 0
    while tries < _MOST_TRIES and tried < _MOST_TRIED and (match := _BRACKET.search(text, at)) is not None:
        start = match.start()
        try:
            value, end = decoder.raw_decode(text, start)
        except json.JSONDecodeError as error:
            tried += max(1, error.pos - start)
            value, end = tokens.value_at(start)
        except (ValueError, RecursionError):  # a number of too many digits, too much in one another
            tried += 1000
            value, end = tokens.value_at(start)
        if value is None:
            at = start + 1
            tries += 1
        else:
            values.append((value, end - start))
            at = end
    return values


class _Unreadable(Exception):
    """What stands here is not a value."""


class _Tokens:
    """Reads values that are nearly JSON, with so many tokens to spend on one text."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._left = _MOST_TOKENS
        self._at = 0

    def value_at(self, start: int) -> tuple[Any, int]:
        """Return the value that begins here, and where it ends; None if none does."""
        self._at = start
        try:
            return self._value(self._next(), 0), self._at
        except _Unreadable:
            return None, start

    def _next(self) -> re.Match[str]:
        self._left -= 1
        token = _TOKEN.match(self._text, self._at) if self._left > 0 else None
        if token is None:
            raise _Unreadable
        self._at = token.end()
        return token

    def _value(self, token: re.Match[str], depth: int) -> Any:
        if depth > _DEEPEST:
            raise _Unreadable
        found = token.group(token.lastgroup or 0)
        if token.lastgroup == "string":
            return _unescaped(found[1:-1])
        if token.lastgroup == "number":
            return int(found) if found.lstrip("-").isdecimal() else float(found)
        if token.lastgroup == "word" and found in _WORDS:
            return _WORDS[found]
        if found == "{":
            return self._entries(depth)
        if found in ("[", "("):
            return self._items(_CLOSING[found], depth)
        raise _Unreadable

    def _items(self, closing: str, depth: int) -> list[Any]:
        items: list[Any] = []
        token = self._next()
        while token.group("mark") != closing:
            items.append(self._value(token, depth + 1))
            token = self._separated(closing)
        return items

    def _entries(self, depth: int) -> dict[Any, Any]:
        entries: dict[Any, Any] = {}
        token = self._next()
        while token.group("mark") != "}":
            key = self._value(token, depth + 1)
            if not isinstance(key, str | int | float | bool | None) or self._next().group("mark") != ":":
                raise _Unreadable
            entries[key] = self._value(self._next(), depth + 1)
            token = self._separated("}")
        return entries

    def _separated(self, closing: str) -> re.Match[str]:
        """Return the token behind a comma, or the closing one."""
        token = self._next()
        if token.group("mark") == ",":
            return self._next()
        if token.group("mark") != closing:
            raise _Unreadable
        return token


def _unescaped(text: str) -> str:
    def one(escape: re.Match[str]) -> str:
        said = escape.group(1)
        if len(said) > 1:
            return chr(int(said[1:], 16))
        return _ESCAPED.get(said, said)

    return _ESCAPE.sub(one, text) if "\\" in text else text
