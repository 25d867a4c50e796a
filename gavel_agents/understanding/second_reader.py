"""Two readers, the rules and a network: what both read alike is meant, else what the network is sure of, else it asks.

The network is often right where the rules have no reading; the rules know what cannot be.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from gavel_agents.understanding.asking import question_of, with_answers
from gavel_agents.understanding.checks import check_capable, check_possible
from gavel_agents.understanding.interface import Abstention, Decomposition, Rooms, TaskUnderstanding
from gavel_agents.understanding.learned.options import able, members
from gavel_agents.understanding.learned.reader import LearnedReader, Reading
from gavel_agents.understanding.rules import RulesUnderstanding
from gavel_agents.understanding.rules.lexer import tokens_of
from gavel_agents.understanding.rules.reading import passed_over
from gavel_agents.understanding.rules.sense import check_sense
from gavel_agents.understanding.rules.text import readable
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.goals import Goal, Literal, Predicate
from gavel_env.world_model.ontology import category_of

__all__ = ["SURE", "TwoReaders", "alike", "combined", "stands", "taken"]

_FINAL = frozenset({"empty", "too_long", "not_text", "foreign"})
"""Reasons of the rules that speak of the text as a whole: nothing else reads it."""
_IMPOSSIBLE = frozenset(
    {"cannot_move", "cannot_switch", "cannot_open", "cannot_process", "cannot_hold", "too_big", "already", "choice"}
)
_SHORT = 16
"""Words and marks of a text of which the rules can be sure that it asks for what cannot be."""
_SAYS_MORE = (Kind.UNKNOWN, Kind.ASIDE)
"""Words that the rules pass over without knowing what they say."""
_LEADS_ON = (Kind.AND, Kind.OR, Kind.COMMA, Kind.THEN, Kind.ALSO, Kind.DETERMINER, Kind.POSSESSIVE, Kind.ADJECTIVE)
"""Kinds of words and marks that belong to what follows them."""
_HOLD = (Predicate.ON_TOP, Predicate.INSIDE)


SURE = 0.5
"""How probable a reading must be that the rules do not share: more than not. Chosen on sentences that the networks had
not seen, and on the half of the voices for development."""


class TwoReaders:
    """The rules and the learned reader together."""

    name = "rules"

    def __init__(self, second: LearnedReader, rules: RulesUnderstanding | None = None) -> None:
        self.rules = rules or RulesUnderstanding()
        self.second = second

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of an instruction's text; without the rooms of a house the rules read alone."""
        first = self.rules.understand(text, rooms=rooms, answers=answers)
        if rooms is None or first.refused.partition(":")[0] in _FINAL or stands(first, text):
            return first
        try:
            reading = self.second.read(readable(text), Counter(room.type for room in rooms.values()))
        except Abstention:
            return first
        return combined(text, first, with_answers(reading, answers or {}, rooms))


def stands(first: Decomposition, text: str) -> bool:
    """Return whether the rules made something of every word: a reading, or of a short text that it cannot be."""
    tokens = tokens_of(readable(text))
    if not first.tasks and (first.refused.partition(":")[0] not in _IMPOSSIBLE or len(tokens) > _SHORT):
        return False
    return all(token.kind not in _SAYS_MORE for token in tokens)


def combined(text: str, first: Decomposition, reading: Reading) -> Decomposition:
    """Return what the rules and a second reading come to, where theirs does not stand."""
    second = taken(text, reading)
    if second is None:
        return first
    if (first.tasks and alike(first, second)) or reading.meant.sure >= SURE:
        return second
    return asked(first, reading)


def asked(first: Decomposition, reading: Reading) -> Decomposition:
    """Return the refusal of what two readers read differently, with the question that the network is least sure of."""
    question = question_of(reading)
    if question is None:
        return first
    return Decomposition((), f"unsure: {question.about}", question=question)


def alike(first: Decomposition, second: Decomposition) -> bool:
    """Return whether two readings ask for the same, if one of them may use a wider word or leave a room out."""
    theirs = [literal for task in second.tasks for literal in task.goal.literals]
    for literal in (literal for task in first.tasks for literal in task.goal.literals):
        same = next((other for other in theirs if _same(literal, other)), None)
        if same is None:
            return False
        theirs.remove(same)
    return not theirs


def _same(a: Literal, b: Literal) -> bool:
    if (a.predicate, a.negated, a.object is None) != (b.predicate, b.negated, b.object is None):
        return False
    pairs = [(a.subject, b.subject)] + ([(a.object, b.object)] if a.object is not None and b.object is not None else [])
    if a.predicate is Predicate.IN_ROOM:
        return bool(members(a.subject.name) & members(b.subject.name)) and a.object == b.object
    return all((x.room == y.room or not (x.room and y.room)) and members(x.name) & members(y.name) for x, y in pairs)


def taken(text: str, reading: Reading) -> Decomposition | None:
    """Return a learned reading as tasks, or None if it asks for nothing or makes no sense."""
    goals = [literal for _, literal in reading.meant.goals]
    if not goals:
        return None
    try:
        check_possible(goals, "shall be")
        check_capable(goals)
        check_sense(goals)
    except Abstention:
        return None
    said = (*passed_over(text, reading.read.tokens), *_unasked(text, reading))
    return Decomposition(tuple(_tasks(text, reading)), passed_over=said)


def _unasked(text: str, reading: Reading) -> Iterator[str]:
    """Yield the things that a text names and that nothing is asked for, as it has them."""
    meant, read = reading.meant, reading.read
    every = [said for _, said in (*meant.goals, *meant.relations)]
    spoken = {said.subject.name for said in every}
    spoken |= {said.object.name for said in every if said.object is not None and said.predicate in _HOLD}
    used = frozenset[str]().union(*map(members, spoken))
    for mention in read.mentions:
        if mention.movable and not members(mention.name) & used:
            token = read.tokens[mention.token]
            yield text[token.start : token.end]


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
    held = a.object if a.object is not None and a.predicate in _HOLD and able(a.object.name, "graspable") else None
    if b.subject in (a.subject, held) or b.object in (a.subject, held or a.subject):
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
    said = [token for token in tokens if own <= token.start < following]
    while len(said) > 1 and said[-1].kind in _LEADS_ON:
        said.pop()
    words = text[own : said[-1].end].strip(" ,;:\n")
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "!", "?")) else ".")
