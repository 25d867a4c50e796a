"""Paired comparison of two contestants on the instructions that both ran."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from eval.records.schema import EpisodeKey, EpisodeRecord

__all__ = ["Paired", "bootstrap_interval", "paired_metres", "paired_success"]

_RESAMPLES = 10_000
_CHUNK = 500
_SAME = 1e-9


class Paired(NamedTuple):
    """How one contestant differs from another; instructions are the units, seeds are averaged first.

    Attributes:
        difference: mean of the instructions' differences, first minus second: percentage points of success, or metres.
        interval: (low, high), 95 % by bootstrap over instructions; None for fewer than two of them.
        base: mean of the second.
        better, equal, worse: instructions on which the first is.
        differences: per instruction, in the order of their ids.
    """

    difference: float
    interval: tuple[float, float] | None
    base: float
    better: int
    equal: int
    worse: int
    differences: tuple[tuple[str, float], ...]


def bootstrap_interval(values: Sequence[float], seed: int = 0) -> tuple[float, float] | None:
    """Return the 95 % percentile interval of a mean, by resampling the values; None for fewer than two."""
    if len(values) < 2:
        return None
    data = np.asarray(values, np.float64)
    rng = np.random.default_rng(seed)
    means = [data[rng.integers(len(data), size=(_CHUNK, len(data)))].mean(axis=1) for _ in range(_RESAMPLES // _CHUNK)]
    low, high = np.quantile(np.concatenate(means), (0.025, 0.975))
    return float(low), float(high)


def paired_success(
    first: Iterable[EpisodeKey], second: Iterable[EpisodeKey], records: Mapping[EpisodeKey, EpisodeRecord]
) -> Paired | None:
    """Compare success in per cent, over (instruction, seed) pairs that both were scheduled on.

    Args:
        first: scheduled episodes of one; those without a record count as not solved.
        second: those of the other.
        records: by key.
    """

    def solved(keys: Iterable[EpisodeKey]) -> dict[tuple[str, int], float]:
        return {(k.instruction, k.seed): 100.0 * (k in records and records[k].success) for k in keys}

    return _paired(solved(first), solved(second), more_is_better=True)


def paired_metres(
    first: Iterable[EpisodeKey], second: Iterable[EpisodeKey], records: Mapping[EpisodeKey, EpisodeRecord]
) -> Paired | None:
    """Compare metres over the (instruction, seed) pairs that both solved; see `paired_success`."""

    def driven(keys: Iterable[EpisodeKey]) -> dict[tuple[str, int], float]:
        return {(k.instruction, k.seed): records[k].metres for k in keys if k in records and records[k].success}

    return _paired(driven(first), driven(second), more_is_better=False)


def _paired(
    first: Mapping[tuple[str, int], float], second: Mapping[tuple[str, int], float], *, more_is_better: bool
) -> Paired | None:
    by_instruction: dict[str, list[tuple[float, float]]] = {}
    for key in sorted(first.keys() & second.keys()):
        by_instruction.setdefault(key[0], []).append((first[key], second[key]))
    if not by_instruction:
        return None
    differences = {i: float(np.mean([a - b for a, b in pairs])) for i, pairs in by_instruction.items()}
    gains = [value if more_is_better else -value for value in differences.values()]
    return Paired(
        float(np.mean(list(differences.values()))),
        bootstrap_interval(list(differences.values())),
        float(np.mean([np.mean([b for _, b in pairs]) for pairs in by_instruction.values()])),
        sum(gain > _SAME for gain in gains),
        sum(abs(gain) <= _SAME for gain in gains),
        sum(gain < -_SAME for gain in gains),
        tuple(differences.items()),
    )
