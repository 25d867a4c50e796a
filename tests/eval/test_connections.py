"""Many calls at once, one answer per call, limits that stop a run cleanly, and endpoints that go away."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec
import pytest
from support.plan_server import PlanServer, plan_server
from support.timeless import timeless

from eval.cli import main
from eval.records.journal import RecordFile, read_records
from eval.records.schema import EpisodeKey, EpisodeRecord, Usage
from eval.report.formats import to_csv
from eval.report.tables import results
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.limits import Limits
from eval.run.planners import default_connections
from eval.run.rig import import_plugins
from eval.run.runner import Schedule, run, schedule
from gavel_agents.llm import Completion, Message, Prompt
from gavel_agents.llm.sharing import SharingModel
from gavel_env.errors import DataError, EndpointError, RunStopped
from gavel_env.instructions.record import InstructionSet, read_instructions, shipped

SETTINGS = EnvironmentSettings()
AGENTS = ["llm-only", "sayplan", "gavel-full", "epog", "asking"]
PLUGIN = "tests.support.eval_agents"


@pytest.fixture(scope="module")
def few() -> InstructionSet:
    records = list(read_instructions(shipped("single")).values())[:4]
    return InstructionSet(records, (), "a stamp", "four.jsonl")


def planned(few: InstructionSet, server: PlanServer, agents: list[str] = AGENTS) -> Schedule:
    import_plugins([PLUGIN])  # registers `asking`

    contestants = choose(agents, SETTINGS, planners=[f"openai:m@{server.url}"])
    return schedule(contestants, [few], settings=SETTINGS, plugins=[PLUGIN])


def compared(file: RecordFile) -> dict[EpisodeKey, EpisodeRecord]:
    """Return records without who of those that asked the same was the one that really asked."""
    return {key: msgspec.structs.replace(timeless(record), usage=Usage()) for key, record in file.records.items()}


def test_records_do_not_depend_on_connections_or_workers(few: InstructionSet, tmp_path: Path) -> None:
    found = []
    with plan_server(few.values(), latency_s=0.02) as server:
        plan = planned(few, server)
        for name, options in {"one": (1, 1), "eight": (8, 1), "processes": (4, 2)}.items():
            connections, workers = options
            path = run(plan, tmp_path / name, connections=connections, workers=workers)
            found.append(read_records([path]))
    first, *others = found
    assert len(first.records) == len(AGENTS) * len(few)
    assert all(record.outcome == "success" for record in first.records.values() if record.contestant.planner)
    for other in others:
        assert compared(other) == compared(first)


def test_as_many_calls_are_under_way_as_there_are_connections(few: InstructionSet, tmp_path: Path) -> None:
    with plan_server(few.values(), latency_s=0.3) as server:
        run(planned(few, server), tmp_path, connections=3)
        assert server.most == 3
        # The first plans are the same for all methods, own agents ask the same as well: one call each, and the check.
        assert server.calls == len(few) + 1


def test_no_episode_reads_the_metadata_of_installed_packages(
    few: InstructionSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That takes a millisecond, for which many threads wait one after the other."""
    reads: list[object] = []
    real = metadata.entry_points

    def reading(**chosen: Any) -> Any:
        reads.append(chosen)
        return real(**chosen)

    monkeypatch.setattr(metadata, "entry_points", reading)
    plan = schedule(choose(["epog", "oracle"], SETTINGS), [few])
    reads.clear()
    assert len(read_records([run(plan, tmp_path)]).records) == 2 * len(few)
    assert len(reads) <= 2, "once per process, not once per episode"


def test_what_was_asked_is_counted_once(few: InstructionSet, tmp_path: Path) -> None:
    with plan_server(few.values()) as server:
        path = run(planned(few, server), tmp_path)
    records = read_records([path]).records.values()
    assert sum(record.usage.calls for record in records) == len(few)
    assert sum(record.usage.prompt_tokens for record in records) == 100 * len(few)
    for record in records:
        assert len(record.calls) == (1 if record.contestant.planner else 0)


