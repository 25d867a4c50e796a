"""Runs as data sets: good plans, preference pairs and trajectories, in the shape that trainers read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from eval.cli import main
from eval.records.journal import read_records
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.proposing.prompts import SYSTEM


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run")
    command = ["eval", "--planner", "simulated:qwen3-4b", "--agents", "llm-only,sayplan,gavel-full,oracle"]
    assert main([*command, "--kind", "single", "--sample", "6", "--seeds", "0,1", "--out", str(out), "--quiet"]) == 0
    return out


def exported(what: str, ran: Path, out: Path, *options: str) -> list[dict[str, Any]]:
    assert main(["export", what, str(ran), "--out", str(out), *options]) == 0
    return [json.loads(line) for line in (out / "train.jsonl").read_text().splitlines()]


def test_tuning_pairs_are_prompts_with_plans_that_succeeded(ran: Path, tmp_path: Path) -> None:
    rows = exported("sft", ran, tmp_path / "sft")
    assert {row["instruction_id"] for row in rows} == {
        r.instruction for r in read_records([ran]).records.values() if r.success and r.contestant.planner
    }
    for row in rows:
        assert row["prompt"][0] == {"role": "system", "content": SYSTEM}
        assert row["prompt"][-1]["role"] == "user"
        [turn] = row["completion"]
        assert turn["role"] == "assistant"
        assert parse_plans(turn["content"], None, 1).plans[0]
    assert len({json.dumps([row["prompt"], row["completion"]]) for row in rows}) == len(rows)


def test_preference_pairs_set_a_refused_plan_beside_its_repair(ran: Path, tmp_path: Path) -> None:
    rows = exported("dpo", ran, tmp_path / "dpo")
    assert {row["chosen_by"] for row in rows} == {"repair", "later attempt"}
    for row in rows:
        assert row["chosen"] != row["rejected"]
        assert row["refused_because"]
        assert row["prompt"][-1]["role"] == "user"
    by_repair = [row for row in rows if row["chosen_by"] == "repair"]
    assert all(row["edits"] and row["agent"] == "gavel-full" for row in by_repair)
    records = {
        (r.instruction, r.seed): r for r in read_records([ran]).records.values() if r.contestant.agent == "gavel-full"
    }
    for row in by_repair:
        [task] = records[row["instruction_id"], row["seed"]].trace.tasks
        assert len(row["chosen"][0]["content"].splitlines()) == 1 + len(task.plan)


def test_trajectories_show_what_was_seen_done_and_said(ran: Path, tmp_path: Path) -> None:
    rows = exported("trajectories", ran, tmp_path / "trajectories")
    records = {(r.contestant.agent, r.instruction, r.seed): r for r in read_records([ran]).records.values() if r.steps}
    assert len(rows) == len(records)
    for row in rows:
        record = records[row["agent"], row["instruction_id"], row["seed"]]
        steps = row["steps"]
        assert [step["action"] for step in steps] == [step.action for step in record.steps]
        assert [step["verdict"] for step in steps] == [step.outcome for step in record.steps]
        assert len({step["observation"] for step in steps}) > 1 or len(steps) == 1
        assert row["success"] == (row["outcome"] == "success") == record.success
    failed = [row for row in rows if row["outcome"] == "violation"]
    assert failed
    assert all(row["steps"][-1]["verdict"] != "ok" and row["steps"][-1]["detail"] for row in failed)


@pytest.mark.parametrize("what", ["sft", "dpo", "trajectories"])
@pytest.mark.parametrize("form", ["jsonl", "parquet"])
def test_trainers_can_load_it(ran: Path, tmp_path: Path, what: str, form: str) -> None:
    datasets = pytest.importorskip("datasets")
    folder = tmp_path / "set"
    assert main(["export", what, str(ran), "--out", str(folder), "--format", form]) == 0
    rows = datasets.load_dataset(str(folder), split="train", cache_dir=str(tmp_path / "cache"))
    exported(what, ran, tmp_path / "plain")
    plain = [json.loads(line) for line in (tmp_path / "plain" / "train.jsonl").read_text().splitlines()]
    assert rows.to_list() == plain
    card = (folder / "README.md").read_text()
    assert f"{len(plain)} rows" in card
    assert "simulated qwen3-4b (no model)" in card
    assert all(f"`{column}`" in card for column in rows.column_names)


def test_what_cannot_be_exported_is_said(ran: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").touch()
    assert main(["export", "sft", str(ran), "--out", str(tmp_path / "full")]) == 2
    assert "not empty" in capsys.readouterr().err
    assert main(["eval", "--agents", "oracle", "--sample", "1", "--out", str(tmp_path / "run"), "--quiet"]) == 0
    capsys.readouterr()
    assert main(["export", "dpo", str(tmp_path / "run"), "--out", str(tmp_path / "none")]) == 2
    assert "nothing for a data set" in capsys.readouterr().err
