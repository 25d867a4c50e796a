"""Tables of how good the location priors are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from eval.report.grid import UNDEFINED, Grid

if TYPE_CHECKING:
    from eval.studies.beliefs import Score

__all__ = ["belief_tables", "movables_table"]

_QUERY = (
    "Query: (scene, room, category) for every room that holds the category; a belief over all rooms of the scene, "
    "whose types and sizes are known and which are unseen, is asked to name the room. Houses are held out in five "
    "folds, gardens with their house; the shipped weights never saw the benchmark houses. Ties are split. rsn: the "
    "paper's; choice: the default; ceiling: knows every room that holds the category. The RSN's held-out scores are "
    "the shipped ones (made by `python -m gavel_agents.rsn train --folds`), so that no torch is needed."
)
_MOVABLES = (
    "Query: a movable of an instruction whose place is unsaid; a belief over the rooms that the robot can enter is "
    "asked to name the room where it starts, before anything is seen. Ties are split. generator: the distribution "
    "that the starts are drawn from.",
    "The paper's query is another one: 832 queries in scenes held out, AUC .904, Brier .057, top-1 47 %. Without "
    "--movables the closest to it is scored: (scene, room, category).",
)
_PUBLISHED = "The paper: 832 queries in scenes held out, AUC .904, Brier .057, top-1 47 %."


def belief_tables(parts: Mapping[str, Sequence[Score]], facts: Sequence[str]) -> list[Grid]:
    """Return a table of scores per part, and the calibration curve of the first.

    Args:
        parts: title of a set of queries -> scores by prior.
        facts: what they were made from.
    """
    first, *others = parts.items()
    return [
        _scores(*first, facts, (_QUERY, _PUBLISHED)),
        *(_scores(*part, (), ()) for part in others),
        _calibration(first[1]),
    ]


def movables_table(scores: Sequence[Score], facts: Sequence[str]) -> Grid:
    """Return the table of movables whose place an instruction leaves unsaid."""
    return _scores("movables whose place is unsaid", scores, facts, _MOVABLES)


def _scores(name: str, scores: Sequence[Score], facts: Sequence[str], notes: Sequence[str]) -> Grid:
    return Grid(
        title=f"Location priors, {name} ({scores[0].queries} queries)",
        facts=tuple(facts),
        header=("prior", "top-1", "AUC", "Brier", "NLL", "calibration error"),
        labels=1,
        rows=tuple(
            (s.prior, *(f"{value:.3f}" for value in (s.top1, s.auc, s.brier, s.nll, s.calibration_error)))
            for s in scores
        ),
        notes=tuple(notes),
    )


def _calibration(scores: Sequence[Score]) -> Grid:
    shown = [s for s in scores if s.prior in ("rsn", "choice")]
    bins = len(shown[0].calibration)
    rows = []
    for b in range(bins):
        curve = [s.calibration[b] for s in shown]
        cells = (f"{belief:.3f} → {share:.3f} ({n})" if n else UNDEFINED for n, belief, share in curve)
        rows.append((f"{b / bins:.1f}–{(b + 1) / bins:.1f}", *cells))
    return Grid(
        title="Calibration curve: mean belief → share that is the true room (pairs)",
        facts=(),
        header=("belief", *(s.prior for s in shown)),
        labels=1,
        rows=tuple(rows),
    )
