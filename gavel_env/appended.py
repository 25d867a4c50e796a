"""Files that are only ever appended to, whole piece by whole piece, by one process at a time.

Journals of lines and files of gzip members are written so. What a killed process leaves torn is at the end; whatever
else is damaged is passed over, in a stream and with caps, since a few megabytes can unpack to any size.
"""

from __future__ import annotations

import errno
import mmap
import os
import stat
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from gavel_env.errors import DataError

__all__ = ["MEMBER_BYTES", "AppendedFile", "Member", "cut_member", "free_name", "read_members"]

MEMBER_BYTES = 64 << 20
"""Most bytes that a member unpacks to; a larger one is passed over as damaged."""

_WASTED_BYTES = 1 << 30
"""Most bytes of a file that are unpacked for nothing, while the next whole member is looked for."""

_MAGIC = b"\x1f\x8b\x08"
_CHUNK = 64 << 10


class Member(NamedTuple):
    """One whole member.

    Attributes:
        start, end: where it lies in the file, bytes.
        content: unpacked.
    """

    start: int
    end: int
    content: bytes


def read_members(path: str | Path) -> Iterator[Member]:
    """Yield the whole members of a file; what lies between two of them or behind the last is damaged.

    Raises:
        OSError: the file cannot be read.
    """
    found = Path(path).stat()
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file")
    if not found.st_size:
        return
    with Path(path).open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as packed:
        position = wasted = 0
        while wasted < _WASTED_BYTES and (start := packed.find(_MAGIC, position)) >= 0:
            content, end, _ = _unpack(packed, start)
            if end is None:
                position = start + 1
                wasted += len(content)
            else:
                yield Member(start, end, content)
                position = end


def cut_member(path: str | Path, start: int) -> bytes | None:
    """Return what can be unpacked of a member that is cut off by the end of the file; None if it is damaged otherwise.

    Args:
        path: of the file.
        start: where the member begins, bytes.

    Raises:
        OSError: the file cannot be read.
    """
    with Path(path).open("rb") as file:
        if start >= Path(path).stat().st_size:
            return None
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as packed:
            content, _, cut = _unpack(packed, start)
            return content if cut else None


def _unpack(packed: mmap.mmap, start: int) -> tuple[bytes, int | None, bool]:
    """Return what the member unpacks to that starts here, where it ends (None: nowhere), and whether it is cut off."""
    stream = zlib.decompressobj(zlib.MAX_WBITS | 16)
    content = bytearray()
    position = start
    try:
        while not stream.eof:
            chunk = stream.unconsumed_tail
            if not chunk:
                chunk = packed[position : position + _CHUNK]
                position += len(chunk)
            if not chunk:
                return bytes(content), None, True
            content += stream.decompress(chunk, MEMBER_BYTES + 1 - len(content))
            if len(content) > MEMBER_BYTES:
                return bytes(content), None, False
    except zlib.error:
        return bytes(content), None, False
    return bytes(content), position - len(stream.unused_data), False


class AppendedFile:
    """A file that this process alone appends to while it is open; what was appended is on the disk."""

    def __init__(self, path: str | Path, what: str) -> None:
        """Open (or create) the file and lock it, where there is `flock`.

        Args:
            path: of the file; missing folders are made.
            what: kind of the file, for errors: "records".

        Raises:
            DataError: the file cannot be opened, or another process appends to it.
        """
        self.path = Path(path)
        self._what = what
        self._descriptor = -1
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            while not self._opened():
                pass
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DataError(f"{what} {path} cannot be written: {reason}") from error

    def _opened(self) -> bool:
        """Open and lock the file; return False if it was set aside or deleted meanwhile."""
        descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            _lock(descriptor)
        except OSError as error:
            os.close(descriptor)
            raise DataError(
                f"{self._what} {self.path} are being written by another run; choose another --out"
            ) from error
        try:
            mine = os.path.samestat(os.fstat(descriptor), self.path.stat())
        except OSError:
            mine = False
        if not mine:
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def __len__(self) -> int:
        """Return the bytes of the file."""
        return os.fstat(self._descriptor).st_size

    def truncate(self, size: int) -> None:
        """Cut the file off.

        Raises:
            DataError: it cannot be written.
        """
        try:
            os.ftruncate(self._descriptor, size)
        except OSError as error:
            raise DataError(f"{self._what} {self.path} cannot be written: {error.strerror}") from error

    def set_aside(self, name: Path, kept: bytes = b"") -> None:
        """Give what is there another name and begin anew; nobody else can write to either meanwhile.

        A process that is killed in here leaves the file as it was, or as it shall be.

        Args:
            name: what is there is called from now on.
            kept: what the file begins with.

        Raises:
            DataError: the disk did not take it, or the file cannot be renamed.
        """
        fresh = self.path.with_name(f"{self.path.name}.new")
        try:
            descriptor = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o644)
            try:
                _lock(descriptor)
                _write(descriptor, kept)
                try:
                    os.link(self.path, name)
                except OSError:  # a disk without links
                    self.path.rename(name)
                fresh.replace(self.path)
            except OSError:
                os.close(descriptor)
                fresh.unlink(missing_ok=True)
                raise
        except OSError as error:
            raise DataError(f"{self._what} {self.path} cannot be set aside: {error.strerror}") from error
        os.close(self._descriptor)
        self._descriptor = descriptor

    def append(self, piece: bytes) -> None:
        """Write a piece whole and flush it to the disk; if that fails, none of it stays.

        Raises:
            DataError: the disk did not take it.
        """
        before = len(self)
        try:
            _write(self._descriptor, piece)
        except OSError as error:
            if len(self) > before:
                self.truncate(before)
            raise DataError(f"{self._what} {self.path} cannot be written: {error.strerror}") from error

    def close(self) -> None:
        """Close the file and give up its lock."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __del__(self) -> None:
        self.close()

    def __enter__(self) -> AppendedFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _write(descriptor: int, piece: bytes) -> None:
    """Write a piece whole and flush it to the disk.

    Raises:
        OSError: the disk did not take it; some of it may be there.
    """
    written = 0
    while written < len(piece):
        written += os.write(descriptor, piece[written:] if written else piece)
    os.fsync(descriptor)


def _lock(descriptor: int) -> None:
    """Lock a file until it is closed or the process ends, however it ends; where there is `flock`.

    Raises:
        OSError: another process has the lock.
    """
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def free_name(path: Path) -> Path:
    """Return a name beside a file that nothing has: `records.1.jsonl` for `records.jsonl`."""
    stem, dot, ending = path.name.partition(".")
    number = 1
    while (name := path.with_name(f"{stem}.{number}{dot}{ending}")).exists():
        number += 1
    return name
