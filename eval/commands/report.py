"""`gavel report`: tables and replays of record files as one HTML file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel report`."""
    parser = subparsers.add_parser(
        "report",
        help="one HTML file with the tables and every episode replayed on the floor plan",
        description="Write a report of record files (or of the folders that `gavel eval` wrote) as one HTML file.",
    )
    parser.add_argument("records", nargs="+", metavar="RECORDS", help="records.jsonl files, or folders with one")
    parser.add_argument("--output", default="report.html", metavar="FILE", help="default: report.html")
    parser.add_argument("--title", default="GAVEL results", help="heading of the page")
    parser.add_argument("--compare", metavar="A,B", help="agents whose metres are matched")
    parser.set_defaults(run=_report)


def _report(arguments: argparse.Namespace) -> int:
    from eval.records.conversations import read_conversations
    from eval.records.journal import read_records
    from eval.report.html import html_report
    from gavel_env.errors import DataError

    compare = arguments.compare.split(",") if arguments.compare else None
    conversations = read_conversations(arguments.records)
    page = html_report(read_records(arguments.records), compare, arguments.title, conversations=conversations)
    try:
        Path(arguments.output).write_text(page, encoding="utf-8")
    except OSError as error:
        raise DataError(f"the report cannot be written to {arguments.output}: {error.strerror}") from error
    print(f"{arguments.output}: {len(page) / 1e6:.1f} MB", file=sys.stderr)
    return 0
