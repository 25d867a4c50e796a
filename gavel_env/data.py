"""Data files: where the shipped ones lie, and the one way in which any file is read.

Every reader here takes regular files only, up to a size, and turns what is wrong into a typed error that names the file
(and the line), so that a folder, a device, a decompression bomb or a byte that is no UTF-8 is said instead of met.
"""

from __future__ import annotations

import stat
import zlib
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from gavel_env.errors import DataError

__all__ = ["MOST_BYTES", "is_path", "read_bytes", "read_json", "read_lines", "shipped_data"]

T = TypeVar("T")

MOST_BYTES = 1 << 30
"""Of one file, as unpacked. The largest that ships has 30 MB."""

_GZIP = zlib.MAX_WBITS | 16
_CHUNK = 1 << 20


def shipped_data(*parts: str) -> Path:
    """Return the path of a file or folder of `envs_data`."""
    return Path(str(resources.files("envs_data"))).joinpath(*parts)


def is_path(source: str | Path) -> bool:
    """Return whether a source is a path rather than the name of something shipped.

    A `Path` is, and a text that has a folder or a file ending.
    """
    return isinstance(source, Path) or "/" in source or "\\" in source or Path(source).suffix != ""


def read_bytes(
    path: str | Path, what: str, error: type[DataError] = DataError, *, most: int = MOST_BYTES, torn: bool = False
) -> bytes:
    """Return the content of a file; of a `.gz` file as unpacked.

    Args:
        path: of a regular file.
        what: kind of the file, for errors: "scene file".
        error: class of the errors.
        most: bytes, as unpacked.
        torn: pass over a last gzip member that is cut off, as a killed process leaves it.

    Raises:
        DataError: the file is missing, no regular file, too large, or not gzip although it is named so.
    """
    path = Path(path)
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise error(f"{what} {path} is not a regular file")
        if found.st_size > most:
            raise error(f"{what} {path} has {found.st_size} bytes; at most {most} are read")
        content = path.read_bytes()
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"{what} {path} cannot be read: {reason}") from problem
    if path.suffix != ".gz":
        return content
    try:
        return b"".join(_members(content, most, torn))
    except (zlib.error, EOFError, OverflowError) as problem:
        raise error(f"{what} {path} cannot be unpacked: {problem}") from problem


def _members(packed: bytes, most: int, torn: bool) -> Iterator[bytes]:
    """Yield the content of every gzip member in pieces, and stop where it becomes too much."""
    total = 0
    while packed:
        stream = zlib.decompressobj(_GZIP)
        member: list[bytes] = []
        while not stream.eof:
            piece = stream.decompress(packed, _CHUNK)
            packed = stream.unconsumed_tail
            total += len(piece)
            if total > most:
                raise OverflowError(f"more than {most} bytes")
            member.append(piece)
            if not packed and not piece and not stream.eof:
                if torn:
                    return
                raise EOFError("its end is missing")
        yield from member
        packed = stream.unused_data


def read_json(
    path: str | Path, form: type[T], what: str, error: type[DataError] = DataError, *, version: str | None = None
) -> T:
    """Read and validate a JSON file.

    Args:
        path: of the file; `.json` or `.json.gz`.
        form: a msgspec type.
        what: kind of the file, for errors.
        error: class of the errors.
        version: what the field `format` must say.

    Raises:
        DataError: unreadable, malformed, or of another format version.
    """
    content = read_bytes(path, what, error)
    try:
        found: Any = msgspec.json.decode(content, type=form)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
        raise error(f"{what} {path} is malformed: {problem}") from problem
    if version is not None and found.format != version:
        raise error(f"{what} {path} has format {found.format!r}; this version reads {version!r}")
    return found  # type: ignore[no-any-return]


def read_lines(path: str | Path, form: type[T], what: str, error: type[DataError] = DataError) -> Iterator[T]:
    """Yield the lines of a JSON Lines file (`.jsonl` or `.jsonl.gz`); blank ones are passed over.

    Raises:
        DataError: unreadable, or a line is malformed; names the line.
    """
    for number, line in enumerate(read_bytes(path, what, error).split(b"\n"), start=1):
        if not line.strip():
            continue
        try:
            yield msgspec.json.decode(line, type=form)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
            raise error(f"{path}:{number}: malformed {what}: {problem}") from problem
