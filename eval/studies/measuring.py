"""What a line of the bench is, and how it is measured."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from gavel_env.errors import NotInstalled

__all__ = ["Measured", "Measurement", "Samples", "measure", "timed"]

Samples = Iterator[float]


class Measurement(NamedTuple):
    """One line of the bench.

    Attributes:
        name: what one sample is.
        unit: of the printed number: "s", "ms", "µs" (time of a sample), "/s" (samples per second) or "×" (a ratio).
        target: to be at most (times) or at least (rates and ratios); None if there is none.
        samples: yields seconds per sample, or ratios.
    """

    name: str
    unit: str
    target: float | None
    samples: Callable[[], Samples]


class Measured(NamedTuple):
    """What a measurement gave; `value` is the median in its unit, None if it cannot be made here (`note` says why)."""

    name: str
    unit: str
    target: float | None
    value: float | None
    samples: int
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a value or target."""
        if self.value is None or self.target is None:
            return None
        return self.value >= self.target if self.more_is_better else self.value <= self.target

    @property
    def more_is_better(self) -> bool:
        """True for rates and ratios, False for times."""
        return self.unit in ("/s", "×")


_SCALE: dict[str, Callable[[float], float]] = {
    "s": lambda seconds: seconds,
    "ms": lambda seconds: seconds * 1e3,
    "µs": lambda seconds: seconds * 1e6,
    "/s": lambda seconds: 1 / seconds,
    "×": lambda ratio: ratio,
}


def measure(measurement: Measurement) -> Measured:
    """Make one measurement."""
    name, unit, target, samples = measurement
    try:
        found = list(samples())
    except NotInstalled as error:
        return Measured(name, unit, target, None, 0, str(error))
    return Measured(name, unit, target, _SCALE[unit](statistics.median(found)), len(found))


def timed(work: Callable[[], object], count: int = 1) -> float:
    """Return the seconds of one of `count` runs in a row."""
    begun = time.perf_counter()
    for _ in range(count):
        work()
    return (time.perf_counter() - begun) / count
