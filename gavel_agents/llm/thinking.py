"""Answers of models that think aloud before they answer."""

from __future__ import annotations

import re

__all__ = ["without_thinking"]

_THINKING = re.compile(r"<(think|thinking|reasoning)>.*?(</\1>|\Z)", re.DOTALL | re.IGNORECASE)
_HEADLESS = re.compile(r"\A.*?</(?:think|thinking|reasoning)>", re.DOTALL | re.IGNORECASE)


def without_thinking(text: str) -> str:
    """Return an answer without its thinking, also where only the end of the thinking is marked."""
    return _HEADLESS.sub("", _THINKING.sub("", text)).strip()
