"""Scaling curves: the fitted exponent, and that curves can be measured and drawn."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eval.studies import scaling
from eval.studies.plots import fitted_exponent
from eval.studies.scaling import CURVES, Curve, main
from gavel_env.errors import NotInstalled


def test_the_exponent_is_that_of_the_power_law() -> None:
    sizes = [1.0, 10.0, 100.0, 1000.0]
    assert fitted_exponent(sizes, [3.0 * size**1.5 for size in sizes]) == pytest.approx((1.5, 3.0))
    assert fitted_exponent(sizes, [7.0] * 4) == pytest.approx((0.0, 7.0))


def test_points_are_printed_and_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    square = Curve("things", "work, s", lambda: iter([(2.0, 4.0), (1.0, 1.0), (4.0, 16.0)]))
    monkeypatch.setattr(scaling, "CURVES", (square,))
    assert main(["--json", str(tmp_path / "points.json")]) == 0
    assert "work, s against things: k = 2.00 (1: 1, 2: 4, 4: 16)" in capsys.readouterr().out
    [found] = json.loads((tmp_path / "points.json").read_text("utf-8"))
    assert found == {"size": "things", "cost": "work, s", "points": [[1, 1], [2, 4], [4, 16]]}
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        with pytest.raises(NotInstalled, match=r"gavel-env\[plots\]"):
            main(["--png", str(tmp_path / "curves.png")])
    else:
        assert main(["--png", str(tmp_path / "curves.png")]) == 0
        assert (tmp_path / "curves.png").stat().st_size > 5_000


def test_cost_against_objects_is_measured_in_growing_scenes() -> None:
    points = list(scaling._in_scenes(scaling._reset_ms, ("gates_bedroom", "Rs_int")))
    assert [size for size, _ in points] == [22.0, 63.0]
    assert all(0.0 < cost < 1000.0 for _, cost in points)


def test_memory_is_looked_at_while_episodes_are_played(capsys: pytest.CaptureFixture[str]) -> None:
    scaling.play(300)
    found = [tuple(map(float, line.split())) for line in capsys.readouterr().out.splitlines()]
    assert [episode for episode, _ in found] == [100.0, 300.0]
    assert 50.0 < found[0][1] <= found[1][1] < 20_000.0


def test_memory_is_looked_at_while_episodes_are_evaluated(capsys: pytest.CaptureFixture[str]) -> None:
    scaling.evaluate_many(120)
    [(episode, megabytes)] = [tuple(map(float, line.split())) for line in capsys.readouterr().out.splitlines()]
    assert episode == 100.0
    assert 50.0 < megabytes < 20_000.0


@pytest.mark.slow
def test_memory_is_flat_over_ten_thousand_evaluated_episodes() -> None:
    """The houses are loaded within the first thousand; two kilobytes kept of every later episode would be seen."""
    found = dict(scaling.memory_mb("evaluate_many"))
    assert list(found) == [100.0, 300.0, 1_000.0, 3_000.0, 10_000.0]
    assert found[10_000.0] - found[3_000.0] <= 12.0


@pytest.mark.slow
@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: curve.size)
def test_every_curve_can_be_measured(curve: Curve) -> None:
    points = list(curve.points())
    assert len(points) >= 3
    assert all(size > 0 and cost > 0 for size, cost in points)