@pytest.mark.parametrize(
    ("limit", "calls"), [(Limits(max_calls=2), 2), (Limits(max_tokens=301), 3), (Limits(max_calls=4), 4)]
)
def test_a_limit_stops_cleanly_and_the_run_goes_on(
    few: InstructionSet, tmp_path: Path, limit: Limits, calls: int
) -> None:
    with plan_server(few.values()) as server:
        whole = run(planned(few, server, ["llm-only"]), tmp_path / "whole")
        server.calls = 0
        with pytest.raises(RunStopped, match="--max-"):
            run(planned(few, server, ["llm-only"]), tmp_path / "limited", limits=limit, connections=1)
        assert server.calls == calls + 1
        assert len(read_records([tmp_path / "limited"]).records) == calls
        path = run(planned(few, server, ["llm-only"]), tmp_path / "limited", existing="resume")
    assert to_csv(results(read_records([path]))).count("\n") == to_csv(results(read_records([whole]))).count("\n")
    assert compared(read_records([path])) == compared(read_records([whole]))


def test_a_limit_of_cost_needs_a_price(few: InstructionSet, tmp_path: Path) -> None:
    with plan_server(few.values()) as server, pytest.raises(DataError, match=r"no price of model 'm'.*--prices"):
        run(planned(few, server), tmp_path, limits=Limits(max_cost=1.0))
    prices = tmp_path / "prices.json"
    prices.write_text('{"models": {"m": {"prompt": 10000, "completion": 10000}}}')
    with plan_server(few.values()) as server:
        spec = ["--planner", f"openai:m@{server.url}", "--agents", "llm-only", "--kind", "single", "--sample", "5"]
        options = ["--max-cost", "2", "--prices", str(prices), "--connections", "1", "--quiet", "--costs"]
        assert main(["eval", *spec, *options, "--out", str(tmp_path / "out")]) == 1
    assert len(read_records([tmp_path / "out"]).records) == 2


def test_an_endpoint_that_does_not_answer_is_said_before_anything_runs(few: InstructionSet, tmp_path: Path) -> None:
    with plan_server(few.values(), dies_after=0) as server:
        with pytest.raises(EndpointError, match="rejected"):
            run(planned(few, server), tmp_path)
        assert server.calls == 1
    assert not (tmp_path / "records.jsonl").exists()


@pytest.mark.parametrize("connections", [1, 4])
def test_an_endpoint_that_goes_away_ends_the_run_and_resuming_completes_it(
    tmp_path: Path, connections: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with plan_server(read_instructions(shipped("single")).values(), dies_after=4) as server:
        spec = ["eval", "--planner", f"openai:m@{server.url}", "--agents", "llm-only,gavel-full", "--kind", "single"]
        options = ["--sample", "12", "--connections", str(connections), "--format", "csv", "--quiet"]
        assert main([*spec, *options, "--out", str(tmp_path)]) == 1
        shown = capsys.readouterr()
        assert "5 episodes in a row failed to reach the model" in shown.err
        assert f"--out {tmp_path} --resume" in shown.err
        done = read_records([tmp_path]).records
        assert {record.outcome for record in done.values()} == {"success"}
        assert len(done) == 6 if connections == 1 else 1 <= len(done) <= 6  # which calls were under way is chance
        server.dies_after = None
        assert main([*spec, *options, "--out", str(tmp_path), "--resume"]) == 0
    records = read_records([tmp_path]).records
    assert len(records) == 24
    assert {record.outcome for record in records.values()} == {"success"}


def test_connections_are_several_only_for_servers() -> None:
    assert default_connections(["openai:m", "reference:single"]) == 8
    assert default_connections(["hf:m", "openai:m"]) == 1
    assert default_connections(["replay:single"]) == 1
    assert default_connections([]) == 1


class Flaky:
    """Fails at the first call, and answers with how often it was asked then."""

    name, decoding = "flaky", {"temperature": 0.0}

    def __init__(self) -> None:
        self.calls = 0
        self.begun, self.go = threading.Event(), threading.Event()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.calls += 1
        self.begun.set()
        if self.calls == 1:
            self.go.wait(30)
            raise EndpointError("gone")
        return [Completion(str(self.calls)) for _ in prompts]


def test_who_waits_for_an_answer_that_does_not_come_asks_again() -> None:
    model = Flaky()
    sharing = SharingModel(model, 2)
    prompt = Prompt((Message("user", "hello"),))
    came: list[object] = []

    def ask() -> None:
        try:
            came.append(sharing.complete([prompt])[0].text)
        except EndpointError:
            came.append("error")

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
        model.begun.wait(30)
    model.go.set()
    for thread in threads:
        thread.join(30)
    assert sorted(map(str, came)) == ["2", "2", "error"]
    assert model.calls == 2
