"""What a tolerant reading passes over: every piece of a plan's text that may be a step and was not read as one.

`parse` takes from a model's answer what it can; a gate must also know what it could not. `unread` lists both what the
parser left out and what it passed over without a word: a second step on a line, a call that names no primitive, a step
beside the JSON, a value that breaks off. Comments, fences, headings and thinking are not steps.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence

import msgspec

from gavel_agents.proposing.parse import Dropped, ParsedPlans
from gavel_agents.proposing.parse_line import calls_in, read_line, without_bullet
from gavel_agents.proposing.thinking import without_thinking
from gavel_env.data import sayable
from gavel_env.errors import MalformedAction, nearest_names
from gavel_env.world_model.actions import Action, nearest_primitives, normalise_name, parse_action
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Unread", "steps_among", "unread"]


class Unread(msgspec.Struct, frozen=True):
    """A piece of text that may be a step and was not read as one.

    Attributes:
        line: 1-based line of the text; 0 if it is not found there.
        text: what stands there, at most 120 characters.
        reason: why it is not a step.
        nearest: actions that look like it, in text form, best first.
    """

    line: int
    text: str
    reason: str
    nearest: tuple[str, ...] = ()

    def __str__(self) -> str:
        where = f"line {self.line}: " if self.line else ""
        hint = f"; did you mean {' or '.join(self.nearest)}?" if self.nearest else ""
        return f"{where}{self.text!r}: {self.reason}{hint}"


_COMMENT = re.compile(r"^\s*(?:#|//|;|--\s)")
_HEADING = re.compile(r"^\W*(?:the\s+)?(?:plan|actions?|steps?|answer)\W*$", re.IGNORECASE)
_CALL = re.compile(r"([A-Za-z][A-Za-z_ -]*?)\s*\(([^()]*)\)")
_NEXT = re.compile(r"(?:[,;.]|\b(?:and|then)\b)+", re.IGNORECASE)
_LONGEST = 4_000
_OPENING = re.compile(r"[\[{]")
_FENCE = re.compile(r"^\s*(?:```|~~~)")


def unread(text: str, parsed: ParsedPlans, graph: SceneGraph | None = None) -> tuple[Unread, ...]:
    """Return what of a plan's text may be a step and was not read as one, in the order of the text.

    Args:
        text: the plan as it was given.
        parsed: what was read of it.
        graph: its names are offered in the nearest readings.
    """
    body, _ = without_thinking(sayable(text))
    lines = body.splitlines()
    found: list[tuple[int, str, str]] = []
    for dropped in parsed.dropped:
        if dropped.line and _is_no_step(lines[dropped.line - 1]):
            continue
        found.append((dropped.line or _line_of(lines, dropped.text), dropped.text, dropped.reason))
    found += _beside_json(body) if parsed.is_json else _within_lines(lines)
    if parsed.problem and not found and text.strip() not in ("", "[]"):
        found.append((0, text.strip(), parsed.problem))
    found.sort(key=lambda entry: entry[0])
    return tuple(Unread(n, piece[:120], reason.partition(";")[0], _nearest(piece, graph)) for n, piece, reason in found)


def steps_among(dropped: Sequence[Dropped], task: int) -> tuple[str, ...]:
    """Return those of the texts left out of one task's plan that look like a step rather than like prose."""
    return tuple(d.text for d in dropped if d.task == task and (d.line == 0 or _looks_like_a_step(d.text)))


def _looks_like_a_step(text: str) -> bool:
    words = without_bullet(text).split()
    if not words or len(words) > 3:
        return bool(_CALL.search(text))
    return bool(_CALL.search(text)) or words[0].isupper() or bool(nearest_primitives(words[0]))


def _is_no_step(line: str) -> bool:
    return bool(_COMMENT.match(line) or _HEADING.match(line) or _FENCE.match(line))


_PYTHON = {"None": "null", "True": "true", "False": "false"}
_MOST_LINES = 12


