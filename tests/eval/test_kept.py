"""Studies of single parts keep what their parts came to, say how far they are, and go on with what is missing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eval.cli import main
from eval.studies import beliefs, cost_limits, cost_model
from eval.studies.beliefs import Score, evaluate_shipped
from eval.studies.cost_limits import Limits
from eval.studies.cost_model import Drive
from eval.studies.kept import Kept
from gavel_env.errors import DataError


class Asked:
    """Counts how often a part is made."""

    def __init__(self, result: Any) -> None:
        self.result, self.times = result, 0

    def __call__(self, *_: Any, fitted: Callable[[], object] = lambda: None, **options: Any) -> Any:
        self.times += 1
        fitted()
        options.get("measured", lambda: None)()
        return self.result


def test_a_part_is_made_once_and_again_for_other_choices(tmp_path: Path) -> None:
    file, made = tmp_path / "folder" / "parts.jsonl", Asked([("a", 1.5)])
    assert Kept(file, ("choice",)).get("one", list[tuple[str, float]], made) == [("a", 1.5)]
    with pytest.raises(DataError, match="--resume continues"):
        Kept(file, ("choice",))
    again = Kept(file, ("choice",), "resume")
    assert "one" in again
    assert again.get("one", list[tuple[str, float]], made) == [("a", 1.5)]
    assert made.times == 1
    assert "one" not in Kept(file, ("other",), "resume")
    assert "one" not in Kept(file, ("choice",), "fresh")
    assert (tmp_path / "folder" / "parts.1.jsonl").exists()


def test_a_torn_part_is_made_again_and_something_else_is_said(tmp_path: Path) -> None:
    file = tmp_path / "parts.jsonl"
    for part in ("one", "two"):
        Kept(file, (), "resume").get(part, int, lambda: 7)
    file.write_bytes(file.read_bytes()[:-5])
    torn = Kept(file, (), "resume")
    assert ("one" in torn, "two" in torn) == (True, False)
    assert torn.get("two", int, lambda: 8) == 8
    assert Kept(file, (), "resume").get("two", int, lambda: 9) == 8
    file.write_text('{"schema": "gavel-run/1"}\n')
    with pytest.raises(DataError, match="something else than results"):
        Kept(file, (), "resume")


def test_everything_into_one_folder_and_again_without_doing_it_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scores = evaluate_shipped()
    fitted, shipped = Asked(scores), Asked(scores)
    driven = Asked([Drive(f"i{n}", 2, 10.0 + n, 9.0 + n * n, 0.01) for n in range(5)])
    limited = Asked(Limits(3, 16, 8, 0.5, 0.6, -0.1, 0.4, 0.05, None))
    monkeypatch.setattr(beliefs, "evaluate", fitted)
    monkeypatch.setattr(beliefs, "evaluate_shipped", shipped)
    monkeypatch.setattr(cost_model, "drives", driven)
    monkeypatch.setattr(cost_limits, "limits", limited)
    command = ["eval", "all", "--sample", "2", "--format", "markdown", "--out", str(tmp_path)]
    assert main(command) == 0
    first = capsys.readouterr()
    for title in (
        "Experiment 1",
        "Experiment 2",
        "Experiment 3",
        "What caused them",
        "Location priors, 51 scenes, categories unseen (438 queries)",
        "Calibration curve",
        "Cost of the chosen order (carried)",
        "What can be asked of it: 3 instructions",
    ):
        assert title in first.out
    for folder in ("exp1", "exp2", "exp3"):
        assert (tmp_path / folder / "records.jsonl").exists()
    assert "gavel eval beliefs: " in first.err
    assert main([*command, "--resume"]) == 0
    assert capsys.readouterr().out == first.out
    assert (fitted.times, shipped.times, driven.times, limited.times) == (2, 1, 1, 1)
    assert main(command) == 2
    assert "--resume continues" in capsys.readouterr().err


def test_fits_are_counted_as_they_are_made(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    made: list[bool] = []

    def evaluate(*, unseen: bool = False, fitted: Callable[[], object], **_: Any) -> list[Score]:
        for _fit in range(beliefs.fits(unseen=unseen)):
            fitted()
        made.append(unseen)
        return evaluate_shipped()

    monkeypatch.setattr(beliefs, "evaluate", evaluate)
    assert main(["eval", "beliefs"]) == 0
    assert "gavel eval beliefs: 30/30 fits" in capsys.readouterr().err
    assert made == [False, True]
    assert main(["eval", "beliefs", "--quick", "--quiet"]) == 0
    assert capsys.readouterr().err == ""
