"""Files of gzip members that are appended whole: read in a stream, with caps, past whatever is damaged."""

from __future__ import annotations

import mmap
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

__all__ = ["MEMBER_BYTES", "Member", "read_members"]

MEMBER_BYTES = 64 << 20
"""Most bytes that a member unpacks to; a larger one is passed over as damaged."""

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
    with Path(path).open("rb") as file:
        if not Path(path).stat().st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as packed:
            position = 0
            while (start := packed.find(_MAGIC, position)) >= 0:
                member = _unpack(packed, start)
                if member is None:
                    position = start + 1
                else:
                    yield member
                    position = member.end


def _unpack(packed: mmap.mmap, start: int) -> Member | None:
    """Return the member that starts here, or None if it is torn, damaged or too large."""
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
                return None
            content += stream.decompress(chunk, MEMBER_BYTES + 1 - len(content))
            if len(content) > MEMBER_BYTES:
                return None
    except zlib.error:
        return None
    return Member(start, position - len(stream.unused_data), bytes(content))
