"""The few statistics that tables need, each saying what its ± is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean, stdev
from typing import NamedTuple

__all__ = ["Estimate", "over_episodes", "over_seeds", "share_over_seeds", "wilson"]

_Z95 = 1.959963984540054


class Estimate(NamedTuple):
    """A mean and how sure it is.

    Attributes:
        mean: of what was measured.
        spread: the ±: a standard deviation or a standard error, as the function that made it says; None if undefined.
        interval: (low, high) instead of a ±, or None.
    """

    mean: float
    spread: float | None = None
    interval: tuple[float, float] | None = None


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a share, within [0, 1].

    Raises:
        ValueError: no trials.
    """
    if trials < 1:
        raise ValueError("an interval needs at least one trial")
    share = successes / trials
    scale = 1 + _Z95**2 / trials
    centre = (share + _Z95**2 / (2 * trials)) / scale
    half = _Z95 / scale * math.sqrt(share * (1 - share) / trials + _Z95**2 / (4 * trials**2))
    return max(0.0, centre - half), min(1.0, centre + half)


def share_over_seeds(counts: Sequence[tuple[int, int]]) -> Estimate | None:
    """Return the mean share in per cent: ± the sample standard deviation over seeds; for one seed a Wilson interval.

    Args:
        counts: (successes, trials) per seed; seeds without trials are left out.
    """
    counts = [count for count in counts if count[1]]
    if not counts:
        return None
    shares = [100 * successes / trials for successes, trials in counts]
    if len(counts) > 1:
        return Estimate(fmean(shares), stdev(shares))
    low, high = wilson(*counts[0])
    return Estimate(shares[0], None, (100 * low, 100 * high))


def over_seeds(values: Sequence[Sequence[float]]) -> Estimate | None:
    """Return the mean over seeds of the seeds' means.

    ± is the sample standard deviation over seeds; for one seed the standard error over its values.

    Args:
        values: per seed; seeds without values are left out.
    """
    values = [seed for seed in values if seed]
    if not values:
        return None
    means = [fmean(seed) for seed in values]
    if len(means) > 1:
        return Estimate(fmean(means), stdev(means))
    [only] = values
    return Estimate(means[0], stdev(only) / math.sqrt(len(only)) if len(only) > 1 else None)


def over_episodes(values: Sequence[float]) -> Estimate | None:
    """Return mean ± sample standard deviation over episodes."""
    if not values:
        return None
    return Estimate(fmean(values), stdev(values) if len(values) > 1 else None)
