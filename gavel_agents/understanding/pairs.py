"""Pairs of a sentence and what understanding it must give: what understandings are trained on and scored by."""

from __future__ import annotations

from pathlib import Path

import msgspec

from gavel_env.data import decode, is_path, read_lines, shipped_data
from gavel_env.errors import DataError
from gavel_env.instructions.record import Instruction, read_instructions, shipped

__all__ = ["Denotes", "Extent", "Sample", "Target", "read_samples"]


class Extent(msgspec.Struct, frozen=True):
    """How much a word covers: the instances that it must denote, and those that it may."""

    least: frozenset[str] = frozenset()
    most: frozenset[str] = frozenset()


class Denotes(msgspec.Struct, frozen=True):
    """What a goal literal may denote in its house if people's words leave it open (docs/explanation/voices.md)."""

    predicates: tuple[str, ...]
    subject: Extent
    object: Extent = Extent()
    negated: bool = False


class Target(msgspec.Struct, frozen=True):
    """What understanding one task must give, in text form; `denotes` says what its goal may denote, or nothing."""

    text: str
    objects: tuple[str, ...]
    relations: tuple[str, ...]
    goal: tuple[str, ...]
    denotes: tuple[Denotes, ...] = ()


class Sample(msgspec.Struct, frozen=True):
    """A sentence and its tasks.

    Attributes:
        id, text, tasks: of the sentence.
        instruction: the record that it comes from, or None for a pair, which is about no house.
        voice, split: who speaks, and whether it may be looked at (`dev`) or only scored (`test`), where a file says so.
    """

    id: str
    text: str
    tasks: tuple[Target, ...]
    instruction: Instruction | None = None
    voice: str = ""
    split: str = ""


class _Meta(msgspec.Struct, frozen=True):
    targets: tuple[Target, ...] = ()
    voice: str = ""
    split: str = ""


class _Line(msgspec.Struct, frozen=True):
    """A line of an instruction file, or of a file of pairs (whose tasks are targets themselves)."""

    id: str
    text: str
    tasks: msgspec.Raw
    meta: _Meta = _Meta()
    scene: str = ""


def read_samples(source: str) -> list[Sample]:
    """Return the samples of a shipped file (`train`, `validation`, `single`, `multi`, ...) or of a path.

    Raises:
        UnknownInstruction: no shipped file has this name.
        DataError: unreadable or malformed; names the file and the line.
    """
    path = _path(source)
    samples = []
    lines = list(read_lines(path, _Line, "targets of understanding"))
    records = read_instructions(path) if any(line.scene for line in lines) else {}
    for line in lines:
        try:
            tasks = line.meta.targets or decode(line.tasks, tuple[Target, ...])
        except msgspec.DecodeError as error:
            raise DataError(f"{path}: no targets of understanding in {line.id!r}: {error}") from error
        samples.append(Sample(line.id, line.text, tasks, records.get(line.id), line.meta.voice, line.meta.split))
    return samples


def _path(source: str) -> Path:
    if is_path(source):
        return Path(source)
    pairs = (shipped_data("instructions", "pairs", f"{source}{ending}") for ending in (".jsonl", ".jsonl.gz"))
    return next((path for path in pairs if path.is_file()), None) or shipped(source)
