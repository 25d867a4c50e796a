"""`RulesUnderstanding`: text -> tokens -> frames -> acts -> tasks; what one fact would settle is asked back."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from gavel_agents.understanding.checks import check_capable, check_possible
from gavel_agents.understanding.interface import Abstention, Decomposition, Rooms, TaskUnderstanding
from gavel_agents.understanding.rules.discourse import Act, Discourse
from gavel_agents.understanding.rules.elements import Entity, Frame, Phrase
from gavel_agents.understanding.rules.frames import frames_of
from gavel_agents.understanding.rules.lexer import Token, tokens_of
from gavel_agents.understanding.rules.nouns import kinds_of
from gavel_agents.understanding.rules.questions import answered, asked_anything, asked_instead, asked_what, asked_where
from gavel_agents.understanding.rules.sense import check_already, check_sense, one_end
from gavel_agents.understanding.rules.signals import check_signals
from gavel_agents.understanding.rules.tasks import Sentence, split_tasks
from gavel_agents.understanding.rules.text import readable
from gavel_agents.understanding.rules.verbs import read_frame
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.goals import Designator, Literal, Predicate

__all__ = ["RulesUnderstanding", "passed_over"]


_MOST_QUESTIONS = 20
_FORBIDDING = re.compile(r"\b(?:don't|do not|never|not)\b[\w' ]{0,40}\b(?:anything|any of it|a thing)\b", re.IGNORECASE)
_RETURNING = re.compile(r"\b(?:back|again|return\w*|stay\w*|leav\w*|left|keep\w*|remain\w*|still)\b", re.IGNORECASE)
"""Words of what goes back to where it is, or stays there."""
_ONE_OF_SEVERAL = re.compile(r"_\d+$")
"""The end of `mug_0`: one mug of two, each of which may be said to be somewhere else."""
_FINAL = ("empty", "too_long", "not_text", "foreign")
"""Reasons that no answer helps against: it must be said anew."""


class RulesUnderstanding:
    """Understands what it has words for, passes over what says nothing about what shall be, and asks; never guesses."""

    name = "rules"

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of an instruction's text, or the typed reason of an abstention with its question."""
        house = None if rooms is None else Counter(room.type for room in rooms.values())
        for _ in range(_MOST_QUESTIONS):
            try:
                return _read(readable(text), house, answers or {})
            except Abstention as why:
                question = why.question
                if question is None and why.kind not in _FINAL:
                    why = asked_instead(why.kind, str(why).partition(": ")[2])
                    question = why.question
                if question is None or not answers or question.key not in answers:
                    return Decomposition.refusal(why)
                text = answered(text, question, answers[question.key])
        return Decomposition((), "unparsed: the answers lead to no reading")


def _read(text: str, house: Counter[str] | None, answers: Mapping[str, str]) -> Decomposition:
    tokens = tokens_of(text)
    discourse = Discourse()
    memory: list[tuple[str, Entity]] = []
    read: list[Sentence] = []
    opened = False
    for sentence in _sentences(text, tokens):
        frames = frames_of(sentence.tokens, house, discourse.room, memory)
        opened = opened or sentence.opened
        if not frames:
            opened = True
            continue
        read.append(Sentence(sentence.text, opened, offset=sentence.start))
        for index, frame in enumerate(frames):
            following = next((f for f in frames[index + 1 :] if not f.aside), None)
            read[-1].acts.append(read_frame(discourse, frame, following))
    tasks = split_tasks(read)
    if not tasks:
        if discourse.homeless:
            raise asked_where(next(iter(discourse.homeless)))
        raise asked_anything(tokens)
    _check_complete(discourse, tasks)
    tasks = one_end(tasks, answers)
    stated = [literal for task in tasks for literal in task.relations]
    asked = [literal for task in tasks for literal in task.goal.literals]
    check_possible([lit for lit in stated if not _ONE_OF_SEVERAL.search(lit.subject.name)], "is said to be")
    check_possible(asked, "should be")
    check_capable(asked)
    forbidden = _FORBIDDING.search(text)
    if forbidden is not None:
        raise asked_instead("contradiction", f"{forbidden.group()!r} forbids what else is asked for")
    if not _RETURNING.search(text):
        check_already(asked, stated)
    check_sense(asked)
    asides = [act.frame for act in discourse.acts if act.passed]
    check_signals(tokens, asides, asked, stated)
    notes = tuple(
        f"{text[t.start : t.end]!r}: where in a room things are is not known" for t in tokens if t.kind is Kind.SPOT
    )
    return Decomposition(tasks, notes=notes, passed_over=tuple(passed_over(text, tokens, asides)))


class _Spoken(NamedTuple):
    """A sentence: its words, its tokens, whether a remark leads to it, and where it starts."""

    text: str
    tokens: Sequence[Token]
    opened: bool
    start: int


