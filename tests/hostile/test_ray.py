"""What goes wrong on a Ray cluster, in its driver, its workers and what they are given, is counted or said."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.hostile import times
from support.ray_nodes import RAY_WARNS, Nodes, ray_nodes
from support.timeless import timeless

from eval.records.journal import read_records
from eval.records.schema import EpisodeKey, EpisodeRecord
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import import_plugins
from eval.run.runner import Schedule, run, schedule
from gavel_env.errors import WorkerFailed
from gavel_env.instructions.record import read_instructions, shipped

pytestmark = [
    pytest.mark.hostile,
    pytest.mark.slow,
    RAY_WARNS,
]

ROOT = Path(__file__).parents[2]
PLUGIN = "tests.support.eval_agents"
SETTINGS = EnvironmentSettings(max_steps=60)


def planned(*agents: str, sampled: int = 4, plugins: tuple[str, ...] = (PLUGIN,)) -> Schedule:
    import_plugins([PLUGIN])
    contestants = choose(agents, SETTINGS, planners=["simulated:qwen3-8b"])
    file = read_instructions(shipped("single"))
    return schedule(contestants, [file], sampled=sampled, settings=SETTINGS, plugins=plugins)


def found(out: Path) -> dict[EpisodeKey, EpisodeRecord]:
    return {key: timeless(record) for key, record in read_records([out]).records.items()}


def test_killed_workers_change_no_record(cluster: Nodes, tmp_path: Path) -> None:
    """Ray runs their tasks again; the driver counts those alone whose worker ends each time."""
    plan = planned("slow", "lazy", "gavel-full", sampled=10)
    run(plan, tmp_path / "here")
    expected = found(tmp_path / "here")
    drawn = random.Random(7)
    kills = 0

    def kill(_: EpisodeRecord) -> None:
        nonlocal kills
        workers = cluster.workers()
        if workers and drawn.random() < 0.3:
            os.kill(drawn.choice(workers), signal.SIGKILL)
            kills += 1

    for series in range(times(1, 3)):
        out = tmp_path / str(series)
        run(plan, out, executor="ray", address=cluster.address, report=kill)
        after = found(out)
        died = {key for key, record in after.items() if record.failure == "error:worker_died"}
        assert {key: after.get(key) for key in expected.keys() - died} == {
            key: record for key, record in expected.items() if key not in died
        }
        run(plan, out, existing="resume", retry=("error",), executor="ray", address=cluster.address)
        assert found(out) == expected
    assert kills >= times(1, 3)


def test_an_agent_that_ends_its_worker_without_a_word_is_counted(cluster: Nodes, tmp_path: Path) -> None:
    plan = planned("vanishing", "teacher")
    run(plan, tmp_path, executor="ray", address=cluster.address)
    failures = sorted(record.failure or "success" for record in found(tmp_path).values())
    odd = sum(len(i.text) % 2 for i in plan.instructions.values())
    assert odd
    assert failures == ["error:worker_died"] * odd + ["success"] * (8 - odd)


@pytest.mark.parametrize("what", ["raise ValueError('not here')", "raise SystemExit(0)"])
def test_a_plug_in_that_raises_in_workers_alone_is_said(cluster: Nodes, tmp_path: Path, what: str) -> None:
    name = f"raising_elsewhere_{len(what)}"
    module = ROOT / "tests" / f"{name}.py"
    module.write_text(f"import os\nif os.getpid() != {os.getpid()}:\n    {what}\n")
    try:
        plan = planned("lazy", plugins=(PLUGIN, f"tests.{name}"))
        with pytest.raises(WorkerFailed, match=f"plugin 'tests.{name}' cannot be imported"):
            run(plan, tmp_path, executor="ray", address=cluster.address)
    finally:
        module.unlink()
    assert not (tmp_path / "records.jsonl").exists()


def test_a_cluster_that_is_not_there_is_said(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    with pytest.raises(WorkerFailed, match="cannot be reached"):
        run(planned("lazy"), tmp_path, executor="ray", address="127.0.0.1:1")
    assert not (tmp_path / "records.jsonl").exists()


def test_a_killed_driver_and_a_killed_cluster_leave_a_run_that_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    agents = ["--plugin", PLUGIN, "--agents", "slow,lazy,gavel-full", "--planner", "simulated:qwen3-8b"]
    command = ["eval", *agents, "--kind", "single", "--sample", "6", "--max-steps", "60", "--quiet", "--out"]
    import_plugins([PLUGIN])

    def start(out: Path, *more: str, moment: str = '{"at": "event", "number": 0}') -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "tests.support.killed", moment, *command, str(out), *more],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    whole = start(tmp_path / "whole")
    assert whole.wait() == 0, whole.communicate()
    expected = found(tmp_path / "whole")
    out = tmp_path / "out"
    with ray_nodes() as nodes:
        on_ray = ["--executor", "ray", "--address", nodes.address, "--resume"]
        driver = start(out, *on_ray, moment='{"at": "write", "number": 8, "part": 0.5}')
        assert driver.wait() == -signal.SIGKILL, driver.communicate()
        before = found(out)
        assert 0 < len(before) < len(expected)
        driver = start(out, *on_ray)
        while driver.poll() is None and len(found(out)) == len(before):
            pass
        nodes.end()
        said = driver.communicate()[1]
        assert driver.returncode != 0
        assert "Traceback" not in said
    after = found(out)
    assert {key: after.get(key) for key in before} == before
    last = start(out, "--resume")
    assert last.wait() == 0, last.communicate()
    assert found(out) == expected
