"""`gavel verify`: check anyone's plan against an instruction, and repair it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gavel_env.errors import DataError

if TYPE_CHECKING:
    from rich.console import Console

    from gavel_agents.verification import Verified
    from gavel_env.world_model.verdict import Verdict

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel verify`."""
    parser = subparsers.add_parser(
        "verify",
        help="check a plan against an instruction, and repair it",
        description="Exit status: 0 = valid (with --repair: valid after repair), 1 = invalid, 2 = bad input.",
    )
    parser.add_argument("--scene", help="scene name or file; default: the instruction's own")
    parser.add_argument(
        "--instruction", required=True, metavar="ID|FILE", help="id of a shipped instruction, FILE, or FILE#ID"
    )
    parser.add_argument("--plan", required=True, metavar="FILE", help="text or JSON in any form; - = standard input")
    parser.add_argument("--repair", action="store_true", help="repair the plan; show the edits and the difference")
    parser.add_argument("--profile", choices=("paper", "omnigibson"), default="paper", help="rules (default: paper)")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a report")
    parser.set_defaults(run=_verify)


def _verify(arguments: argparse.Namespace) -> int:
    from gavel_agents.verification import verify

    result = verify(
        scene=arguments.scene,
        instruction=arguments.instruction,
        plan=_read_plan(arguments.plan),
        repair=arguments.repair,
        profile=arguments.profile,
    )
    if arguments.json:
        print(json.dumps(result.as_dict(), indent=2, ensure_ascii=False))
    else:
        _report(result)
    return 0 if result.final.valid else 1


def _read_plan(path: str) -> str:
    try:
        return sys.stdin.read() if path == "-" else Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise DataError(f"plan file {path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"plan file {path} is no UTF-8 text: {error.reason} at byte {error.start}") from error


def _report(result: Verified) -> None:
    from rich.console import Console

    out = Console(highlight=False, markup=False)
    out.print(f"{result.instruction} in {result.scene} ({result.profile.value} rules)", style="bold")
    out.print("goal: " + ", ".join(result.goal.text()))
    if result.parsed.problem:
        out.print(f"plan: {result.parsed.problem}", style="red")
    for dropped in result.dropped:
        out.print(f"left out, line {dropped.line}: {dropped.text!r}: {dropped.reason}", style="yellow")
    _print_verdict(out, "plan", result.verdict)
    if result.repaired is None:
        _print_plan(out, result.verdict)
    else:
        for edit in result.edits:
            out.print(f"  {edit}", style="cyan")
        _print_diff(out, result)
        _print_verdict(out, "repaired plan", result.repaired.verdict)
    if result.complaint:
        out.print("\n" + result.complaint, style="dim")


def _print_verdict(out: Console, name: str, verdict: Verdict) -> None:
    if verdict.valid:
        out.print(f"{name}: valid, {len(verdict.plan)} steps, {verdict.cost:g} navigations", style="bold green")
        return
    out.print(f"{name}: invalid", style="bold red")
    if verdict.violation is not None:
        out.print(f"  step {(verdict.violation.step or 0) + 1}: {verdict.violation}", style="red")
        if verdict.nearest:
            out.print(f"  did you mean {' or '.join(verdict.nearest)}?", style="red")
    for condition in verdict.unmet:
        out.print(f"  unmet: {condition}", style="red")
    for flag, obj in verdict.unsafe:
        out.print(f"  left {'open' if flag.name == 'OPEN' else 'on'}: {obj}", style="red")


def _print_plan(out: Console, verdict: Verdict) -> None:
    failing = None if verdict.violation is None else verdict.violation.step
    for index, action in enumerate(verdict.plan):
        out.print(f"  {index + 1:3d}  {action}", style="red" if index == failing else None)


def _print_diff(out: Console, result: Verified) -> None:
    styles = {"+": "green", "-": "red"}
    lines = result.diff().splitlines()
    for line in lines[3:]:
        out.print(f"  {line[:1]} {line[1:]}", style=styles.get(line[:1]))
    if not lines:
        out.print("  (no change)")
