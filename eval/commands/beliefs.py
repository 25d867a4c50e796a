"""`gavel eval beliefs`: how good the location priors are on houses that they never saw."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eval.commands._families import family
from eval.commands._runs import add_kept, add_shown, kept_in

if TYPE_CHECKING:
    from eval.studies.beliefs import Score

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel eval beliefs`."""
    command = family(subparsers, "eval").add_parser("beliefs", help="score the location priors on houses held out")
    command.add_argument("--quick", action="store_true", help="known categories only (leaves out the unseen ones)")
    command.add_argument("--json", action="store_true", help="print the scores as JSON")
    command.add_argument(
        "--movables",
        nargs="?",
        const="multi",
        metavar="NAME",
        help="instead: movables whose place the text does not say, of an instruction file (default: multi)",
    )
    command.add_argument("--weights", type=Path, metavar="DIR", help="other weights than the shipped ones")
    add_kept(command)
    add_shown(command)
    command.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from eval.records.provenance import file_stamp
    from eval.report.beliefs import belief_tables, movables_table
    from eval.report.formats import render_grids
    from eval.run.progress import StepProgress
    from eval.studies.beliefs import Score, evaluate, evaluate_shipped, fits
    from gavel_agents.rsn.encoder import weights_folder

    folder: Path | None = arguments.weights
    weights = file_stamp(folder or weights_folder())
    kept = kept_in(arguments, "beliefs.jsonl", (weights,))
    if arguments.movables:
        scores = kept.get(
            f"movables of {arguments.movables}", list[Score], lambda: _movables(arguments.movables, folder)
        )
        if arguments.json:
            return _print_json({"movables": scores})
        sys.stdout.write(render_grids([movables_table(scores, (f"weights {weights}", *kept.facts))], arguments.format))
        return 0
    with StepProgress("gavel eval beliefs", "fits", quiet=arguments.quiet) as progress:
        known, unseen = "51 scenes", "51 scenes, categories unseen"
        sets = {known: False} if arguments.quick else {known: False, unseen: True}
        progress.begin(sum(fits(unseen=hard) for name, hard in sets.items() if name not in kept))
        parts = {known: kept.get(known, list[Score], lambda: evaluate(folder=folder, fitted=progress.step))}
        shipped = "the ten benchmark houses, weights as they are"
        parts[shipped] = kept.get(shipped, list[Score], lambda: evaluate_shipped(folder))
        if not arguments.quick:
            parts[unseen] = kept.get(
                unseen, list[Score], lambda: evaluate(unseen=True, folder=folder, fitted=progress.step)
            )
    if arguments.json:
        return _print_json(parts)
    sys.stdout.write(render_grids(belief_tables(parts, (f"weights {weights}", *kept.facts)), arguments.format))
    return 0


def _movables(source: str, folder: Path | None) -> list[Score]:
    from eval.studies.movables import evaluate_movables
    from gavel_env.instructions.record import read_instructions, shipped

    return evaluate_movables(
        read_instructions(source if source.endswith(".jsonl") else shipped(source)).values(), folder
    )


def _print_json(parts: Mapping[str, Sequence[Score]]) -> int:
    table = {
        name: [s._asdict() | {"calibration_error": s.calibration_error} for s in scores]
        for name, scores in parts.items()
    }
    print(json.dumps(table, indent=1))
    return 0
