"""`gavel figures`: the figures of a run, as vector graphics and as pictures."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel figures`."""
    parser = subparsers.add_parser(
        "figures",
        help="figures of a run: success, metres, failures, attempts, beliefs, costs",
        description="Draw what the records can show, each figure as SVG and PNG. Needs the extra [plots].",
    )
    parser.add_argument("records", nargs="+", metavar="RUN", help="records.jsonl files, or folders with one")
    parser.add_argument("--out", default="figures", metavar="DIR", help="folder for the files (default: figures)")
    parser.set_defaults(run=_figures)


def _figures(arguments: argparse.Namespace) -> int:
    from eval.records.journal import read_records
    from eval.report.figures import figures
    from gavel_env.errors import DataError

    folder = Path(arguments.out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, drawing in figures(read_records(arguments.records)):
            for kind, more in (("svg", {"metadata": {"Date": None}}), ("png", {})):
                drawing.savefig(folder / f"{name}.{kind}", **more)
            print(folder / f"{name}.svg")
    except OSError as error:
        raise DataError(f"figures cannot be written to {folder}: {error.strerror}") from error
    return 0
