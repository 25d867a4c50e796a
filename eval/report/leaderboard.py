"""Submissions ranked: one row per contestant of every run folder, on the same data and rules or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from eval.records.journal import RecordFile
from eval.report.grid import UNDEFINED, Grid, number, seconds, short_spec
from eval.report.tables import Row, Section, results
from gavel_env.errors import DataError

__all__ = ["Submission", "leaderboard", "unique_names"]

_NUMBERS = ("Success (%)", "Metres", "Attempts", "Planning (s)")


class Submission(NamedTuple):
    """A run folder that was handed in.

    Attributes:
        name: of the folder.
        files: its records.
        verified: whether `verify_run` passed; None if it was not asked.
    """

    name: str
    files: RecordFile
    verified: bool | None = None


def leaderboard(submissions: Sequence[Submission]) -> list[Grid]:
    """Return one ranking per kind of instructions: by success over all that was scheduled, then by metres.

    Raises:
        DataError: submissions of one kind are over different data, rules or numbers of episodes; says which.
    """
    entries: dict[str, list[tuple[Submission, Section, Row]]] = {}
    for submission in submissions:
        for section in results(submission.files).sections:
            if section.part != "shared":
                entries.setdefault(section.benchmark.kind, []).extend((submission, section, r) for r in section.rows)
    return [_ranked(kind, found) for kind, found in entries.items()]


def _ranked(kind: str, entries: Sequence[tuple[Submission, Section, Row]]) -> Grid:
    by_stamp: dict[tuple[str, str, int], list[str]] = {}
    for submission, section, row in entries:
        stamp = (section.benchmark.data, _rules(submission), row.scheduled)
        by_stamp.setdefault(stamp, []).append(submission.name)
    if len(by_stamp) > 1:
        said = "; ".join(
            f"{', '.join(dict.fromkeys(names))}: data {data}, rules {rules}, {count} episodes"
            for (data, rules, count), names in by_stamp.items()
        )
        raise DataError(f"these runs of {kind} instructions cannot be ranked together: {said}")
    [(data, rules, count)] = by_stamp
    ordered = sorted(entries, key=lambda entry: _rank_key(entry[2]))
    rows = [
        (
            str(_place(ordered, at)),
            submission.name,
            row.contestant.agent + (" †" if row.contestant.privileged else ""),
            short_spec(row.contestant.planner) or UNDEFINED,
            number(row.success, 1),
            number(row.metres, 2),
            number(row.attempts, 2),
            seconds(row.planning_s),
            {True: "yes", False: "NO", None: "not asked"}[submission.verified],
        )
        for at, (submission, _, row) in enumerate(ordered)
    ]
    return Grid(
        title=f"Leaderboard: {kind} instructions",
        facts=(f"data {data}", f"rules {rules}", f"{count} episodes each"),
        header=(
            "Rank",
            "Submission",
            "Agent",
            "Planner",
            "Success (%)",
            "Metres",
            "Attempts",
            "Planning (s)",
            "Verified",
        ),
        labels=4,
        rows=tuple(rows),
        notes=(
            "Ranked by success over all scheduled episodes, then by metres over the own successes. † sees the hidden "
            "state. Verified: gavel verify-run found every recorded action and prompt as it is played again.",
        ),
    )


def _rules(submission: Submission) -> str:
    return (
        ", ".join(dict.fromkeys(str(h.environment.get("profile", "")) for h in submission.files.headers)) or UNDEFINED
    )


def _rank_key(row: Row) -> tuple[bool, float, float]:
    success = row.success.mean if row.success else 0.0
    return (row.contestant.privileged, -success, row.metres.mean if row.metres else float("inf"))


def _place(ordered: Sequence[tuple[Submission, Section, Row]], at: int) -> int:
    """Return the rank of a row: rows that are alike share the first one's."""
    while at and _rank_key(ordered[at][2]) == _rank_key(ordered[at - 1][2]):
        at -= 1
    return at + 1


def unique_names(paths: Sequence[str]) -> Mapping[str, str]:
    """Return path -> folder name, with its parent's where two are called the same."""
    short = {path: Path(path).resolve().name for path in paths}
    names = list(short.values())
    return {p: n if names.count(n) == 1 else "/".join(Path(p).resolve().parts[-2:]) for p, n in short.items()}
