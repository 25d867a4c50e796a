"""Reading one line of model output: calls, `VERB object` and plain English imperatives."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from gavel_env.errors import MalformedAction
from gavel_env.world_model.actions import Action, Primitive, normalise_name, parse_action

__all__ = ["calls_in", "from_parts", "read_line", "without_bullet"]

_BULLET = re.compile(
    r"^\s*(?:[-*•>+]\s+|\(?\d+\s*[.):\]]\s*|\[\d+\]\s*|(?:step|action)\s*\d+\s*[:.)-]*\s*)+", re.IGNORECASE
)
_CALL = re.compile(r"([A-Za-z][A-Za-z_ -]*?)\s*\(([^()]*)\)")
_COMMENT = re.compile(r"\s*(?:#|//|;|\s--\s|\s[–—]\s).*$")
_PUT = re.compile(
    r"^(?:place|put|set|lay|drop)\s+(?:down\s+)?(?:.+?\s+)?(on top of|on top|on to|onto|on|into|inside|in)\s+(.+)$",
    re.IGNORECASE,
)
_SWITCH = re.compile(r"^(?:turn|switch)\s+(.+?)\s+(on|off)$", re.IGNORECASE)
_TAIL = re.compile(
    r"\s+(?:from|with|using|to get|to find|then|so that|which|where|while|by"
    r"|and (?:then|open|close|shut|grasp|pick|place|put|turn|switch|toggle|navigate|go|release))\s+.*$",
    re.IGNORECASE,
)
_VERB = re.compile(r"[A-Za-z][A-Za-z _-]*")
_NAME = re.compile(r"[\w@.'-]+")
_MOST_WORDS = 9


def without_bullet(line: str) -> str:
    """Return a line without its bullet, number, quotes and marks of emphasis."""
    return _BULLET.sub("", line.strip().strip("`*_ \t")).strip().strip("`*\"', \t[]{}")


def read_line(line: str) -> tuple[list[Action], str]:
    """Return the actions of one line, and why it has none."""
    calls = list(calls_in(line))
    if calls:
        return calls, ""
    try:
        return [_read_phrase(_COMMENT.sub("", line))], ""
    except MalformedAction as error:
        return [], str(error)


def calls_in(line: str) -> Iterator[Action]:
    """Yield every `Verb(arguments)` of a line that is an action."""
    for verb, arguments in _CALL.findall(line):
        # `then GRASP(x)`: the verb is the last word, or the last few words.
        words = verb.split()
        for start in range(len(words)):
            action = from_parts(" ".join(words[start:]), [a for a in arguments.split(",") if a.strip()])
            if action is not None:
                yield action
                break


def _read_phrase(phrase: str) -> Action:
    """Read `navigate to the fridge`, `GRASP apple`, `put the apple on the table`.

    Raises:
        MalformedAction: no action, or prose around one.
    """
    phrase = _TAIL.sub("", phrase.strip().rstrip(".,;:!"))
    shift = _PUT.match(phrase)
    switch = _SWITCH.match(phrase)
    if shift:
        preposition, place = shift.groups()
        on_top = preposition.lower().startswith("on")
        action = Action(Primitive.PLACE_ON_TOP if on_top else Primitive.PLACE_INSIDE, normalise_name(place))
    elif switch:
        on = switch.group(2).lower() == "on"
        action = Action(Primitive.TOGGLE_ON if on else Primitive.TOGGLE_OFF, normalise_name(switch.group(1)))
    else:
        action = parse_action(phrase)
    if len(phrase.split()) > _MOST_WORDS or (action.target and not _NAME.fullmatch(action.target)):
        raise MalformedAction(f"prose: {phrase[:80]!r}")
    return action


def from_parts(verb: str, arguments: Sequence[str]) -> Action | None:
    """Return the action of a verb and its arguments; placements take the last one, others the first object."""
    if not _VERB.fullmatch(verb):
        return None
    names = [normalise_name(re.split(r"[=:]", a)[-1]) for a in arguments]
    names = [n for n in names if n and n not in ("robot", "agent", "none", "null")]
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
