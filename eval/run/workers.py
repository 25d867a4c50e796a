"""Runs episodes, in this process or in several; the records do not depend on how many.

Each worker process builds its own `Rig` and is given as many episodes at a time as it has lanes. Episodes that may
share completions (all contestants on an instruction with a seed) go to the same worker. One that dies or overruns its
time is replaced: the episode to blame gets a record that says so, and others that it had begun are run again.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.lanes import Lanes, lanes_for
from eval.run.rig import Finished, Rig
from gavel_env.errors import GavelError, WorkerFailed

__all__ = ["groups_of", "run_episodes"]

_STARTS_WITHOUT_AN_EPISODE = 3
"""In a row, after which a run ends."""

_GRACE_S = 2.0
"""A worker ends an overdue episode itself between two actions; one that has not done so by then hangs."""


def run_episodes(
    episodes: Sequence[Episode],
    settings: EnvironmentSettings,
    plugins: Sequence[str] = (),
    workers: int = 1,
    timeout_s: float | None = None,
    connections: int = 1,
    stop: threading.Event | None = None,
    ready: Callable[[], object] | None = None,
) -> Iterator[Finished]:
    """Yield one result per episode, in the order in which they end.

    Args:
        episodes: what to run.
        settings: of the environments.
        plugins: modules whose import registers agents.
        workers: processes; 1 without a timeout runs everything in this process.
        timeout_s: seconds of wall clock per episode; a worker that hangs past it is ended.
        connections: calls of each model under way at once, over all workers.
        stop: once it is set, nothing further is begun.
        ready: called before the first episode is begun; what it raises ends the run.

    Raises:
        GavelError: a contestant cannot be built, or workers cannot start.
    """
    if not episodes:
        return
    stop = stop or threading.Event()
    ready = ready or (lambda: None)
    workers = max(1, min(workers, len(groups_of(episodes))))
    each = max(1, connections // workers)
    if workers == 1 and timeout_s is None:
        yield from _run_here(episodes, Rig(settings, plugins, each), each, stop, ready)
        return
    pool = _Pool(episodes, (settings, tuple(plugins), timeout_s, each), lanes_for(each), stop)
    ready()
    try:
        yield from pool.run(workers)
    finally:
        pool.close()


def groups_of(episodes: Sequence[Episode]) -> list[list[Episode]]:
    """Return episodes by instruction and seed, in order: those that may ask a model the same."""
    groups: dict[tuple[str, str, int], list[Episode]] = {}
    for episode in episodes:
        groups.setdefault((episode.key.data, episode.key.instruction, episode.key.seed), []).append(episode)
    return list(groups.values())


def _run_here(
    episodes: Sequence[Episode],
    rig: Rig,
    connections: int,
    stop: threading.Event,
    ready: Callable[[], object],
) -> Iterator[Finished]:
    rig.check(episodes)
    if connections == 1:
        ready()
        for episode in itertools.takewhile(lambda _: not stop.is_set(), episodes):
            yield rig.run(episode)
        return
    rig.warm(episodes)
    ready()
    lanes = Lanes(rig, min(lanes_for(connections), len(episodes)))
    running = 0
    try:
        for number, episode in itertools.takewhile(lambda _: not stop.is_set(), enumerate(episodes)):
            lanes.put(number, episode)
            running += 1
            if running == lanes.count:
                yield lanes.get()[1]
                running -= 1
        for _ in range(running):
            yield lanes.get()[1]
    finally:
        lanes.close()


_Made = tuple[EnvironmentSettings, tuple[str, ...], float | None, int]
"""What a worker's rig is made of: settings, plugins, seconds per episode, connections."""


class _Running(NamedTuple):
    """An episode that a worker has begun, and when it must have ended."""

    episode: Episode
    deadline_s: float


class _Worker:
    """A process, the pipe to it, and what it is doing."""

    def __init__(self, made: _Made, checked: Sequence[Episode]) -> None:
        context = multiprocessing.get_context("spawn")  # forking after numba or torch have started threads can hang
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, made, tuple(checked)), daemon=True)
        self.process.start()
        theirs.close()
        self.ready = False
        self.alone = False
        self.mine: deque[Episode] = deque()
        self.running: dict[int, _Running] = {}

    def give(self, number: int, episode: Episode, timeout_s: float | None) -> None:
        deadline_s = float("inf") if timeout_s is None else time.monotonic() + timeout_s + _GRACE_S
        self.running[number] = _Running(episode, deadline_s)
        with contextlib.suppress(OSError):  # it has just died; reading from its pipe will say so
            self.pipe.send((number, episode))

    @property
    def deadline_s(self) -> float:
        return min((running.deadline_s for running in self.running.values()), default=float("inf"))

    def end(self) -> None:
        self.pipe.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()


