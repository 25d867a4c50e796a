"""Record files: whole lines, torn lines, locks, versions and what must not be in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.cli import main
from eval.records.encoding import sound
from eval.records.journal import RecordWriter, read_records
from eval.records.schema import OUTCOMES, Benchmark, Contestant, EpisodeRecord, RunHeader, Step
from eval.records.scrub import describe_error, scrub, scrub_secrets
from eval.report.formats import render
from eval.report.tables import results
from gavel_agents.agent import AgentTrace, TaskTrace
from gavel_env.errors import DataError

WHO = Contestant("epog", understanding="reference", config="c0")


def episode(instruction: str = "i0", seed: int = 0, outcome: str = "success", **fields: Any) -> EpisodeRecord:
    return EpisodeRecord(
        seed=seed, instruction=instruction, kind="multi", scene="Rs_int", text="Do it.", data="d0", code="v0",
        contestant=fields.pop("contestant", WHO), outcome=outcome, **fields,
    )  # fmt: skip


def header(**fields: Any) -> RunHeader:
    values: dict[str, Any] = {
        "started": "", "versions": {}, "code": "v0", "arguments": {}, "contestants": (WHO,), "benchmarks": (),
        "seeds": (0,), "environment": {},
    }  # fmt: skip
    return RunHeader(**(values | fields))


def test_what_is_written_is_what_is_read(tmp_path: Path) -> None:
    trace = AgentTrace(tasks=[TaskTrace(text="t", plan=("OPEN(fridge_0)",))], attempts=2, seconds={"plan": 1.5})
    step = Step("NAVIGATE_TO(fridge)", "ok", 3.25, "fridge_0", ((0.5, 1.0), (2.0, 1.0)))
    written = episode(trace=trace, steps=(step,), metres=3.25, tasks_met=(True,), unmet=("open(fridge)",))
    with RecordWriter(tmp_path / "records.jsonl") as writer:
        writer.write(header())
        writer.write(written)
    found = read_records([tmp_path])
    assert found.headers == (header(),)
    assert list(found.records.values()) == [written]
    assert found.damaged == ()
    first, second = (tmp_path / "records.jsonl").read_text().splitlines()
    assert first.startswith('{"schema":"gavel-run/1"')
    assert second.startswith('{"schema":"gavel-record/1"')


@settings(max_examples=40, deadline=None)
@given(cut=st.integers(min_value=1, max_value=400))
def test_a_torn_last_line_is_left_out_and_then_rewritten(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    path = tmp_path_factory.mktemp("torn") / "records.jsonl"
    with RecordWriter(path) as writer:
        for name in ("a", "b", "c"):
            writer.write(episode(name))
    content = path.read_bytes()
    last = len(content.splitlines(keepends=True)[-1])
    path.write_bytes(content[: -min(cut, last)])
    assert {key.instruction for key in read_records([path]).records} == {"a", "b"}
    with RecordWriter(path) as writer:
        writer.write(episode("c"))
    assert path.read_bytes() == content


def test_contestants_of_before_samples_are_read_as_on_everything() -> None:
    old = b'{"agent":"llm-only","planner":"replay:single","config":"c0","kinds":["single"]}'
    read = msgspec.json.decode(old, type=Contestant)
    assert read == Contestant("llm-only", "replay:single", config="c0", kinds=("single",))
    assert msgspec.json.encode(read) == old
    assert Benchmark("single", "f", "s", "d", ("a", "b")).scheduled_for(read) == ("a", "b")


def test_a_damaged_line_is_reported_and_the_others_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    with RecordWriter(path) as writer:
        writer.write(episode("a"))
        writer.write(episode("b"))
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b'{"schema":"gavel-record/1","seed":"zero"}\n' + b"\xff\xfe\n" + lines[1])
    found = read_records([path])
    assert {key.instruction for key in found.records} == {"a", "b"}
    assert [place.split(":")[1] for place in found.damaged] == ["2", "3"]


def test_the_last_of_two_records_of_an_episode_counts(tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    with RecordWriter(path) as writer:
        writer.write(episode("a", outcome="error"))
        writer.write(episode("a", outcome="success"))
    [record] = read_records([path]).records.values()
    assert record.success


def test_a_file_is_written_by_one_run_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "records.jsonl"
    with RecordWriter(path), pytest.raises(DataError, match="another run"):
        RecordWriter(path)
    RecordWriter(path).close()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds no record"),
        (b'{"schema":"gavel-record/9"}\n', "gavel-record/9"),
        (b"not json\n", "holds no record"),
    ],
)
def test_files_that_are_no_records_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "records.jsonl"
    path.write_bytes(content)
    with pytest.raises(DataError, match=message):
        read_records([path])


def test_a_missing_file_is_named() -> None:
    with pytest.raises(DataError, match=r"nowhere/records\.jsonl"):
        read_records(["nowhere/records.jsonl"])


def test_every_outcome_says_what_it_means() -> None:
    assert all(OUTCOMES.values())
    assert episode(outcome="success").success
    assert not any(episode(outcome=name).success for name in OUTCOMES if name != "success")


def test_no_value_of_the_environment_reaches_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_SERVICE_API_KEY", "abcd1234efgh")
    path = tmp_path / "records.jsonl"
    with RecordWriter(path) as writer:
        writer.write(header(arguments={"planner": "openai:m@https://user:pass1234@host/v1", "note": "abcd1234efgh"}))
        writer.write(episode(error="key abcd1234efgh refused"))
    text = path.read_text()
    assert "abcd1234efgh" not in text
    assert "pass1234" not in text
    assert "[MY_SERVICE_API_KEY]" in text
    assert read_records([path]).records


def test_scrubbing_removes_secrets_and_values_but_nothing_else() -> None:
    environment = {"API_TOKEN": "tok-12345678", "HOME": "/home/someone", "TERM": "xterm", "MODE_KEY": "short"}
    text = "tok-12345678 in /home/someone/x, xterm, short, sk-abcdefghijklmnop1234, kitchen_0"
    assert scrub(text, environment) == "[API_TOKEN] in [HOME]/x, xterm, short, [removed], kitchen_0"
    assert "/home/someone" in scrub_secrets(text, environment)


def test_a_traceback_keeps_its_lines_but_no_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SECRET_KEY", "s3cr3tvalue")
    try:
        raise ValueError("bad s3cr3tvalue" + "x" * 20_000)
    except ValueError as error:
        text = describe_error(error)
    assert "tests/eval/test_records.py" in text
    assert str(Path(__file__).parents[3]) + "/" not in text
    assert "ValueError" in text
    assert "s3cr3tvalue" not in text
    assert len(text) < 9000


def test_records_of_a_plain_json_reader_have_the_documented_fields(tmp_path: Path) -> None:
    with RecordWriter(tmp_path / "records.jsonl") as writer:
        writer.write(episode(steps=(Step("RELEASE()", "hand_empty"),)))
    line = msgspec.json.decode((tmp_path / "records.jsonl").read_bytes())
    assert {"schema", "seed", "instruction", "kind", "data", "code", "contestant", "trace", "steps", "outcome"} <= set(
        line
    )
    assert line["steps"] == [{"action": "RELEASE()", "outcome": "hand_empty"}]


@pytest.mark.parametrize(
    "secret", ["contestant", "gavel-record/1", 'abc"def\\ghi', "tab\tand\nline", "geheimnis-ü", "instruction"]
)
def test_a_secret_is_out_whatever_it_looks_like_and_the_file_stays_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, secret: str
) -> None:
    monkeypatch.setenv("SESSION_TOKEN", secret)
    trace = AgentTrace(tasks=[TaskTrace(text=f"say {secret}", edits=(secret,))], stopped=secret)
    with RecordWriter(tmp_path / "records.jsonl") as writer:
        writer.write(header(arguments={secret: [f"x{secret}"]}))
        writer.write(episode(trace=trace, failure=secret, method={"key": secret}))
    found = read_records([tmp_path])
    [record] = found.records.values()
    assert not found.damaged
    assert record.key == episode().key
    free = (record.trace.stopped, record.trace.tasks[0].edits, record.failure, record.method["key"])
    assert all(text == "[SESSION_TOKEN]" for text in (free[0], *free[1], *free[2:]))
    assert secret not in {*found.headers[0].arguments} - {"contestant", "instruction"}
    assert record.trace.tasks[0].text == "say [SESSION_TOKEN]"


@pytest.mark.parametrize(
    "trace",
    [
        AgentTrace(attempts=np.int64(3)),  # type: ignore[arg-type]
        AgentTrace(expected_m=float("nan"), seconds={"plan": float("inf")}),
        AgentTrace(stopped=None),  # type: ignore[arg-type]
        AgentTrace(order=["first"]),  # type: ignore[list-item]
        AgentTrace(seconds={"plan": object()}),  # type: ignore[dict-item]
        AgentTrace(prompts=[b"\xff"]),  # type: ignore[list-item]
    ],
)
def test_what_an_agent_leaves_behind_never_spoils_the_file(tmp_path: Path, trace: AgentTrace) -> None:
    found = sound(episode(trace=trace))
    with RecordWriter(tmp_path / "records.jsonl") as writer:
        writer.write(found)
        writer.write(episode("b"))
    read = read_records([tmp_path])
    assert not read.damaged
    assert [r.outcome for r in read.records.values()] in (["error", "success"], ["success", "success"])
    assert read.records[found.key] == found


def test_half_characters_are_replaced(tmp_path: Path) -> None:
    found = sound(episode(trace=AgentTrace(completions=["half \ud83d"])))
    assert found.trace.completions == ["half ?"]


def test_tables_of_slim_records_are_those_of_whole_ones(tmp_path: Path) -> None:
    command = ["eval", "--planner", "simulated:qwen3-8b", "--agents", "llm-only,gavel-full,oracle", "--sample", "3"]
    assert main([*command, "--kind", "single", "--out", str(tmp_path), "--quiet"]) == 0
    whole, slim = read_records([tmp_path]), read_records([tmp_path], whole=False)
    assert whole.records.keys() == slim.records.keys()
    for form in ("csv", "terminal"):
        shown = [render(results(found), form, failures=True, costs=True) for found in (whole, slim)]
        assert shown[0] == shown[1]
    assert len({id(record.contestant) for record in slim.records.values()}) == 3
