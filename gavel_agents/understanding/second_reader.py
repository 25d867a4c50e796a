"""Two readers: the rules read first, and a learned reader is asked where they refuse and where they may be wrong.

What the rules refuse for want of a structure is believed of the learned reader where it is sure, names everything, and
makes sense; all else stays as the rules say it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from gavel_agents.understanding.checks import check_capable, check_possible
from gavel_agents.understanding.interface import Abstention, Decomposition, Rooms, TaskUnderstanding
from gavel_agents.understanding.learned.options import able
from gavel_agents.understanding.learned.reader import LearnedReader, Reading
from gavel_agents.understanding.rules import RulesUnderstanding
from gavel_agents.understanding.rules.sense import check_sense
from gavel_agents.understanding.rules.text import readable
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.goals import Goal, Literal, Predicate
from gavel_env.world_model.ontology import category_of

__all__ = ["SURE", "TwoReaders", "combined", "taken"]

SURE = 0.75
"""Least probability of a learned reading that stands alone; chosen on the sixth of the voices left out of training."""
_MAY_BE_READ = frozenset(
    {"unparsed", "no_destination", "no_antecedent", "no_goal", "unknown_place", "choice", "counting"}
)
"""Reasons of the rules that speak of structure: not of words that name nothing, nor of what cannot be."""
_HOLD = (Predicate.ON_TOP, Predicate.INSIDE)


class TwoReaders:
    """The rules, with the learned reader for what they refuse."""

    name = "rules"

    def __init__(self, second: LearnedReader, rules: RulesUnderstanding | None = None) -> None:
        self.rules = rules or RulesUnderstanding()
        self.second = second

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of an instruction's text; without the rooms of a house the rules read alone."""
        first = self.rules.understand(text, rooms=rooms, answers=answers)
        if rooms is None or not asks_second(first):
            return first
        house = Counter(room.type for room in rooms.values())
        try:
            reading = self.second.read(readable(text), house)
        except Abstention:
            return first
        return combined(text, first, reading)


def asks_second(first: Decomposition) -> bool:
    """Return whether a second reading can change what the rules say."""
    return first.refused.partition(":")[0] in _MAY_BE_READ


def combined(text: str, first: Decomposition, reading: Reading, sure: float = SURE) -> Decomposition:
    """Return what a refusal of the rules and a second reading come to."""
    second = taken(text, reading) if reading.meant.sure >= sure else None
    return first if second is None else second


def taken(text: str, reading: Reading) -> Decomposition | None:
    """Return a learned reading as tasks, or None if it leaves something out or makes no sense."""
    goals = [literal for _, literal in reading.meant.goals]
    if not goals or not accounted(reading):
        return None
    try:
        check_possible(goals, "shall be")
        check_capable(goals)
        check_sense(goals)
    except Abstention:
        return None
    return Decomposition(tuple(_tasks(text, reading)))


def accounted(reading: Reading) -> bool:
    """Return whether each thing that is named is asked for or was said to be somewhere."""
    meant, read = reading.meant, reading.read
    spoken = {
        category_of(d.name)
        for _, literal in (*meant.goals, *meant.relations)
        for d in (literal.subject, literal.object)
        if d
    }
    led = (Kind.DETERMINER, Kind.POSSESSIVE, Kind.ADJECTIVE, Kind.COUNT, Kind.QUANTIFIER)
    for mention in read.mentions:
        if not mention.movable or mention.name in spoken:
            continue
        before = read.tokens[mention.token - 1] if mention.token else None
        if before is not None and before.kind in led and not able(mention.name, "toggleable"):
            return False
    return True


def _tasks(text: str, reading: Reading) -> Iterator[TaskUnderstanding]:
    """Yield the tasks: goals that share a thing, or that put things in the same place, belong together."""
    parts: list[list[tuple[int, Literal]]] = []
    for index, literal in reading.meant.goals:
        for part in parts:
            if any(_belong(literal, other) for _, other in part):
                part.append((index, literal))
                break
        else:
            parts.append([(index, literal)])
    for part in sorted(parts, key=lambda p: min(index for index, _ in p)):
        literals = tuple(literal for _, literal in part)
        things = {literal.subject.name for literal in literals}
        relations = tuple(
            told
            for _, told in reading.meant.relations
            if told.subject.name in {category_of(t) for t in things} | things
        )
        objects = dict.fromkeys(
            d for said in (*relations, *literals)
            for d in (said.subject, None if said.predicate is Predicate.IN_ROOM else said.object) if d is not None
        )  # fmt: skip
        yield TaskUnderstanding(_words(text, parts, part, reading), tuple(objects), relations, Goal(literals))


def _belong(a: Literal, b: Literal) -> bool:
    named = {d for d in (a.subject, a.object if a.object and able(a.object.name, "graspable") else None) if d}
    if b.subject in named or (b.object in named):
        return True
    return a.predicate in _HOLD and (a.predicate, a.object) == (b.predicate, b.object)


def _words(
    text: str, parts: Sequence[Sequence[tuple[int, Literal]]], part: Sequence[tuple[int, Literal]], reading: Reading
) -> str:
    """Return the sentences that a task's things are named in; all of the text for a single task."""
    if len(parts) == 1:
        return text.strip()
    tokens, mentions = reading.read.tokens, reading.read.mentions
    starts = sorted(tokens[mentions[min(i for i, _ in p)].token].start for p in parts)
    own = tokens[mentions[min(i for i, _ in part)].token].start
    following = next((s for s in starts if s > own), len(text))
    words = text[own:following].strip(" ,;:\n")
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "!", "?")) else ".")
