"""What the learned reader asks: about the choice that it is least sure of; and what an answer makes of its reading."""

from __future__ import annotations

from collections.abc import Mapping

from gavel_agents.understanding.interface import Question, Rooms
from gavel_agents.understanding.learned.decode import Decision, Meant
from gavel_agents.understanding.learned.options import members
from gavel_agents.understanding.learned.reader import Reading
from gavel_agents.understanding.rules import RulesUnderstanding
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.goals import Designator, Literal, Predicate

__all__ = ["question_of", "with_answers"]

_PLACES = {Predicate.ON_TOP: "on", Predicate.INSIDE: "in", Predicate.IN_ROOM: "in"}
_STATES = {
    (Predicate.WASHED, False): "wash it", (Predicate.DRIED, False): "dry it", (Predicate.COOKED, False): "warm it",
    (Predicate.TOGGLED, False): "switch it on", (Predicate.TOGGLED, True): "switch it off",
    (Predicate.OPEN, False): "open it", (Predicate.OPEN, True): "close it",
}  # fmt: skip
NOTHING = "nothing"


def question_of(reading: Reading) -> Question | None:
    """Return what to ask about a reading, or None if it made no choice."""
    if not reading.meant.decisions:
        return None
    least = min(reading.meant.decisions, key=lambda decision: decision.probability)
    name = _words(reading, least)
    choices = list(dict.fromkeys((_spoken(least.literals), _spoken(least.instead))))
    asks = f"What should be done with the {name}: {', or '.join(choices)}?"
    return Question(_key(name), asks, name, tuple(choices))


def with_answers(reading: Reading, answers: Mapping[str, str], rooms: Rooms | None) -> Reading:
    """Return a reading in which what was asked is as it was answered.

    An answer says what to do ("switch it off"), where to put a thing ("in the fridge"), or "nothing".
    """
    decisions = []
    goals = list(reading.meant.goals)
    for decision in reading.meant.decisions:
        name = _words(reading, decision)
        literals = _answered(name, answers[_key(name)], rooms) if _key(name) in answers else None
        if literals is not None:
            subject = reading.read.mentions[decision.mention].name
            goals = [goal for goal in goals if goal[0] != decision.mention]
            goals += [(decision.mention, _about(literal, subject)) for literal in literals]
            decision = Decision(decision.mention, literals, 1.0)
        decisions.append(decision)
    meant = reading.meant
    return Reading(reading.read, Meant(tuple(goals), meant.relations, tuple(decisions), meant.whole))


def _key(name: str) -> str:
    return f"what:{name}"


def _words(reading: Reading, decision: Decision) -> str:
    mention = reading.read.mentions[decision.mention]
    name = in_words(mention.name)
    return f"light in the {name}" if mention.room else name


def _answered(name: str, answer: str, rooms: Rooms | None) -> tuple[Literal, ...] | None:
    """Return what an answer asks for, or None if it cannot be read."""
    said = answer.strip().rstrip(".!")
    if said.lower() in (NOTHING, "nowhere", "none"):
        return ()
    rules = RulesUnderstanding()
    for text in (said.replace(" it", f" the {name}", 1), f"Put the {name} {said}.", said):
        literals = [literal for task in rules.understand(text, rooms=rooms).tasks for literal in task.goal.literals]
        if literals:
            return tuple(literals)
    return None


def _about(literal: Literal, name: str) -> Literal:
    """Return a literal about the thing that was asked about, by the name that the text has for it."""
    if members(literal.subject.name) & members(name) and literal.subject.room is None:
        return literal._replace(subject=Designator(name))
    return literal


def _spoken(literals: tuple[Literal, ...]) -> str:
    """Return what a choice asks for, in words."""
    return " and ".join(map(_order, literals)) or NOTHING


def _order(literal: Literal) -> str:
    if literal.object is None:
        return _STATES.get((literal.predicate, literal.negated), str(literal))
    place = in_words(literal.object.name)
    room = f" in the {in_words(literal.object.room)}" if literal.object.room else ""
    return f"put it {_PLACES[literal.predicate]} the {place}{room}"
