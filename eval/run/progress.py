"""Progress of a run on stderr: a bar on a terminal, a plain line every few seconds elsewhere."""

from __future__ import annotations

import sys
import time
from collections import Counter
from types import TracebackType
from typing import TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from eval.records.schema import EpisodeRecord

__all__ = ["RunProgress"]

_SECONDS_BETWEEN_LINES = 5.0


class RunProgress:
    """Shows how far a run is; `started` and `advance` fit `eval.run.runner.run`."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._outcomes: Counter[str] = Counter()
        self._scheduled = 0
        self._before = 0
        self._last_line_s = 0.0
        self._begun_s = time.monotonic()
        self._bar: Progress | None = None
        self._task = TaskID(0)
        if self._stream.isatty():
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=Console(file=self._stream),
                transient=True,
            )

    def started(self, scheduled: int, done: int) -> None:
        """Say how many episodes there are, and how many had a record before."""
        self._scheduled, self._before = scheduled, done
        if done:
            self._say(f"{done} of {scheduled} episodes have records already")
        if self._bar is not None:
            self._task = self._bar.add_task("episodes", total=scheduled, completed=done)
            self._bar.start()

    def count(self, record: EpisodeRecord) -> None:
        """Count one new record, and show nothing."""
        self._outcomes[record.outcome] += 1

    @property
    def all_failed(self) -> bool:
        """Whether there are new records, and each of them is of an error."""
        return 0 < self._outcomes.total() == self._outcomes["error"]

    def advance(self, record: EpisodeRecord) -> None:
        """Count one new record and show how far the run is."""
        self.count(record)
        if self._bar is not None:
            self._bar.update(self._task, advance=1, description=self._summary())
            return
        done = self._before + self._outcomes.total()
        now = time.monotonic()
        if now - self._last_line_s >= _SECONDS_BETWEEN_LINES or done == self._scheduled:
            self._last_line_s = now
            self._say(f"{done}/{self._scheduled} episodes, {self._summary()}, {now - self._begun_s:.0f} s")

    def _summary(self) -> str:
        solved = self._outcomes["success"]
        errors = self._outcomes["error"] + self._outcomes["timeout"]
        return f"{solved} solved" + (f", {errors} errors" if errors else "")

    def _say(self, text: str) -> None:
        print(f"gavel eval: {text}", file=self._stream, flush=True)

    def __enter__(self) -> RunProgress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
