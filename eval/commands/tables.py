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
    parser.add_argument("--output", metavar="FILE", help="write to a file instead of the terminal")
    parser.set_defaults(run=_tables)


def _tables(arguments: argparse.Namespace) -> int:
    from eval.records.journal import read_records
    from eval.report.formats import render
    from eval.report.tables import results
    from gavel_env.errors import DataError

    compare = arguments.compare.split(",") if arguments.compare else None
    found = results(read_records(arguments.records), compare)
    text = render(found, arguments.format, failures=arguments.failures, costs=arguments.costs)
    if arguments.output is None:
        sys.stdout.write(text)
        return 0
    try:
        Path(arguments.output).write_text(text, encoding="utf-8")
    except OSError as error:
        raise DataError(f"tables cannot be written to {arguments.output}: {error.strerror}") from error
    return 0
