"""Tables: numbers recomputed independently, the scheduled denominator, and every format."""

from __future__ import annotations

import csv
import io
import itertools
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from eval.records.journal import RecordFile
from eval.records.sampling import sample
from eval.records.schema import Benchmark, Contestant, EpisodeKey, EpisodeRecord, RejectedLine, RunHeader
from eval.report.formats import FORMATS, render, terminal, to_csv
from eval.report.grid import Grid, grids
from eval.report.statistics import over_episodes, over_seeds, share_over_seeds, wilson
from eval.report.tables import Results, Row, results
from gavel_agents.agent import AgentTrace
from gavel_env.errors import UnknownAgent

ORACLE = Contestant("oracle", config="c-oracle", privileged=True)
EPOG = Contestant("epog", understanding="reference", prior="choice", config="c-epog")
LLM = Contestant("llm-only", "scripted:a.jsonl", "reference", "choice", "c-llm")
FULL = Contestant("gavel-full", "scripted:a.jsonl", "reference", "choice", "c-full")
ALL = (LLM, EPOG, FULL, ORACLE)
IDS = tuple(f"i{n}" for n in range(30))
SHARE = {"llm-only": 0.2, "epog": 0.6, "gavel-full": 0.9, "oracle": 1.0}


def benchmark(ids: tuple[str, ...] = IDS, kind: str = "multi", data: str = "d0", **fields: Any) -> Benchmark:
    return Benchmark(kind=kind, source="multi.jsonl", stamp="s0", data=data, instructions=ids, **fields)


def header(
    who: tuple[Contestant, ...] = ALL, benchmarks: tuple[Benchmark, ...] = (), seeds: tuple[int, ...] = (0, 1, 2)
) -> RunHeader:
    return RunHeader(
        started="", versions={}, code="abc", arguments={}, contestants=who, benchmarks=benchmarks or (benchmark(),),
        seeds=seeds, environment={"profile": "paper"},
    )  # fmt: skip


def record(who: Contestant, instruction: str, seed: int, outcome: str = "success", **fields: Any) -> EpisodeRecord:
    values: dict[str, Any] = {
        "failure": "" if outcome == "success" else f"{outcome}:x", "metres": 1.0, "kind": "multi", "data": "d0"
    }  # fmt: skip
    return EpisodeRecord(
        seed=seed, instruction=instruction, scene="Rs_int", text="", code="abc", contestant=who, outcome=outcome,
        **(values | fields),
    )  # fmt: skip


def made_up(who: tuple[Contestant, ...] = ALL, seeds: tuple[int, ...] = (0, 1, 2)) -> list[EpisodeRecord]:
    rng = np.random.default_rng(7)
    return [
        record(
            one,
            instruction,
            seed,
            "success" if rng.random() < SHARE[one.agent] else "unmet",
            metres=float(rng.uniform(20, 90)),
            trace=AgentTrace(
                attempts=int(rng.integers(1, 6)), seconds={"plan": float(rng.uniform(1, 9)), "order": 0.5}
            ),
        )
        for one, seed, instruction in itertools.product(who, seeds, IDS)
    ]


def file(records: list[EpisodeRecord], *headers: RunHeader) -> RecordFile:
    return RecordFile(headers or (header(),), {r.key: r for r in records}, ())


def rows(found: Results) -> dict[str, Row]:
    return {row.contestant.agent: row for section in found.sections for row in section.rows}


def frame(records: list[EpisodeRecord]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "agent": r.contestant.agent,
            "seed": r.seed,
            "instruction": r.instruction,
            "solved": r.outcome == "success",
            "metres": r.metres,
            "attempts": r.trace.attempts,
            "planning": sum(r.trace.seconds.values()),
        }
        for r in records
    )


