"""What `gavel eval cost-model` measures: fits recomputed, orders really driven, worlds like the real one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eval.cli import main
from eval.studies.cost_limits import limits, reordered
from eval.studies.cost_model import Drive, drives, fits
from gavel_agents.ordering.cost import TravelModel, travel_model
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.world_model.actions import parse_action

MULTI = read_instructions(shipped("multi"))
FEW = {name: MULTI[name] for name in list(MULTI)[:6]}


def test_fits_are_those_of_the_drives() -> None:
    found = [Drive(str(i), 2 + i % 2, float(e), float(d), 0.001) for i, (e, d) in enumerate(
        [(10, 8), (20, 15), (30, 33), (25, 20), (12, 16), (40, 31), (7, 9)])]  # fmt: skip
    by_tasks = {fit.tasks: fit for fit in fits(found)}
    assert list(by_tasks) == [2, 3, None]
    every = by_tasks[None]
    expected, driven = np.array([(d.expected_m, d.driven_m) for d in found]).T
    slope, _ = np.polyfit(expected, driven, 1)
    assert every.slope == pytest.approx(slope)
    assert every.r_squared == pytest.approx(np.corrcoef(expected, driven)[0, 1] ** 2)
    assert every.bias == pytest.approx(expected.mean() / driven.mean() - 1.0)


def test_a_reordered_instruction_is_the_same_tasks_in_another_order() -> None:
    instruction = next(i for i in MULTI.values() if len(i.tasks) == 4)
    other = reordered(instruction, (2, 0, 3, 1))
    assert [task.text for task in other.tasks] == [instruction.tasks[i].text for i in (2, 0, 3, 1)]
    assert other.meta["targets"] == [instruction.meta["targets"][i] for i in (2, 0, 3, 1)]
    assert other.placements == instruction.placements
    assert reordered(other, (1, 3, 0, 2)) == instruction


def test_limits_of_a_few_instructions() -> None:
    by_j = limits(FEW, count=5, worlds=3, orders=4)
    assert by_j.instructions == 5
    assert by_j.ceiling_r_squared is not None
    assert 0.0 <= by_j.ceiling_r_squared <= 1.0
    assert by_j.ceiling_bias is not None
    assert abs(by_j.ceiling_bias) < 0.6
    assert by_j.sequential_r_squared is not None
    assert by_j.sequential_r_squared > 0.9
    assert by_j == limits(FEW, count=5, worlds=3, orders=4)
    simulated = limits(FEW, cost="simulated", count=5, worlds=3, orders=4)
    assert simulated.sequential_r_squared is None
    assert simulated.rank_correlation != by_j.rank_correlation


def _file(folder: Path, step: int) -> str:
    path = folder / "some.jsonl"
    lines = Path(str(shipped("multi"))).read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join(lines[::step]), encoding="utf-8")
    return str(path)


def test_simulated_metres_are_hardly_biased_and_j_is(tmp_path: Path) -> None:
    by_cost = {}
    for cost in ("paper", "carried", "simulated"):
        [every] = [fit for fit in fits(list(drives(_file(tmp_path, 20), cost=cost))) if fit.tasks is None]
        by_cost[cost] = every
    assert by_cost["paper"].bias > by_cost["carried"].bias > 0.3
    assert abs(by_cost["simulated"].bias) < 0.15
    assert by_cost["simulated"].r_squared > 0.5


def test_the_paper_s_cost_is_its_formula() -> None:
    layout = known_layout(load_scene("Rs_int"))
    printed, carried = travel_model(layout, "paper"), travel_model(layout, "carried")
    assert isinstance(printed, TravelModel)
    assert printed.search_m == pytest.approx([layout.traversable_m2(room) / 1.2 for room in printed.rooms])
    assert printed.found_fraction == 0.5
    alike = np.full(len(printed.rooms), 1.0 / len(printed.rooms))
    beliefs = {"a": alike, "b": alike}
    plan = [parse_action("NAVIGATE_TO(a)"), parse_action("NAVIGATE_TO(b)")]
    both = printed.rollout(plan, printed.at(layout.start), beliefs, {})
    first = printed.search_cost(printed.at(layout.start), alike)
    second = printed.search_cost(printed.among(alike), alike)
    assert both.metres == pytest.approx(first + second)
    assert not both.searched.any()
    narrow = travel_model(layout, "carried", 1.2).rollout(plan, carried.at(layout.start), beliefs, {})
    assert narrow.metres < both.metres


def test_the_command_prints_every_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    command = ["eval", "cost-model", "--instructions", _file(tmp_path, 80)]
    assert main([*command, "--sample", "3", "--cost", "paper"]) == 0
    printed = capsys.readouterr().out
    for words in ("(paper)", "bias", "slope", "worlds drawn", "rank correlation", "whole order", "0.93 at N = 4"):
        assert words in printed
    with pytest.raises(SystemExit):
        main([*command, "--sample", "some"])
