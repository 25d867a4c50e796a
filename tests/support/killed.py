"""Runs a command of `gavel` and kills it (SIGKILL) at a moment that is counted: the same one can be had again.

    python -m tests.support.killed '{"at": "event", "number": 1234}' eval --agents …
    python -m tests.support.killed '{"at": "write", "number": 7, "part": 0.4}' eval --agents …

Counting begins when the first file is opened that is appended to (records, recordings): events are calls and returns
of functions, Python's and C's, in all threads (that takes time, and is left out for a moment of writing); writes are
those to regular files, of which only a part gets there.
A command that ends before its moment says how much it has counted, as a JSON object on the last line of stderr.

`Commands` runs many of them, each in a fork of one process that has imported everything.
"""

from __future__ import annotations

import itertools
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import msgspec

from gavel_env.appended import AppendedFile

if TYPE_CHECKING:
    from typing import Self

    from typing_extensions import Buffer

__all__ = ["Commands", "Ended", "Moment"]

ROOT = Path(__file__).parents[2]


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
        self._begun, self._events_too = False, moment.at == "event"
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
        if not self._begun and self._events_too:
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


def run(moment: Moment, arguments: list[str]) -> int:
    """Run a command until the moment."""
    counting = _Counting(moment)
    counting.install()
    from eval.cli import main as gavel

    status = gavel(arguments)
    sys.setprofile(None)
    sys.stderr.write(json.dumps(counting.counted) + "\n")
    return status


class _Job(msgspec.Struct, frozen=True):
    moment: Moment
    arguments: list[str]


class Ended(NamedTuple):
    """What a command came to; `returncode` as of `subprocess.run`."""

    returncode: int
    stdout: str
    stderr: str


class Commands:
    """Runs commands one after the other, each in a process of its own that need not import anything."""

    def __enter__(self) -> Self:
        self._server = subprocess.Popen(
            [sys.executable, "-m", "tests.support.killed", "serve"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._server.communicate()

    def run(self, moment: Moment, *arguments: str) -> Ended:
        """Run a command; returns once all of its processes have closed their output."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(msgspec.json.encode(_Job(moment, list(arguments))) + b"\n")
        self._server.stdin.flush()
        return msgspec.json.decode(self._server.stdout.readline(), type=Ended)


def _serve() -> None:
    """Read jobs from standard input, fork for each, and write what it came to."""
    import eval.commands.eval
    import eval.commands.record
    import eval.run.runner  # noqa: F401

    for line in sys.stdin.buffer:
        job = msgspec.json.decode(line, type=_Job)
        ours, theirs = os.pipe()
        with tempfile.TemporaryFile() as out:
            sys.stdout.flush()
            child = os.fork()
            if not child:
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                os.dup2(out.fileno(), 1)
                os.dup2(theirs, 2)
                os.close(ours)
                os.close(theirs)
                sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
                sys.exit(run(job.moment, job.arguments))
            os.close(theirs)
            with os.fdopen(ours, "rb") as errors:
                said = errors.read()
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            out.seek(0)
            ended = Ended(code, out.read().decode(), said.decode())
        sys.stdout.buffer.write(msgspec.json.encode(ended) + b"\n")
        sys.stdout.buffer.flush()


def main() -> int:
    """Run the command behind the moment, or serve `Commands`."""
    if sys.argv[1:] == ["serve"]:
        _serve()
        return 0
    return run(msgspec.json.decode(sys.argv[1], type=Moment), sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
