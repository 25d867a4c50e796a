"""Whatever an agent that is not this package's does is its own episode's, and nobody else's."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from support.ray_nodes import RAY_WARNS

from eval.records.journal import read_records
from eval.records.schema import EpisodeRecord
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import import_plugins
from eval.run.runner import run, schedule
from gavel_env.instructions.record import read_instructions, shipped

pytestmark = pytest.mark.hostile

PLUGIN = "tests.hostile.foreign"
SETTINGS = EnvironmentSettings(options={"observation": "symbolic"})

ENDS: dict[str, str | tuple[str, ...]] = {
    "fair": ("unmet", "violation"),
    "peeking": "unmet",
    "numpy": ("unmet", "violation"),
    "scalar": "error:Unencodable",
    "exits": "error:SystemExit",
    "dies": "error:agent_died",
    "interrupts": "error:KeyboardInterrupt",
    "cancels": "error:CancelledError",
    "stops": "error:Stop",
    "moves": "unmet",
    "prints": ("unmet", "violation"),
    "lingers": "unmet",
    "answers": "error:TypeError",
    "unpicklable": "error:Unencodable",
    "recursive": "error:RecursionError",
    "surrogate": "error:ValueError",
    "constructor": "error:ZeroDivisionError",
    "nan": "error:Unencodable",
    "untraced": ("unmet", "error:AttributeError"),
    "changes": "error:AttributeError",
}


@pytest.fixture(scope="module", params=["local", pytest.param("ray", marks=[pytest.mark.slow, RAY_WARNS])])
def where(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the options of `run` for worker processes here and for a Ray cluster."""
    if request.param == "local":
        return {}
    return {"executor": "ray", "address": request.getfixturevalue("cluster").address}


@pytest.fixture(scope="module")
def records(where: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[EpisodeRecord]]:
    """Run every agent of the list, and the oracle among them, over the same two instructions."""
    import_plugins([PLUGIN])  # registers agents

    names = tuple(ENDS)
    out = tmp_path_factory.mktemp("run")
    before = os.getcwd()
    plan = schedule(
        choose([*names, "oracle"], SETTINGS, understanding="reference"),
        [read_instructions(shipped("single"))],
        limit=2,
        settings=SETTINGS,
        plugins=[PLUGIN],
    )
    path = run(plan, out, **where)
    assert os.getcwd() == before
    found: dict[str, list[EpisodeRecord]] = {}
    for record in read_records([path]).records.values():
        found.setdefault(record.contestant.agent, []).append(record)
    return found


@pytest.mark.parametrize("name", ENDS)
def test_every_misdeed_is_a_record_of_its_own_episode(records: dict[str, list[EpisodeRecord]], name: str) -> None:
    assert [record.failure.startswith(ENDS[name]) for record in records[name]] == [True, True], records[name]


def test_the_oracle_beside_them_succeeds(records: dict[str, list[EpisodeRecord]]) -> None:
    assert [record.outcome for record in records["oracle"]] == ["success", "success"]


def test_nothing_hidden_is_in_the_process_of_an_agent(records: dict[str, list[EpisodeRecord]]) -> None:
    assert [record.trace.stopped for record in records["peeking"]] == ["found []"] * 2


def test_an_agent_drives_and_leaves_its_trace(records: dict[str, list[EpisodeRecord]]) -> None:
    for record in [*records["fair"], *records["numpy"]]:
        assert record.trace.attempts == 1
        assert len(record.steps) == 1


def test_what_agents_print_is_no_part_of_the_output(
    where: dict[str, Any], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    import_plugins([PLUGIN])  # registers agents

    plan = schedule(
        choose(["prints"], SETTINGS),
        [read_instructions(shipped("single"))],
        limit=1,
        settings=SETTINGS,
        plugins=[PLUGIN],
    )
    run(plan, tmp_path, **where)
    said = capfd.readouterr()
    assert said.out == ""
    assert ("agent,of,doom" in said.err) == (not where)  # a cluster keeps it in its own logs