def _line_of(lines: Sequence[str], entry: str) -> int:
    """Return the first line of the shortest stretch of text that holds every word of an entry of JSON; 0 if none."""
    words = {_PYTHON.get(word, word) for word in re.findall(r"[\w@|]+", entry)}
    said = [set(re.findall(r"[\w@|]+", line)) for line in lines]
    for count in range(1, _MOST_LINES + 1):
        for first in range(len(said) - count + 1):
            if words and words <= set().union(*said[first : first + count]):
                return first + 1
    return 0


# --- lines -----------------------------------------------------------------------------------------------------------


def _within_lines(lines: Sequence[str]) -> Iterator[tuple[int, str, str]]:
    for number, line in enumerate(lines, start=1):
        if _is_no_step(line):
            continue
        if len(line) > _LONGEST:
            yield number, line, f"longer than {_LONGEST} characters"
            continue
        phrase = without_bullet(line)
        if any(calls_in(phrase)):
            for verb, arguments in _CALL.findall(phrase):
                if not any(calls_in(f"{verb}({arguments})")):
                    yield number, f"{verb}({arguments})", "names no primitive, or no target"
            rest = _CALL.sub(";", phrase)
        elif read_line(phrase)[0]:
            # The line was read as one phrase; what follows an `and` or a `then` was not.
            _, *more = _NEXT.split(phrase)
            rest = ";".join(more)
        else:
            continue
        for piece in _NEXT.split(rest):
            if _is_action(piece):
                yield number, piece.strip(), "a further step on the line"


def _is_action(piece: str) -> bool:
    try:
        parse_action(piece)
    except MalformedAction:
        return False
    return True


# --- JSON ------------------------------------------------------------------------------------------------------------


def _beside_json(body: str) -> Iterator[tuple[int, str, str]]:
    """Yield steps that stand beside the JSON, and JSON that breaks off."""
    decoder = json.JSONDecoder()
    outside: list[str] = []
    at = 0
    while at < len(body):
        opening = _OPENING.search(body, at)
        if opening is None:
            break
        start = opening.start()
        outside.append(body[at:start])
        try:
            _, end = decoder.raw_decode(body, start)
            outside.append("\n" * body.count("\n", start, end))
        except (json.JSONDecodeError, RecursionError):
            last = max(body.rfind("]"), body.rfind("}"))
            if last <= start or not _balanced(body[start : last + 1]):
                line = body.count("\n", 0, start) + 1
                yield line, body[start:].strip().splitlines()[0], "the JSON does not end"
                return
            # Nearly JSON, such as single quotes: it goes to the last bracket.
            end = last + 1
            outside.append("\n" * body.count("\n", start, end))
        at = end
    outside.append(body[at:])
    for number, rest in enumerate("".join(outside).splitlines(), start=1):
        for call in calls_in(rest):
            yield number, str(call), "stands beside the JSON"


def _balanced(text: str) -> bool:
    bare = re.sub(r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'", "", text)
    return bare.count("[") == bare.count("]") and bare.count("{") == bare.count("}")


# --- nearest readings ------------------------------------------------------------------------------------------------


def _nearest(text: str, graph: SceneGraph | None) -> tuple[str, ...]:
    """Return up to three actions that look like a text."""
    call = _CALL.search(text)
    quoted = re.findall(r"[\w@|.-]+", text)
    words = re.split(r"[\s,]+", without_bullet(text)) if call is None else [call[1], *re.split(r"[\s,]+", call[2])]
    if text.lstrip()[:1] in "[{":
        words = [word for word in quoted if word not in ("None", "null", "action", "target", "object", "primitive")]
    if not words:
        return ()
    names = [normalise_name(word) for word in words[1:] if word]
    known = () if graph is None else tuple(graph.world.nodes)
    readings = []
    for primitive in nearest_primitives(words[0]):
        if not primitive.takes_target:
            readings.append(str(Action(primitive)))
            continue
        target = next((near for name in names if (near := nearest_names(name, known, 1))), names[-1:] or ("…",))
        readings.append(f"{primitive.name}({target[0]})")
    return tuple(readings)
