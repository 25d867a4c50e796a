"""`gavel eval` and `gavel tables` as a user meets them."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from eval.cli import build_parser, main
from eval.records.journal import read_records
from eval.run.contestants import ORDER
from gavel_env.instructions.record import Instruction, read_instructions, shipped

ROOT = Path(__file__).parents[2]
CONFERRED = ("cooked", "washed", "dried")


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three single and three multi-task instructions in one file; at least one needs an appliance, one does not."""
    chosen: list[Instruction] = []
    for kind in ("single", "multi"):
        records = list(read_instructions(shipped(kind)).values())
        needing = [r for r in records if needs_appliance(r)]
        others = [r for r in records if not needs_appliance(r)]
        chosen += [needing[0], others[0], others[1]]
    path = tmp_path_factory.mktemp("few") / "few.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(r) + b"\n" for r in chosen))
    return path


def needs_appliance(instruction: Instruction) -> bool:
    return any(lit.predicate.value in CONFERRED for lit in instruction.goal().literals)


def script(instructions: Path, path: Path) -> Path:
    """Write the reference plans as scripted completions."""
    lines = []
    for record in read_instructions(instructions).values():
        text = "".join(f"Task {n}:\n" + "\n".join(t.reference_plan) + "\n" for n, t in enumerate(record.tasks, start=1))
        lines.append(json.dumps({"instruction_id": record.id, "completions": [text]}))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_default_table(few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "--instructions", str(few), "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr()
    for title in ("Single tasks", "Multi-task instructions"):
        assert f"{title}\n3 from few.jsonl · stamp" in shown.out
    assert shown.out.count("oracle †") == 2
    assert "18/18 episodes" in shown.err
    assert str(tmp_path / "records.jsonl") in shown.err
    for record in read_records([tmp_path]).records.values():
        needs = any(text.startswith(CONFERRED) for task in record.trace.tasks for text in task.goal)
        assert record.success == (record.contestant.agent != "epog" or not needs), (
            record.instruction,
            record.failure,
        )


def test_every_method_on_scripted_completions(few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = f"scripted:{script(few, tmp_path / 'answers.jsonl')}"
    options = ["--kind", "single", "--planner", spec, "--out", str(tmp_path / "out"), "--format", "csv", "--quiet"]
    assert main(["eval", "--instructions", str(few), *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[4] for line in lines[1:]] == list(ORDER)
    records = read_records([tmp_path / "out"]).records.values()
    assert len(records) == 3 * len(ORDER)
    asked = [r for r in records if r.contestant.planner_kind == "scripted"]
    assert {r.contestant.agent for r in asked} == set(ORDER) - {"llm+p", "epog", "oracle"}
    for record in asked:
        assert record.trace.attempts >= 1
        assert len(record.trace.prompts) == len(record.calls) == record.trace.attempts
        assert record.model == "scripted:answers.jsonl"
        assert record.method["source"] == "model"
        assert record.trace.tasks[0].proposed


def test_the_default_planner_plans_for_what_another_understanding_makes_of_the_text(
    few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--understanding", "rules", "--agents", "gavel-basic,llm+p", "--kind", "single", "--format", "csv"]
    for source in (["--instructions", str(few)], ["--limit", "3"]):
        assert main(["eval", *source, *options, "--out", str(tmp_path / source[0])]) == 0
        lines = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
        assert [(line["agent"], line["planner"]) for line in lines] == [
            (agent, "classical:search") for agent in ("gavel-basic", "llm+p")
        ]
        for record in read_records([tmp_path / source[0]]).records.values():
            assert record.model.startswith("classical planner")
    assert main(["eval", "--understanding", "llm", "--agents", "gavel-basic", "--limit", "1"]) == 2
    assert "asks a language model, and none is given" in capsys.readouterr().err


def test_a_shipped_recording_of_a_sample_is_in_the_default_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gavel_agents.llm.replay.RECORDINGS", tmp_path)
    recorded = ["--planner", "reference:multi", "--instructions", "multi", "--sample", "2", "--agents", "llm-only"]
    assert main(["record", *recorded, "--out", str(tmp_path / "multi.jsonl.gz")]) == 0
    entry = {"model": "m", "source": "s", "instructions": "multi", "agents": ["llm-only"], "sample": 2}
    (tmp_path / "index.json").write_text(json.dumps({"multi": entry}))
    run = ["eval", "--kind", "multi", "--quiet", "--format", "csv"]
    capsys.readouterr()
    assert main([*run, "--sample", "4", "--out", str(tmp_path / "default")]) == 0
    lines = csv.DictReader(io.StringIO(capsys.readouterr().out))
    rest = [
        ("llm+p", "classical:search"),
        ("epog", ""),
        ("gavel-map", "reference:multi"),
        ("gavel-static", "reference:multi"),
        ("gavel-full", "reference:multi"),
        ("gavel-plus", "reference:multi"),
        ("oracle", ""),
    ]
    assert [(line["part"], line["agent"], line["planner"], line["scheduled"], line["recorded"]) for line in lines] == [
        ("shared", "llm-only", "replay:multi", "2", "2"),
        *(("shared", agent, planner, "2", "2") for agent, planner in rest),
        *(("all", agent, planner, "4", "4") for agent, planner in rest),
    ]
    assert main([*run, "--agents", "llm-only", "--planner", "multi=replay:multi", "--out", str(tmp_path / "own")]) == 0
    [line] = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert (line["scheduled"], line["success_pct"]) == ("2", "100.0")


def test_tables_of_a_run_in_every_format(few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    run = ["eval", "--instructions", str(few), "--agents", "epog", "--out", str(out), "--quiet"]
    assert main([*run, "--format", "markdown", "--failures"]) == 0
    printed = capsys.readouterr().out
    assert main(["tables", str(out), "--format", "markdown", "--failures"]) == 0
    assert capsys.readouterr().out == printed
    assert "why episodes failed" in printed
    assert main(["tables", str(out / "records.jsonl"), "--format", "latex", "--output", str(tmp_path / "t.tex")]) == 0
    assert r"\toprule" in (tmp_path / "t.tex").read_text()
    assert capsys.readouterr().out == ""


def test_seeds_agents_and_limit_make_the_schedule(few: Path, tmp_path: Path) -> None:
    options = ["--agents", "epog,oracle", "--seeds", "0,1,1", "--limit", "1", "--kind", "multi", "--out", str(tmp_path)]
    assert main(["eval", "--instructions", str(few), *options, "--quiet"]) == 0
    found = read_records([tmp_path])
    [header] = found.headers
    assert header.seeds == (0, 1)
    assert sorted(found.records) == sorted(header.keys())
    assert len(found.records) == 4


def test_what_is_there_is_not_run_again_and_not_overwritten(
    few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = ["eval", "--instructions", str(few), "--agents", "epog", "--limit", "1", "--out", str(tmp_path)]
    assert main(run) == 0
    first = capsys.readouterr().out
    assert main(run) == 2
    assert "--resume" in capsys.readouterr().err
    assert main([*run, "--resume"]) == 0
    shown = capsys.readouterr()
    assert "2 of 2 episodes have records already" in shown.err
    assert shown.out == first


def test_a_file_with_bad_lines_still_gives_a_table(
    few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_bytes(b"nonsense\n" + few.read_bytes().splitlines(keepends=True)[1])
    assert main(["eval", "--instructions", str(path), "--agents", "oracle", "--out", str(tmp_path / "o")]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "50.0 [" in out
    assert "bad.jsonl:1: malformed instruction" in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--agents", "orakle"], "did you mean 'oracle'"),
        (["--agents", "llm-only"], "--planner"),
        (["--agents", "llm-only", "--planner", "scriptd:x"], "did you mean 'scripted'"),
        (["--agents", "llm-only", "--planner", "scripted:/nowhere.jsonl"], "/nowhere.jsonl cannot be read"),
        (["--instructions", "/nowhere.jsonl"], "/nowhere.jsonl cannot be read"),
        (["--understanding", "referenc", "--agents", "epog"], "reference"),
        (["--prior", "chioce", "--agents", "epog"], "choice"),
        (["--plugin", "no_such_module"], "no_such_module"),
    ],
)
def test_wrong_use_is_said_in_one_line(
    options: list[str], message: str, few: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = options if "--instructions" in options else ["--instructions", str(few), *options]
    assert main(["eval", *given, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out" / "records.jsonl").exists()


@pytest.mark.parametrize("options", [["--seeds", "a"], ["--seeds", "-1"], ["--limit", "0"], ["--agents", ","]])
def test_malformed_options_are_refused_by_the_parser(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as error:
        build_parser().parse_args(["eval", *options])
    assert error.value.code == 2
    assert options[0] in capsys.readouterr().err


def test_a_plugin_in_the_working_directory_takes_part_by_name(few: Path, tmp_path: Path) -> None:
    (tmp_path / "my_agents.py").write_text(
        "import gavel_agents\n"
        "class Idle:\n"
        "    name = 'idle'\n"
        "    def reset(self, observation, info): pass\n"
        "    def act(self, observation, info): return None\n"
        "gavel_agents.register('idle', lambda **options: Idle())\n"
    )
    arguments = ["eval", "--plugin", "my_agents", "--agents", "idle", "--instructions", str(few), "--limit", "2"]
    code = f"import sys; from eval.cli import main; sys.exit(main({[*arguments, '--workers', '2', '--quiet']!r}))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    [run] = (tmp_path / "runs").iterdir()
    assert {record.outcome for record in read_records([run]).records.values()} == {"unmet"}


def test_evaluations_of_parts_stand_beside_the_run() -> None:
    parser = build_parser()
    whole, part = parser.parse_args(["eval", "--limit", "3"]), parser.parse_args(["eval", "beliefs"])
    assert whole.limit == 3
    assert whole.run is not part.run
    assert part.run.__module__ == "eval.commands.beliefs"


@pytest.mark.slow
def test_the_shipped_instructions_check_the_agents(tmp_path: Path) -> None:
    """The oracle solves every one; graph edits fail exactly where a state must be conferred."""
    assert main(["eval", "--agents", "epog,oracle", "--out", str(tmp_path), "--quiet"]) == 0
    files = {kind: read_instructions(shipped(kind)) for kind in ("single", "multi")}
    for record in read_records([tmp_path]).records.values():
        needs = needs_appliance(files[record.kind][record.instruction])
        expected = record.contestant.agent == "oracle" or not needs
        assert record.success == expected, (record.contestant.agent, record.instruction, record.failure)


def test_the_command_line_has_one_thread_for_linear_algebra_unless_told_otherwise() -> None:
    script = (
        "import gavel_eval, os, sys\n"
        "print('OPENBLAS_NUM_THREADS' in os.environ, 'numpy' in sys.modules)\n"
        "sys.argv = ['gavel', '--version']\n"
        "try: gavel_eval.main()\n"
        "except SystemExit: print(os.environ['OPENBLAS_NUM_THREADS'])\n"
    )
    clean = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    for given, last in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")):
        done = subprocess.run(
            [sys.executable, "-c", script], env=clean | given, capture_output=True, text=True, check=True
        )
        first, _version, used = done.stdout.splitlines()
        assert first == f"{bool(given)} False"  # it is read when numpy is imported
        assert used == last