def test_numbers_equal_an_independent_computation_with_pandas() -> None:
    records = made_up()
    data = frame(records)
    found = rows(results(file(records), compare=["epog", "gavel-full", "oracle"]))
    wide = data[data.agent != "llm-only"].pivot_table(index=["seed", "instruction"], columns="agent", values="solved")
    every = wide[wide.all(axis=1)].index
    assert len(every) > 20
    for agent, part in data.groupby("agent"):
        row = found[str(agent)]
        share = part.groupby("seed").solved.mean() * 100
        assert row.success is not None
        assert row.success.mean == pytest.approx(share.mean())
        assert row.success.spread == pytest.approx(share.std())
        metres = part[part.solved].groupby("seed").metres.mean()
        assert row.metres is not None
        assert row.metres[:2] == pytest.approx((metres.mean(), metres.std()))
        if agent == "llm-only":
            assert row.matched is None
        else:
            matched = part.set_index(["seed", "instruction"]).loc[every].groupby("seed").metres.mean()
            assert row.matched is not None
            assert row.matched[:2] == pytest.approx((matched.mean(), matched.std()))
        if agent == "oracle":
            assert row.planning_s is None
        else:
            assert row.planning_s is not None
            assert row.planning_s[:2] == pytest.approx((part.planning.mean(), part.planning.std()))
        if agent in ("llm-only", "gavel-full"):
            assert row.attempts is not None
            assert row.attempts[:2] == pytest.approx((part.attempts.mean(), part.attempts.std()))
        else:
            assert row.attempts is None
    full, oracle = found["gavel-full"], found["oracle"]
    assert full.matched is not None
    assert oracle.matched is not None
    assert full.regret == pytest.approx(full.matched.mean / oracle.matched.mean)
    assert oracle.regret == 1.0


def test_agents_below_half_are_not_matched_unless_asked_for() -> None:
    records = made_up()
    assert rows(results(file(records)))["llm-only"].matched is None
    asked = results(file(records), compare=["llm-only", "oracle"])
    assert rows(asked)["llm-only"].matched is not None
    data = frame(records)
    assert asked.sections[0].matched == int(data[(data.agent == "llm-only")].solved.sum())


def test_an_agent_to_compare_must_be_in_the_records() -> None:
    with pytest.raises(UnknownAgent, match="did you mean 'oracle'"):
        results(file(made_up()), compare=["orcale"])


def test_a_planner_for_one_kind_is_scheduled_for_that_kind_alone() -> None:
    only = msgspec.structs.replace(FULL, kinds=("single",))
    both = header((EPOG, only), (benchmark(), benchmark(kind="single")), (0,))
    assert len(both.keys()) == 3 * len(IDS)
    found = results(file([], both))
    assert [[row.contestant.agent for row in s.rows] for s in found.sections] == [["epog"], ["epog", "gavel-full"]]


def test_rows_on_a_sample_say_so_and_matched_metres_are_over_common_episodes() -> None:
    replay = Contestant("gavel-full", "replay:multi", "reference", "choice", "c-replay", sample=10)
    plans = Contestant("gavel-full", "reference:multi", "reference", "choice", "c-plans")
    drawn = sample(IDS, 10)
    records = [record(one, name, 0, metres=float(name[1:])) for one in (plans, ORACLE) for name in IDS]
    records += [record(replay, name, 0, metres=50.0) for name in drawn[:6]]
    records += [record(replay, name, 0, "unmet") for name in drawn[6:]]
    found = results(file(records, header((replay, plans, ORACLE), seeds=(0,))))
    shared, rest = found.sections
    assert [(section.part, section.instructions) for section in found.sections] == [("shared", 10), ("all", 30)]
    assert [[row.scheduled for row in section.rows] for section in found.sections] == [[10, 10, 10], [30, 30]]
    assert (shared.matched, rest.matched) == (6, 30)
    common = np.mean([float(name[1:]) for name in drawn[:6]])
    assert [row.matched.mean for row in shared.rows if row.matched] == [50.0, common, common]
    assert shared.rows[0].regret == pytest.approx(50.0 / common)
    first, second = grids(found)
    assert first.title.endswith("the 10 on which all rows were run")
    assert second.title.endswith("all 30")
    assert [row[1] for row in first.rows] == ["replay:multi", "reference:multi", "—"]
    notes = " ".join(first.notes)
    assert "replay:multi: a sample" in notes
    assert "6 episodes that all of these solved: gavel-full replay:multi, gavel-full ¶ reference:multi, or" in notes


def test_rows_on_the_same_episodes_are_one_table() -> None:
    assert all(not section.part for section in results(file(made_up())).sections)
    bound = msgspec.structs.replace(FULL, sample=10)
    few = benchmark(tuple(sample(IDS, 10)))
    assert [s.part for s in results(file([], header((bound, ORACLE), (few,)))).sections] == [""]


