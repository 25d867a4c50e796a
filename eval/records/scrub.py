"""What must not reach a record: keys, tokens and other values of environment variables.

Values are scrubbed before they are encoded, so that no secret hides behind an escape and no encoding is broken by one.
"""

from __future__ import annotations

import os
import re
import traceback
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import msgspec

__all__ = ["describe_error", "may_hold_secrets", "scrub", "scrub_secrets", "scrubbed"]

_SECRET_NAME = re.compile(r"key|token|secret|passw|credential|auth|cookie", re.IGNORECASE)
_SECRET_SHAPE = re.compile(
    r"\bsk-[A-Za-z0-9_\-]{16,}|\bhf_[A-Za-z0-9]{20,}|\bgh[pous]_[A-Za-z0-9]{20,}"  # keys of well-known services
    r"|(?<=Bearer )[A-Za-z0-9._\-]{8,}"
    r"|(?<=://)[^/\s:@\"]+:[^/\s@\"]+(?=@)"  # user:password in a URL
)
_SHAPES_BEGIN = ("sk-", "hf_", "ghp_", "gho_", "ghu_", "ghs_", "Bearer ", "://")
"""One of these is in every text that `_SECRET_SHAPE` matches; looking for them is quicker."""

_SHORTEST_VALUE = 8
_MOST_CHARACTERS = 8000

_Replaced = tuple[tuple[str, str], ...]


def _values(environment: Mapping[str, str] | None, *, secrets: bool) -> _Replaced:
    """Return (value, what to write instead) of environment variables, longest values first."""
    environment = os.environ if environment is None else environment
    found = [
        (value, f"[{name}]")
        for name, value in environment.items()
        if len(value) >= _SHORTEST_VALUE and (not secrets or _SECRET_NAME.search(name))
    ]
    return tuple(sorted(found, key=lambda item: (-len(item[0]), item[1])))


@lru_cache(maxsize=8)
def _pattern(values: _Replaced) -> tuple[re.Pattern[str] | None, dict[str, str]]:
    by_value = dict(reversed(values))
    text = "|".join(re.escape(value) for value, _ in values)
    return (re.compile(text) if text else None), by_value


def _without(text: str, values: _Replaced) -> str:
    pattern, names = _pattern(values)
    if pattern is not None:
        text = pattern.sub(lambda match: names[match.group()], text)
    return _SECRET_SHAPE.sub("[removed]", text) if _shaped(text) else text


def _shaped(text: str) -> bool:
    return any(beginning in text for beginning in _SHAPES_BEGIN)


def scrub_secrets(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Return the text without anything that is, or looks like, a key, token or password.

    Args:
        text: to be written down.
        environment: environment variables; default those of the process.
    """
    return _without(text, _values(environment, secrets=True))


def scrub(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Return the text without secrets and without any longer value of an environment variable."""
    return _without(scrub_secrets(text, environment), _values(environment, secrets=False))


def may_hold_secrets(encoded: str) -> bool:
    """Return whether JSON text may hold something that `scrubbed` would take out; quick, and never wrong about no.

    Args:
        encoded: as msgspec writes it, which escapes quotes, backslashes and control characters alone.
    """
    values = _values(None, secrets=True)
    written = tuple((msgspec.json.encode(value).decode()[1:-1], name) for value, name in values)
    pattern, _ = _pattern(written)
    if pattern is not None and pattern.search(encoded):
        return True
    return _shaped(encoded) and _SECRET_SHAPE.search(encoded) is not None


def scrubbed(value: Any, kept: frozenset[str] = frozenset(), names: frozenset[str] = frozenset()) -> Any:
    """Return JSON-like data without secrets in any of its strings, keys included; characters that no UTF-8 has are `?`.

    Args:
        value: dicts, lists, tuples, strings, numbers and None.
        kept: keys whose values are the program's own words and stay as they are.
        names: keys that are names of fields and stay as they are.
    """
    values = _values(None, secrets=True)

    def clean(value: Any) -> Any:
        if isinstance(value, str):
            text = value if value.isascii() else value.encode("utf-8", "replace").decode("utf-8")
            return _without(text, values)
        if isinstance(value, dict):
            return {
                key if key in names else clean(key): item if key in kept else clean(item) for key, item in value.items()
            }
        if isinstance(value, list | tuple):
            return [clean(item) for item in value]
        return value

    return clean(value)


def describe_error(error: BaseException) -> str:
    """Return the traceback of an error for a record: files by their last three parts, scrubbed, cut in the middle."""
    lines = traceback.format_exception(error)
    text = "".join(re.sub(r'File "[^"]*?((?:[^/"]+/){0,2}[^/"]+)"', r'File "\1"', line) for line in lines)
    text = scrub(text.rstrip())
    if len(text) > _MOST_CHARACTERS:
        half = _MOST_CHARACTERS // 2
        text = f"{text[:half]}\n[… {len(text) - 2 * half} characters left out …]\n{text[-half:]}"
    return text
