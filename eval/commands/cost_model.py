"""`gavel eval cost-model`: J against the metres driven. `gavel eval coverage`: what searching a room takes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from eval.commands._families import family
from eval.commands._runs import add_kept, add_shown, kept_in

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel eval cost-model` and `gavel eval coverage`."""
    coverage = family(subparsers, "eval").add_parser("coverage", help="measure the coverage width w_cov of s(r)")
    coverage.add_argument(
        "--scenes", nargs="+", metavar="SCENE", help="default: measured houses that no benchmark uses"
    )
    coverage.set_defaults(run=_run_coverage)
    parser = family(subparsers, "eval").add_parser(
        "cost-model", help="how well the cost of an order predicts the metres driven, and how well anything could"
    )
    parser.add_argument("--instructions", default="multi", metavar="NAME", help="shipped file or path (default: multi)")
    parser.add_argument("--agent", default="gavel-static", metavar="NAME", help="default: gavel-static")
    parser.add_argument("--prior", default="choice", metavar="NAME", help="location prior (default: choice)")
    parser.add_argument(
        "--cost",
        choices=("paper", "carried", "simulated"),
        help="J as printed, carried or simulated (default: carried)",
    )
    parser.add_argument(
        "--coverage-width", type=_positive, metavar="M", help="w_cov of J (default: as measured; 1.2 with --cost paper)"
    )
    parser.add_argument(
        "--sample",
        type=_count,
        default=60,
        metavar="N",
        help="instructions for ceiling and ranks (default: 60; 0: none)",
    )
    add_kept(parser)
    add_shown(parser)
    parser.set_defaults(run=_run)


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of instructions")
    return int(text)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number of metres")
    return value


def _run(arguments: argparse.Namespace) -> int:
    from eval.records.provenance import data_stamp
    from eval.report.cost_model import fits_table, limits_table
    from eval.report.formats import render_grids
    from eval.run.progress import StepProgress
    from eval.studies.cost_limits import Limits, limits
    from eval.studies.cost_model import Drive, drives, fits
    from gavel_agents.methods import METHODS
    from gavel_env.instructions.record import read_instructions, shipped

    source, agent, width = arguments.instructions, arguments.agent, arguments.coverage_width
    cost = arguments.cost or (METHODS[agent].cost if agent in METHODS else "carried")
    instructions = read_instructions(source if source.endswith(".jsonl") else shipped(source))
    data = data_stamp(instructions.stamp, instructions.values())
    made_from = (data, agent, arguments.prior, cost, width)
    kept = kept_in(arguments, "cost-model.jsonl", made_from)
    sample = min(arguments.sample, len(instructions))
    measured = f"limits on {sample}"
    with StepProgress("gavel eval cost-model", "instructions", quiet=arguments.quiet) as progress:
        progress.begin(("drives" not in kept) * len(instructions) + (measured not in kept) * sample)

        def driven() -> list[Drive]:
            found = []
            for drive in drives(source, agent, arguments.prior, arguments.cost, width):
                found.append(drive)
                progress.step()
            return found

        def limited() -> Limits:
            return limits(
                instructions,
                agent=agent,
                prior=arguments.prior,
                cost=arguments.cost,
                coverage_width_m=width,
                count=sample,
                measured=progress.step,
            )

        found = kept.get("drives", list[Drive], driven)
        tables = [limits_table(kept.get(measured, Limits, limited))] if sample else []
    facts = (f"{len(found)} from {Path(instructions.source).name}", f"data {data}", f"prior {arguments.prior}")
    tables.insert(0, fits_table(fits(found), cost=cost, agent=agent, facts=(*facts, *kept.facts)))
    sys.stdout.write(render_grids(tables, arguments.format))
    return 0


def _run_coverage(arguments: argparse.Namespace) -> int:
    from eval.studies.room_coverage import CALIBRATION_HOUSES, coverage, room_searches

    scenes = tuple(arguments.scenes or CALIBRATION_HOUSES)
    found = coverage(list(room_searches(scenes)))
    print(
        f"{found.searches} complete searches of rooms, from their entrances, in {', '.join(scenes)}\n"
        f"A_trav {found.area_m2:.1f} m2 and {found.metres:.2f} m driven on average: w_cov = {found.width_m:.1f} m\n"
        f"line through them: {found.constant_m:.2f} m + A_trav / {found.line_width_m:.1f} m, "
        f"R2 {found.line_r_squared:.2f}\n"
        f"an object anywhere on the floor: seen from the entrance {found.at_once:.0%}, "
        f"on average after {found.until_seen_m:.2f} m"
    )
    return 0
