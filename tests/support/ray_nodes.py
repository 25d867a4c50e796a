"""Nodes of Ray in this machine, for tests that start and kill them."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

__all__ = ["RAY_WARNS", "Nodes", "ray_nodes"]

ROOT = Path(__file__).parents[2]

RAY_WARNS = pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning", "ignore::DeprecationWarning")
"""A mark for tests that import Ray."""


class Nodes:
    """Ray nodes in this machine; each in a session of its own, so that it can be killed as a machine would be."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.address = f"127.0.0.1:{port}"
        self._folder, self._started = folder, list[subprocess.Popen[bytes]]()
        self.add("--head", f"--port={port}", "--include-dashboard=false", f"--temp-dir={folder}")

    def add(self, *options: str) -> subprocess.Popen[bytes]:
        ray = Path(sys.executable).with_name("ray")
        where = options or (f"--address={self.address}",)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "GAVEL_TEST_SLEEP": "0.5", "RAY_USAGE_STATS_ENABLED": "0"}
        node = subprocess.Popen(
            [str(ray), "start", "--block", "--num-cpus=1", "--disable-usage-stats", *where],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._started.append(node)
        return node

    def wait(self, cores: float) -> None:
        """Wait until the cluster has so many cores."""
        import ray

        while all(node.poll() is None for node in self._started):
            try:
                ray.init(address=self.address, log_to_driver=False, logging_level="error")
                if ray.cluster_resources().get("CPU", 0) >= cores:
                    return
            except (ConnectionError, RuntimeError, ValueError):
                pass
            finally:
                ray.shutdown()
            time.sleep(0.5)
        raise RuntimeError(f"a Ray node ended before there were {cores:g} cores")

    @staticmethod
    def kill(node: subprocess.Popen[bytes]) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(node.pid, signal.SIGKILL)
        node.wait()

    def end(self) -> None:
        for node in reversed(self._started):
            self.kill(node)

    def workers(self) -> list[int]:
        """Return the processes on these nodes that run a task or wait for one."""
        groups = {node.pid for node in self._started}
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if (process / "cmdline").read_bytes().startswith((b"ray::_run_group", b"ray::IDLE")):
                    parent = int((process / "stat").read_text().rpartition(")")[2].split()[1])
                    found += [int(process.name)] if os.getpgid(parent) in groups else []
        return sorted(found)


@contextlib.contextmanager
def ray_nodes() -> Iterator[Nodes]:
    """Start a cluster of one node with one core, and end it with all that were added."""
    with tempfile.TemporaryDirectory(prefix="ray") as folder:  # sockets need short paths
        nodes = Nodes(Path(folder))
        try:
            nodes.wait(1)
            yield nodes
        finally:
            nodes.end()
