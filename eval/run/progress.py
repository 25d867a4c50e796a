"""Progress on stderr: a bar on a terminal, a plain line every few seconds elsewhere."""

from __future__ import annotations

import sys
import time
from collections import Counter
from types import TracebackType
from typing import Self, TextIO

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

__all__ = ["RunProgress", "StepProgress"]

_SECONDS_BETWEEN_LINES = 5.0


class StepProgress:
    """Shows how many of a known number of steps are done."""

    def __init__(self, command: str, unit: str, *, quiet: bool = False, stream: TextIO | None = None) -> None:
        """Prepare; nothing is shown before `begin`.

        Args:
            command: what lines begin with.
            unit: what is counted, in the plural.
            quiet: show nothing at all.
            stream: default stderr.
        """
        self._command, self._unit, self._quiet = command, unit, quiet
        self._stream = stream or sys.stderr
        self._total = self._done = 0
        self._last_line_s = 0.0
        self._begun_s = time.monotonic()
        self._bar: Progress | None = None
        self._task = TaskID(0)
        if self._stream.isatty() and not quiet:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=Console(file=self._stream),
                transient=True,
            )

    def begin(self, total: int, done: int = 0) -> None:
        """Say how many steps there are, and how many of them were done before."""
        self._total, self._done = total, done
        if self._bar is not None:
            self._task = self._bar.add_task(self._unit, total=total, completed=done)
            self._bar.start()

    def step(self, summary: str = "") -> None:
        """Count one step."""
        self._done += 1
        if self._bar is not None:
            self._bar.update(self._task, advance=1, description=summary or self._unit)
            return
        now = time.monotonic()
        if now - self._last_line_s >= _SECONDS_BETWEEN_LINES or self._done == self._total:
            self._last_line_s = now
            parts = (f"{self._done}/{self._total} {self._unit}", summary, f"{now - self._begun_s:.0f} s")
            self.say(", ".join(filter(None, parts)))

    def say(self, text: str) -> None:
        """Show a line of its own."""
        if not self._quiet:
            print(f"{self._command}: {text}", file=self._stream, flush=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


class RunProgress(StepProgress):
    """Shows how far a run is; `started` and `advance` fit `eval.run.runner.run`."""

    def __init__(self, stream: TextIO | None = None) -> None:
        super().__init__("gavel eval", "episodes", stream=stream)
        self._outcomes: Counter[str] = Counter()

    def started(self, scheduled: int, done: int) -> None:
        """Say how many episodes there are, and how many had a record before."""
        if done:
            self.say(f"{done} of {scheduled} episodes have records already")
        self.begin(scheduled, done)

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
        solved = self._outcomes["success"]
        errors = self._outcomes["error"] + self._outcomes["timeout"]
        self.step(f"{solved} solved" + (f", {errors} errors" if errors else ""))
