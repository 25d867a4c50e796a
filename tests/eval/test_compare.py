"""Comparing runs, ranking them, and finding out whether a run folder is what it says."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from scipy.stats import binomtest

from eval.cli import main
from eval.records.journal import RecordWriter, read_records
from eval.records.prices import Price, Prices, read_prices
from eval.records.schema import EpisodeRecord
from eval.report.diff import changes, matched, mcnemar, wilcoxon
from eval.report.formats import render
from eval.report.leaderboard import Submission, leaderboard
from eval.report.tables import results
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import import_plugins
from eval.run.runner import run, schedule
from eval.run.verification import verify_run
from gavel_env.errors import DataError
from gavel_env.instructions.record import read_instructions, shipped

PLUGIN = "tests.support.eval_agents"
ASKED = ["llm-only", "sayplan", "gavel-full", "epog", "oracle"]


def ran(
    out: Path, agents: list[str], planner: str = "simulated:qwen3-8b", kind: str = "single", sampled: int = 5
) -> Path:
    import_plugins([PLUGIN])  # registers agents

    settings = EnvironmentSettings()
    contestants = choose(agents, settings, planners=[planner])
    plan = schedule(
        contestants, [read_instructions(shipped(kind))], sampled=sampled, settings=settings, plugins=[PLUGIN]
    )
    return run(plan, out)


def rewritten(path: Path, change: Callable[[EpisodeRecord], EpisodeRecord], agent: str) -> None:
    """Change the first record of an agent in a record file."""
    files = read_records([path])
    path.unlink()
    done = False
    with RecordWriter(path) as writer:
        for header in files.headers:
            writer.write(header)
        for record in files.records.values():
            if record.contestant.agent == agent and not done:
                record, done = change(record), True
            writer.write(record)
    assert done


def test_a_run_passes_whoever_ran_it(tmp_path: Path) -> None:
    ran(tmp_path, [*ASKED, "lazy", "sloppy", "asking"], kind="single", sampled=4)
    found = verify_run(tmp_path)
    assert found.findings == ()
    assert (found.replayed, found.recorded, found.missing) == (32, 32, 0)


def test_a_run_of_several_tasks_passes_with_search_priors(tmp_path: Path) -> None:
    ran(tmp_path, ["gavel-full", "asking", "epog"], kind="multi", sampled=4)
    assert any(step.search_prior for r in read_records([tmp_path]).records.values() for step in r.steps)
    assert verify_run(tmp_path).findings == ()


CHANGES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "an outcome": ("llm-only", lambda r: msgspec.structs.replace(r, outcome="truncated", failure="truncated")),
    "metres": ("gavel-full", lambda r: msgspec.structs.replace(r, metres=r.metres - 1.0)),
    "an action": (
        "gavel-full",
        lambda r: msgspec.structs.replace(
            r, steps=(msgspec.structs.replace(r.steps[0], action="GRASP(mug)"), *r.steps[1:])
        ),
    ),
    "a step left out": ("epog", lambda r: msgspec.structs.replace(r, steps=r.steps[1:])),
    "an action of somebody's own agent": ("sloppy", lambda r: msgspec.structs.replace(r, steps=r.steps[:-1])),
    "an outcome of somebody's own agent": (
        "sloppy",
        lambda r: msgspec.structs.replace(r, outcome="success", failure="", unmet=(), tasks_met=(True,)),
    ),
    "an order": ("oracle", lambda r: msgspec.structs.replace(r, trace=msgspec.structs.replace(r.trace, order=[7]))),
    "a prompt's hash": (
        "llm-only",
        lambda r: msgspec.structs.replace(r, trace=msgspec.structs.replace(r.trace, prompts=["0" * 16])),
    ),
    "a call that is another one's": ("sayplan", lambda r: msgspec.structs.replace(r, calls=("0" * 32, *r.calls[1:]))),
    "a call left out": ("llm-only", lambda r: msgspec.structs.replace(r, calls=())),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_changed_record_is_found(tmp_path: Path, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    agent, change = CHANGES[what]
    path = ran(tmp_path, [agent], sampled=3)
    assert main(["verify-run", str(tmp_path)]) == 0
    rewritten(path, change, agent)
    assert main(["verify-run", str(tmp_path)]) == 1
    assert "NOT as recorded" in capsys.readouterr().out


def test_a_changed_conversation_is_found(tmp_path: Path) -> None:
    import gzip

    ran(tmp_path, ["llm-only"], sampled=3)
    store = tmp_path / "conversations.jsonl.gz"
    content = gzip.decompress(store.read_bytes())
    store.write_bytes(gzip.compress(content.replace(b"NAVIGATE_TO", b"NAVIGATE-TO")))
    assert verify_run(tmp_path).findings


def test_instructions_that_are_not_here_are_asked_for(tmp_path: Path) -> None:
    some = list(read_instructions(shipped("single")).values())[:2]
    path = tmp_path / "mine.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in some))
    command = ["eval", "--agents", "epog", "--instructions", str(path), "--out", str(tmp_path / "run"), "--quiet"]
    assert main(command) == 0
    with pytest.raises(DataError, match="--instructions"):
        verify_run(tmp_path / "run")
    assert verify_run(tmp_path / "run", [path]).findings == ()


def test_a_diff_says_what_changed_and_how_sure_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    agents = ["llm-only", "gavel-full"]
    ran(tmp_path / "old", agents, "simulated:qwen3-4b", sampled=12)
    ran(tmp_path / "new", agents, "simulated:qwen3-8b", sampled=12)
    first, second = read_records([tmp_path / "old"]), read_records([tmp_path / "new"])
    [llm, _] = matched(first, second)
    assert (llm.first.planner, llm.second.planner) == ("simulated:qwen3-4b", "simulated:qwen3-8b")
    found = changes(llm, first, second)
    for change in found:
        assert change.first is not None
        assert change.second is not None
        assert (change.first.failure, change.first.metres) != (change.second.failure, change.second.metres)
    outcomes = {
        r.instruction: (r.success, s.success)
        for r in first.records.values()
        for s in second.records.values()
        if r.contestant.agent == s.contestant.agent == "llm-only" and r.instruction == s.instruction
    }
    better = sum(b and not a for a, b in outcomes.values())
    worse = sum(a and not b for a, b in outcomes.values())
    assert better + worse > 0
    assert main(["tables", str(tmp_path / "old"), str(tmp_path / "new"), "--diff"]) == 0
    shown = capsys.readouterr().out
    assert f"{better} / {12 - better - worse} / {worse}" in shown
    assert "What changed from old to new" in shown
    assert main(["tables", str(tmp_path / "old"), str(tmp_path / "old"), "--diff"]) == 0
    assert "came out differently: 0" in capsys.readouterr().out
    assert main(["tables", str(tmp_path / "old"), "--diff"]) == 2
    ran(tmp_path / "other", agents, "simulated:qwen3-8b", "multi", 2)
    assert main(["tables", str(tmp_path / "old"), str(tmp_path / "other"), "--diff"]) == 2
    assert "different data" in capsys.readouterr().err


def test_the_tests_are_those_of_the_books() -> None:
    assert mcnemar(0, 0) == 1.0
    assert mcnemar(9, 1) == pytest.approx(binomtest(9, 10, 0.5).pvalue)
    assert mcnemar(9, 1) == pytest.approx(2 * (10 + 1) / 2**10)
    assert wilcoxon([0.0, 0.0]) == 1.0
    assert wilcoxon([1.0, 2.0, 3.0, 4.0, 5.0]) == pytest.approx(2 / 2**5)


def test_runs_are_ranked_on_the_same_data_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ran(tmp_path / "weak", ["llm-only", "oracle"], "simulated:qwen3-4b", sampled=8)
    ran(tmp_path / "strong", ["gavel-full"], "simulated:qwen3-8b", sampled=8)
    submissions = [Submission(name, read_records([tmp_path / name]), True) for name in ("weak", "strong")]
    [grid] = leaderboard(submissions)
    assert [row[:3] for row in grid.rows] == [
        ("1", "strong", "gavel-full"), ("2", "weak", "llm-only"), ("3", "weak", "oracle †"),
    ]  # fmt: skip
    page = tmp_path / "board.html"
    command = ["leaderboard", str(tmp_path / "weak"), str(tmp_path / "strong"), "--verify", "--format", "html"]
    assert main([*command, "--output", str(page)]) == 0
    assert page.read_text().count("<tr>") == 4
    assert ">yes<" in page.read_text()
    ran(tmp_path / "fewer", ["gavel-full"], "simulated:qwen3-8b", sampled=3)
    assert main(["leaderboard", str(tmp_path / "strong"), str(tmp_path / "fewer")]) == 2
    assert "fewer: data" in capsys.readouterr().err


def test_prices_are_read_found_and_shown(tmp_path: Path) -> None:
    assert read_prices().models == {}
    price = {"prompt": 2.0, "completion": 8.0}
    names = ("claude-sonnet-4", "claude-sonnet-4-5", "gpt-4o", "gpt-4.1")
    (tmp_path / "mine.json").write_text(json.dumps({"models": dict.fromkeys(names, price)}))
    prices = read_prices(tmp_path / "mine.json")
    assert prices.find("claude-sonnet-4-5-20250929") == prices.models["claude-sonnet-4-5"]
    assert prices.find("claude-sonnet-4-20250514") == prices.models["claude-sonnet-4"]
    assert prices.find("gpt-4o-mini-audio") is None
    assert prices.of("gpt-4.1", 1_000_000, 500_000) == pytest.approx(6.0)
    path = ran(tmp_path, ["llm-only"], sampled=2)
    files = read_records([path])
    assert "Cost" not in render(results(files), costs=True)
    mine = Prices(models={"simulated qwen3-8b (no model)": Price(1.0, 1.0)})
    assert "Cost" in render(results(files, None, mine), costs=True)
    (tmp_path / "bad.json").write_text('{"models": {"m": {"prompt": -1, "completion": 1}}}')
    with pytest.raises(DataError, match="0 or more"):
        read_prices(tmp_path / "bad.json")
