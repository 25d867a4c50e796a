"""Data files: where the shipped ones lie, and the one way in which any file is read.

Every reader here takes regular files only, up to a size, and turns what is wrong into a typed error that names the file
(and the line), so that a folder, a device, a decompression bomb or a byte that is not UTF-8 is said instead of met.
"""

from __future__ import annotations

import stat
import threading
import zlib
from collections.abc import Iterator
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from gavel_env.errors import DataError

__all__ = [
    "MOST_BYTES",
    "convert",
    "decode",
    "is_path",
    "read_bytes",
    "read_json",
    "read_lines",
    "sayable",
    "shipped_data",
]

T = TypeVar("T")

MOST_BYTES = 256 << 20
"""Of one file, as unpacked. The largest that ships has 30 MB."""

_TURN = threading.Lock()

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


def sayable(text: str) -> str:
    """Return a text as UTF-8 can say it: `?` for half a character, a lone surrogate."""
    return text if text.isascii() else text.encode("utf-8", "replace").decode("utf-8")


def read_bytes(path: str | Path, what: str, error: type[DataError] = DataError, *, most: int = MOST_BYTES) -> bytes:
    """Return the content of a file; of a `.gz` file as unpacked.

    Args:
        path: of a regular file.
        what: kind of the file, for errors: "scene file".
        error: class of the errors.
        most: bytes, as unpacked.

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
        return b"".join(_unpacked(content, most))
    except (zlib.error, EOFError, OverflowError) as problem:
        raise error(f"{what} {path} cannot be unpacked: {problem}") from problem


def _unpacked(packed: bytes, most: int) -> Iterator[bytes]:
    """Yield the content of all gzip members in pieces, and stop where it becomes too much."""
    total = 0
    while packed:
        stream = zlib.decompressobj(_GZIP)
        while not stream.eof:
            piece = stream.decompress(packed, _CHUNK)
            packed = stream.unconsumed_tail
            total += len(piece)
            if total > most:
                raise OverflowError(f"more than {most} bytes")
            yield piece
            if not packed and not piece and not stream.eof:
                raise EOFError("its end is missing")
        packed = stream.unused_data


@lru_cache(maxsize=256)
def _decoder(form: Any) -> msgspec.json.Decoder[Any]:
    return msgspec.json.Decoder(form)


def _known(form: Any) -> msgspec.json.Decoder[Any]:
    """Return the decoder of a type, which one thread alone may build.

    msgspec notes what it finds out of a type on the type itself, at first use and without a lock: threads that come to
    it together end the process.
    """
    with _TURN:
        return _decoder(form)


def decode(content: bytes | str, form: type[T]) -> T:
    """Return JSON as a value of a type; safe for several threads, as `msgspec.json.decode` is not.

    Raises:
        msgspec.DecodeError, UnicodeDecodeError, RecursionError: malformed.
    """
    found: T = _known(form).decode(content)
    return found


def convert(value: Any, form: type[T]) -> T:
    """Return a value of builtin types as one of a type; safe for several threads.

    Raises:
        msgspec.ValidationError: it does not fit.
    """
    _known(form)
    return msgspec.convert(value, form)


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
        found: Any = decode(content, form)
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
            yield decode(line, form)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
            raise error(f"{path}:{number}: malformed {what}: {problem}") from problem