class _Pool:
    def __init__(self, episodes: Sequence[Episode], made: _Made, lanes: int, stop: threading.Event) -> None:
        self._stop = stop
        self._made, self._lanes, self._timeout_s = made, lanes, made[2]
        self._waiting = deque(deque(group) for group in groups_of(episodes))
        self._suspects: deque[Episode] = deque()
        self._checked = _one_per_contestant(episodes)
        self._workers: list[_Worker] = []
        self._failed_starts = 0
        self._given = 0

    def run(self, count: int) -> Iterator[Finished]:
        for _ in range(count):
            self._start()
        while any(worker.running for worker in self._workers) or (self._left and not self._stop.is_set()):
            nearest = min(worker.deadline_s for worker in self._workers)
            limit = None if nearest == float("inf") else max(0.0, nearest - time.monotonic())
            readable = wait([worker.pipe for worker in self._workers], limit)
            for worker in list(self._workers):
                if worker.pipe in readable:
                    yield from self._read(worker)
                elif time.monotonic() >= worker.deadline_s:
                    yield from self._overdue(worker)

    @property
    def _left(self) -> bool:
        return bool(self._waiting or self._suspects or any(worker.mine for worker in self._workers))

    def close(self) -> None:
        for worker in self._workers:
            worker.end()
        self._workers = []

    def _start(self) -> None:
        self._workers.append(_Worker(self._made, self._checked))

    def _replace(self, worker: _Worker) -> None:
        """End a worker; what it was to run goes back to the others."""
        self._workers.remove(worker)
        worker.end()
        if worker.mine:
            self._waiting.appendleft(worker.mine)
        if self._waiting or self._suspects:
            self._start()

    def _feed(self, worker: _Worker) -> None:
        """Give a worker as many episodes as it has lanes; one that may kill it, alone."""
        if self._stop.is_set():
            return
        if self._suspects and not worker.running:
            worker.alone = True
            self._give(worker, self._suspects.popleft())
            return
        if worker.alone and worker.running:
            return
        worker.alone = False
        while len(worker.running) < self._lanes and not self._suspects:
            if not worker.mine:
                if not self._waiting:
                    return
                worker.mine = self._waiting.popleft()
            self._give(worker, worker.mine.popleft())

    def _give(self, worker: _Worker, episode: Episode) -> None:
        self._given += 1
        worker.give(self._given, episode, self._timeout_s)

    def _read(self, worker: _Worker) -> Iterator[Finished]:
        try:
            kind, number, content = worker.pipe.recv()
        except (EOFError, OSError):
            yield from self._died(worker)
            return
        if kind == "refused":
            raise WorkerFailed(content)
        if kind == "ready":
            self._failed_starts = 0
        if kind == "finished":
            del worker.running[number]
            yield content
        worker.ready = True
        self._feed(worker)

    def _overdue(self, worker: _Worker) -> Iterator[Finished]:
        now = time.monotonic()
        late = [running.episode for running in worker.running.values() if now >= running.deadline_s]
        others = [running.episode for running in worker.running.values() if now < running.deadline_s]
        if others:
            self._waiting.appendleft(deque(others))
        worker.running.clear()
        self._replace(worker)
        for episode in late:
            error = f"no answer within {self._timeout_s} s; its process was ended"
            yield Finished(episode.record("timeout", error=error))

    def _died(self, worker: _Worker) -> Iterator[Finished]:
        worker.process.join()
        code = worker.process.exitcode
        reason = f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit status {code}"
        running = [one.episode for one in worker.running.values()]
        if len(running) == 1:
            error = f"the worker process ended with {reason}"
            yield Finished(running[0].record("error", "error:worker_died", error=error))
        elif running:
            self._suspects.extend(running)  # one of them did it; each is run again, alone
        elif not worker.ready:
            self._failed_starts += 1
            if self._failed_starts >= _STARTS_WITHOUT_AN_EPISODE:
                raise WorkerFailed(f"worker processes end before their first episode, with {reason}")
        worker.running.clear()
        self._replace(worker)


def _one_per_contestant(episodes: Sequence[Episode]) -> list[Episode]:
    """Return the first readable episode of every contestant and kind: enough to see whether agents can be built."""
    first: dict[tuple[str, str], Episode] = {}
    for episode in episodes:
        if episode.instruction is not None:
            first.setdefault((episode.contestant.config, episode.kind), episode)
    return list(first.values())


def _serve(pipe: Connection[Any, Any], made: _Made, checked: tuple[Episode, ...]) -> None:
    """Answer episodes with what they came to until the pipe closes; the body of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    settings, plugins, timeout_s, connections = made
    try:
        rig = Rig(settings, plugins, connections)
        rig.check(checked)
    except GavelError as error:
        pipe.send(("refused", 0, str(error)))
        return
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        if connections == 1:
            pipe.send(("ready", 0, None))
            while True:
                number, episode = pipe.recv()
                pipe.send(("finished", number, rig.run(episode, timeout_s)))
        rig.warm(checked)
        lanes = Lanes(rig, lanes_for(connections), timeout_s)
        threading.Thread(target=_take, args=(pipe, lanes), daemon=True).start()
        pipe.send(("ready", 0, None))
        while True:
            pipe.send(("finished", *lanes.get()))


def _take(pipe: Connection[Any, Any], lanes: Lanes) -> None:
    """Pass on the episodes that come, until the pipe closes."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            lanes.put(*pipe.recv())
