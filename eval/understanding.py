"""How much of an instruction an understanding gets right: exact match and F1 of objects, relations, goals and tasks."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import msgspec

from gavel_agents.understanding import Decomposition, Understanding
from gavel_env.errors import DataError
from gavel_env.instructions import shipped

__all__ = ["PARTS", "Part", "Report", "Sample", "Target", "evaluate", "read_samples"]

PARTS = ("objects", "relations", "goals", "tasks")


class Target(msgspec.Struct, frozen=True):
    """What understanding one task must give, in text form."""

    text: str
    objects: tuple[str, ...]
    relations: tuple[str, ...]
    goal: tuple[str, ...]


class Sample(msgspec.Struct, frozen=True):
    """A sentence and its tasks."""

    id: str
    text: str
    tasks: tuple[Target, ...]


class _Meta(msgspec.Struct, frozen=True):
    targets: tuple[Target, ...] = ()


class _Line(msgspec.Struct, frozen=True):
    """A line of an instruction file, or of a file of pairs (whose tasks are targets themselves)."""

    id: str
    text: str
    tasks: msgspec.Raw
    meta: _Meta = _Meta()


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


def read_samples(source: str) -> list[Sample]:
    """Return the samples of a shipped file (`single`, `multi`, `validation`, ...) or of a path.

    Raises:
        UnknownInstruction: no shipped file has this name.
        DataError: unreadable or malformed; names the file and the line.
    """
    path = _path(source)
    try:
        content = path.read_bytes()
        lines = (gzip.decompress(content) if path.suffix == ".gz" else content).splitlines()
    except (OSError, EOFError) as error:
        raise DataError(f"{path} cannot be read: {error}") from error
    samples = []
    for number, raw in enumerate(lines, start=1):
        try:
            line = msgspec.json.decode(raw, type=_Line)
            tasks = line.meta.targets or msgspec.json.decode(line.tasks, type=tuple[Target, ...])
        except msgspec.DecodeError as error:
            raise DataError(f"{path}:{number}: no targets of understanding: {error}") from error
        samples.append(Sample(line.id, line.text, tasks))
    return samples


def _path(source: str) -> Path:
    if source.endswith((".jsonl", ".jsonl.gz")):
        return Path(source)
    folder = Path(str(resources.files("envs_data") / "instructions" / "pairs"))
    pairs = (folder / f"{source}{ending}" for ending in (".jsonl", ".jsonl.gz"))
    return next((path for path in pairs if path.is_file()), None) or shipped(source)


def evaluate(understanding: Understanding, samples: Sequence[Sample]) -> Report:
    """Return the scores of an understanding; parts are compared as sets over the whole instruction.

    A task is right if its goal literals are; the tasks are exactly right if they also stand in the same order.
    """
    parts = dict.fromkeys(PARTS, Part())
    exact, refused, mistakes = 0, dict[str, int](), list[tuple[Sample, Decomposition]]()
    for sample in samples:
        got = understanding.understand(sample.text, sample.id)
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
