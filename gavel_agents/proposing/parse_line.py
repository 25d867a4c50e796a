"""Reading one line of model output: calls, `VERB object` and plain English imperatives."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from gavel_env.errors import MalformedAction
from gavel_env.world_model.actions import (
    Action,
    Primitive,
    normalise_name,
    own_step,
    parameters_of,
    parse_action,
    primitive_of,
)

__all__ = ["calls_in", "from_parts", "read_line", "without_bullet"]

_BULLET = re.compile(
    r"^\s*+(?:[-*•>+]\s++|\(?\d++\s*+[.):\]]\s*+|\[\d++\]\s*+|(?:step|action)\s*+\d++\s*+[:.)-]*+\s*+)++", re.IGNORECASE
)
_ARGUMENTS = re.compile(r"\(([^()]*+)\)")
_COMMENT = re.compile(r"#|//|;|\s--\s|\s[–—]\s")
_SHIFTS = ("place", "put", "set", "lay", "drop")
_PREPOSITIONS = ("on", "onto", "into", "inside", "in")
_PUT = re.compile(
    r"^(?:place|put|set|lay|drop)\s+(?:down\s+)?(?:.+?\s+)?(on top of|on top|on to|onto|on|into|inside|in)\s+(.+)$",
    re.IGNORECASE,
)
_SWITCH = re.compile(r"^(?:turn|switch)\s+(.+?)\s+(on|off)$", re.IGNORECASE)
_TAIL = re.compile(
    r"\s(?:from|with|using|to get|to find|then|so that|which|where|while|by"
    r"|and (?:then|open|close|shut|grasp|pick|place|put|turn|switch|toggle|navigate|go|release))(?=\s)",
    re.IGNORECASE,
)
_VERB = re.compile(r"[A-Za-z][A-Za-z _-]*")
_NAME = re.compile(r"[\w@|.'-]+")
_MOST_WORDS = 9
_MOST_WORDS_OF_A_VERB = 40


def without_bullet(line: str) -> str:
    """Return a line without its bullet, number, quotes and marks of emphasis."""
    return _BULLET.sub("", line.strip().strip("`*_ \t")).strip().strip("`*\"', \t[]{}")


def read_line(line: str) -> tuple[list[Action], str]:
    """Return the actions of one line, and why it has none."""
    calls = list(calls_in(line))
    if calls:
        return calls, ""
    try:
        return [_read_phrase(_up_to(_COMMENT, line))], ""
    except MalformedAction as error:
        return [], str(error)


def calls_in(line: str) -> Iterator[Action]:
    """Yield every `Verb(arguments)` of a line that is an action."""
    end = 0
    for arguments in _ARGUMENTS.finditer(line):
        start = max(end, line.rfind("(", end, arguments.start()) + 1, line.rfind(")", end, arguments.start()) + 1)
        verb = _run_before(line, start, arguments.start())
        if verb:
            action = _called(verb.split(), [a for a in arguments.group(1).split(",") if a.strip()])
            if action is not None:
                yield action
            end = arguments.end()


def _run_before(line: str, start: int, end: int) -> str:
    """Return the letters, spaces, hyphens and underscores that stand before a bracket, from a letter on."""
    stem = line[start:end].rstrip()
    at = len(stem)
    while at and ((stem[at - 1].isalpha() and stem[at - 1].isascii()) or stem[at - 1] in "_ -"):
        at -= 1
    return stem[at:].lstrip("_ -")


def _called(words: Sequence[str], arguments: Sequence[str]) -> Action | None:
    """Return the action of a call: in `then GRASP(x)` the verb is the last word, or the last few words."""
    for start in range(max(0, len(words) - _MOST_WORDS_OF_A_VERB), len(words)):
        action = from_parts(" ".join(words[start:]), arguments)
        if action is not None:
            return action
    return None


def _up_to(mark: re.Pattern[str], text: str) -> str:
    """Return a text up to the first mark behind which nothing but its last line follows."""
    lines = text.rstrip("\n")
    earlier = len(lines[: lines.rfind("\n") + 1].rstrip())
    found = next((m for m in mark.finditer(text) if m.end() > earlier or not earlier), None)
    return text if found is None else text[: found.start()].rstrip()


def _read_phrase(phrase: str) -> Action:
    """Read `navigate to the fridge`, `GRASP apple`, `put the apple on the table`.

    Raises:
        MalformedAction: no action, or prose around one.
    """
    phrase = _up_to(_TAIL, phrase.strip().rstrip(".,;:!"))
    words = phrase.split()
    if len(words) > _MOST_WORDS:
        if not _shifts(words):
            parse_action(phrase)
        raise MalformedAction(f"prose: {phrase[:80]!r}")
    plain = " ".join(words)
    shift = _PUT.match(plain)
    switch = _SWITCH.match(plain)
    if shift:
        preposition, place = shift.groups()
        on_top = preposition.lower().startswith("on")
        action = Action(Primitive.PLACE_ON_TOP if on_top else Primitive.PLACE_INSIDE, normalise_name(place))
    elif switch:
        on = switch.group(2).lower() == "on"
        action = Action(Primitive.TOGGLE_ON if on else Primitive.TOGGLE_OFF, normalise_name(switch.group(1)))
    else:
        action = parse_action(phrase)
    if action.target and not _NAME.fullmatch(action.target):
        raise MalformedAction(f"prose: {phrase[:80]!r}")
    return action


def _shifts(words: Sequence[str]) -> bool:
    """Return whether words say that something is put somewhere, or switched."""
    verb = words[0].lower()
    if verb in ("turn", "switch"):
        return words[-1].lower() in ("on", "off")
    return verb in _SHIFTS and any(word.lower() in _PREPOSITIONS for word in words[1:-1])


def from_parts(verb: str, arguments: Sequence[str]) -> Action | None:
    """Return the action of a verb and its arguments; placements take the last one, others the first object."""
    if not _VERB.fullmatch(verb):
        return None
    names = [normalise_name(re.split(r"[=:]", a)[-1]) for a in arguments]
    names = [n for n in names if n and n not in ("robot", "agent", "none", "null")]
    own = primitive_of(verb)
    parameters = None if own is None else parameters_of(own)
    if own is not None and parameters is not None:
        return own_step(own, names) if len(names) == len(parameters) else None
    try:
        primitive = parse_action(f"{verb}(x)").primitive
    except MalformedAction:
        return None
    if not primitive.takes_target:
        return Action(primitive)
    if not names:
        return None
    placing = primitive in (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE)
    return Action(primitive, names[-1] if placing else names[0])
