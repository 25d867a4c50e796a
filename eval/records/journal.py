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
from eval.records.schema import EpisodeKey, EpisodeRecord, RunHeader
from gavel_env.errors import DataError

__all__ = ["RecordFile", "RecordWriter", "read_records"]

_SCHEMAS = ("gavel-run/1", "gavel-record/1")


class _Schema(msgspec.Struct):
    schema: str = ""


class RecordFile(NamedTuple):
    """What record files hold.

    Attributes:
        headers: in order.
        records: by key; of records with the same key the last one.
        damaged: `PLACE: REASON` per line that is no record; their episodes count as not run.
    """

    headers: tuple[RunHeader, ...]
    records: Mapping[EpisodeKey, EpisodeRecord]
    damaged: tuple[str, ...]


def read_records(paths: Iterable[str | Path]) -> RecordFile:
    """Read record files; a folder stands for its `records.jsonl`. A torn last line is left out.

    Raises:
        DataError: unreadable file, no line that is a record, or a schema of another version.
    """
    headers: list[RunHeader] = []
    records: dict[EpisodeKey, EpisodeRecord] = {}
    damaged: list[str] = []
    for path in map(Path, paths):
        file = path / "records.jsonl" if path.is_dir() else path
        try:
            content = file.read_bytes()
        except OSError as error:
            raise DataError(f"records {file} cannot be read: {error.strerror}") from error
        for number, line in enumerate(content.splitlines(keepends=True), start=1):
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
                records[entry.key] = entry
        if not headers and not records:
            raise DataError(f"{file} holds no record" + (f"; {damaged[0]}" if damaged else ""))
    return RecordFile(tuple(headers), records, tuple(damaged))


def _refuse_other_version(line: bytes, place: str) -> None:
    try:
        schema = msgspec.json.decode(line, type=_Schema).schema
    except (msgspec.DecodeError, UnicodeDecodeError):
        return
    if schema.startswith("gavel-") and schema not in _SCHEMAS:
        raise DataError(f"{place}: schema {schema!r} is not known here; known: {', '.join(_SCHEMAS)}")


def _lock(descriptor: int) -> None:
    """Lock a file until it is closed or the process ends, however it ends; where there is `flock`.

    Raises:
        OSError: another process has the lock.
    """
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class RecordWriter:
    """Appends lines to one record file; the only writer of that file while it is open."""

    def __init__(self, path: str | Path) -> None:
        """Open (or create) the file, lock it, and cut off a torn last line.

        Raises:
            DataError: the file cannot be opened, or another run is writing to it.
        """
        self.path = Path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise DataError(f"records {self.path} cannot be written: {error.strerror}") from error
        try:
            _lock(self._descriptor)
        except OSError as error:
            os.close(self._descriptor)
            raise DataError(f"records {self.path} are being written by another run; choose another --out") from error
        content = self.path.read_bytes()
        if content and not content.endswith(b"\n"):
            os.ftruncate(self._descriptor, content.rfind(b"\n") + 1)

    def set_aside(self) -> Path | None:
        """Rename what is there, while it is locked, and begin anew; return its new name, or None if it is empty.

        Raises:
            DataError: the file cannot be renamed, or another run has begun there.
        """
        if not self.path.stat().st_size:
            return None
        aside = _free_name(self.path)
        try:
            self.path.rename(aside)
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
            _lock(descriptor)
        except OSError as error:
            raise DataError(f"records {self.path} cannot be set aside: {error.strerror}") from error
        os.close(self._descriptor)
        self._descriptor = descriptor
        return aside

    def write(self, entry: RunHeader | EpisodeRecord) -> None:
        """Append one line and flush it to the disk.

        Raises:
            Unencodable: the entry cannot be written as JSON.
            DataError: the disk did not take the whole line.
        """
        line = encoded(entry)
        try:
            written = os.write(self._descriptor, line)
            os.fsync(self._descriptor)
        except OSError as error:
            raise DataError(f"records {self.path} cannot be written: {error.strerror}") from error
        if written != len(line):
            raise DataError(f"records {self.path}: only {written} of {len(line)} bytes were written; is the disk full?")

    def close(self) -> None:
        """Close the file and give up its lock."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> RecordWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _free_name(path: Path) -> Path:
    number = 1
    while (name := path.with_name(f"{path.stem}.{number}{path.suffix}")).exists():
        number += 1
    return name
