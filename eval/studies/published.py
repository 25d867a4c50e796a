"""The paper's own figures, to stand beside ours in columns marked *published*."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from eval.report.statistics import Estimate

__all__ = ["DEFAULT_MODEL", "EXPERIMENTS", "RESIDUAL_MULTI", "Published", "published_model"]

DEFAULT_MODEL = "Qwen3-8B"
"""Whose figures stand beside those of a planner that the paper does not have."""

MODELS = ("Qwen3-4B", "Qwen3-8B", "GPT-5.6 Sol", "Claude Sonnet 5")


class Published(NamedTuple):
    """One row of a table of the paper, mean ± as printed there; None where it has no such column.

    Attributes:
        success: per cent.
        seconds: of planning.
        attempts: calls of the language model.
        metres: on matched successes.
    """

    success: Estimate
    seconds: Estimate | None
    attempts: Estimate | None = None
    metres: Estimate | None = None


def _exp1(success: float, pm: float, attempts: float, pm_attempts: float, seconds: float, pm_s: float) -> Published:
    return Published(Estimate(success, pm), Estimate(seconds, pm_s), Estimate(attempts, pm_attempts))


def _exp2(success: float, pm: float, metres: float, pm_m: float, seconds: float | None, pm_s: float) -> Published:
    spent = None if seconds is None else Estimate(seconds, pm_s)
    return Published(Estimate(success, pm), spent, None, Estimate(metres, pm_m))


def _exp3(success: float, pm: float, seconds: float, pm_s: float) -> Published:
    return Published(Estimate(success, pm), Estimate(seconds, pm_s))


_NO_MODEL = ""

EXPERIMENTS: Mapping[str, Mapping[tuple[str, str], Published]] = {
    "exp1": {
        ("Qwen3-4B", "llm-only"): _exp1(21.8, 1.5, 1.00, 0.0, 9.2, 1.0),
        ("Qwen3-4B", "sayplan"): _exp1(55.4, 1.9, 3.4, 1.7, 27.6, 12.0),
        ("Qwen3-4B", "gavel-basic"): _exp1(67.7, 1.6, 1.00, 0.0, 9.2, 1.0),
        ("Qwen3-4B", "gavel-full"): _exp1(88.8, 1.6, 1.7, 1.3, 15.0, 11.1),
        ("Qwen3-8B", "llm-only"): _exp1(41.2, 1.2, 1.00, 0.0, 13.3, 6.4),
        ("Qwen3-8B", "sayplan"): _exp1(76.4, 1.5, 2.7, 1.7, 24.6, 15.8),
        ("Qwen3-8B", "gavel-basic"): _exp1(76.2, 1.2, 1.00, 0.0, 13.5, 6.4),
        ("Qwen3-8B", "gavel-full"): _exp1(91.8, 1.3, 1.5, 1.1, 15.5, 9.4),
    },
    "exp2": {
        ("Qwen3-8B", "llm-only"): _exp2(19.9, 0.7, 86.69, 0.37, 31.8, 10.5),
        ("Qwen3-8B", "sayplan"): _exp2(75.6, 2.1, 83.01, 0.42, 51.4, 27.6),
        (_NO_MODEL, "epog"): _exp2(60.2, 0.0, 84.51, 0.0, 13.9, 3.9),
        ("Qwen3-8B", "gavel-map"): _exp2(92.6, 1.0, 82.45, 0.23, 39.3, 22.6),
        ("Qwen3-8B", "gavel-static"): _exp2(92.6, 1.0, 79.69, 0.45, 39.3, 22.6),
        ("Qwen3-8B", "gavel-full"): _exp2(92.6, 1.0, 78.01, 0.71, 39.3, 22.6),
        (_NO_MODEL, "oracle"): _exp2(100.0, 0.0, 56.17, 0.0, None, 0.0),
    },
    "exp3": {
        ("Qwen3-4B", "llm-only"): _exp3(2.4, 1.5, 23.0, 7.4),
        ("Qwen3-4B", "gavel-full"): _exp3(75.2, 2.1, 35.0, 31.2),
        ("Qwen3-8B", "llm-only"): _exp3(23.6, 1.5, 31.8, 10.5),
        ("Qwen3-8B", "gavel-full"): _exp3(89.2, 1.3, 39.3, 22.6),
        ("GPT-5.6 Sol", "llm-only"): _exp3(24.6, 3.9, 16.5, 3.9),
        ("GPT-5.6 Sol", "gavel-full"): _exp3(99.2, 0.8, 16.5, 4.0),
        ("Claude Sonnet 5", "llm-only"): _exp3(38.6, 2.2, 18.0, 4.4),
        ("Claude Sonnet 5", "gavel-full"): _exp3(99.4, 0.5, 18.2, 4.4),
    },
}
"""Experiment -> (model, method) -> its row; methods that ask no model stand under an empty name."""

RESIDUAL_MULTI: Mapping[str, int] = {"understanding": 21, "proposal": 5, "unmet goals": 9, "all": 38}
"""Failures of the paper's GAVEL that remain in experiment 2, as its text counts them."""


def published_model(*names: str) -> str:
    """Return the paper's model whose name is in one of some names (planner specs, models), else `DEFAULT_MODEL`."""
    plain = " ".join("".join(filter(str.isalnum, name.lower())) for name in names)
    named = (name for name in MODELS if "".join(filter(str.isalnum, name.lower())) in plain)
    return next(named, DEFAULT_MODEL)
