"""`gavel tables`: the result tables of record files, in any format."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel tables`."""
    parser = subparsers.add_parser(
        "tables",
        help="result tables from episode records",
        description="Print the result tables of record files (or of the folders that `gavel eval` wrote).",
    )
    parser.add_argument("records", nargs="+", metavar="RECORDS", help="records.jsonl files, or folders with one")
    parser.add_argument("--format", choices=("terminal", "markdown", "csv", "latex"), default="terminal")
    parser.add_argument("--failures", action="store_true", help="also count the episodes of every failure class")
    parser.add_argument("--costs", action="store_true", help="also calls, tokens and seconds by stage")
    parser.add_argument(
        "--compare", metavar="A,B", help="agents whose metres are matched (default: those that solved at least half)"
    )
    parser.add_argument(
        "--diff", action="store_true", help="of two runs: what changed per instruction, with paired tests (needs scipy)"
    )
    parser.add_argument("--all", action="store_true", help="with --diff: every episode that changed")
    parser.add_argument("--prices", metavar="FILE.json", help="prices of models, for the cost column of --costs")
    parser.add_argument("--output", metavar="FILE", help="write to a file instead of the terminal")
    parser.set_defaults(run=_tables)


def _tables(arguments: argparse.Namespace) -> int:
    from eval.records.journal import read_records
    from eval.records.prices import read_prices
    from eval.report.formats import render
    from eval.report.tables import results
    from gavel_env.errors import DataError

    if arguments.diff:
        text = _diff(arguments)
    else:
        compare = arguments.compare.split(",") if arguments.compare else None
        found = results(read_records(arguments.records, whole=False), compare, read_prices(arguments.prices))
        text = render(found, arguments.format, failures=arguments.failures, costs=arguments.costs)
    if arguments.output is None:
        sys.stdout.write(text)
        return 0
    try:
        Path(arguments.output).write_text(text, encoding="utf-8")
    except OSError as error:
        raise DataError(f"tables cannot be written to {arguments.output}: {error.strerror}") from error
    return 0


def _diff(arguments: argparse.Namespace) -> str:
    from eval.records.journal import read_records
    from eval.report.diff import diff_tables
    from eval.report.formats import render_grids
    from eval.report.leaderboard import unique_names
    from gavel_env.errors import BadOption

    if len(arguments.records) != 2:
        raise BadOption(f"--diff compares two runs, not {len(arguments.records)}")
    first, second = arguments.records
    names = unique_names([first, second])
    most = None if arguments.all or arguments.format == "csv" else 40
    tables = diff_tables(
        read_records([first], whole=False), read_records([second], whole=False), (names[first], names[second]), most
    )
    return render_grids(tables, arguments.format)
