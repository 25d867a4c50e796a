"""How much of an instruction an understanding gets right.

A goal is exact if its literals denote what the meant ones denote in that house: the same instances under the same
predicates, whatever they are called. Where a record says how much its words may cover (`denotes`, see
docs/explanation/voices.md), a literal is right within those bounds. Beside it stand exact match and F1 of the text
forms of objects, relations, goals and tasks. A refusal counts as not exact, and so does a question, unless the author
of the record answers it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from eval.studies.author import Author
from gavel_agents.understanding import BatchedUnderstanding, Decomposition, Rooms, Understanding
from gavel_agents.understanding.pairs import Denotes, Extent, Sample, Target
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.world_model.goals import Designator, Literal, Predicate, fitting, parse_literal
from gavel_env.world_model.graph import Room, SceneGraph

__all__ = ["PARTS", "Outcome", "Part", "Report", "evaluate", "goals_denote_the_same"]

PARTS = ("objects", "relations", "goals", "tasks")


class Part(NamedTuple):
    """Scores of one part, by its text form.

    Attributes:
        exact: instructions whose part is exactly right.
        found, wrong, missed: items over all instructions.
    """

    exact: int = 0
    found: int = 0
    wrong: int = 0
    missed: int = 0

    @property
    def f1(self) -> float | None:
        """Return 2PR / (P + R) over all items, or None without any."""
        total = 2 * self.found + self.wrong + self.missed
        return 2 * self.found / total if total else None


class Outcome(NamedTuple):
    """What became of one instruction.

    Attributes:
        sample: the instruction.
        got: what was understood, after the last answer.
        goals: its goals are exact, by what they denote.
        asked: questions that the author answered.
    """

    sample: Sample
    got: Decomposition
    goals: bool
    asked: int = 0

    @property
    def wrong(self) -> bool:
        """True if it was understood, and not as it was meant: silently wrong."""
        return bool(self.got.tasks) and not self.goals


class Report(NamedTuple):
    """Scores of a file.

    Attributes:
        instructions: how many there are.
        parts: by name of the part.
        exact: instructions whose objects, relations and goals are all exactly right in their text form.
        refused: instructions that were refused, by reason.
        outcomes: one per instruction.
        mistakes: those that are not exactly right in their text form.
    """

    instructions: int
    parts: dict[str, Part]
    exact: int
    refused: dict[str, int]
    outcomes: tuple[Outcome, ...]
    mistakes: tuple[Outcome, ...]

    @property
    def goals_exact(self) -> int:
        """Instructions whose goals are exact by what they denote."""
        return sum(outcome.goals for outcome in self.outcomes)

    @property
    def silently_wrong(self) -> int:
        """Instructions that were understood, and not as they were meant."""
        return sum(outcome.wrong for outcome in self.outcomes)

    @property
    def asked(self) -> int:
        """Questions that the author answered."""
        return sum(outcome.asked for outcome in self.outcomes)

    def of(self, key: Callable[[Sample], str]) -> dict[str, list[Outcome]]:
        """Return the outcomes by a property of their samples, sorted."""
        found: dict[str, list[Outcome]] = {}
        for outcome in self.outcomes:
            found.setdefault(key(outcome.sample), []).append(outcome)
        return dict(sorted(found.items()))


_Denoted = tuple[Predicate, frozenset[str], frozenset[str], bool]
_CHUNK = 64
"""Texts that are put to a model together."""
_MOST_ANSWERS = 8


def _answers(understanding: Understanding, samples: Sequence[Sample]) -> Iterator[Decomposition]:
    if not isinstance(understanding, BatchedUnderstanding):
        yield from (understanding.understand(sample.text, rooms=_rooms(sample)) for sample in samples)
        return
    for start in range(0, len(samples), _CHUNK):
        chunk = samples[start : start + _CHUNK]
        yield from understanding.understand_all([s.text for s in chunk], rooms=[_rooms(s) for s in chunk])


def _rooms(sample: Sample) -> Rooms | None:
    if sample.instruction is None:
        return None
    return {room.id: Room(room.id, room.type) for room in load_scene(sample.instruction.scene).rooms}


def _graph_of(sample: Sample) -> SceneGraph:
    """Return a sample's house as it is at the start."""
    assert sample.instruction is not None
    return instruction_graph(load_scene(sample.instruction.scene), sample.instruction)


