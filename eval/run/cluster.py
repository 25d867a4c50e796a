"""Runs episodes on a Ray cluster (extra `ray`); this process alone writes records.

A task is a group of episodes: all contestants on an instruction with a seed, so that they share completions. Ray runs
the task of a lost worker or node again. A group that keeps killing its workers is split, so that the episode to blame
gets the record that says so.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.rig import Finished, Rig
from eval.run.workers import groups_of
from gavel_env.errors import GavelError, NotInstalled, WorkerFailed

__all__ = ["run_on_ray"]

_RETRIES = 2
"""Of a group whose worker is lost; an episode that is run by itself for that reason has one."""

_START_S = 60.0
"""For a worker to start and import everything."""

_KNOCK_S = 10.0
"""For a cluster to take up a connection."""

_RIGS: dict[bytes, Rig] = {}


def run_on_ray(
    episodes: Sequence[Episode],
    settings: EnvironmentSettings,
    plugins: Sequence[str],
    address: str | None,
    timeout_s: float | None,
    connections: int,
    stop: threading.Event,
) -> Iterator[Finished]:
    """Yield one result per episode, in the order in which they end.

    Args:
        episodes: what to run.
        settings: of the environments.
        plugins: modules whose import registers agents; every node must find them.
        address: of the cluster; None = the one of RAY_ADDRESS, else a local one for this run.
        timeout_s: seconds of wall clock per episode.
        connections: calls of each model under way at once, over the cluster: where they are more than its cores, tasks
            share cores.
        stop: once it is set, nothing further is begun.

    Raises:
        WorkerFailed: the cluster cannot be reached or fails, or an agent cannot be built there.
        NotInstalled: Ray is missing.
    """
    if not episodes:
        return
    ray = _ray()
    ours = not ray.is_initialized()
    if ours:
        _join(ray, address, plugins)
    try:
        yield from _Tasks(ray, episodes, settings, tuple(plugins), timeout_s, connections, stop).run()
    except (ray.exceptions.RayError, ConnectionError) as error:
        raise WorkerFailed(f"the Ray cluster failed: {error}") from error
    finally:
        if ours:
            ray.shutdown()


def _ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise NotInstalled("--executor ray needs the package ray: pip install 'gavel-env[ray]'") from error
    return ray


def _join(ray: Any, address: str | None, plugins: Sequence[str]) -> None:
    paths = [os.getcwd(), os.environ.get("PYTHONPATH", "")] if plugins else [os.environ.get("PYTHONPATH", "")]
    path = os.pathsep.join(filter(None, paths))
    environment = {"env_vars": {"PYTHONPATH": path}} if path else {}
    address = address or os.environ.get("RAY_ADDRESS")
    try:
        _knock(address or "")
        ray.init(
            address=address,
            runtime_env=environment,
            log_to_driver=False,
            include_dashboard=False,
            logging_level="error",
        )
    except (OSError, OverflowError, ValueError, RuntimeError) as error:
        raise WorkerFailed(f"the Ray cluster {address or ''} cannot be reached: {error}") from error


def _knock(address: str) -> None:
    """Try out whether anything answers at HOST:PORT; Ray itself would try for more than a minute.

    Raises:
        OSError: nothing does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host.strip("[]"), int(port)), _KNOCK_S).close()


class _Tasks:
    """Groups of episodes as tasks, no more of them under way than the cluster runs at once."""

    def __init__(
        self,
        ray: Any,
        episodes: Sequence[Episode],
        settings: EnvironmentSettings,
        plugins: tuple[str, ...],
        timeout_s: float | None,
        connections: int,
        stop: threading.Event,
    ) -> None:
        self._ray, self._stop, self._timeout_s = ray, stop, timeout_s
        self._connections = connections
        self._waiting = deque((group, _RETRIES) for group in groups_of(episodes))
        self._running: dict[Any, tuple[list[Episode], float]] = {}
        self._made = (settings, plugins, timeout_s)
        cores = float(ray.cluster_resources().get("CPU", 1.0))
        self._share = max(0.01, min(1.0, cores / max(1, connections)))
        local = any(episode.contestant.planner_kind == "hf" for episode in episodes)
        gpus = 1 if local and ray.cluster_resources().get("GPU") else 0
        self._task = ray.remote(num_cpus=self._share, num_gpus=gpus)(_run_group)

    def run(self) -> Iterator[Finished]:
        while self._running or (self._waiting and not self._stop.is_set()):
            self._begin()
            ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=1.0)
            for task in ready:
                yield from self._ended(task)
            yield from self._overdue()

    def _begin(self) -> None:
        most = max(1, round(float(self._ray.cluster_resources().get("CPU", 1.0)) / self._share))
        while self._waiting and len(self._running) < most and not self._stop.is_set():
            group, retries = self._waiting.popleft()
            limit_s = float("inf") if self._timeout_s is None else _START_S + self._timeout_s * (len(group) + 1)
            task = self._task.options(max_retries=retries).remote(group, *self._made)
            self._running[task] = (group, time.monotonic() + limit_s)

    def _ended(self, task: Any) -> Iterator[Finished]:
        group, _ = self._running.pop(task)
        exceptions = self._ray.exceptions
        try:
            yield from self._ray.get(task)
        except (exceptions.WorkerCrashedError, exceptions.NodeDiedError, exceptions.OutOfMemoryError) as error:
            yield from self._lost(group, "error", "error:worker_died", f"its worker ended each time: {error}")
        except exceptions.RayTaskError as error:
            cause = error.cause if isinstance(error.cause, GavelError) else error
            raise WorkerFailed(f"a task failed on the cluster: {cause}") from None

    def _overdue(self) -> Iterator[Finished]:
        now = time.monotonic()
        for task in [task for task, (_, deadline_s) in self._running.items() if now >= deadline_s]:
            group, _ = self._running.pop(task)
            self._ray.cancel(task, force=True)
            yield from self._lost(group, "timeout", "", f"no answer within {self._timeout_s} s; its worker was ended")

    def _lost(self, group: list[Episode], outcome: str, failure: str, why: str) -> Iterator[Finished]:
        """Record the one episode to blame; of several, run each by itself."""
        if len(group) == 1:
            yield Finished(group[0].record(outcome, failure, error=why))
        else:
            self._waiting.extendleft(([episode], 1) for episode in reversed(group))


def _run_group(
    group: list[Episode], settings: EnvironmentSettings, plugins: tuple[str, ...], timeout_s: float | None
) -> list[Finished]:
    """Run the episodes of a group; the body of a task. A worker process keeps its rig for the next one."""
    key = msgspec.json.encode([settings, plugins])
    if key not in _RIGS:
        _RIGS[key] = Rig(settings, plugins)
    rig = _RIGS[key]
    rig.check(group)
    return [rig.run(episode, timeout_s) for episode in group]