def _sentences(text: str, tokens: Sequence[Token]) -> Iterator[_Spoken]:
    """Yield the sentences that say anything."""
    start, said = 0, list[Token]()
    ended = [*tokens, Token(Kind.STOP, ".", ".", "", len(text), len(text))]
    for index, token in enumerate(ended):
        if not (token.kind is Kind.STOP and token.value == "."):
            said.append(token)
            continue
        if index + 1 < len(tokens) and tokens[index + 1].kind is Kind.CORRECTION:
            continue  # "In the sink. No wait, the dishwasher."
        while said and said[0].kind is Kind.STOP and said[0].value == ";":
            said.pop(0)  # a bullet
        if any(t.kind not in (Kind.COMMA, Kind.STOP) for t in said):
            yield _Spoken(text[start : token.start], said, _opened(said), start)
        start, said = token.start + 1, []


def _opened(tokens: Sequence[Token]) -> bool:
    """Return whether what asks for nothing leads to a colon or the like: `a few things to do: …`."""
    for token in tokens:
        if token.kind is Kind.STOP:
            return True
        if token.kind not in (Kind.FILLER, Kind.UNKNOWN, Kind.SUBJECT, Kind.DETERMINER, Kind.COUNT, Kind.ADJECTIVE):
            return False
    return False


_SAYS_NOTHING = (Kind.FILLER, Kind.UNKNOWN, Kind.SUBJECT, Kind.ASIDE)


def passed_over(text: str, tokens: Sequence[Token], asides: Sequence[Frame] = ()) -> Iterator[str]:
    """Yield the phrases that say nothing about what shall be: unknown words, remarks, what shall not be done."""
    spans = [(frame.start, frame.end) for frame in asides if frame.start >= 0]
    start, unknown = -1, False
    for token in (*tokens, Token(Kind.STOP, "", "", "", len(text), len(text), close=False)):
        if token.kind in _SAYS_NOTHING and (start < 0 or token.close):
            start, end = (token.start if start < 0 else start), token.end
            unknown = unknown or token.kind is not Kind.FILLER
            continue
        if start >= 0 and (unknown or " " in text[start:end]):
            spans.append((start, end))
        start, unknown = -1, False
        if token.kind in _SAYS_NOTHING:
            start, end, unknown = token.start, token.end, token.kind is not Kind.FILLER
    said = 0
    for start, end in sorted(spans, key=lambda span: (span[0], -span[1])):
        if end > said:
            yield text[start:end].strip()
            said = end


def _check_complete(discourse: Discourse, tasks: Sequence[TaskUnderstanding]) -> None:
    """Refuse what names a thing and then asks for nothing about it: something was not understood.

    Raises:
        Abstention: `unparsed`, with the question what should be done with it.
    """
    asked = {d.name for task in tasks for literal in task.goal.literals for d in _named(literal)}
    told = {d.name for task in tasks for literal in task.relations for d in _named(literal)}
    used = [kinds_of(name) for name in asked]
    for act in discourse.acts:
        if act.passed and not act.frame.negated:
            _check_passed(act, asked)
        for entity in act.mentions if not act.passed else ():
            done = entity.category in asked or any(set(entity.kinds) & set(kinds) for kinds in used)
            fact = act.frame.mood == "fact" or not entity.movable
            if not (done or (fact and _told(act, entity, told)) or entity in discourse.used):
                raise asked_where(entity) if entity in discourse.homeless else asked_what(entity)


def _check_passed(act: Act, asked: Collection[str]) -> None:
    """Refuse a remark that speaks of a thing for which nothing is asked, or of a place: it may have been a request.

    Raises:
        Abstention: `unparsed`.
    """
    phrases = [e for e in act.frame.elements if isinstance(e, Phrase) and e.preposition != "at"]
    places = [e for e in phrases if isinstance(e.target, Entity)]
    lost = [e for e in act.mentions if e.movable and e.category not in asked and e in act.frame.definite]
    if lost:
        raise asked_what(lost[0])
    if not act.frame.told and any(isinstance(p.target, Entity) and not p.target.movable for p in places):
        raise asked_instead("unparsed", "a remark may ask for something that is not understood")


def _told(act: Act, entity: Entity, told: Collection[str]) -> bool:
    """Return whether it is enough that something is told of a thing: of furniture, or of what someone did."""
    if entity.movable:
        return act.frame.told or not any(isinstance(e, Phrase) for e in act.frame.elements)
    subject = any(element == entity for element in act.frame.elements)
    return (act.frame.mood == "fact" and not subject) or entity.category in told


def _named(literal: Literal) -> Iterator[Designator]:
    yield literal.subject
    if literal.object is not None and literal.predicate is not Predicate.IN_ROOM:
        yield literal.object