@pytest.mark.parametrize("width", [40, 60, 100, 200])
def test_a_wide_table_is_set_below_itself_and_no_word_is_broken(width: int) -> None:
    header_ = ("Failure", *(f"contestant-number-{n} reference:multi" for n in range(9)))
    grid = Grid("Title", (), header_, 1, (("violation:not_graspable", *("123456",) * 9),))
    text = terminal([grid], Results((), (), (), ()), width)
    words = text.split()
    assert words.count("123456") == 9
    assert words.count("violation:not_graspable") >= 1
    assert all(f"contestant-number-{n}" in words for n in range(9))


def test_the_names_of_models_are_in_the_header() -> None:
    records = [record(FULL, name, 0, model="some-8b") for name in IDS]
    [grid] = grids(results(file(records, header((FULL,), seeds=(0,)))))
    assert "model some-8b" in grid.facts


def test_order_of_records_does_not_matter() -> None:
    records = made_up()
    shuffled = [records[i] for i in np.random.default_rng(1).permutation(len(records))]
    assert to_csv(results(file(records))) == to_csv(results(file(shuffled)))


def test_the_denominator_is_what_was_scheduled() -> None:
    records = [record(EPOG, name, 0) for name in IDS[:6]] + [record(EPOG, IDS[6], 0, "error")]
    found = results(file(records, header((EPOG,), seeds=(0,))))
    row = rows(found)["epog"]
    assert (row.scheduled, row.recorded) == (30, 7)
    assert row.success is not None
    assert row.success.mean == pytest.approx(100 * 6 / 30)
    assert row.failures == {"not run": 23, "error:x": 1}
    text = render(found)
    assert "7 of 30" in text
    assert "INCOMPLETE: 23" in text
    assert "1 episodes ended in an error" in text


def test_rejected_lines_count_and_are_named() -> None:
    bench = benchmark(IDS[:3], rejected=(RejectedLine("line 4", "f.jsonl:4: malformed"),))
    records = [record(EPOG, name, 0) for name in IDS[:3]] + [record(EPOG, "line 4", 0, "rejected")]
    found = results(file(records, header((EPOG,), (bench,), (0,))))
    row = rows(found)["epog"]
    assert row.success is not None
    assert row.success.mean == 75.0
    assert "f.jsonl:4: malformed" in render(found)


def test_benchmarks_with_other_data_are_kept_apart() -> None:
    headers = (header((EPOG,), seeds=(0,)), header((EPOG,), (benchmark(data="d1"),), (0,)))
    records = [record(EPOG, name, 0) for name in IDS] + [record(EPOG, name, 0, "unmet", data="d1") for name in IDS]
    found = results(file(records, *headers))
    assert [s.rows[0].success.mean for s in found.sections if s.rows[0].success] == [100.0, 0.0]


def test_a_later_header_adds_to_the_schedule() -> None:
    headers = (header((EPOG,), seeds=(0,)), header((EPOG, ORACLE), seeds=(0, 1)))
    records = [record(one, name, seed) for one in (EPOG, ORACLE) for seed in (0, 1) for name in IDS]
    found = results(file(records, *headers))
    assert {agent: row.scheduled for agent, row in rows(found).items()} == {"epog": 60, "oracle": 60}


def test_records_without_a_header_are_their_own_schedule() -> None:
    records = [record(EPOG, name, 0) for name in IDS[:4]]
    found = results(RecordFile((), {r.key: r for r in records}, ()))
    assert rows(found)["epog"].scheduled == 4


def test_contestants_that_share_a_name_are_told_apart() -> None:
    other = Contestant("gavel-full", "scripted:b.jsonl", "reference", "choice", "c-other")
    twin = Contestant("gavel-full", "scripted:b.jsonl", "reference", "choice", "c-twin")
    for who, column in (((FULL, other), "Planner"), ((other, twin), "Settings")):
        records = [record(one, name, 0) for one in who for name in IDS]
        [grid] = grids(results(file(records, header(who, seeds=(0,)))))
        assert column in grid.header
        assert len({row[: grid.labels] for row in grid.rows}) == 2


def test_planners_that_are_no_language_model_and_privileged_agents_are_marked() -> None:
    simulated = Contestant("sayplan", "simulated:qwen3-8b", "reference", "choice", "c-sim")
    who = (LLM, simulated, EPOG, ORACLE)
    records = [record(one, name, 0) for one in who for name in IDS]
    [grid] = grids(results(file(records, header(who, seeds=(0,)))))
    assert [row[0] for row in grid.rows] == ["llm-only §", "sayplan ‡", "epog", "oracle †"]
    notes = "\n".join(grid.notes)
    assert "§ planner answers from a file" in notes
    assert "‡ simulated" in notes
    assert "† sees the hidden state" in notes


