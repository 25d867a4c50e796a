"""`gavel eval understanding`: exact match and F1 of what an understanding makes of instructions."""

from __future__ import annotations

import argparse
import json
from functools import partial
from typing import TYPE_CHECKING, Any

from eval.commands._families import family

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from eval.studies.understanding import Report
    from gavel_agents.understanding import Decomposition

__all__ = ["register"]

_FILES = ("validation", "single", "multi")


def register(subparsers: Any) -> None:
    """Add `gavel eval understanding`."""
    command = family(subparsers, "eval").add_parser(
        "understanding", help="score task understanding: objects, relations, goals, decomposition"
    )
    command.add_argument(
        "--understanding",
        default="rules",
        metavar="NAME",
        help="rules (default), adapter, adapter:FOLDER, llm or reference",
    )
    command.add_argument("--planner", metavar="SPEC", help="the language model that llm asks")
    command.add_argument("--record", metavar="FILE.jsonl.gz", help="keep what it answers; an existing file goes on")
    command.add_argument(
        "--instructions",
        action="append",
        metavar="FILE|NAME",
        help=f"instruction file or file of pairs, shipped or a path; repeatable (default: {', '.join(_FILES)})",
    )
    command.add_argument("--limit", type=int, metavar="N", help="only the first N of each file")
    command.add_argument("--mistakes", type=int, default=0, metavar="N", help="show the first N that are not exact")
    command.add_argument("--json", action="store_true", help="print the scores as JSON")
    command.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from eval.studies.recording import recorder
    from eval.studies.understanding import evaluate
    from gavel_agents.llm import load_model
    from gavel_agents.understanding import load_understanding
    from gavel_agents.understanding.pairs import read_samples
    from gavel_env.instructions.record import read_instructions, shipped

    planner, record = arguments.planner, arguments.record
    model = (recorder(planner, record, threads=1) if record else load_model(planner)) if planner else None
    names: list[str] = arguments.instructions or list(_FILES)
    reports: dict[str, Report] = {}
    for name in names:
        instructions: Any = ()
        if arguments.understanding == "reference":
            instructions = read_instructions(name if name.endswith(".jsonl") else shipped(name)).values()
        understanding = load_understanding(arguments.understanding, instructions, model)
        samples = read_samples(name)[: arguments.limit]
        reports[name] = evaluate(understanding, samples, partial(_shown, name, len(samples)))
    if arguments.json:
        print(json.dumps({name: _plain(report) for name, report in reports.items()}, indent=1))
    else:
        _print(arguments.understanding, reports, arguments.mistakes)
    return 0


def _shown(name: str, total: int, answers: Iterable[Decomposition]) -> Iterator[Decomposition]:
    """Pass answers on, with a bar on a terminal's stderr."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(answers, name, total, console=console, transient=True, disable=not console.is_terminal)


def _plain(report: Report) -> dict[str, Any]:
    parts = {name: part._asdict() | {"f1": part.f1} for name, part in report.parts.items()}
    return {"instructions": report.instructions, "exact": report.exact, "parts": parts, "refused": report.refused}


def _print(name: str, reports: dict[str, Report], mistakes: int) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    for file, report in reports.items():
        table = Table(title=f"Understanding {name!r} on {file} ({report.instructions} instructions)")
        table.add_column("part")
        table.add_column("exact", justify="right")
        table.add_column("exact %", justify="right")
        table.add_column("F1", justify="right")
        for part, score in report.parts.items():
            f1 = "—" if score.f1 is None else f"{score.f1:.4f}"
            table.add_row(part, str(score.exact), _percent(score.exact, report.instructions), f1)
        table.add_row(
            "objects, relations and goals", str(report.exact), _percent(report.exact, report.instructions), ""
        )
        console.print(table)
        if report.refused:
            console.print("refused: " + ", ".join(f"{why} {n}" for why, n in sorted(report.refused.items())))
        for sample, got in report.mistakes[:mistakes]:
            console.print(f"[bold]{sample.id}[/bold] {sample.text}", highlight=False)
            console.print("  meant: " + " | ".join(str((*t.relations, "->", *t.goal)) for t in sample.tasks))
            console.print(
                "  read:  "
                + (got.refused or " | ".join(str((*map(str, t.relations), "->", *t.goal.text())) for t in got.tasks))
            )


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}" if whole else "—"
