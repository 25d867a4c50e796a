"""Writes and reads record files.

Lines are appended whole: one write, flushed to the disk before the next episode. A line that a killed process left
torn is cut off before anything is appended, so its episode runs again.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import msgspec

from eval.records.encoding import LINE, encoded
from eval.records.schema import Contestant, EpisodeKey, EpisodeRecord, RunHeader
from gavel_agents.agent import AgentTrace
from gavel_env.appended import AppendedFile, free_name
from gavel_env.data import decode, read_bytes
from gavel_env.errors import DataError

__all__ = ["RecordFile", "RecordWriter", "read_records"]

MOST_BYTES = 16 << 30
"""Of one record file; a year of runs has less."""

_SCHEMAS = ("gavel-run/1", "gavel-record/1")


class _Schema(msgspec.Struct):
    schema: str = ""


class RecordFile(NamedTuple):
    """What record files hold.

    Attributes:
        headers: in order.
        records: by key; of records with the same key the last one.
        damaged: `PLACE: REASON` per line that is not a record; their episodes count as not run.
        folders: in which the files lie.
    """

    headers: tuple[RunHeader, ...]
    records: Mapping[EpisodeKey, EpisodeRecord]
    damaged: tuple[str, ...]
    folders: tuple[Path, ...] = ()


def read_records(paths: Iterable[str | Path], *, whole: bool = True) -> RecordFile:
    """Read record files; a folder stands for its `records.jsonl`. A torn last line is left out.

    Args:
        paths: files and folders.
        whole: with steps, plans and goals; tables need none of them, and a million records without them fit in memory.

    Raises:
        DataError: unreadable file, no line that is a record, or a schema of another version.
    """
    headers: list[RunHeader] = []
    records: dict[EpisodeKey, EpisodeRecord] = {}
    contestants: dict[Contestant, Contestant] = {}
    damaged: list[str] = []
    folders: dict[Path, None] = {}
    for path in map(Path, paths):
        file = path / "records.jsonl" if os.path.isdir(path) else path
        folders[file.parent] = None
        for number, line in enumerate(read_bytes(file, "records", most=MOST_BYTES).splitlines(keepends=True), start=1):
            if not line.endswith(b"\n"):
                damaged.append(f"{file}:{number}: torn last line")
                continue
            try:
                entry = LINE.decode(line)
            except (msgspec.DecodeError, UnicodeDecodeError) as error:
                _refuse_other_version(line, f"{file}:{number}")
                damaged.append(f"{file}:{number}: {error}")
                continue
            if isinstance(entry, RunHeader):
                headers.append(entry)
            else:
                who = contestants.setdefault(entry.contestant, entry.contestant)
                records[entry.key] = msgspec.structs.replace(entry, contestant=who) if whole else _slim(entry, who)
        if not headers and not records:
            raise DataError(f"{file} holds no record" + (f"; {damaged[0]}" if damaged else ""))
    return RecordFile(tuple(headers), records, tuple(damaged), tuple(folders))


def _slim(record: EpisodeRecord, who: Contestant) -> EpisodeRecord:
    """Return what tables need of a record."""
    trace = record.trace
    return EpisodeRecord(
        seed=record.seed,
        instruction=sys.intern(record.instruction),
        kind=sys.intern(record.kind),
        scene=sys.intern(record.scene),
        text="",
        data=sys.intern(record.data),
        code=sys.intern(record.code),
        contestant=who,
        outcome=sys.intern(record.outcome),
        failure=sys.intern(record.failure),
        model=sys.intern(record.model),
        decoding={sys.intern(name): value for name, value in record.decoding.items()},
        trace=AgentTrace(
            attempts=trace.attempts,
            expected_m=trace.expected_m,
            seconds={sys.intern(stage): seconds for stage, seconds in trace.seconds.items()},
            prompt_tokens=trace.prompt_tokens,
            completion_tokens=trace.completion_tokens,
        ),
        usage=record.usage,
        metres=record.metres,
        error=record.error if record.outcome == "rejected" else "",
    )


def _refuse_other_version(line: bytes, place: str) -> None:
    try:
        schema = decode(line, _Schema).schema
    except (msgspec.DecodeError, UnicodeDecodeError):
        return
    if schema.startswith("gavel-") and schema not in _SCHEMAS:
        raise DataError(f"{place}: schema {schema!r} is not known here; known: {', '.join(_SCHEMAS)}")


class RecordWriter:
    """Appends lines to one record file; the only writer of that file while it is open."""

    def __init__(self, path: str | Path) -> None:
        """Open (or create) the file, lock it, and cut off a torn last line.

        Raises:
            DataError: the file cannot be opened, or another run is writing to it.
        """
        self._file = AppendedFile(path, "records")
        self.path = self._file.path
        content = read_bytes(self.path, "records", most=MOST_BYTES)
        if content and not content.endswith(b"\n"):
            self._file.truncate(content.rfind(b"\n") + 1)

    def set_aside(self) -> Path | None:
        """Rename what is there, while it is locked, and begin anew; return its new name, or None if it is empty.

        Raises:
            DataError: the file cannot be renamed, or another run has begun there.
        """
        if not self.path.stat().st_size:
            return None
        aside = free_name(self.path)
        self._file.set_aside(aside)
        return aside

    def write(self, entry: RunHeader | EpisodeRecord) -> None:
        """Append one line and flush it to the disk.

        Raises:
            Unencodable: the entry cannot be written as JSON.
            DataError: the disk did not take the whole line.
        """
        self._file.append(encoded(entry))

    def close(self) -> None:
        """Close the file and give up its lock."""
        self._file.close()

    def __enter__(self) -> RecordWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
