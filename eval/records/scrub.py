"""What must not reach a record: keys, tokens and other values of environment variables."""

from __future__ import annotations

import os
import re
import traceback
from collections.abc import Mapping

__all__ = ["describe_error", "scrub", "scrub_secrets"]

_SECRET_NAME = re.compile(r"key|token|secret|passw|credential|auth|cookie", re.IGNORECASE)
_SECRET_SHAPE = re.compile(
    r"\bsk-[A-Za-z0-9_\-]{16,}|\bhf_[A-Za-z0-9]{20,}|\bgh[pous]_[A-Za-z0-9]{20,}"  # keys of well-known services
    r"|(?<=Bearer )[A-Za-z0-9._\-]{8,}"
    r"|(?<=://)[^/\s:@\"]+:[^/\s@\"]+(?=@)"  # user:password in a URL
)
_SHORTEST_VALUE = 8
_MOST_CHARACTERS = 8000


def scrub_secrets(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Return the text without anything that is, or looks like, a key, token or password.

    Args:
        text: to be written down.
        environment: environment variables; default those of the process.
    """
    environment = os.environ if environment is None else environment
    for name, value in sorted(environment.items(), key=lambda item: (-len(item[1]), item[0])):
        if len(value) >= _SHORTEST_VALUE and _SECRET_NAME.search(name):
            text = text.replace(value, f"[{name}]")
    return _SECRET_SHAPE.sub("[removed]", text)


def scrub(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Return the text without secrets and without any longer value of an environment variable."""
    environment = os.environ if environment is None else environment
    text = scrub_secrets(text, environment)
    for name, value in sorted(environment.items(), key=lambda item: (-len(item[1]), item[0])):
        if len(value) >= _SHORTEST_VALUE:
            text = text.replace(value, f"[{name}]")
    return text


def describe_error(error: BaseException) -> str:
    """Return the traceback of an error for a record: files by their last three parts, scrubbed, cut in the middle."""
    lines = traceback.format_exception(error)
    text = "".join(re.sub(r'File "[^"]*?((?:[^/"]+/){0,2}[^/"]+)"', r'File "\1"', line) for line in lines)
    text = scrub(text.rstrip())
    if len(text) > _MOST_CHARACTERS:
        half = _MOST_CHARACTERS // 2
        text = f"{text[:half]}\n[… {len(text) - 2 * half} characters left out …]\n{text[-half:]}"
    return text
