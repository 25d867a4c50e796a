"""How much of an instruction an understanding gets right: exact match and F1 of objects, relations, goals and tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from gavel_agents.understanding import BatchedUnderstanding, Decomposition, Understanding
from gavel_agents.understanding.pairs import Sample, Target

__all__ = ["PARTS", "Part", "Report", "evaluate"]

PARTS = ("objects", "relations", "goals", "tasks")


class Part(NamedTuple):
    """Scores of one part.

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


class Report(NamedTuple):
    """Scores of a file.

    Attributes:
        instructions: how many there are.
        parts: by name of the part.
        exact: instructions whose objects, relations and goals are all exactly right.
        refused: instructions that were refused, by reason.
        mistakes: those that are not exactly right, with what came out.
    """

    instructions: int
    parts: dict[str, Part]
    exact: int
    refused: dict[str, int]
    mistakes: tuple[tuple[Sample, Decomposition], ...]


_CHUNK = 64
"""Texts that are put to a model together."""


def _answers(understanding: Understanding, samples: Sequence[Sample]) -> Iterator[Decomposition]:
    if not isinstance(understanding, BatchedUnderstanding):
        yield from (understanding.understand(sample.text) for sample in samples)
        return
    for start in range(0, len(samples), _CHUNK):
        chunk = samples[start : start + _CHUNK]
        yield from understanding.understand_all([s.text for s in chunk])


def evaluate(
    understanding: Understanding,
    samples: Sequence[Sample],
    watch: Callable[[Iterator[Decomposition]], Iterable[Decomposition]] = iter,
) -> Report:
    """Return the scores of an understanding; parts are compared as sets over the whole instruction.

    A task is right if its goal literals are; the tasks are exactly right if they also stand in the same order.

    Args:
        understanding: what is scored.
        samples: texts and what they mean.
        watch: passes the answers on, one per sample, as they come.
    """
    parts = dict.fromkeys(PARTS, Part())
    exact, refused, mistakes = 0, dict[str, int](), list[tuple[Sample, Decomposition]]()
    for sample, got in zip(samples, watch(_answers(understanding, samples)), strict=True):
        said, meant = _given(got), _wanted(sample.tasks)
        in_order = [_goals(t) for t in said.tasks] == [_goals(t) for t in meant.tasks]
        for name in PARTS:
            a, b = set(_items(said, name)), set(_items(meant, name))
            right = a == b and (name != "tasks" or in_order)
            old = parts[name]
            parts[name] = Part(
                old.exact + right, old.found + len(a & b), old.wrong + len(a - b), old.missed + len(b - a)
            )
        whole = all(set(_items(said, n)) == set(_items(meant, n)) for n in PARTS[:3])
        exact += whole
        if not whole or not in_order:
            mistakes.append((sample, got))
        if got.refused:
            reason = got.refused.partition(":")[0]
            refused[reason] = refused.get(reason, 0) + 1
    return Report(len(samples), parts, exact, refused, tuple(mistakes))


class _Tasks(NamedTuple):
    tasks: tuple[Target, ...]


def _given(got: Decomposition) -> _Tasks:
    return _Tasks(
        tuple(
            Target(t.text, tuple(map(str, t.objects)), tuple(map(str, t.relations)), t.goal.text()) for t in got.tasks
        )
    )


def _wanted(tasks: Iterable[Target]) -> _Tasks:
    return _Tasks(tuple(tasks))


def _goals(task: Target) -> str:
    return "; ".join(sorted(task.goal))


def _items(said: _Tasks, part: str) -> Iterator[str]:
    """Yield the items of a part; a task is its goal literals."""
    for task in said.tasks:
        if part == "tasks":
            yield _goals(task)
        else:
            yield from {"objects": task.objects, "relations": task.relations, "goals": task.goal}[part]
