"""`gavel leaderboard`: run folders ranked. `gavel verify-run`: whether a run folder is what it says."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

__all__ = ["register"]

_SHOWN = 20


def register(subparsers: Any) -> None:
    """Add `gavel leaderboard` and `gavel verify-run`."""
    board = subparsers.add_parser(
        "leaderboard",
        help="rank run folders on one page",
        description="Rank the contestants of run folders, of the same data and rules only.",
    )
    board.add_argument("runs", nargs="+", metavar="DIR", help="folders that gavel eval wrote")
    board.add_argument("--verify", action="store_true", help="replay every run first (gavel verify-run)")
    board.add_argument("--format", choices=("terminal", "markdown", "csv", "latex", "html"), default="terminal")
    board.add_argument("--output", metavar="FILE", help="write to a file instead of the terminal")
    board.set_defaults(run=_leaderboard)
    verify = subparsers.add_parser(
        "verify-run",
        help="replay a run folder: every action and prompt must match the record",
        description="Exit status: 0 = everything matches the record, 1 = something differs.",
    )
    verify.add_argument("run_folder", metavar="DIR", help="a folder that gavel eval wrote")
    verify.add_argument(
        "--instructions",
        action="append",
        default=[],
        metavar="FILE.jsonl",
        help="in addition to the shipped ones; repeatable",
    )
    verify.set_defaults(run=_verify)


def _leaderboard(arguments: argparse.Namespace) -> int:
    from eval.records.journal import read_records
    from eval.report.formats import html_page, render_grids
    from eval.report.leaderboard import Submission, leaderboard, unique_names
    from eval.run.verification import verify_run
    from gavel_env.errors import DataError

    names = unique_names(arguments.runs)
    submissions = []
    for path in arguments.runs:
        verified = not verify_run(path).findings if arguments.verify else None
        submissions.append(Submission(names[path], read_records([path], whole=False), verified))
    tables = leaderboard(submissions)
    page = html_page("Leaderboard", tables) if arguments.format == "html" else render_grids(tables, arguments.format)
    if arguments.output is None:
        sys.stdout.write(page)
        return 0
    try:
        Path(arguments.output).write_text(page, encoding="utf-8")
    except OSError as error:
        raise DataError(f"the leaderboard cannot be written to {arguments.output}: {error.strerror}") from error
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    from eval.run.verification import verify_run

    found = verify_run(arguments.run_folder, arguments.instructions)
    for place, what in found.findings[:_SHOWN]:
        print(f"{place}: {what}")
    if len(found.findings) > _SHOWN:
        print(f"and {len(found.findings) - _SHOWN} more")
    verdict = "NOT as recorded" if found.findings else "everything is as recorded"
    print(
        f"{arguments.run_folder}: {found.replayed} of {found.recorded} records played again, "
        f"{found.missing} scheduled episodes without a record: {verdict}"
    )
    return 1 if found.findings else 0
