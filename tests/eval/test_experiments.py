"""The paper's experiments by name: what they run, the published figures beside ours, paired differences, failures."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.cli import main
from eval.records.journal import read_records
from eval.records.sampling import sample
from eval.records.schema import Contestant, EpisodeKey, EpisodeRecord, Step
from eval.report.experiments import experiment_tables
from eval.report.failures import failure_tables
from eval.report.paired import bootstrap_interval, paired_metres, paired_success
from eval.report.waterfall import cause, waterfall
from eval.run.runner import run
from eval.studies.experiments import EXPERIMENTS, planned, sampled_by, seeds_for
from eval.studies.published import EXPERIMENTS as PUBLISHED
from eval.studies.published import published_model
from gavel_agents.agent import AgentTrace, TaskTrace
from gavel_env.instructions.record import read_instructions, shipped

A, B = Contestant("gavel-full", "p", config="a"), Contestant("sayplan", "p", config="b")


def record(who: Contestant, name: str, seed: int = 0, outcome: str = "success", **fields: object) -> EpisodeRecord:
    return EpisodeRecord(
        seed=seed, instruction=name, kind="single", scene="", text="", data="d", code="", contestant=who,
        outcome=outcome, **fields,  # type: ignore[arg-type]
    )  # fmt: skip


def keys(who: Contestant, names: list[str], seeds: tuple[int, ...] = (0,)) -> list[EpisodeKey]:
    return [EpisodeKey("d", who.config, name, seed) for name in names for seed in seeds]


def test_every_published_row_is_of_an_agent_of_its_experiment() -> None:
    for name, rows in PUBLISHED.items():
        agents = {agent for _, agent in rows}
        assert agents <= set(EXPERIMENTS[name].agents)
        for claim in EXPERIMENTS[name].claims:
            assert {claim.first, claim.second} <= agents


def test_published_figures_stand_beside_the_model_that_they_are_of() -> None:
    assert published_model("hf:Qwen/Qwen3-4B?batch=8") == "Qwen3-4B"
    assert published_model("openai:qwen3_8b@http://127.0.0.1/v1") == "Qwen3-8B"
    assert published_model("anthropic:claude-sonnet-5-20260101") == "Claude Sonnet 5"
    assert published_model("replay:single", "qwen2.5-coder-1.5b") == "Qwen3-8B"
    assert published_model("replay:mine.jsonl.gz", "Qwen3-4B (temperature 0.7)") == "Qwen3-4B"


@pytest.mark.parametrize(
    ("planner", "samples"),
    [
        ("simulated:qwen3-8b", True),
        ("single=simulated:qwen3-8b", True),
        ("openai:m@http://127.0.0.1/v1?temperature=0.7", True),
        ("openai:m@http://127.0.0.1/v1?temperature=0.0", False),
        ("hf:Qwen/Qwen3-8B", False),
        ("anthropic:m", True),
        ("replay:single", False),
        ("reference:multi", False),
    ],
)
def test_five_seeds_where_something_is_random(planner: str, samples: bool) -> None:
    assert sampled_by(planner) == samples
    assert seeds_for([planner]) == ((0, 1, 2, 3, 4) if samples else (0,))


def test_experiment_3_takes_every_fifth_instruction_or_those_that_were_recorded() -> None:
    multi = list(read_instructions(shipped("multi")))
    [asked] = planned(EXPERIMENTS["exp3"], planners=["simulated:qwen3-8b", "simulated:qwen3-4b"]).benchmarks
    assert asked.instructions == tuple(multi[::5])
    assert len(asked.instructions) == 100
    [unasked] = planned(EXPERIMENTS["exp3"]).benchmarks
    assert unasked.instructions == tuple(sample(multi, 100))


def test_differences_are_paired_and_say_better_equal_worse() -> None:
    names = ["i0", "i1", "i2", "i3"]
    ours = dict(zip(names, ["success", "success", "unmet", "success"], strict=True))
    theirs = dict(zip(names, ["success", "unmet", "success", "unmet"], strict=True))
    found = [record(A, n, outcome=o, metres=10.0) for n, o in ours.items()]
    found += [record(B, n, outcome=o, metres=14.0) for n, o in theirs.items()]
    records = {r.key: r for r in found}
    success = paired_success(keys(A, names), keys(B, names), records)
    assert success is not None
    assert (success.difference, success.better, success.equal, success.worse) == (25.0, 2, 1, 1)
    metres = paired_metres(keys(A, names), keys(B, names), records)
    assert metres is not None
    assert (metres.difference, metres.base, metres.better, metres.equal, metres.worse) == (-4.0, 14.0, 1, 0, 0)
    assert metres.interval is None
    assert paired_metres(keys(A, ["i1"]), keys(B, ["i1"]), records) is None


def test_seeds_are_averaged_before_instructions_are_compared() -> None:
    found = [record(A, "i", s, outcome="success" if s else "unmet") for s in (0, 1)]
    found += [record(B, "i", s, outcome="unmet") for s in (0, 1)]
    paired = paired_success(keys(A, ["i"], (0, 1)), keys(B, ["i"], (0, 1)), {r.key: r for r in found})
    assert paired is not None
    assert paired.differences == (("i", 50.0),)


@settings(deadline=None)
@given(st.lists(st.floats(-50, 50), min_size=2, max_size=40))
def test_a_bootstrap_interval_holds_the_mean_and_repeats(values: list[float]) -> None:
    interval = bootstrap_interval(values)
    assert interval is not None
    assert interval[0] - 1e-9 <= np.mean(values) <= interval[1] + 1e-9
    assert min(values) - 1e-9 <= interval[0] <= interval[1] <= max(values) + 1e-9
    assert bootstrap_interval(values) == interval


def test_a_bootstrap_interval_is_as_wide_as_theory_says() -> None:
    values = np.random.default_rng(0).normal(3.0, 2.0, 400)
    interval = bootstrap_interval(values.tolist())
    assert interval is not None
    assert interval[1] - interval[0] == pytest.approx(2 * 1.96 * values.std() / 20, rel=0.05)


def task(proposed: str, after: str, *, edits: tuple[str, ...] = (), plan: tuple[str, ...] = ()) -> TaskTrace:
    return TaskTrace(
        text="t", proposed=("GRASP(mug)",), proposed_verdict=proposed, plan=plan, edits=edits, verdict=after
    )


BAD = "unmet: on_top(mug, bed)"
MENDED = [task(BAD, "valid", edits=("insert OPEN",))]


@pytest.mark.parametrize(
    ("expected", "fields"),
    [
        ("understanding", {"outcome": "refused"}),
        ("understanding", {"outcome": "unmet", "misread": ("goal: missing cooked(pie)",), "trace": [task(BAD, BAD)]}),
        ("proposal", {"outcome": "unmet", "trace": [task(BAD, BAD)]}),
        ("repair", {"outcome": "unmet", "trace": MENDED, "tasks_met": (False,)}),
        ("execution", {"outcome": "unmet", "trace": [task("valid", "valid")], "tasks_met": (False,)}),
        (
            "execution",
            {
                "outcome": "violation",
                "trace": MENDED,
                "steps": (Step("GRASP(mug_1)", "closed"),),
            },
        ),
        (
            "repair",
            {
                "outcome": "violation",
                "trace": MENDED,
                "steps": (Step("OPEN(box_1)", "no_door"),),
            },
        ),
        ("error", {"outcome": "error"}),
    ],
)
def test_a_failure_is_attributed_to_the_stage_that_caused_it(expected: str, fields: dict[str, object]) -> None:
    tasks = fields.pop("trace", [])
    assert cause(record(A, "i", trace=AgentTrace(tasks=tasks), **fields)) == expected  # type: ignore[arg-type]


def test_the_waterfall_counts_what_remains_after_each_stage() -> None:
    bad, repaired, good = task(BAD, BAD), task(BAD, "valid"), task("valid", "valid")
    found = [
        record(A, "0", trace=AgentTrace(tasks=[good])),
        record(A, "1", trace=AgentTrace(tasks=[repaired])),
        record(A, "2", trace=AgentTrace(tasks=[good], earlier=[[bad], [bad]])),
        record(A, "3", outcome="unmet", trace=AgentTrace(tasks=[bad], earlier=[[bad]])),
        record(A, "4", outcome="unmet", trace=AgentTrace(tasks=[good, good]), tasks_met=(True, False)),
        record(A, "5", outcome="refused"),
    ]
    fall = waterfall(found)
    assert fall.remaining == {"proposal": 4, "repair": 3, "feedback": 2, "execution": 3}
    assert {name: n for name, n in fall.causes.items() if n} == {"proposal": 1, "execution": 1, "understanding": 1}
    assert sum(fall.causes.values()) == sum(not r.success for r in found)


def test_a_simulated_run_of_experiment_1_shows_seeds_published_and_differences(tmp_path: Path) -> None:
    plan = planned(EXPERIMENTS["exp1"], planners=["simulated:qwen3-4b"], sampled=8, seeds=(0, 1))
    files = read_records([run(plan, tmp_path)])
    table, differences = experiment_tables(EXPERIMENTS["exp1"], files)
    cells = {row[0].split()[0]: dict(zip(table.header, row, strict=True)) for row in table.rows}
    assert set(cells) == set(EXPERIMENTS["exp1"].agents)
    assert table.header.count("*published*") == 3
    published = [row[table.header.index("*published*")] for row in table.rows]
    assert published[:2] == ["21.8 ± 1.5", "55.4 ± 1.9"]
    assert "±" in cells["llm-only"]["Success (%)"]
    notes = " ".join(table.notes)
    assert "simulated:qwen3-4b (a simulated model: published error statistics, no language model)" in notes
    assert "standard deviation over seeds" in notes
    shown = {row[0]: row for row in differences.rows}
    assert shown["gavel-full − llm-only"][5] == "+67.0 points"
    by_seed = {s: {r.instruction for r in files.records.values() if r.success and r.seed == s} for s in (0, 1)}
    assert by_seed[0] != by_seed[1] or len(by_seed[0]) == 8
    [remaining, causes] = failure_tables(files)
    assert remaining.rows[-1] == ("episodes", "16")
    assert causes.header == ("Cause", "simulated:qwen3-4b")


def test_the_commands_run_on_what_is_shipped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "exp1", "--sample", "4", "--out", str(tmp_path / "1"), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "replay:single (answers of a real model that were recorded once)" in shown
    assert "paired differences" in shown
    assert main(["eval", "exp2", "--sample", "3", "--out", str(tmp_path / "2"), "--quiet", "--format", "csv"]) == 0
    shown = capsys.readouterr().out
    assert {line.split(",")[0].split()[0] for line in shown.splitlines()[2:12]} >= {"epog", "oracle", "gavel-full"}
    assert main(["eval", "failures", "--sample", "4", "--out", str(tmp_path / "f"), "--quiet"]) == 0
    assert "What caused them" in capsys.readouterr().out
    assert main(["eval", "exp1", "--sample", "4", "--out", str(tmp_path / "1"), "--quiet"]) == 2
    assert main(["eval", "exp1", "--sample", "4", "--out", str(tmp_path / "1"), "--quiet", "--resume"]) == 0


def test_agents_of_ones_own_run_once(tmp_path: Path) -> None:
    command = [
        "eval",
        "--plugin",
        "tests.support.eval_agents",
        "--agents",
        "lazy,gavel-full",
        "--sample",
        "2",
        "--quiet",
    ]
    assert main([*command, "--out", str(tmp_path)]) == 0
    records = read_records([tmp_path]).records.values()
    own = [r for r in records if r.contestant.agent == "lazy"]
    assert len(own) == 4
    assert {r.contestant.planner for r in own} == {""}


@pytest.mark.parametrize("kind", ["single", "multi"])
def test_the_oracle_plans_where_no_reference_plan_is_given(tmp_path: Path, kind: str) -> None:
    some = list(read_instructions(shipped(kind)).values())[:3]
    bare = [
        msgspec.structs.replace(one, tasks=tuple(msgspec.structs.replace(t, reference_plan=()) for t in one.tasks))
        for one in some
    ]
    path = tmp_path / "bare.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in bare))
    assert main(["eval", "--agents", "oracle", "--instructions", str(path), "--out", str(tmp_path), "--quiet"]) == 0
    for found in read_records([tmp_path]).records.values():
        assert found.success, found.failure
        assert {t.verdict for t in found.trace.tasks} == {"planned"}
