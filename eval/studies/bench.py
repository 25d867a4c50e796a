"""`python -m eval.studies.bench`: how fast everything is, as medians beside the targets and beside the run before.

Peers are stepped in the same run. Scenes and compiled kernels are warm unless a line says fresh.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from eval.studies.bench_agents import AGENTS
from eval.studies.bench_decisions import DECISIONS
from eval.studies.bench_peers import PEERS
from eval.studies.bench_world import WORLD
from eval.studies.measuring import Measured, Measurement, measure
from gavel_env.errors import DataError, NotInstalled

__all__ = ["MEASUREMENTS", "Measured", "Measurement", "NotInstalled", "main", "measure"]

MEASUREMENTS: tuple[Measurement, ...] = (*WORLD, *AGENTS, *DECISIONS, *PEERS)
LAST = Path("runs") / "bench.json"


def main(argv: Sequence[str] | None = None) -> int:
    """Print the bench, and keep it for the next run to be compared with.

    Args:
        argv: arguments after the program's name; None = those of the process.

    Returns:
        0, or with `--strict` 1 if a target was missed.
    """
    parser = argparse.ArgumentParser(
        prog="python -m eval.studies.bench", description="Measure speed: medians beside targets and the run before."
    )
    parser.add_argument("--only", metavar="TEXT", help="only measurements whose name has this text")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--strict", action="store_true", help="exit with 1 if a target is missed")
    parser.add_argument(
        "--last", type=Path, default=LAST, metavar="FILE", help=f"compare with it, then write it (default: {LAST})"
    )
    arguments = parser.parse_args(argv)
    before = _read(arguments.last)
    found = [measure(m) for m in MEASUREMENTS if arguments.only is None or arguments.only.lower() in m.name.lower()]
    _write(arguments.last, before, found)
    if arguments.json:
        print(json.dumps([m._asdict() | {"met": m.met} for m in found], indent=1, ensure_ascii=False))
    else:
        _show(found, before)
    return 1 if arguments.strict and any(m.met is False for m in found) else 0


def _read(path: Path) -> dict[str, float]:
    """Return the medians of the run before by name; none if there was no run.

    Raises:
        DataError: the file is not a bench.
    """
    if not path.exists():
        return {}
    try:
        return {str(name): float(value) for name, value in json.loads(path.read_text("utf-8")).items()}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise DataError(f"bench {path} cannot be read: {error}; remove it, or choose another with --last") from error


def _write(path: Path, before: Mapping[str, float], found: Sequence[Measured]) -> None:
    medians = {**before, **{m.name: m.value for m in found if m.value is not None}}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(medians, indent=1, ensure_ascii=False) + "\n", "utf-8")


def _show(found: Sequence[Measured], before: Mapping[str, float]) -> None:
    from rich.console import Console
    from rich.table import Table

    busy = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    table = Table(
        title=f"Medians on {os.cpu_count()} × {platform.machine()}, Python {platform.python_version()}{busy}",
        title_justify="left",
    )
    for column in ("measured", "median", "last", "target", "", "samples"):
        table.add_column(column, justify="left" if column == "measured" else "right")
    for m in found:
        bound = "" if m.target is None else f"{'≥' if m.more_is_better else '≤'} {m.target:,g} {m.unit}"
        value = "—" if m.value is None else f"{_number(m.value)} {m.unit}"
        last = _number(before[m.name]) if m.name in before else ""
        verdict = {True: "met", False: "MISSED", None: m.note}[m.met]
        table.add_row(m.name, value, last, bound, verdict, str(m.samples or ""))
    console = Console()
    if not console.is_terminal:
        console.width = 130
    console.print(table)


def _number(value: float) -> str:
    return f"{value:,.{0 if value >= 100 else 1 if value >= 10 else 2 if value >= 1 else 3}f}"


if __name__ == "__main__":
    sys.exit(main())
