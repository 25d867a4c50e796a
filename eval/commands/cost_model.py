"""`gavel eval cost-model`: J against the metres driven. `gavel eval coverage`: what searching a room takes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from eval.commands._families import family

if TYPE_CHECKING:
    from eval.studies.cost_limits import Limits

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
    from rich.console import Console
    from rich.table import Table

    from eval.studies.cost_limits import limits
    from eval.studies.cost_model import drives, fits
    from gavel_agents.methods import METHODS
    from gavel_env.instructions.record import read_instructions, shipped

    source, agent = arguments.instructions, arguments.agent
    own = METHODS[agent].cost if agent in METHODS else "carried"
    cost = arguments.cost or own
    expected = "metres" if cost == "simulated" else "J (m)"
    table = Table(title=f"Cost of the chosen order ({cost}) against metres driven ({agent}, reference plans)")
    columns = ("tasks N", "instructions", "R²", "slope", "bias", f"mean {expected}", "mean driven (m)", "order (ms)")
    for column in columns:
        table.add_column(column, justify="right")
    found = list(drives(source, agent, arguments.prior, arguments.cost, arguments.coverage_width))
    for fit in fits(found):
        table.add_row(
            "all" if fit.tasks is None else str(fit.tasks),
            str(fit.instructions),
            f"{fit.r_squared:.2f}",
            f"{fit.slope:.2f}",
            f"{100 * fit.bias:+.0f} %",
            f"{fit.expected_m:.1f}",
            f"{fit.driven_m:.1f}",
            f"{fit.ordering_ms:.1f}",
        )
    console = Console()
    console.print(table)
    console.print(
        "R²: squared correlation over instructions. slope: metres driven per metre expected. bias: metres expected per "
        "metre driven, less 1.",
        highlight=False,
    )
    if arguments.sample:
        path = source if source.endswith(".jsonl") else shipped(source)
        _print_limits(
            limits(
                read_instructions(path),
                agent=agent,
                prior=arguments.prior,
                cost=arguments.cost,
                coverage_width_m=arguments.coverage_width,
                count=arguments.sample,
            )
        )
    console.print(
        "The paper, in its own executor: R² = 0.93 at N = 4, 0.89 at N = 5, which justifies pairwise costs in place of "
        "rolling out every order; 17 ms of ordering. Here nothing that does not know where things are comes near that, "
        "but J and its own rollouts through whole orders do.",
        highlight=False,
    )
    return 0


def _print_limits(found: Limits) -> None:
    from rich.console import Console
    from rich.table import Table

    def shown(value: float | None, error: float | None = None) -> str:
        return "—" if value is None else f"{value:.2f}" + ("" if error is None else f" ± {error:.2f}")

    table = Table(title=f"What can be asked of it: {found.instructions} instructions, drawn by the hash of their ids")
    table.add_column("measured")
    table.add_column("", justify="right")
    table.add_row("R² of the cost and the metres driven, on this sample", shown(found.model_r_squared))
    table.add_row(
        f"R² of the executor itself, mean over {found.worlds} worlds drawn from B₀", shown(found.ceiling_r_squared)
    )
    table.add_row("    its bias", "—" if found.ceiling_bias is None else f"{100 * found.ceiling_bias:+.0f} %")
    table.add_row(
        f"rank correlation of cost and metres over {found.orders} random orders of an instruction",
        shown(found.rank_correlation, found.rank_error),
    )
    table.add_row("R² of pairwise J and J rolled out through the whole order", shown(found.sequential_r_squared))
    Console().print(table)


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
