"""Figures of a run: what the records can show is drawn, the same each time; without matplotlib that is said."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from eval import evaluate
from eval.cli import main
from eval.records.journal import read_records
from eval.report.figures import FIGURES, figures
from eval.report.tables import results
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import contestant, schedule
from eval.run.runner import run as execute
from gavel_env.errors import NotInstalled
from gavel_env.instructions.record import read_instructions, shipped


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out: Path = tmp_path_factory.mktemp("run")
    few = list(read_instructions(shipped("multi")).values())[:16]
    evaluate(["gavel-map", "gavel-full", "oracle"], few, planner="reference:multi", out=out)
    return out


def test_everything_that_can_be_shown_is_drawn(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    for folder in ("once", "again"):
        assert main(["figures", str(run), "--out", str(tmp_path / folder)]) == 0
    names = {path.stem for path in (tmp_path / "once").iterdir()}
    # One call per episode: nothing to show of attempts.
    assert names == {f"multi-{name}" for name in FIGURES if name != "attempts"}
    for path in (tmp_path / "once").glob("*.png"):
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()
    assert "multi-metres.svg" in capsys.readouterr().out


def test_rows_over_other_instructions_have_figures_of_their_own(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    few = read_instructions(shipped("multi"))
    settings = EnvironmentSettings()
    sampled = contestant("gavel-full", settings, planner="reference:multi", understanding="reference", sampled=3)
    plan = schedule([sampled, *choose(["epog", "oracle"], settings)], [few], limit=6, settings=settings)
    files = read_records([execute(plan, tmp_path)])
    drawn = dict(figures(files))
    assert {"multi-shared-success", "multi-all-success"} <= set(drawn)
    bars = {name: [t.get_text() for t in drawing.axes[0].get_yticklabels()] for name, drawing in drawn.items()}
    assert len(bars["multi-shared-success"]) == 3
    assert len(bars["multi-all-success"]) == 2
    assert [len(section.rows) for section in results(files).sections] == [3, 2]


def test_without_the_extra_it_says_what_to_install(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    with pytest.raises(NotInstalled, match=r"gavel-env\[plots\]"):
        next(iter(figures(read_records([run]))))
