"""What a model thought aloud before its answer, taken out in one pass."""

from __future__ import annotations

import bisect
import re
from itertools import islice

__all__ = ["without_thinking"]

_MOST_TAGS = 2_000
_TAG = re.compile(r"<(/?)(think|thinking|reasoning)>", re.IGNORECASE)


def without_thinking(text: str) -> tuple[str, bool]:
    """Return an answer without its thinking, line numbers kept, and whether it ends within it.

    A block goes from its tag to the next closing tag of the same name; what stands before a closing tag alone is
    thinking too, and so is everything behind an opening tag alone. Of the tags, the first 2,000 count.
    """
    closing: dict[str, list[tuple[int, int]]] = {}
    tags = list(islice(_TAG.finditer(text), _MOST_TAGS))
    for tag in tags:
        if tag.group(1):
            closing.setdefault(tag.group(2).lower(), []).append(tag.span())
    blocks: list[tuple[int, int]] = []
    at = 0
    for tag in tags:
        if tag.group(1) or tag.start() < at:
            continue
        ends = closing.get(tag.group(2).lower(), [])
        place = bisect.bisect_left(ends, (tag.end(), 0))
        if place < len(ends):
            at = ends[place][1]
            blocks.append((tag.start(), at))
    body = _blanked(text, blocks)
    left = islice(_TAG.finditer(body), _MOST_TAGS)
    last = max((tag.end() for tag in left if tag.group(1)), default=0)
    body = _blanked(body, [(0, last)] if last else [])
    opened = _TAG.search(body)
    return (body, False) if opened is None else (body[: opened.start()], True)


def _blanked(text: str, spans: list[tuple[int, int]]) -> str:
    """Return a text with nothing but the line ends of some stretches of it."""
    pieces: list[str] = []
    at = 0
    for start, end in spans:
        pieces += [text[at:start], "\n" * text.count("\n", start, end)]
        at = end
    return "".join([*pieces, text[at:]])
