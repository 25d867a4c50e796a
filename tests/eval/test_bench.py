"""The bench: what counts as met, and that its lines can be measured."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from eval.studies.bench import MEASUREMENTS, Measurement, NotInstalled, main, measure


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
    def nothing() -> Iterator[float]:
        raise NotInstalled("minigrid is not installed")
        yield 0.0

    found = measure(Measurement("x", "ms", 1.0, nothing))
    assert (found.value, found.met, found.note) == (None, None, "minigrid is not installed")


def test_a_chosen_line_is_printed_as_json_and_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--only", "validate", "--json"]) == 0
    [line] = json.loads(capsys.readouterr().out)
    assert line["samples"] > 10
    assert line["value"] > 0
    assert main(["--only", "validate"]) == 0
    assert "≤ 150 µs" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("measurement", MEASUREMENTS, ids=lambda m: m.name)
def test_every_line_can_be_measured(measurement: Measurement) -> None:
    found = measure(measurement)
    assert found.value is not None, found.note
    assert found.samples >= 3
