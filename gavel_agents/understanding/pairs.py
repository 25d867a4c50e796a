"""Pairs of a sentence and what understanding it must give: what understandings are trained on and scored by."""

from __future__ import annotations

import gzip
from importlib import resources
from pathlib import Path

import msgspec

from gavel_env.errors import DataError
from gavel_env.instructions.record import shipped

__all__ = ["Sample", "Target", "read_samples"]


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


def read_samples(source: str) -> list[Sample]:
    """Return the samples of a shipped file (`train`, `validation`, `single`, `multi`, ...) or of a path.

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
