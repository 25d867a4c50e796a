"""`gavel eval cost-model`: J against the metres driven. `gavel eval coverage`: what searching a room takes."""

from __future__ import annotations

import argparse
from typing import Any

from eval.commands._families import family

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel eval cost-model` and `gavel eval coverage`."""
    coverage = family(subparsers, "eval").add_parser("coverage", help="measure the coverage width w_cov of s(r)")
    coverage.add_argument("--scenes", nargs="+", metavar="SCENE", help="default: measured houses of no benchmark")
    coverage.set_defaults(run=_run_coverage)
    parser = family(subparsers, "eval").add_parser(
        "cost-model", help="how well the ordering cost J predicts the metres driven"
    )
    parser.add_argument("--instructions", default="multi", metavar="NAME", help="shipped file or path (default: multi)")
    parser.add_argument("--agent", default="gavel-static", metavar="NAME", help="default: gavel-static")
    parser.add_argument("--prior", default="choice", metavar="NAME", help="location prior (default: choice)")
    parser.add_argument(
        "--coverage-width", type=_positive, metavar="M", help="w_cov (default: as measured; the paper's is 1.2)"
    )
    parser.set_defaults(run=_run)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number of metres")
    return value


def _run(arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    from eval.studies.cost_model import drives, fits
    from gavel_agents.ordering.cost import COVERAGE_WIDTH_M

    width_m = COVERAGE_WIDTH_M if arguments.coverage_width is None else arguments.coverage_width

    table = Table(title=f"Ordering cost J against metres driven ({arguments.agent}, reference plans)")
    for column in ("tasks N", "instructions", "R²", "slope", "mean J (m)", "mean driven (m)", "ordering (ms)"):
        table.add_column(column, justify="right")
    for fit in fits(list(drives(arguments.instructions, arguments.agent, arguments.prior, width_m))):
        table.add_row(
            "all" if fit.tasks is None else str(fit.tasks),
            str(fit.instructions),
            f"{fit.r_squared:.2f}",
            f"{fit.slope:.2f}",
            f"{fit.expected_m:.1f}",
            f"{fit.driven_m:.1f}",
            f"{fit.ordering_ms:.1f}",
        )
    console = Console()
    console.print(table)
    console.print(
        "R²: squared correlation over instructions. slope: metres driven per metre of J.\n"
        "The paper, for its own executor and benchmark: R² = 0.93 at N = 4, 0.89 at N = 5, 17 ms of ordering."
    )
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
