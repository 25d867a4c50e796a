"""Runs episodes, in this process or in several; the records do not depend on how many.

Each worker process builds its own `Rig` and is given one episode at a time. A worker that dies or overruns its time is
replaced, and its episode gets a record that says so.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from eval.records.schema import EpisodeRecord
from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.rig import Rig
from gavel_env.errors import GavelError, WorkerFailed

__all__ = ["WorkerFailed", "run_episodes"]

_STARTS_WITHOUT_AN_EPISODE = 3
_GRACE_S = 2.0
"""A worker ends an overdue episode itself between two actions; one that has not done so by then hangs."""


def run_episodes(
    episodes: Sequence[Episode],
    settings: EnvironmentSettings,
    plugins: Sequence[str] = (),
    workers: int = 1,
    timeout_s: float | None = None,
) -> Iterator[EpisodeRecord]:
    """Yield one record per episode, in the order in which they end.

    Args:
        episodes: what to run.
        settings: of the environments.
        plugins: modules whose import registers agents.
        workers: processes; 1 without a timeout runs everything in this process.
        timeout_s: seconds of wall clock per episode; a worker that hangs past it is ended.

    Raises:
        GavelError: a contestant cannot be built, or workers cannot start.
    """
    if not episodes:
        return
    if workers <= 1 and timeout_s is None:
        rig = Rig(settings, plugins)
        rig.check(episodes)
        for episode in episodes:
            yield rig.run(episode)
        return
    pool = _Pool(episodes, settings, tuple(plugins), timeout_s)
    try:
        yield from pool.run(max(1, min(workers, len(episodes))))
    finally:
        pool.close()


class _Worker:
    """A process, the pipe to it, and what it is doing."""

    def __init__(
        self,
        settings: EnvironmentSettings,
        plugins: tuple[str, ...],
        timeout_s: float | None,
        checked: Sequence[Episode],
    ) -> None:
        context = multiprocessing.get_context("spawn")  # forking after numba or torch have started threads can hang
        self.pipe, theirs = context.Pipe()
        arguments = (theirs, settings, plugins, timeout_s, tuple(checked))
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        self.process.start()
        theirs.close()
        self.ready = False
        self.episode: Episode | None = None
        self.deadline_s = float("inf")

    def give(self, episode: Episode, timeout_s: float | None) -> None:
        self.episode = episode
        self.deadline_s = float("inf") if timeout_s is None else time.monotonic() + timeout_s + _GRACE_S
        with contextlib.suppress(OSError):  # it has just died; reading from its pipe will say so
            self.pipe.send(episode)

    def end(self) -> None:
        self.pipe.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()


class _Pool:
    def __init__(
        self,
        episodes: Sequence[Episode],
        settings: EnvironmentSettings,
        plugins: tuple[str, ...],
        timeout_s: float | None,
    ) -> None:
        self._settings, self._plugins, self._timeout_s = settings, plugins, timeout_s
        self._waiting = deque(episodes)
        self._checked = _one_per_contestant(episodes)
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def run(self, count: int) -> Iterator[EpisodeRecord]:
        for _ in range(count):
            self._start()
        while self._waiting or any(worker.episode for worker in self._workers):
            nearest = min(worker.deadline_s for worker in self._workers)
            limit = None if nearest == float("inf") else max(0.0, nearest - time.monotonic())
            readable = wait([worker.pipe for worker in self._workers], limit)
            for worker in list(self._workers):
                if worker.pipe in readable:
                    yield from self._read(worker)
                elif worker.episode is not None and time.monotonic() >= worker.deadline_s:
                    episode = worker.episode
                    self._replace(worker)
                    yield episode.record(
                        "timeout", error=f"no answer within {self._timeout_s} s; its process was ended"
                    )

    def close(self) -> None:
        for worker in self._workers:
            worker.end()
        self._workers = []

    def _start(self) -> None:
        self._workers.append(_Worker(self._settings, self._plugins, self._timeout_s, self._checked))

    def _replace(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end()
        if self._waiting:
            self._start()

    def _read(self, worker: _Worker) -> Iterator[EpisodeRecord]:
        try:
            kind, content = worker.pipe.recv()
        except (EOFError, OSError):
            yield from self._died(worker)
            return
        if kind == "refused":
            raise WorkerFailed(content)
        if kind == "record":
            yield content
            worker.episode = None
        worker.ready = True
        worker.deadline_s = float("inf")
        if self._waiting:
            worker.give(self._waiting.popleft(), self._timeout_s)

    def _died(self, worker: _Worker) -> Iterator[EpisodeRecord]:
        worker.process.join()
        code = worker.process.exitcode
        reason = f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit status {code}"
        if worker.episode is not None:
            yield worker.episode.record("error", "error:worker_died", error=f"the worker process ended with {reason}")
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts >= _STARTS_WITHOUT_AN_EPISODE:
                raise WorkerFailed(f"worker processes end before their first episode, with {reason}")
        self._replace(worker)


def _one_per_contestant(episodes: Sequence[Episode]) -> list[Episode]:
    """Return the first readable episode of every contestant: enough to see whether its agent can be built."""
    first: dict[str, Episode] = {}
    for episode in episodes:
        if episode.instruction is not None:
            first.setdefault(episode.contestant.config, episode)
    return list(first.values())


def _serve(
    pipe: Connection[Any, Any],
    settings: EnvironmentSettings,
    plugins: tuple[str, ...],
    timeout_s: float | None,
    checked: tuple[Episode, ...],
) -> None:
    """Answer episodes with records until the pipe closes; the body of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    try:
        rig = Rig(settings, plugins)
        rig.check(checked)
    except GavelError as error:
        pipe.send(("refused", str(error)))
        return
    try:
        pipe.send(("ready", None))
        while True:
            pipe.send(("record", rig.run(pipe.recv(), timeout_s)))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
