"""On a Ray cluster: the same table as here, whatever becomes of its nodes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.ray_nodes import Nodes, ray_nodes
from support.timeless import timeless, timeless_csv

from eval.cli import main
from eval.records.journal import RecordFile, read_records
from eval.records.schema import EpisodeKey, EpisodeRecord
from eval.report.formats import to_csv
from eval.report.tables import results
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import import_plugins
from eval.run.runner import Schedule, run, schedule
from gavel_env.instructions.record import read_instructions, shipped

ROOT = Path(__file__).parents[2]
SETTINGS = EnvironmentSettings(max_steps=60)
PLUGIN = "tests.support.eval_agents"


def planned(agents: list[str], sampled: int) -> Schedule:
    import_plugins([PLUGIN])  # registers agents

    contestants = choose(agents, SETTINGS, planners=["simulated:qwen3-8b"])
    file = read_instructions(shipped("single"))
    return schedule(contestants, [file], sampled=sampled, settings=SETTINGS, plugins=[PLUGIN])


def compared(file: RecordFile) -> dict[EpisodeKey, EpisodeRecord]:
    return {key: timeless(record) for key, record in file.records.items()}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::ResourceWarning", "ignore::DeprecationWarning")
class TestRay:
    """Ray of two nodes in this machine, started by the test."""

    @pytest.fixture
    def cluster(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[Nodes]:
        pytest.importorskip("ray")
        monkeypatch.setenv("PYTHONPATH", str(ROOT))
        monkeypatch.chdir(ROOT)
        with ray_nodes() as nodes:
            yield nodes

    def test_the_table_is_that_of_one_process_though_a_node_dies(self, cluster: Nodes, tmp_path: Path) -> None:
        plan = planned(["slow", "lazy", "gavel-full"], 10)
        here = run(plan, tmp_path / "here")
        node = cluster.add()
        cluster.wait(2)
        ended: list[str] = []
        killed: list[bool] = []

        def report(record: Any) -> None:
            ended.append(record.instruction)
            if len(ended) >= 6 and not killed:
                killed.append(True)
                cluster.kill(node)

        there = run(plan, tmp_path / "there", executor="ray", address=cluster.address, connections=2, report=report)
        assert killed
        first, second = read_records([here]), read_records([there])
        assert compared(first) == compared(second)
        assert timeless_csv(to_csv(results(first))) == timeless_csv(to_csv(results(second)))

    def test_an_agent_that_kills_its_worker_is_counted_and_a_run_resumes(self, cluster: Nodes, tmp_path: Path) -> None:
        plan = planned(["killed", "teacher"], 4)
        path = run(plan, tmp_path, executor="ray", address=cluster.address)
        failures = sorted(r.failure or "success" for r in read_records([path]).records.values())
        odd = sum(len(i.text) % 2 for i in plan.instructions.values())
        assert failures == ["error:worker_died"] * odd + ["success"] * (8 - odd)
        ran: list[Any] = []
        run(plan, tmp_path, existing="resume", executor="ray", address=cluster.address, report=ran.append)
        assert ran == []


def test_ray_is_asked_for_where_it_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    command = ["eval", "--agents", "epog", "--sample", "1", "--executor", "ray", "--quiet"]
    assert main([*command, "--out", str(tmp_path)]) == 2
    assert "gavel-env[ray]" in capsys.readouterr().err
    assert not (tmp_path / "records.jsonl").exists()


def test_shards_are_put_together_to_the_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["eval", "--agents", "epog,gavel-full,oracle", "--planner", "simulated:qwen3-8b", "--kind", "single"]
    options = ["--sample", "7", "--format", "csv", "--quiet"]
    assert main([*command, *options, "--out", str(tmp_path / "whole")]) == 0
    whole = capsys.readouterr().out
    parts = [tmp_path / f"part{k}" for k in (1, 2, 3)]
    for k, part in enumerate(parts, start=1):
        assert main([*command, *options, "--out", str(part), "--shard", f"{k}/3"]) == 0
    records = [read_records([part]).records for part in parts]
    assert [len(found) for found in records] == [9, 6, 6]
    assert sum(map(len, records)) == len({key for found in records for key in found})
    for found in records:
        assert all(sum(k.instruction == key.instruction for k in found) == 3 for key in found)
    capsys.readouterr()
    assert main(["tables", *map(str, parts), "--format", "csv"]) == 0
    assert timeless_csv(capsys.readouterr().out) == timeless_csv(whole)
    with pytest.raises(SystemExit):
        main([*command, "--out", str(tmp_path / "x"), "--shard", "4/3"])
