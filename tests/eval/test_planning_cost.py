"""What planning cost: numbers recomputed independently, and shown only where asked for, in every format."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eval.cli import main
from eval.records.journal import RecordFile, RecordWriter
from eval.records.schema import Benchmark, Contestant, EpisodeRecord, RunHeader
from eval.report.formats import FORMATS, render, to_csv
from eval.report.grid import Grid, grids
from eval.report.planning_cost import costs, in_order
from eval.report.tables import Results, results
from gavel_agents.agent import AgentTrace

IDS = tuple(f"i{n}" for n in range(20))
REPLAY = Contestant("gavel-full", "replay:single", "reference", "choice", "c-full")
EPOG = Contestant("epog", understanding="reference", prior="choice", config="c-epog")
ORACLE = Contestant("oracle", config="c-oracle", privileged=True)
MINE = Contestant("mine", "openai:some-model", "reference", "choice", "c-mine")
ALL = (REPLAY, EPOG, MINE, ORACLE)


def trace(who: Contestant, rng: np.random.Generator) -> AgentTrace:
    if who is ORACLE:
        return AgentTrace(seconds={"plan": 1.0})
    seconds = {"understand": float(rng.uniform(0, 1)), "order": float(rng.uniform(0, 1))}
    if who is EPOG:
        return AgentTrace(seconds=seconds)
    seconds["plan"] = float(rng.uniform(5, 40))
    if rng.random() < 0.5:
        seconds["repair"] = float(rng.uniform(0, 0.1))
    if who is MINE:
        seconds["reflect"] = 0.25
        return AgentTrace(attempts=1, seconds=seconds)
    return AgentTrace(
        attempts=int(rng.integers(1, 6)), seconds=seconds,
        prompt_tokens=int(rng.integers(900, 5000)), completion_tokens=int(rng.integers(50, 400)),
    )  # fmt: skip


def made_up() -> list[EpisodeRecord]:
    rng = np.random.default_rng(3)
    return [
        EpisodeRecord(
            seed=0, instruction=name, kind="single", scene="Rs_int", text="", data="d0", code="abc", contestant=who,
            outcome="success" if rng.random() < 0.7 else "unmet", trace=trace(who, rng),
        )
        for who in ALL
        for name in IDS
    ]  # fmt: skip


def header(who: tuple[Contestant, ...] = ALL) -> RunHeader:
    return RunHeader(
        started="", versions={}, code="abc", arguments={}, contestants=who, seeds=(0,), environment={},
        benchmarks=(Benchmark("single", "single.jsonl", "s0", "d0", IDS),),
    )  # fmt: skip


def file(records: list[EpisodeRecord], who: tuple[Contestant, ...] = ALL) -> RecordFile:
    return RecordFile((header(who),), {r.key: r for r in records}, ())


@pytest.fixture(scope="module")
def records() -> list[EpisodeRecord]:
    return made_up()


@pytest.fixture(scope="module")
def found(records: list[EpisodeRecord]) -> Results:
    return results(file(records))


@pytest.fixture(scope="module")
def table(found: Results) -> Grid:
    _, second = grids(found, costs=True)
    return second


def cells(table: Grid, agent: str) -> dict[str, str]:
    [row] = [row for row in table.rows if row[0] == agent]
    return dict(zip(table.header, row, strict=True))


def test_numbers_equal_an_independent_computation_with_pandas(records: list[EpisodeRecord], found: Results) -> None:
    data = pd.DataFrame(
        {
            "agent": r.contestant.agent,
            "calls": r.trace.attempts,
            "prompt": r.trace.prompt_tokens,
            "new": r.trace.completion_tokens,
            "planning": sum(r.trace.seconds.values()),
            **{f"s_{name}": spent for name, spent in r.trace.seconds.items()},
        }
        for r in records
    ).fillna(0.0)
    rows = {row.contestant.agent: row for row in found.sections[0].rows}
    for agent, measures in {"gavel-full": ("calls", "prompt", "new", "planning"), "epog": ("planning",)}.items():
        part = data[data.agent == agent]
        spent = rows[agent].costs
        values = {
            "calls": spent.calls, "prompt": spent.prompt_tokens, "new": spent.completion_tokens,
            "planning": spent.planning_s,
        }  # fmt: skip
        for name in measures:
            value = values[name]
            assert value is not None
            assert value[:2] == pytest.approx((part[name].mean(), part[name].std()))
        for stage, value in spent.seconds.items():
            assert value[:2] == pytest.approx((part[f"s_{stage}"].mean(), part[f"s_{stage}"].std()))
        assert spent.planning_s is not None
        assert sum(value.mean for value in spent.seconds.values()) == pytest.approx(spent.planning_s.mean)
    assert rows["epog"].costs.calls is None
    assert list(rows["gavel-full"].costs.seconds) == ["understand", "plan", "repair", "order"]


def test_results_stay_as_they_are_unless_costs_are_asked_for(found: Results) -> None:
    for form in FORMATS:
        plain, more = render(found, form), render(found, form, costs=True)
        assert "token" not in plain.lower()
        assert "token" in more.lower()
    assert grids(found)[0].rows == grids(found, costs=True)[0].rows
    titles = [grid.title for grid in grids(found, costs=True, failures=True)]
    assert titles == [
        "Single tasks", "Single tasks: what planning cost per instruction", "Single tasks: why episodes failed"
    ]  # fmt: skip


def test_the_table_has_who_planned_and_every_stage(table: Grid) -> None:
    assert [row[0] for row in table.rows] == ["gavel-full", "epog", "mine"]
    assert table.header == (
        "Agent", "Planner", "Calls", "Prompt tokens", "New tokens", "Understand (s)", "Planner (s)", "Repair (s)",
        "Order (s)", "reflect (s)", "Planning (s)", "N",
    )  # fmt: skip
    assert cells(table, "mine")["reflect (s)"] == "0.25"
    assert cells(table, "mine")["N"] == "20"
    assert {row[table.header.index("Planner (s)")] for row in table.rows if row[0] == "epog"} == {"—"}


def test_what_is_not_counted_is_undefined_and_not_zero(table: Grid) -> None:
    assert cells(table, "mine")["Prompt tokens"] == cells(table, "mine")["New tokens"] == "—"
    assert cells(table, "mine")["Calls"] == "1.00 ± 0.00"
    assert cells(table, "epog")["Calls"] == "—"
    assert cells(table, "gavel-full")["Prompt tokens"] != "—"


def test_recorded_seconds_are_said_to_be_recorded(table: Grid, records: list[EpisodeRecord]) -> None:
    assert any("answered from a recording" in note for note in table.notes)
    others = (EPOG, MINE)
    live = grids(results(file([r for r in records if r.contestant in others], others)), costs=True)[1]
    assert not any("recording" in note for note in live.notes)


def test_episodes_that_never_planned_are_left_out_and_failed_ones_are_not(records: list[EpisodeRecord]) -> None:
    mine = [r for r in records if r.contestant is REPLAY]
    crashed = EpisodeRecord(
        seed=0, instruction="i99", kind="single", scene="", text="", data="d0", code="", contestant=REPLAY,
        outcome="error",
    )  # fmt: skip
    assert any(not r.success for r in mine)
    assert costs([*mine, crashed], asks_model=True) == costs(mine, asks_model=True)
    assert costs(mine, asks_model=True).episodes == 20
    nothing = costs([crashed], asks_model=True)
    assert (nothing.calls, nothing.planning_s, nothing.episodes, dict(nothing.seconds)) == (None, None, 0, {})


def test_without_any_planning_there_is_no_table_of_costs(records: list[EpisodeRecord]) -> None:
    only = results(file([r for r in records if r.contestant is ORACLE], (ORACLE,)))
    assert len(grids(only, costs=True)) == 1


def test_stages_are_in_the_order_of_the_pipeline() -> None:
    assert in_order(["z", "order", "a", "plan", "order"]) == ("plan", "order", "a", "z")


def test_csv_holds_the_numbers_in_full(found: Results) -> None:
    lines = {line["agent"]: line for line in csv.DictReader(io.StringIO(to_csv(found, costs=True)))}
    for row in found.sections[0].rows:
        line = lines[row.contestant.agent]
        expected = {"prompt_tokens": row.costs.prompt_tokens, "completion_tokens": row.costs.completion_tokens}
        expected |= {f"{s}_s": row.costs.seconds.get(s) for s in ("understand", "plan", "repair", "order", "reflect")}
        for name, value in expected.items():
            assert line[name] == ("" if value is None else repr(value.mean))
            assert line[f"{name}_pm"] == ("" if value is None else repr(value.spread))
    assert to_csv(found) == "".join(
        ",".join(line.split(",")[: to_csv(found).split("\n")[0].count(",") + 1]) + "\n"
        for line in to_csv(found, costs=True).splitlines()
    )


@pytest.mark.parametrize("form", ["terminal", "markdown", "latex"])
def test_every_format_has_every_number(found: Results, table: Grid, form: str) -> None:
    text = render(found, form, costs=True)
    for row in table.rows:
        for cell in row[2:]:
            for part in cell.replace("—", "").split(" ± "):
                assert part in text


def test_the_command_shows_costs_of_stored_records(
    records: list[EpisodeRecord], found: Results, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "records.jsonl"
    with RecordWriter(path) as writer:
        writer.write(header())
        for record in records:
            writer.write(record)
    for form in FORMATS:
        assert main(["tables", str(path), "--costs", "--format", form]) == 0
        assert capsys.readouterr().out == render(found, form, costs=True)
