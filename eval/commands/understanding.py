"""`gavel eval understanding`: how much of instructions an understanding gets right, refuses and gets wrong."""

from __future__ import annotations

import argparse
import json
from functools import partial
from typing import TYPE_CHECKING, Any

from eval.commands._families import family

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.console import Console

    from eval.studies.understanding import Outcome, Report
    from gavel_agents.understanding import Decomposition
    from gavel_agents.understanding.pairs import Sample

__all__ = ["register"]

_FILES = ("validation", "single", "multi")
_SPLITS = ("dev", "test")


def register(subparsers: Any) -> None:
    """Add `gavel eval understanding`."""
    command = family(subparsers, "eval").add_parser(
        "understanding", help="score task understanding: objects, relations, goals, decomposition"
    )
    command.add_argument(
        "--understanding",
        default="rules",
        metavar="NAME",
        help="rules (default), adapter:FOLDER, llm or reference",
    )
    command.add_argument("--planner", metavar="SPEC", help="the language model that llm asks")
    command.add_argument("--record", metavar="FILE.jsonl.gz", help="record its answers; an existing file is continued")
    command.add_argument(
        "--instructions",
        action="append",
        metavar="FILE|NAME",
        help=f"instruction file or file of pairs, shipped or a path; repeatable (default: {', '.join(_FILES)})",
    )
    command.add_argument(
        "--answers", choices=("reference",), help="reference: the author of a record answers what is asked about it"
    )
    command.add_argument("--limit", type=int, metavar="N", help="only the first N of each file")
    command.add_argument(
        "--mistakes",
        type=int,
        default=0,
        metavar="N",
        help="show the first N that are not exact; those of a test half are only counted",
    )
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
        shown = partial(_shown, name, len(samples))
        reports[name] = evaluate(understanding, samples, shown, answered=arguments.answers is not None)
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
    return {
        **_counts(report.outcomes),
        "exact": report.exact,
        "parts": {name: part._asdict() | {"f1": part.f1} for name, part in report.parts.items()},
        "refused_for": report.refused,
        "splits": {split: _counts(part) for split, part in report.of(lambda sample: sample.split).items() if split},
        "voices": {voice: _counts(part) for voice, part in report.of(_voice).items() if voice},
    }


def _voice(sample: Sample) -> str:
    return f"{sample.split} {sample.voice}" if sample.voice else ""


def _counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    return {
        "instructions": len(outcomes),
        "goals": sum(outcome.goals for outcome in outcomes),
        "refused": sum(bool(outcome.got.refused) for outcome in outcomes),
        "silently_wrong": sum(outcome.wrong for outcome in outcomes),
        "asked": sum(outcome.asked for outcome in outcomes),
    }


def _print(name: str, reports: dict[str, Report], mistakes: int) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    for file, report in reports.items():
        table = Table(title=f"Understanding {name!r} on {file} ({report.instructions} instructions)")
        for column in ("", "goals exact", "%", "refused", "silently wrong", "questions answered"):
            table.add_column(column, justify="left" if not column else "right")
        table.add_row("all", *_row(report.outcomes))
        for split, part in report.of(lambda sample: sample.split).items():
            if split in _SPLITS:
                table.add_row(split, *_row(part))
        for voice, part in report.of(_voice).items():
            if voice:
                table.add_row(f"  {voice}", *_row(part))
        console.print(table)
        _print_parts(console, report)
        if report.refused:
            console.print("refused: " + ", ".join(f"{why} {n}" for why, n in sorted(report.refused.items())))
        for outcome in [o for o in report.mistakes if o.sample.split != "test"][:mistakes]:
            _print_mistake(console, outcome)


def _row(outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    counts = _counts(outcomes)
    share = _percent(counts["goals"], counts["instructions"])
    return (str(counts["goals"]), share, *(str(counts[key]) for key in ("refused", "silently_wrong", "asked")))


def _print_parts(console: Console, report: Report) -> None:
    """Print the strict figures, by text form."""
    from rich.table import Table

    table = Table(title="by their text form")
    for column in ("part", "exact", "exact %", "F1"):
        table.add_column(column, justify="left" if column == "part" else "right")
    for part, score in report.parts.items():
        f1 = "—" if score.f1 is None else f"{score.f1:.4f}"
        table.add_row(part, str(score.exact), _percent(score.exact, report.instructions), f1)
    table.add_row("objects, relations and goals", str(report.exact), _percent(report.exact, report.instructions), "")
    console.print(table)


def _print_mistake(console: Console, outcome: Outcome) -> None:
    sample, got = outcome.sample, outcome.got
    console.print(f"[bold]{sample.id}[/bold] {sample.text}", highlight=False)
    console.print("  meant: " + " | ".join(str((*t.relations, "->", *t.goal)) for t in sample.tasks))
    read = " | ".join(str((*map(str, t.relations), "->", *t.goal.text())) for t in got.tasks)
    console.print(f"  read:  {got.refused or read}")


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}" if whole else "—"
