"""`gavel eval`: run agents over instructions and print the results table; also the evaluations of single parts."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from eval.commands._families import family_parser
from eval.commands._runs import add_how, add_shown, names, positive, run_shown, seeds

if TYPE_CHECKING:
    from eval.records.schema import EpisodeRecord
    from gavel_env.instructions.record import InstructionSet

__all__ = ["register"]

_KINDS = {"single": ("single",), "multi": ("multi",), "behavior": ("behavior",), "both": ("single", "multi")}


def register(subparsers: Any) -> None:
    """Add `gavel eval`; other modules add evaluations of single parts to the same family."""
    parser = family_parser(subparsers, "eval")
    parser.description = (
        "Run agents over instructions, one record per episode, and print the results table. "
        "Without arguments: the shipped instructions, planned by recordings of a real model and by the certified plans."
    )
    parser.usage = "%(prog)s [OPTIONS]\n       %(prog)s PART …"
    _add_options(parser)
    parser.set_defaults(run=_eval)


def _add_options(parser: argparse.ArgumentParser) -> None:
    what = parser.add_argument_group("what is run")
    what.add_argument(
        "--agents", type=names, metavar="A,B", help="agent names (default: all built-in agents that can run)"
    )
    what.add_argument("--kind", choices=tuple(_KINDS), help="kind of instructions (default: both; with files: all)")
    what.add_argument(
        "--instructions", action="append", metavar="FILE.jsonl", help="instead of the shipped ones; repeatable"
    )
    what.add_argument(
        "--planner",
        action="append",
        default=[],
        metavar="SPEC",
        help="language model, such as scripted:FILE.jsonl, or classical, or multi=SPEC for one kind; repeatable "
        "(default: the shipped ones; with another understanding than reference: classical)",
    )
    what.add_argument(
        "--understanding", default="reference", metavar="NAME", help="reference (default), rules, adapter or llm"
    )
    what.add_argument(
        "--prior", default="choice", metavar="NAME", help="location prior: choice (default), rsn or uniform"
    )
    what.add_argument(
        "--cost",
        type=names,
        default=(),
        metavar="A,B",
        help="cost by which methods order tasks: paper (J as printed), carried (default), simulated; not gavel-plus",
    )
    what.add_argument("--seeds", type=seeds, default=(0,), metavar="0,1", help="default: 0")
    what.add_argument("--sample", type=positive, metavar="N", help="only N of each kind, drawn by the hash of the id")
    what.add_argument("--limit", type=positive, metavar="N", help="only the first N of them")
    what.add_argument("--profile", choices=("paper", "omnigibson"), default="paper", help="rules profile")
    what.add_argument(
        "--plugin", action="append", default=[], metavar="MODULE", help="module that registers agents; repeatable"
    )
    add_how(parser)
    add_shown(parser)
    shown = parser.add_argument_group("what else is shown")
    shown.add_argument("--failures", action="store_true", help="also count the episodes of every failure class")
    shown.add_argument("--costs", action="store_true", help="also calls, tokens, cost and seconds by stage")
    shown.add_argument("--compare", type=names, metavar="A,B", help="agents whose metres are matched")


def _eval(arguments: argparse.Namespace) -> int:
    from eval.records.journal import read_records
    from eval.records.prices import read_prices
    from eval.report.formats import render
    from eval.report.tables import results
    from eval.run.contestants import choose, compared_by_default, default_agents, default_planners
    from eval.run.episodes import EnvironmentSettings
    from eval.run.rig import import_plugins
    from eval.run.runner import schedule

    import_plugins(arguments.plugin)
    settings = EnvironmentSettings(profile=arguments.profile, max_steps=arguments.max_steps)
    kind = arguments.kind or ("both" if arguments.instructions is None else None)
    planners = tuple(arguments.planner)
    if not planners and (arguments.instructions is None or arguments.understanding != "reference"):
        planners = default_planners(_KINDS[kind] if kind else (), arguments.understanding)
    contestants = choose(
        arguments.agents or default_agents(planners),
        settings,
        planners=planners,
        given=arguments.planner,
        understanding=arguments.understanding,
        prior=arguments.prior,
        costs=arguments.cost,
    )
    if not arguments.agents:
        contestants = tuple(filter(compared_by_default, contestants))
    plan = schedule(
        contestants,
        _files(arguments.instructions, kind),
        arguments.seeds,
        kinds=_KINDS[kind] if kind else (),
        sampled=arguments.sample,
        limit=arguments.limit,
        settings=settings,
        plugins=arguments.plugin,
    )
    path, status = run_shown(arguments, plan)
    records = read_records([path], whole=False)
    found = results(records, arguments.compare, read_prices(arguments.prices))
    sys.stdout.write(render(found, arguments.format, failures=arguments.failures, costs=arguments.costs))
    if not arguments.quiet:
        print(f"gavel eval: records in {path}", file=sys.stderr)
    return status or _all_failed(records.records.values())


def _all_failed(records: Collection[EpisodeRecord]) -> int:
    """Return 1, and say why, if every episode ended in an error: that is not a result of the agents."""
    if not records or any(record.outcome not in ("error", "rejected") for record in records):
        return 0
    first = next(iter(records))
    last = (first.error.strip().splitlines() or [first.failure])[-1]
    print(f"gavel eval: every episode failed; the first: {last}", file=sys.stderr)
    return 1


def _files(paths: list[str] | None, kind: str | None) -> list[InstructionSet]:
    from gavel_env.instructions.record import read_instructions, shipped

    if paths is None:
        return [read_instructions(shipped(name)) for name in _KINDS[kind or "both"]]
    return [read_instructions(path) for path in paths]
