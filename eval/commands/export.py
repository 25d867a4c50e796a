"""`gavel export`: runs as data sets for training."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from typing import Any

__all__ = ["register"]

_SAYS = {
    "sft": "fine-tuning pairs: prompt, plan that succeeded (repaired where it had to be)",
    "dpo": "preference pairs: prompt, valid or repaired plan, invalid plan",
    "trajectories": "episodes: observation, action and verdict of every step",
}


def register(subparsers: Any) -> None:
    """Add `gavel export`."""
    parser = subparsers.add_parser(
        "export",
        help="runs as data sets for training",
        description="Write a data set, with its card, from the folders that `gavel eval` wrote.",
    )
    parser.add_argument("what", choices=tuple(_SAYS), help="; ".join(f"{name}: {says}" for name, says in _SAYS.items()))
    parser.add_argument("runs", nargs="+", metavar="DIR", help="folders that gavel eval wrote")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the data set")
    parser.add_argument("--format", choices=("jsonl", "parquet"), default="jsonl", help="default: jsonl")
    parser.add_argument(
        "--instructions",
        action="append",
        default=[],
        metavar="FILE.jsonl",
        help="for trajectories: in addition to the shipped ones",
    )
    parser.set_defaults(run=_export)


def _export(arguments: argparse.Namespace) -> int:
    from eval.export.plans import preference_pairs, tuning_pairs
    from eval.export.trajectories import trajectories
    from eval.export.write import write_dataset
    from eval.records.conversations import read_conversations
    from eval.records.journal import read_records

    files = read_records(arguments.runs)
    rows: Iterable[dict[str, Any]]
    if arguments.what == "trajectories":
        rows = trajectories(files, arguments.instructions)
    else:
        pairs = tuning_pairs if arguments.what == "sft" else preference_pairs
        rows = pairs(list(files.records.values()), read_conversations(arguments.runs))
    count = write_dataset(arguments.what, rows, files, arguments.out, arguments.format)
    print(f"gavel export: {count} rows in {arguments.out}", file=sys.stderr)
    return 0