def evaluate(
    understanding: Understanding,
    samples: Sequence[Sample],
    watch: Callable[[Iterator[Decomposition]], Iterable[Decomposition]] = iter,
    *,
    answered: bool = False,
) -> Report:
    """Return the scores of an understanding; parts are compared as sets over the whole instruction.

    A task is right if its goal literals are; the tasks are exactly right if they also stand in the same order.

    Args:
        understanding: what is scored.
        samples: texts and what they mean.
        watch: passes the answers on, one per sample, as they come.
        answered: the author of a record answers what is asked about it.
    """
    parts = dict.fromkeys(PARTS, Part())
    exact, refused, outcomes, mistakes = 0, dict[str, int](), list[Outcome](), list[Outcome]()
    for sample, first in zip(samples, watch(_answers(understanding, samples)), strict=True):
        got, asked = _asked(understanding, sample, first) if answered else (first, 0)
        said, meant = _given(got), sample.tasks
        in_order = [_goals(t) for t in said] == [_goals(t) for t in meant]
        for name in PARTS:
            a, b = set(_items(said, name)), set(_items(meant, name))
            right = not got.refused and a == b and (name != "tasks" or in_order)
            old = parts[name]
            parts[name] = Part(
                old.exact + right, old.found + len(a & b), old.wrong + len(a - b), old.missed + len(b - a)
            )
        whole = not got.refused and all(set(_items(said, n)) == set(_items(meant, n)) for n in PARTS[:3])
        exact += whole
        outcomes.append(Outcome(sample, got, goals_denote_the_same(sample, got), asked))
        if not whole or not in_order:
            mistakes.append(outcomes[-1])
        if got.refused:
            reason = got.refused.partition(":")[0]
            refused[reason] = refused.get(reason, 0) + 1
    return Report(len(samples), parts, exact, refused, tuple(outcomes), tuple(mistakes))


def _asked(understanding: Understanding, sample: Sample, got: Decomposition) -> tuple[Decomposition, int]:
    """Return what is understood once the author has answered, and how many questions that took."""
    author, answers = Author(sample), dict[str, str]()
    while got.question is not None and got.question.key not in answers and len(answers) < _MOST_ANSWERS:
        answer = author.answer(got.question)
        if answer is None:
            break
        answers[got.question.key] = answer
        got = understanding.understand(sample.text, rooms=_rooms(sample), answers=answers)
    return got, len(answers)


def goals_denote_the_same(sample: Sample, got: Decomposition) -> bool:
    """Return whether what was understood denotes what was meant, in the house of the sample.

    A pair is about no house: there names denote themselves.
    """
    if got.refused:
        return False
    graph = None if sample.instruction is None else _graph_of(sample)
    meant = [parse_literal(text) for task in sample.tasks for text in task.goal]
    said = [literal for task in got.tasks for literal in task.goal.literals]
    if any(task.goal.conditions for task in got.tasks):
        return False
    found = {_denoted(graph, literal) for literal in said}
    bounds = list(_each([bound for task in sample.tasks for bound in task.denotes]))
    if bounds:
        return _paired(sorted(found, key=str), bounds)
    return found == {_denoted(graph, literal) for literal in meant}


def _each(bounds: Sequence[Denotes]) -> Iterator[Denotes]:
    """Yield the bounds, with `both mugs`, which stands there once for each mug, as the one and the other."""
    for index, bound in enumerate(bounds):
        alike = [other for other in bounds if other == bound]
        things = sorted(bound.subject.least)
        if len(alike) > 1 and len(things) == len(alike) and bound.subject.least == bound.subject.most:
            one = frozenset({things[sum(other == bound for other in bounds[:index])]})
            yield Denotes(bound.predicates, Extent(one, one), bound.object, bound.negated)
        else:
            yield bound


def _paired(found: Sequence[_Denoted], bounds: Sequence[Denotes]) -> bool:
    """Return whether each literal that was understood is one that was meant, and each that was meant is understood."""
    if len(found) != len(bounds):
        return False
    if not found:
        return True
    first, rest = found[0], found[1:]
    return any(
        _within(first, bound) and _paired(rest, [*bounds[:index], *bounds[index + 1 :]])
        for index, bound in enumerate(bounds)
    )


def _within(found: _Denoted, bound: Denotes) -> bool:
    predicate, subjects, objects, negated = found
    fits = bound.subject.least <= subjects <= bound.subject.most
    placed = bound.object.least <= objects <= bound.object.most
    return predicate.value in bound.predicates and negated == bound.negated and fits and placed


def _denoted(graph: SceneGraph | None, literal: Literal) -> _Denoted:
    objects = frozenset[str]()
    if literal.object is not None:
        objects = _objects(graph, literal.object, room=literal.predicate is Predicate.IN_ROOM)
    return literal.predicate, _objects(graph, literal.subject), objects, literal.negated


def _objects(graph: SceneGraph | None, designator: Designator, *, room: bool = False) -> frozenset[str]:
    if graph is None:
        return frozenset({str(designator)})
    if room:
        rooms = frozenset(r.id for r in graph.world.rooms.values() if r.fits(str(designator)))
        return rooms or frozenset({str(designator)})
    return frozenset(fitting(graph, designator)) or frozenset({str(designator)})


def _given(got: Decomposition) -> tuple[Target, ...]:
    return tuple(
        Target(t.text, tuple(map(str, t.objects)), tuple(map(str, t.relations)), t.goal.text()) for t in got.tasks
    )


def _goals(task: Target) -> str:
    return "; ".join(sorted(task.goal))


def _items(tasks: Sequence[Target], part: str) -> Iterator[str]:
    """Yield the items of a part; a task is its goal literals."""
    for task in tasks:
        if part == "tasks":
            yield _goals(task)
        else:
            items: Mapping[str, Sequence[str]] = {
                "objects": task.objects,
                "relations": task.relations,
                "goals": task.goal,
            }
            yield from items[part]
