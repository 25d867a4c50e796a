"""The runner: every episode ends in a record, whoever crashes; workers change nothing."""

from __future__ import annotations

import itertools
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.timeless import timeless

from eval.records.journal import read_records
from eval.records.sampling import sample
from eval.records.schema import EpisodeRecord
from eval.report.formats import to_csv
from eval.report.tables import results
from eval.run.contestants import choose, compared_by_default, default_planners
from eval.run.episodes import EnvironmentSettings, simplified
from eval.run.runner import Schedule, contestant, run, schedule
from gavel_agents.llm.replay import ShippedRecording
from gavel_env.errors import BadOption, DataError, GavelError, UnknownAgent
from gavel_env.instructions.record import InstructionSet, read_instructions, shipped

PLUGIN = "tests.support.eval_agents"
SETTINGS = EnvironmentSettings(max_steps=40)


@pytest.fixture(scope="module")
def instructions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six certified single tasks, four with a sentence of odd length (where some of the test agents misbehave)."""
    records = read_instructions(shipped("single")).values()
    odd = [r for r in records if len(r.text) % 2 == 1][:4]
    even = [r for r in records if len(r.text) % 2 == 0][:2]
    path = tmp_path_factory.mktemp("instructions") / "six.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(r) + b"\n" for r in [odd[0], even[0], *odd[1:], even[1]]))
    return path


def scheduled(path: Path, *agents: str, seeds: tuple[int, ...] = (0,), limit: int | None = None) -> Schedule:
    who = [contestant(agent, SETTINGS) for agent in agents]
    return schedule(who, [read_instructions(path)], seeds, limit=limit, settings=SETTINGS, plugins=[PLUGIN])


def outcomes(path: Path) -> list[str]:
    return sorted(record.failure or "success" for record in read_records([path]).records.values())


@pytest.mark.parametrize(
    ("agent", "expected"),
    [
        ("teacher", {"success"}),
        ("crashing", {"error:ZeroDivisionError"}),
        ("clumsy", {"violation:hand_empty"}),
        ("circling", {"truncated"}),
        ("refusing", {"refused:unknown_word"}),
    ],
)
def test_what_an_agent_does_is_what_is_recorded(
    instructions: Path, tmp_path: Path, agent: str, expected: set[str]
) -> None:
    path = run(scheduled(instructions, agent), tmp_path)
    assert set(outcomes(path)) == expected
    assert len(outcomes(path)) == 6


def test_a_record_carries_the_whole_episode(instructions: Path, tmp_path: Path) -> None:
    path = run(scheduled(instructions, "teacher"), tmp_path)
    file = read_instructions(instructions)
    for record in read_records([path]).records.values():
        instruction = file[record.instruction]
        assert [step.action for step in record.steps] == [str(action) for action in instruction.reference_plan()]
        assert record.metres == pytest.approx(sum(step.metres for step in record.steps), abs=0.01)
        assert record.tasks_met == (True,)
        assert record.unmet == ()
        assert (record.scene, record.text, record.kind) == (instruction.scene, instruction.text, "single")
        assert record.contestant.privileged
        driven = [step for step in record.steps if step.metres > 0]
        assert driven
        for step in driven:
            points = np.array(step.route)
            assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(step.metres, rel=0.05, abs=0.1)
        routes = [step.route for step in driven]
        assert all(here[-1] == there[0] for here, there in itertools.pairwise(routes))


def test_an_unfinished_goal_and_a_left_open_door_are_told_apart(instructions: Path, tmp_path: Path) -> None:
    path = run(scheduled(instructions, "sloppy", "untidy"), tmp_path)
    for record in read_records([path]).records.values():
        if record.outcome == "unmet":
            assert record.unmet
            assert record.failure == "unmet:" + record.unmet[0].split("(")[0]
            assert record.tasks_met == (False,)
        elif record.outcome == "unsafe":
            assert not record.unmet
            assert record.unsafe
            assert record.tasks_met == (True,)
    found = {record.outcome for record in read_records([path]).records.values()}
    assert "unmet" in found


def test_a_crash_is_counted_with_its_trace_and_without_secrets(
    instructions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GAVEL_TEST_API_KEY", "very-secret-value")
    path = run(scheduled(instructions, "crashing", "teacher"), tmp_path)
    crashed = [r for r in read_records([path]).records.values() if r.outcome == "error"]
    assert len(crashed) == 6
    assert all("ZeroDivisionError" in r.error and "eval_agents.py" in r.error for r in crashed)
    assert all(len(r.steps) == 1 and r.trace.attempts == 2 for r in crashed)
    assert "very-secret-value" not in path.read_text()
    [section] = results(read_records([path])).sections
    assert [(row.scheduled, row.success.mean) for row in section.rows if row.success] == [(6, 0.0), (6, 100.0)]


def test_an_agent_that_exits_does_not_end_the_run(instructions: Path, tmp_path: Path) -> None:
    path = run(scheduled(instructions, "exiting"), tmp_path)
    assert outcomes(path) == ["error:SystemExit"] * 4 + ["success"] * 2


def test_a_worker_that_is_killed_is_counted_and_replaced(instructions: Path, tmp_path: Path) -> None:
    path = run(scheduled(instructions, "killed", limit=3), tmp_path, workers=2)
    assert outcomes(path) == ["error:worker_died"] * 2 + ["success"]
    died = [r for r in read_records([path]).records.values() if r.outcome == "error"]
    assert all("SIGKILL" in r.error for r in died)


def test_an_agent_that_hangs_times_out(instructions: Path, tmp_path: Path) -> None:
    path = run(scheduled(instructions, "hanging", "dawdling", limit=1), tmp_path, timeout_s=3.0)
    by_agent = {record.contestant.agent: record for record in read_records([path]).records.values()}
    assert {record.outcome for record in by_agent.values()} == {"timeout"}
    assert "process was ended" in by_agent["hanging"].error
    assert by_agent["dawdling"].steps
    assert not by_agent["dawdling"].error


def test_results_do_not_depend_on_workers_seeds_order_or_process(instructions: Path, tmp_path: Path) -> None:
    plan = scheduled(instructions, "lazy", "sloppy", seeds=(0, 1))
    alone = run(plan, tmp_path / "one", workers=1)
    together = run(plan, tmp_path / "three", workers=3)
    first, second = read_records([alone]), read_records([together])
    assert set(first.records) == set(second.records)
    assert len(first.records) == 24
    for key, record in first.records.items():
        assert timeless(record) == timeless(second.records[key])
    assert to_csv(results(first)) == to_csv(results(second))


def test_existing_records_are_refused_continued_or_set_aside(instructions: Path, tmp_path: Path) -> None:
    plan = scheduled(instructions, "lazy")
    path = run(plan, tmp_path)
    before = path.read_bytes()
    with pytest.raises(DataError, match="--resume"):
        run(plan, tmp_path)
    ran: list[EpisodeRecord] = []
    run(plan, tmp_path, existing="resume", report=ran.append)
    assert ran == []
    run(plan, tmp_path, existing="fresh", report=ran.append)
    assert len(ran) == 6
    assert (tmp_path / "records.1.jsonl").read_bytes().startswith(before)


def test_chosen_outcomes_are_run_again(instructions: Path, tmp_path: Path) -> None:
    plan = scheduled(instructions, "exiting", "lazy")
    path = run(plan, tmp_path)
    ran: list[EpisodeRecord] = []
    run(plan, tmp_path, existing="resume", retry=("error",), report=ran.append)
    assert {(record.contestant.agent, record.outcome) for record in ran} == {("exiting", "error")}
    assert len(ran) == 4
    assert len(read_records([path]).records) == 12


def test_other_data_planner_or_settings_are_other_episodes(instructions: Path, tmp_path: Path) -> None:
    script = tmp_path / "answers.jsonl"
    script.write_text('{"instruction_id": "x", "completions": ["a"]}\n')
    one = contestant("llm-only", SETTINGS, planner=f"scripted:{script}")
    assert contestant("llm-only", SETTINGS, planner=f"scripted:{script}") == one
    script.write_text('{"instruction_id": "x", "completions": ["b"]}\n')
    others = [
        contestant("llm-only", SETTINGS, planner=f"scripted:{script}"),
        contestant("llm-only", EnvironmentSettings(max_steps=41), planner=one.planner),
        contestant("sayplan", SETTINGS, planner=one.planner),
        contestant("llm-only", SETTINGS, planner=one.planner, prior="rsn"),
    ]
    assert len({one.config, *(other.config for other in others)}) == 5
    records = read_instructions(instructions)
    changed = InstructionSet(records.values(), (), "another stamp", records.source)
    assert schedule([one], [records]).benchmarks[0].data != schedule([one], [changed]).benchmarks[0].data


def test_rejected_lines_and_records_that_do_not_fit_are_counted(instructions: Path, tmp_path: Path) -> None:
    lines = instructions.read_bytes().splitlines(keepends=True)
    unfit = msgspec.json.decode(lines[1])
    unfit["id"] = "unfit"
    unfit["placements"][0]["target"] = "moon"
    path = tmp_path / "mixed.jsonl"
    path.write_bytes(lines[0] + b'{"id": "broken"\n' + msgspec.json.encode(unfit) + b"\n" + lines[2])
    found = run(scheduled(path, "teacher"), tmp_path / "out")
    assert outcomes(found) == ["rejected", "rejected", "success", "success"]
    records = {r.instruction: r for r in read_records([found]).records.values()}
    assert "mixed.jsonl:2" in records["line 2"].error
    assert "moon" in records["unfit"].error
    [section] = results(read_records([found])).sections
    assert section.instructions == 4
    assert section.rows[0].success is not None
    assert section.rows[0].success.mean == 50.0


def test_limit_and_kind_choose_instructions(instructions: Path) -> None:
    file = read_instructions(instructions)
    who = [contestant("teacher", SETTINGS)]
    assert schedule(who, [file], limit=2).benchmarks[0].instructions == tuple(file)[:2]
    drawn = schedule(who, [file], sampled=4).benchmarks[0].instructions
    assert len(drawn) == 4
    assert drawn == tuple(name for name in file if name in drawn)
    assert set(schedule(who, [file], sampled=2).benchmarks[0].instructions) < set(drawn)
    assert schedule(who, [file], sampled=99).benchmarks[0].instructions == tuple(file)
    with pytest.raises(DataError, match="multi"):
        schedule(who, [file], kinds=("multi",))


def test_a_planner_can_be_for_one_kind() -> None:
    one, other, epog = choose(["llm-only", "epog"], SETTINGS, planners=["multi=reference:multi", "reference:single"])
    assert (one.planner, one.kinds) == ("reference:multi", ("multi",))
    assert (other.planner, other.kinds) == ("reference:single", ())
    assert epog.planner == ""


def recorded(monkeypatch: pytest.MonkeyPatch, **samples: int | None) -> None:
    """Let shipped recordings be these: name -> size of the sample, None for whole ones."""
    agents = ("llm-only", "gavel-map", "gavel-full")
    index = {name: ShippedRecording("a model", "", name, agents, size) for name, size in samples.items()}
    monkeypatch.setattr("eval.run.contestants.shipped_recordings", lambda: index)


def test_without_a_planner_recordings_serve_or_reference_plans_where_only_order_is_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorded(monkeypatch, single=None)
    assert default_planners(("single", "multi")) == ("single=replay:single", "multi=reference:multi")
    agents = ["llm-only", "gavel-basic", "gavel-map", "epog", "oracle"]
    chosen = choose(agents, SETTINGS, planners=["multi=reference:multi", "single=replay:single"])
    kept = [(c.agent, c.planner) for c in filter(compared_by_default, chosen)]
    assert ("gavel-map", "reference:multi") in kept
    assert ("llm-only", "replay:single") in kept
    assert ("llm-only", "reference:multi") not in kept
    assert ("gavel-basic", "reference:multi") not in kept
    assert {"epog", "oracle"} <= {agent for agent, _ in kept}


def test_a_recording_of_a_sample_stands_beside_reference_plans_on_all(
    instructions: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded(monkeypatch, single=3)
    planners = default_planners(("single",))
    assert planners == ("single=replay:single", "single=reference:single")
    who = tuple(filter(compared_by_default, choose(["llm-only", "gavel-map", "oracle"], SETTINGS, planners=planners)))
    file = read_instructions(instructions)
    plan = schedule(who, [file])
    run_on: dict[tuple[str, str], list[str]] = {}
    for episode in plan.episodes(""):
        run_on.setdefault((episode.contestant.agent, episode.contestant.planner), []).append(episode.key.instruction)
    drawn = sample(file, 3)
    assert run_on == {
        ("llm-only", "replay:single"): drawn,
        ("gavel-map", "replay:single"): drawn,
        ("gavel-map", "reference:single"): list(file),
        ("oracle", ""): list(file),
    }
    assert sorted(plan.header({}).keys()) == sorted(episode.key for episode in plan.episodes(""))


@pytest.mark.parametrize("planner", ["replay:single", "single=replay:single"])
def test_a_planner_given_by_hand_is_bound_to_the_sample_of_its_recording(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded(monkeypatch, single=3)
    [one] = choose(["llm-only"], SETTINGS, planners=[planner])
    [other] = choose(["llm-only"], SETTINGS, planners=["reference:single"])
    assert (one.sample, other.sample) == (3, None)


@pytest.mark.parametrize(
    ("sampled", "limit", "whole", "bound"), [(2, None, 2, 2), (5, None, 5, 3), (None, 2, 2, 2), (None, 5, 5, 3)]
)
def test_a_smaller_choice_is_taken_from_the_sample(
    instructions: Path, sampled: int | None, limit: int | None, whole: int, bound: int
) -> None:
    file = read_instructions(instructions)
    some, every = contestant("lazy", SETTINGS, sampled=3), contestant("sloppy", SETTINGS)
    [benchmark] = schedule([some, every], [file], sampled=sampled, limit=limit).benchmarks
    assert len(benchmark.scheduled_for(every)) == whole
    assert len(benchmark.scheduled_for(some)) == bound
    assert set(benchmark.scheduled_for(some)) <= set(benchmark.scheduled_for(every)) & set(sample(file, 3))


def test_an_episode_is_the_same_one_within_a_sample_and_without(instructions: Path, tmp_path: Path) -> None:
    file = read_instructions(instructions)
    some, every = contestant("lazy", SETTINGS, sampled=2), contestant("lazy", SETTINGS)
    ran: list[EpisodeRecord] = []
    path = run(schedule([some], [file], settings=SETTINGS, plugins=[PLUGIN]), tmp_path, report=ran.append)
    assert {record.instruction for record in ran} == set(sample(file, 2))
    plan = schedule([every], [file], settings=SETTINGS, plugins=[PLUGIN])
    run(plan, tmp_path, existing="resume", report=ran.append)
    assert sorted(record.instruction for record in ran) == sorted(file)
    [section] = results(read_records([path])).sections
    assert [(row.scheduled, row.recorded) for row in section.rows] == [(6, 6)]


def test_unknown_agents_and_missing_planners_are_said_before_anything_runs(instructions: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownAgent, match="epog"):
        choose(["epogg"], SETTINGS)
    with pytest.raises(GavelError, match="--planner"):
        choose(["llm-only"], SETTINGS)
    plan = scheduled(instructions, "nobody")
    with pytest.raises(GavelError, match="nobody"):
        run(plan, tmp_path / "in-process")
    with pytest.raises(GavelError, match="nobody"):
        run(plan, tmp_path / "worker", workers=2)


@given(st.lists(st.sampled_from([(1, 0), (0, 1), (1, 1), (-1, 0), (0, -1)]), min_size=1, max_size=40))
def test_a_simplified_route_is_the_same_polyline(moves: list[tuple[int, int]]) -> None:
    points = np.cumsum(np.array([(0.05, 0.05), *(np.array(m) * 0.1 for m in moves)]), axis=0)
    short = np.array(simplified(points))
    assert tuple(short[0]) == pytest.approx(points[0])
    assert tuple(short[-1]) == pytest.approx(points[-1])
    length = np.hypot(*np.diff(points, axis=0).T).sum()
    assert np.hypot(*np.diff(short, axis=0).T).sum() == pytest.approx(length)
    kept = 1 + sum(a != b for a, b in itertools.pairwise(moves))
    assert len(short) == kept + 1


def test_a_method_that_orders_is_run_once_per_cost() -> None:
    agents = ["gavel-basic", "gavel-full", "gavel-plus", "oracle"]
    chosen = choose(agents, SETTINGS, planners=["reference:multi"], costs=["paper", "simulated"])
    assert [(one.agent, one.cost) for one in chosen] == [
        ("gavel-basic", ""),
        ("gavel-full", "paper"),
        ("gavel-full", "simulated"),
        ("gavel-plus", "simulated"),
        ("oracle", ""),
    ]
    with pytest.raises(BadOption, match="'paper', 'carried', 'simulated'"):
        choose(agents, SETTINGS, planners=["reference:multi"], costs=["cheap"])


def test_a_method_s_own_cost_leaves_its_stamp_as_it_was() -> None:
    def stamp(cost: str) -> str:
        return contestant("gavel-full", SETTINGS, planner="reference:multi", cost=cost).config

    assert stamp("") == stamp("carried")
    assert len({stamp("paper"), stamp("carried"), stamp("simulated")}) == 3


def test_scenes_of_every_size_are_run(tmp_path: Path) -> None:
    """house_single_floor shows more nodes than the environments' usual 512."""
    large = next(i for i in read_instructions(shipped("voices")).values() if i.scene == "house_single_floor")
    path = tmp_path / "large.jsonl"
    path.write_bytes(msgspec.json.encode(large))
    plan = schedule([contestant("oracle", SETTINGS, privileged=True)], [read_instructions(path)], settings=SETTINGS)
    assert outcomes(run(plan, tmp_path / "out")) == ["success"]
