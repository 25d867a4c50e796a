"""`gavel eval exp1 | exp2 | exp3 | failures | all`: the paper's experiments from one command each."""

from __future__ import annotations

import argparse
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eval.commands._families import family
from eval.commands._runs import add_how, add_shown, names, positive, run_shown, seeds

if TYPE_CHECKING:
    from eval.report.grid import Grid

__all__ = ["register"]

_SAYS = {
    "exp1": "single tasks: success, attempts and time of llm-only, sayplan, gavel-basic, gavel",
    "exp2": "multi-task instructions: success, metres and time of seven methods",
    "exp3": "every fifth multi-task instruction: several planners with and without GAVEL",
    "failures": "what remains after proposal, repair and feedback, and which stage caused it",
    "all": "all of these, beliefs and the cost model",
}


def register(subparsers: Any) -> None:
    """Add the experiments to `gavel eval`."""
    for name, says in _SAYS.items():
        parser = family(subparsers, "eval").add_parser(name, help=says, description=f"{says}.")
        _add_what(parser)
        add_how(parser)
        add_shown(parser)
        parser.set_defaults(run=_run, experiment=name)


def _add_what(parser: argparse.ArgumentParser) -> None:
    what = parser.add_argument_group("what is run")
    what.add_argument(
        "--planner",
        action="append",
        default=[],
        metavar="SPEC",
        help="language model; repeatable (default: what is shipped)",
    )
    what.add_argument("--agents", type=names, default=(), metavar="A,B", help="besides those of the experiment")
    what.add_argument(
        "--understanding", default="reference", metavar="NAME", help="reference (default), rules, adapter, llm"
    )
    what.add_argument(
        "--prior", default="choice", metavar="NAME", help="location prior: choice (default), rsn or uniform"
    )
    what.add_argument(
        "--cost",
        choices=("paper", "carried", "simulated"),
        help="the cost by which methods order tasks: J as printed, carried (default) or simulated",
    )
    what.add_argument("--seeds", type=seeds, metavar="0,1", help="default: 0,1,2,3,4 where a planner samples, else 0")
    what.add_argument(
        "--sample", type=positive, metavar="N", help="only N of the instructions, drawn by the hash of the id"
    )
    what.add_argument("--limit", type=positive, metavar="N", help="only the first N of them")
    what.add_argument("--profile", choices=("paper", "omnigibson"), default="paper", help="rules profile")
    what.add_argument("--plugin", action="append", default=[], metavar="MODULE", help="module that registers agents")


def _run(arguments: argparse.Namespace) -> int:
    from eval.report.formats import render_grids

    out = Path(arguments.out or Path("runs") / f"{arguments.experiment}-{datetime.now():%Y%m%d-%H%M%S}")
    if arguments.experiment == "all":
        return _run_all(arguments, out)
    tables, status = _tables(arguments, arguments.experiment, out)
    sys.stdout.write(render_grids(tables, arguments.format))
    return status


def _tables(arguments: argparse.Namespace, name: str, out: Path) -> tuple[list[Grid], int]:
    """Run an experiment into a folder and return its tables and the exit status."""
    from eval.records.journal import read_records
    from eval.report.experiments import experiment_tables
    from eval.report.failures import failure_tables
    from eval.run.episodes import EnvironmentSettings
    from eval.run.rig import import_plugins
    from eval.studies.experiments import EXPERIMENTS, planned

    import_plugins(arguments.plugin)
    experiment = EXPERIMENTS["exp1" if name == "failures" else name]
    if name == "failures":
        experiment = experiment._replace(agents=("gavel-full",))
    plan = planned(
        experiment,
        planners=arguments.planner,
        agents=arguments.agents,
        understanding=arguments.understanding,
        prior=arguments.prior,
        costs=[arguments.cost] if arguments.cost else (),
        seeds=arguments.seeds,
        sampled=arguments.sample,
        limit=arguments.limit,
        settings=EnvironmentSettings(profile=arguments.profile, max_steps=arguments.max_steps),
        plugins=arguments.plugin,
    )
    path, status = run_shown(arguments, plan, out)
    files = read_records([path])
    if not arguments.quiet:
        print(f"gavel eval {name}: records in {path}", file=sys.stderr)
    return (failure_tables(files) if name == "failures" else experiment_tables(experiment, files)), status


def _run_all(arguments: argparse.Namespace, out: Path) -> int:
    """Run everything, one folder per experiment; the failures are those of the first two."""
    from eval.records.journal import read_records
    from eval.report.failures import failure_tables
    from eval.report.formats import render_grids

    worst = 0
    for name in ("exp1", "exp2", "exp3"):
        tables, status = _tables(arguments, name, out / name)
        sys.stdout.write(render_grids(tables, arguments.format) + "\n")
        sys.stdout.flush()
        worst = max(worst, status)
    for name in ("exp1", "exp2"):
        tables = failure_tables(read_records([out / name]))
        sys.stdout.write(render_grids(tables, arguments.format) + "\n")
    from eval.cli import main

    shared = ["--out", str(out), "--format", arguments.format, *(["--quiet"] if arguments.quiet else [])]
    shared += ["--resume"] if arguments.resume else ["--fresh"] if arguments.fresh else []
    for part in (["beliefs"], ["cost-model", "--prior", arguments.prior]):
        sys.stdout.flush()
        worst = max(worst, main(["eval", *part, *shared]))
        sys.stdout.write("\n")
    return worst
