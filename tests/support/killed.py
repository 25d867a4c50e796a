"""Runs a command of `gavel` and kills it (SIGKILL) at a moment that is counted: the same one can be had again.

    python -m tests.support.killed '{"at": "event", "number": 1234}' eval --agents …
    python -m tests.support.killed '{"at": "write", "number": 7, "part": 0.4}' eval --agents …

Counting begins when the first file is opened that is appended to (records, recordings): events are calls and returns
of functions, Python's and C's, in all threads; writes are those to regular files, of which only a part gets there.
A command that ends before its moment says how much it has counted, as a JSON object on the last line of stderr.
"""

from __future__ import annotations

import itertools
import json
import os
import signal
import stat
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from gavel_env.appended import AppendedFile

if TYPE_CHECKING:
    from typing_extensions import Buffer

__all__ = ["Moment"]


class Moment(msgspec.Struct, frozen=True):
    """When a command is killed.

    Attributes:
        at: what is counted, "event" or "write".
        number: the how-manieth it does not outlive; 0 = never.
        part: of the bytes of a write, how many get to the file.
    """

    at: Literal["event", "write"]
    number: int
    part: float = 1.0


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


class _Counting:
    def __init__(self, moment: Moment) -> None:
        self._last = {"event": 0, "write": 0, moment.at: moment.number}
        self._part = moment.part
        self._begun = False
        self._events, self._writes = itertools.count(1), itertools.count(1)
        self.counted = {"event": 0, "write": 0}
        self._open, self._write = AppendedFile.__init__, os.write

    def install(self) -> None:
        def opened(file: AppendedFile, path: str | Path, what: str) -> None:
            self._begin()
            self._open(file, path, what)

        AppendedFile.__init__ = opened  # type: ignore[method-assign, assignment]
        os.write = self._written

    def _begin(self) -> None:
        if not self._begun:
            self._begun = True
            threading.setprofile(self._happened)
            sys.setprofile(self._happened)

    def _happened(self, frame: FrameType, event: str, argument: Any) -> None:
        number = self.counted["event"] = next(self._events)
        if number == self._last["event"]:
            _die()

    def _written(self, descriptor: int, content: Buffer, /) -> int:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            return self._write(descriptor, content)
        number = self.counted["write"] = next(self._writes)
        if number == self._last["write"]:
            whole = memoryview(content)
            self._write(descriptor, whole[: int(len(whole) * self._part)])
            _die()
        return self._write(descriptor, content)


def main() -> int:
    """Run the command behind the moment."""
    counting = _Counting(msgspec.json.decode(sys.argv[1], type=Moment))
    counting.install()
    from eval.cli import main as gavel

    status = gavel(sys.argv[2:])
    sys.setprofile(None)
    sys.stderr.write(json.dumps(counting.counted) + "\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
