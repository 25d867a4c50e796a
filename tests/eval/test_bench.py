"""The bench: what counts as met, and that its lines can be measured."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from eval.studies.bench import MEASUREMENTS, Measurement, NotInstalled, main, measure
from gavel_env.errors import DataError


def test_times_are_to_be_at_most_and_rates_at_least() -> None:
    def two_milliseconds() -> Iterator[float]:
        yield from (0.001, 0.002, 0.9)

    def measured(unit: str, target: float | None) -> tuple[float | None, bool | None]:
        found = measure(Measurement("x", unit, target, two_milliseconds))
        return found.value, found.met

    assert measured("ms", 3.0) == (2.0, True)
    assert measured("ms", 1.0) == (2.0, False)
    assert measured("µs", 3000.0) == (2000.0, True)
    assert measured("/s", 400.0) == (500.0, True)
    assert measured("/s", 600.0) == (500.0, False)
    assert measured("s", None) == (0.002, None)


def test_what_cannot_be_measured_says_why() -> None:
    def missing() -> float:
        raise NotInstalled("minigrid is not installed")

    def nothing() -> Iterator[float]:
        yield missing()

    found = measure(Measurement("x", "ms", 1.0, nothing))
    assert (found.value, found.met, found.note) == (None, None, "minigrid is not installed")


def test_ratios_are_to_be_at_least() -> None:
    found = measure(Measurement("x", "×", 5.0, lambda: iter((4.0, 6.0, 7.0))))
    assert (found.value, found.met) == (6.0, True)


def test_a_chosen_line_is_printed_as_json_and_compared_with_the_run_before(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    last = tmp_path / "runs" / "bench.json"
    assert main(["--only", "validate", "--json", "--last", str(last)]) == 0
    [line] = json.loads(capsys.readouterr().out)
    assert line["samples"] > 10
    assert line["value"] > 0
    assert json.loads(last.read_text("utf-8")) == {line["name"]: line["value"]}
    last.write_text(json.dumps({line["name"]: 123456.0, "another": 1.0}), "utf-8")
    assert main(["--only", "validate", "--last", str(last)]) == 0
    shown = capsys.readouterr().out
    assert "≤ 150 µs" in shown
    assert "123,456" in shown
    kept = json.loads(last.read_text("utf-8"))
    assert (kept["another"], kept[line["name"]] < 10_000) == (1.0, True)


def test_a_run_before_that_is_none_is_a_typed_error(tmp_path: Path) -> None:
    last = tmp_path / "bench.json"
    last.write_text("[1]", "utf-8")
    with pytest.raises(DataError, match="--last"):
        main(["--only", "validate", "--last", str(last)])


@pytest.mark.slow
@pytest.mark.parametrize("measurement", MEASUREMENTS, ids=lambda m: m.name)
def test_every_line_can_be_measured(measurement: Measurement) -> None:
    found = measure(measurement)
    if "pddlgym" in found.note:
        pytest.skip(found.note)
    assert found.value is not None, found.note
    assert found.samples >= 3
