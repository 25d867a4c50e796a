"""Records hold what a replay shows: where things were, what was believed, which literals became true."""

from __future__ import annotations

from pathlib import Path

import pytest

from eval import evaluate
from eval.records.schema import EpisodeRecord
from gavel_env.instructions.record import read_instructions, shipped

MULTI = read_instructions(shipped("multi"))
FEW = [MULTI["multi-Rs_int-00"], MULTI["multi-Ihlen_1_int-03"]]


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], EpisodeRecord]:
    out: Path = tmp_path_factory.mktemp("run")
    found = evaluate(["gavel-full", "oracle"], FEW, planner="reference:multi", out=out)
    return {(record.contestant.agent, record.instruction): record for record in found.records}


def test_literals_turn_true_and_end_as_judged(records: dict[tuple[str, str], EpisodeRecord]) -> None:
    for record in records.values():
        scenery = record.scenery
        assert scenery.goal == tuple(str(literal) for literal in MULTI[record.instruction].goal().literals)
        assert scenery.met[0] == (0, ())
        assert record.success
        assert scenery.met[-1][1] == tuple(range(len(scenery.goal)))
        steps = [step for step, _ in scenery.met]
        assert steps == sorted(set(steps))
        assert steps[-1] <= len(record.steps)


def test_movables_start_where_they_are_placed_and_the_robot_where_its_first_drive_begins(
    records: dict[tuple[str, str], EpisodeRecord],
) -> None:
    for record in records.values():
        assert len(record.scenery.things) == len(MULTI[record.instruction].placements)
        first = next(step for step in record.steps if step.route)
        assert record.scenery.start == pytest.approx(first.route[0])


def test_beliefs_are_distributions_that_lose_searched_rooms(records: dict[tuple[str, str], EpisodeRecord]) -> None:
    for (agent, _), record in records.items():
        beliefs = record.scenery.beliefs
        assert bool(beliefs) == (agent != "oracle")
        for step, _, rooms in beliefs:
            assert 0 <= step <= len(record.steps)
            assert sum(rooms.values()) == pytest.approx(1.0, abs=0.1) or rooms == {}
        first = {node: rooms for step, node, rooms in beliefs if step == 0}
        later = [(node, rooms) for step, node, rooms in beliefs if step and node in first]
        assert all(rooms != first[node] for node, rooms in later[:1])
        assert any(len(rooms) < len(first[node]) for node, rooms in later) or not later
