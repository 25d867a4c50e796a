"""Runs, workers and recordings that are killed at any moment: nothing is lost, and going on ends in the same."""

from __future__ import annotations

import contextlib
import itertools
import json
import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

import msgspec
import pytest
from support.hostile import times
from support.killed import Commands, Moment
from support.timeless import timeless, timeless_csv

from eval.records.conversations import read_conversations
from eval.records.journal import read_records
from eval.records.schema import EpisodeKey, EpisodeRecord, Usage
from eval.report.formats import to_csv
from eval.report.tables import results
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import import_plugins
from eval.run.runner import run, schedule
from gavel_agents.llm.replay import Recorded, ReplayModel, read_recording
from gavel_env.errors import WorkerFailed
from gavel_env.instructions.record import read_instructions, shipped

pytestmark = pytest.mark.hostile

ROOT = Path(__file__).parents[2]
PLUGIN = "tests.support.eval_agents"
PLANNER = "simulated:qwen3-8b"
AGENTS = ("lazy", "asking", "gavel-full")
"""One that runs beside the runner, one in a process of its own that asks a model, one of the methods."""

IN_A_ROW = times(2, 5)
"""Kills, before a run may go on to its end."""


INSTRUCTIONS = times(2, 5)

T = TypeVar("T")


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few instructions."""
    records = list(read_instructions(shipped("single")).values())[:INSTRUCTIONS]
    path = tmp_path_factory.mktemp("instructions") / "few.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(record) + b"\n" for record in records))
    return path


@pytest.fixture(scope="module")
def commands() -> Iterator[Commands]:
    with Commands() as running:
        yield running


def to_its_end(
    commands: Commands, *arguments: str, at: Literal["event", "write"] = "write"
) -> tuple[str, dict[str, int]]:
    """Run a command; return what it printed, and how many moments it had (events only if asked for)."""
    done = commands.run(Moment(at, 0), *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout, json.loads(done.stderr.splitlines()[-1])


def moments(seed: int, counted: dict[str, int]) -> Iterator[Moment]:
    """Yield moments without end, in turn within a write and at an event; most are early, as what is left is short."""
    drawn = random.Random(seed)
    while True:
        yield Moment("write", 1 + int(counted["write"] * drawn.random() ** 3), drawn.random())
        yield Moment("event", 1 + int(counted["event"] * drawn.random() ** 3))


def written(out: Path) -> dict[EpisodeKey, EpisodeRecord]:
    """Return the records of a run, of which nothing but the last line may be torn."""
    path = out / "records.jsonl"
    if not path.exists() or b"\n" not in path.read_bytes():
        return {}
    file = read_records([path])
    assert all(reason.endswith("torn last line") for reason in file.damaged)
    return {
        # Who of several really asked is chance; and somebody may commit while this runs.
        key: msgspec.structs.replace(timeless(record), usage=Usage(), code="")
        for key, record in file.records.items()
    }


def kill(
    commands: Commands, command: Sequence[str], at: Iterable[Moment], read: Callable[[], Mapping[T, object]]
) -> int:
    """Kill a command at each moment, until it comes to its end; return how often. What was read stays to be read."""
    kills = 0
    for moment in at:
        before = read()
        done = commands.run(moment, *command)
        if done.returncode == 0:
            break
        assert done.returncode == -signal.SIGKILL, (moment, done.stderr)
        kills += 1
        after = read()
        assert {key: after.get(key) for key in before} == before, moment
    return kills


def test_a_run_killed_at_any_moment_goes_on_to_the_same_table(few: Path, commands: Commands, tmp_path: Path) -> None:
    command = [
        "eval", "--plugin", PLUGIN, "--agents", ",".join(AGENTS), "--planner", PLANNER, "--instructions", str(few),
        "--format", "csv", "--quiet",
    ]  # fmt: skip
    how = (["--workers", "1"], ["--workers", "2"], ["--connections", "3"])
    table, counted = to_its_end(commands, *command, "--out", str(tmp_path / "whole"), at="event")
    expected = written(tmp_path / "whole")
    assert len(expected) == 3 * INSTRUCTIONS
    at = moments(86, counted)
    kills = 0
    for series in itertools.count():
        if kills >= times(2, 86):
            break
        out = tmp_path / str(series)
        here = [*command, *how[series % len(how)], "--out", str(out), "--resume"]
        kills += kill(commands, here, itertools.islice(at, IN_A_ROW), partial(written, out))
        assert timeless_csv(to_its_end(commands, *here)[0]) == timeless_csv(table)
        assert written(out) == expected
        said = read_conversations([out])
        assert not said.damaged
        calls = [call for record in expected.values() for call in record.calls]
        assert calls
        assert all(said.get(call) for call in calls)


def test_killed_workers_cost_the_episodes_that_they_had_begun(few: Path, tmp_path: Path) -> None:
    import_plugins([PLUGIN])
    settings = EnvironmentSettings()
    contestants = choose(AGENTS, settings, planners=[PLANNER])
    seeds = range(times(1, 2))
    plan = schedule(contestants, [read_instructions(few)], seeds, settings=settings, plugins=[PLUGIN])
    table = to_csv(results(read_records([run(plan, tmp_path / "whole")])))
    expected = written(tmp_path / "whole")
    drawn = random.Random(63)
    kills = 0

    def kill_one(_: EpisodeRecord) -> None:
        nonlocal kills
        workers = sorted(multiprocessing.active_children(), key=lambda worker: worker.pid or 0)
        if workers and kills < times(1, 63) and drawn.random() < 0.3:
            time.sleep(0.02 * drawn.random())  # somewhere in the next episode, or between two
            os.kill(drawn.choice(workers).pid or 0, signal.SIGKILL)
            kills += 1

    for series in itertools.count():
        if kills >= times(1, 63):
            break
        out, before = tmp_path / str(series), kills
        while written(out).keys() != expected.keys():
            with contextlib.suppress(WorkerFailed):  # three of them in a row while they started
                run(plan, out, existing="resume", workers=2, connections=(2, 6)[series % 2], report=kill_one)
        found = written(out)
        died = {key for key, record in found.items() if record.failure == "error:worker_died"}
        assert len(died) <= kills - before
        assert all(found[key] == expected[key] for key in found.keys() - died)
        path = run(plan, out, existing="resume", retry=("error",))
        assert written(out) == expected
        assert timeless_csv(to_csv(results(read_records([path])))) == timeless_csv(table)


def recorded(path: Path) -> dict[str, Recorded]:
    """Return the completions of a recording that may be torn at its end."""
    if not path.exists():
        return {}
    return {one.key: msgspec.structs.replace(one, seconds=0.0) for one in read_recording(path)}


def test_a_recording_killed_at_any_moment_goes_on_to_the_same(few: Path, commands: Commands, tmp_path: Path) -> None:
    command = [
        "record", "--planner", PLANNER, "--agents", "llm-only,gavel-full", "--seeds", "0,1,2", "--instructions",
        str(few), "--out",
    ]  # fmt: skip
    whole = tmp_path / "whole.jsonl.gz"
    _, counted = to_its_end(commands, *command, str(whole), at="event")
    expected = recorded(whole)
    assert len(expected) == 3 * INSTRUCTIONS
    at = moments(38, counted)
    kills = 0
    for series in itertools.count():
        if kills >= times(1, 38):
            break
        path = tmp_path / f"{series}.jsonl.gz"
        here = [*command, str(path)]
        kills += kill(commands, here, itertools.islice(at, times(1, 5)), partial(recorded, path))
        to_its_end(commands, *here)
        assert recorded(path) == expected
        assert ReplayModel(str(path)).name == ReplayModel(str(whole)).name
