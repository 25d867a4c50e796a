"""Decompose: which acts make up one task.

Acts belong together when they speak of the same things, by name, by a pronoun or by what was left unsaid. Acts on
different things are tasks of their own in a list or in several sentences; two of them joined by `and` or `then` in the
only sentence are one task.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from gavel_agents.understanding.interface import TaskUnderstanding
from gavel_agents.understanding.rules.discourse import Act
from gavel_agents.understanding.rules.elements import Entity, Phrase, Pronoun, There
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate

__all__ = ["Sentence", "split_tasks"]

_LEADING = re.compile(r"^[\s,;:—–-]*(?:(?:and|then|also|plus|besides|too|or)\b[\s,;:]*)*", re.IGNORECASE)
_PLACES = (Predicate.ON_TOP, Predicate.INSIDE, Predicate.UNDER, Predicate.NEXT_TO, Predicate.IN_ROOM)


@dataclass
class Sentence:
    """A sentence with what its frames contribute.

    Attributes:
        text: as it was written.
        acts: of its frames.
        opened: something that asks for nothing led to it (`A few things to do: …`).
        offset: where it starts in the text, to which the places of its frames refer.
    """

    text: str
    opened: bool = False
    offset: int = 0
    acts: list[Act] = field(default_factory=list)


@dataclass
class _Unit:
    """Acts that speak of the same things."""

    text: str
    acts: list[Act]

    @property
    def things(self) -> set[Entity]:
        return {m for act in self.acts for m in (*act.mentions, *act.things) if m.movable}

    @property
    def asks(self) -> bool:
        return any(act.goals for act in self.acts)

    @property
    def verbs(self) -> int:
        """How many of its acts name or ask for something."""
        return sum(bool(act.goals or act.mentions) for act in self.acts)

    @property
    def switches(self) -> bool:
        """True if it only switches something on."""
        goals = [g for act in self.acts for g in act.goals]
        return bool(goals) and all(g.predicate is Predicate.TOGGLED for g in goals)


def split_tasks(sentences: Sequence[Sentence]) -> tuple[TaskUnderstanding, ...]:
    """Return the tasks of an instruction, in the order written."""
    units: list[_Unit] = []
    asking = [s for s in sentences if any(act.goals for act in s.acts)]
    for sentence in sentences:
        new = _worded(sentence)
        alone = len(asking) == 1 and not sentence.opened
        if alone and len([u for u in new if u.asks]) > 1 and _joined(new):
            new = [_Unit(sentence.text.strip() + ".", [act for unit in new for act in unit.acts])]
        if new and units and _continues(new[0], units[-1]):
            first = new.pop(0)
            units[-1].acts += first.acts
            units[-1].text = f"{units[-1].text} {first.text}"
        units += new
    return tuple(_task(unit) for unit in units if unit.asks)


def _units(sentence: Sentence) -> Iterator[_Unit]:
    """Yield the units of a sentence."""
    unit: _Unit | None = None
    for act in sentence.acts:
        if unit is not None and (_same_unit(act, unit) or not unit.asks or not (act.goals or act.mentions)):
            unit.acts.append(act)
            continue
        if unit is not None:
            yield unit
        unit = _Unit("", [act])
    if unit is not None:
        yield unit


def _worded(sentence: Sentence) -> list[_Unit]:
    """Return the units of a sentence, each with its own part of it as its text."""
    units, start = list(_units(sentence)), 0
    for unit in units:
        end = unit.acts[-1].frame.end - sentence.offset if unit is not units[-1] else len(sentence.text)
        words = _LEADING.sub("", sentence.text[start:end]).strip(" ,;:")
        unit.text = words[:1].upper() + words[1:] + "."
        start = end
    return units


def _same_unit(act: Act, unit: _Unit) -> bool:
    named = {m for m in act.mentions if m.movable}
    there = any(isinstance(e, Phrase) and isinstance(e.target, There | Pronoun) for e in act.frame.elements)
    if named & unit.things or there or act.frame.verb == "SAME":
        return True
    toggles = any(g.predicate is Predicate.TOGGLED for g in act.goals)
    return not named and not toggles


def _continues(new: _Unit, last: _Unit) -> bool:
    """Return whether a sentence goes on about the things of the one before (`The mug is dirty. Wash it.`)."""
    names = any(m.movable for act in new.acts for m in act.mentions)
    return not last.asks or (not names and bool(new.acts[0].things))


def _joined(units: Sequence[_Unit]) -> bool:
    """Return whether the units of a lone sentence are parts of one task and no list."""
    moves = [u for u in units if u.asks and not u.switches]
    if len(moves) > 2 or len(units) - len(moves) > 1 or (moves and units[-1] in moves and len(moves) < len(units)):
        return False
    if any(g.predicate not in _PLACES for u in moves for act in u.acts for g in act.goals):
        return False
    before = set(units[1].acts[0].frame.before)
    first, second = (unit.acts[0].frame.word for unit in units[:2])
    listed = Kind.THEN not in before and bool({Kind.AND, Kind.ALSO} & before) == (Kind.STOP in before)
    if Kind.THEN not in before and len(moves) > 1:
        alike = first == second if Kind.STOP in before else units[0].verbs == units[1].verbs
        listed = listed or not alike or Kind.ALSO in before
    return len(moves[0].things) > 1 if len(moves) == 1 else not listed


def _task(unit: _Unit) -> TaskUnderstanding:
    """Return the task of a unit; a room that was said once with a piece holds for its other mentions."""
    goals = dict.fromkeys(g for act in unit.acts for g in act.goals)
    relations = dict.fromkeys(r for act in unit.acts for r in act.relations)
    objects = dict.fromkeys(Designator(m.category, m.room) for act in unit.acts for m in act.mentions)
    for literal in (*relations, *goals):
        target = None if literal.predicate is Predicate.IN_ROOM else literal.object
        objects |= dict.fromkeys(d for d in (literal.subject, target) if d is not None)
    rooms: dict[str, set[str]] = {}
    for designator in objects:
        if designator.room:
            rooms.setdefault(designator.name, set()).add(designator.room)

    def full(designator: Designator) -> Designator:
        known = rooms.get(designator.name, set())
        return designator if designator.room or len(known) != 1 else Designator(designator.name, min(known))

    def filled(literal: Literal) -> Literal:
        subject = full(literal.subject)
        if literal.object is None or literal.predicate is Predicate.IN_ROOM:
            return literal._replace(subject=subject)
        return literal._replace(subject=subject, object=full(literal.object))

    return TaskUnderstanding(
        unit.text,
        tuple(dict.fromkeys(map(full, objects))),
        tuple(dict.fromkeys(map(filled, relations))),
        Goal(tuple(dict.fromkeys(map(filled, goals)))),
    )
