"""What the parts of a study came to, kept in a file: a study that was ended early goes on with the parts it lacks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeVar

import msgspec

from eval.records.provenance import code_version, stamp
from gavel_env.appended import AppendedFile, free_name
from gavel_env.data import decode, read_bytes
from gavel_env.errors import DataError

__all__ = ["Existing", "Kept"]

Existing = Literal["refuse", "resume", "fresh"]
T = TypeVar("T")


class _Part(msgspec.Struct, frozen=True):
    """One line: a part of a study, what it was made from, and what it came to."""

    part: str
    stamp: str
    code: str
    result: msgspec.Raw


class Kept:
    """Results by part; without a file they are only passed on."""

    def __init__(self, path: Path | None, choices: tuple[object, ...], existing: Existing = "refuse") -> None:
        """Read what is there.

        Args:
            path: JSON Lines, one part each, flushed as it is made; None keeps nothing.
            choices: options on which results depend; parts made with others are made again.
            existing: what to do if the file has parts: refuse, go on with them, or set them aside.

        Raises:
            DataError: the file cannot be read or renamed, or has parts and `existing` is "refuse".
        """
        self._path, self._stamp = path, stamp(*choices)
        self._found: dict[str, _Part] = {}
        self._code: dict[str, None] = {}
        if path is None or not path.exists() or not path.stat().st_size:
            return
        if existing == "refuse":
            raise DataError(f"{path} has results already; --resume continues them, --fresh sets them aside")
        if existing == "fresh":
            path.rename(free_name(path))
            return
        for line in read_bytes(path, "results").splitlines(keepends=True):
            if line.endswith(b"\n"):  # a torn last line is of a part that is made again
                try:
                    part = decode(line, _Part)
                except msgspec.DecodeError as error:
                    raise DataError(f"{path} holds something else than results: {error}") from error
                if part.stamp == self._stamp:
                    self._found[part.part] = part

    def __contains__(self, part: object) -> bool:
        return part in self._found

    def get(self, part: str, form: type[T], make: Callable[[], T]) -> T:
        """Return the result of a part; make and keep it if it is not there.

        Args:
            part: its name.
            form: type of the result.
            make: what makes it.

        Raises:
            DataError: it cannot be written.
        """
        if part not in self._found:
            made = _Part(part, self._stamp, code_version(), msgspec.Raw(msgspec.json.encode(make())))
            self._found[part] = made
            if self._path is not None:
                self._append(self._path, msgspec.json.encode(made) + b"\n")
        found = self._found[part]
        self._code[found.code] = None
        return decode(bytes(found.result), form)

    @property
    def facts(self) -> tuple[str, ...]:
        """What a table of the results asked for so far was made with."""
        return (f"code {', '.join(self._code)}",)

    def _append(self, path: Path, line: bytes) -> None:
        with AppendedFile(path, "results") as file:
            content = read_bytes(path, "results")
            if content and not content.endswith(b"\n"):
                file.truncate(content.rfind(b"\n") + 1)
            file.append(line)
