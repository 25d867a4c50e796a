"""Kernels: compiled once per machine, also where nothing can be written; the bucket queue against a heap."""

from __future__ import annotations

import heapq
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gavel_env.house.kernels.routes import distance_field
from gavel_env.house.kernels.sight import frontier_cells

# numba then finds no place for its cache beside the package or in a home: a read-only installation without a home.
NOWHERE = """
import tempfile, warnings
import numpy as np
{prepare}
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    from gavel_env.house.kernels import drawing, routes, sight
    assert routes.components(np.ones((2, 2), np.bool_)).max() == 0
    assert sight.seen_near is not None
print([str(w.message) for w in caught if w.category is RuntimeWarning])
"""


def run(program: str, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    inherited["NUMBA_CACHE_LOCATOR_CLASSES"] = "UserProvidedCacheLocator"
    return subprocess.run(
        [sys.executable, "-c", program], env=inherited | environment, capture_output=True, text=True, check=False
    )


def test_a_read_only_installation_caches_in_the_temporary_folder(tmp_path: Path) -> None:
    for said in (1, 0):  # the second process finds what the first has compiled
        done = run(NOWHERE.format(prepare=""), TMPDIR=str(tmp_path))
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == "[]"
        assert done.stderr.count("compiling kernels") == said
    assert list(tmp_path.glob("gavel-kernels-*/**/*.nbi"))


def test_without_any_folder_there_is_one_warning_and_no_cache() -> None:
    done = run(NOWHERE.format(prepare="tempfile.gettempdir = lambda: '/proc/nowhere'"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("NUMBA_CACHE_DIR") == 1
    assert "compiling kernels" in done.stderr


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owners here")
def test_a_folder_that_is_not_ones_own_is_not_used(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / f"gavel-kernels-{os.getuid()}").symlink_to(elsewhere)
    done = run(NOWHERE.format(prepare=""), TMPDIR=str(tmp_path))
    assert done.stdout.count("NUMBA_CACHE_DIR") == 1
    assert not list(elsewhere.iterdir())


@pytest.mark.parametrize("seed", range(5))
def test_distances_are_those_of_a_heap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free = rng.random((25, 40)) < 0.75
    sources = np.flatnonzero(free)[:: 200 * (seed + 1)].astype(np.int32)
    assert (distance_field(free, sources) == by_heap(free, sources)).all()


def by_heap(free: np.ndarray, sources: np.ndarray) -> np.ndarray:
    height, width = free.shape
    cost = np.full(free.shape, np.inf)
    queue = [(0.0, divmod(int(s), width)) for s in sources]
    for _, cell in queue:
        cost[cell] = 0.0
    while queue:
        key, (row, column) = heapq.heappop(queue)
        if key > cost[row, column]:
            continue
        for dr, dc in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
            r, c = row + dr, column + dc
            if not (0 <= r < height and 0 <= c < width and free[r, c] and free[row, c] and free[r, column]):
                continue
            reached = key + (2.0**0.5 if dr and dc else 1.0)
            if reached < cost[r, c]:
                cost[r, c] = reached
                heapq.heappush(queue, (reached, (r, c)))
    return cost


def test_the_frontier_kept_up_to_date_is_the_frontier() -> None:
    rng = np.random.default_rng(0)
    opaque = rng.random((20, 30)) < 0.1
    rooms = np.tile(np.repeat(np.array([0, 1], np.int16), 15), (20, 1))
    seen, touched = np.zeros_like(opaque), np.zeros_like(opaque)
    frontier = np.empty(0, np.int32)
    for _ in range(15):
        fresh = np.flatnonzero(~opaque & ~seen & (rng.random(opaque.shape) < 0.1)).astype(np.int32)
        seen.ravel()[fresh] = True
        frontier = np.sort(frontier_cells(frontier, fresh, seen, opaque, rooms, 1, touched))
        padded = np.pad(seen, 1)
        beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
        assert frontier.tolist() == np.flatnonzero(beside & ~seen & ~opaque & (rooms == 1)).tolist()
        assert not touched.any()