def test_undefined_cells_print_a_dash() -> None:
    records = [record(LLM, name, 0, "unmet") for name in IDS] + [record(ORACLE, name, 0) for name in IDS]
    [grid] = grids(results(file(records, header((LLM, ORACLE), seeds=(0,)))))
    row = dict(zip(grid.header, grid.rows[0], strict=True))
    assert row["Metres"] == "—"
    assert row["Success (%)"].startswith("0.0 [")


def test_one_seed_gives_an_interval_and_several_a_deviation() -> None:
    one = render(results(file(made_up(seeds=(0,)), header(seeds=(0,)))))
    many = render(results(file(made_up())))
    assert "95 % Wilson interval" in one
    assert "standard error over instructions" in one
    assert "sample standard deviation over seeds" in many
    assert "Wilson" not in many


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (10, 10), (41, 100), (1, 1), (199, 500)])
def test_the_wilson_interval_is_scipys(successes: int, trials: int) -> None:
    expected = binomtest(successes, trials).proportion_ci(method="wilson")
    assert wilson(successes, trials) == pytest.approx((expected.low, expected.high))


def test_estimates_of_nothing_are_undefined() -> None:
    assert over_seeds([[], []]) is None
    assert over_episodes([]) is None
    assert share_over_seeds([(0, 0)]) is None
    single = over_seeds([[3.0]])
    assert single is not None
    assert single[:2] == (3.0, None)
    skipped = over_seeds([[3.0], [], [5.0]])
    assert skipped is not None
    assert skipped[:2] == pytest.approx((4.0, 2**0.5))


def test_csv_holds_the_numbers_in_full() -> None:
    records = made_up()
    found = results(file(records))
    lines = list(csv.DictReader(io.StringIO(to_csv(found))))
    assert [line["agent"] for line in lines] == [one.agent for one in ALL]
    for line in lines:
        row = rows(found)[line["agent"]]
        assert row.success is not None
        assert row.metres is not None
        assert float(line["success_pct"]) == row.success.mean
        assert float(line["metres_pm"]) == row.metres.spread
        assert line["planning_s"] == ("" if row.planning_s is None else repr(row.planning_s.mean))


def test_every_format_has_every_cell() -> None:
    found = results(file(made_up()))
    [grid] = grids(found)
    for name in ("terminal", "markdown"):
        text = FORMATS[name]([grid], found)
        for cell in itertools.chain.from_iterable(grid.rows):
            assert cell in text
    markdown = render(found, "markdown")
    table = [line for line in markdown.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in table}) == 1
    assert len(table) == 2 + len(ALL)


def test_latex_is_escaped_and_balanced() -> None:
    odd = Contestant("my_agent 100%", "scripted:a_b.jsonl", "reference", "choice", "c-odd")
    records = [record(odd, name, 0) for name in IDS]
    text = render(results(file(records, header((odd,), seeds=(0,)))), "latex")
    assert r"my\_agent 100\%" in text
    assert "±" not in text
    assert "—" not in text
    assert text.count(r"\begin{") == text.count(r"\end{")
    body = text.split(r"\midrule")[1].split(r"\bottomrule")[0]
    header_line = text.split(r"\toprule")[1].split(r"\midrule")[0]
    assert body.count("&") == header_line.count("&")


def test_failures_add_up_to_what_was_not_solved() -> None:
    records = made_up()
    table = grids(results(file(records)), failures=True)[1]
    data = frame(records)
    unsolved = (~data.solved).groupby(data.agent).sum()
    by_agent = {name.split()[0]: i for i, name in enumerate(table.header)}
    for agent, count in unsolved.items():
        column = [int(row[by_agent[str(agent)]]) for row in table.rows]
        assert sum(column[:-1]) == count
        assert column[-1] == 90


def test_keys_are_the_product_of_the_schedule(tmp_path: Path) -> None:
    keys = header(seeds=(3, 4)).keys()
    assert len(keys) == len(set(keys)) == 4 * 2 * 30
    assert EpisodeKey("d0", "c-epog", "i5", 4) in keys
