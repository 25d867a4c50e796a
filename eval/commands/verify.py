"""`gavel verify`: a gate for anyone's plan, on an instruction's house or on one's own graph; and a repairer."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gavel_env.data import read_bytes
from gavel_env.errors import BadOption, DataError

if TYPE_CHECKING:
    from rich.console import Console

    from gavel_agents.verification import Verified
    from gavel_env.world_model.graph import SceneGraph
    from gavel_env.world_model.verdict import Verdict

__all__ = ["read_own_graph", "read_plan", "register"]


def register(subparsers: Any) -> None:
    """Add `gavel verify`."""
    parser = subparsers.add_parser(
        "verify",
        help="check a plan against an instruction, or a goal on a graph of your own, and repair it",
        description="Exit status: 0 = valid (with --repair: valid after repair), 1 = invalid, 2 = wrong use or bad "
        "input. What cannot be read as a step makes a plan invalid, unless --lenient.",
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--instruction", metavar="ID|FILE", help="id of a shipped instruction, FILE, or FILE#ID")
    what.add_argument("--graph", metavar="FILE", help="your own graph (docs/howto/worlds.md); needs --goal")
    parser.add_argument("--goal", action="append", metavar="LITERAL", help='such as "on_top(vial, rack)"; repeatable')
    parser.add_argument("--categories", metavar="FILE", help="your own categories for --graph: TOML or JSON")
    parser.add_argument("--scene", help="scene name or file; default: the instruction's own")
    parser.add_argument("--plan", required=True, metavar="FILE", help="text or JSON in any form; - = standard input")
    parser.add_argument("--repair", action="store_true", help="repair the plan; show the edits and the difference")
    parser.add_argument("--lenient", action="store_true", help="leave out what cannot be read, and say so")
    parser.add_argument("--profile", choices=("paper", "omnigibson"), default="paper", help="rules (default: paper)")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a report")
    parser.set_defaults(run=_verify)


def _verify(arguments: argparse.Namespace) -> int:
    from gavel_agents.verification import verify
    from gavel_env.world_model.goals import parse_goal

    options: dict[str, Any] = {"scene": arguments.scene, "instruction": arguments.instruction}
    if arguments.graph is not None:
        if arguments.scene is not None or not arguments.goal:
            raise BadOption("--graph needs --goal and takes no --scene")
        goal = [literal for text in arguments.goal for literal in parse_goal(text).literals]
        options = {"graph": read_own_graph(arguments.graph, arguments.categories), "goal": goal}
    elif arguments.goal or arguments.categories:
        raise BadOption("--goal and --categories go with --graph")
    result = verify(
        **options,
        plan=read_plan(arguments.plan),
        repair=arguments.repair,
        strict=not arguments.lenient,
        profile=arguments.profile,
    )
    if arguments.json:
        print(json.dumps(result.as_dict(), indent=2, ensure_ascii=False))
    else:
        _report(result)
    return 0 if result.passed else 1


def read_own_graph(graph: str, categories: str | None) -> SceneGraph:
    """Return the graph of a file, whose categories may be of another."""
    from gavel_env.world_model.graph import SceneGraph
    from gavel_env.world_model.ontology import default_ontology

    ontology = default_ontology() if categories is None else default_ontology().extend(Path(categories))
    return SceneGraph.from_json(Path(graph), ontology)


def read_plan(path: str) -> str:
    """Return the text of a plan file; `-` is standard input."""
    try:
        return sys.stdin.read() if path == "-" else read_bytes(path, "plan file").decode("utf-8")
    except UnicodeDecodeError as error:
        raise DataError(f"plan file {path} is not UTF-8 text: {error.reason} at byte {error.start}") from error


def _report(result: Verified) -> None:
    from rich.console import Console

    from gavel_agents.proposing.complaint import complaint

    out = Console(highlight=False, markup=False)
    where = f"{result.instruction} in {result.scene}" if result.instruction else result.scene or "own graph"
    out.print(f"{where} ({result.profile.value} rules)", style="bold")
    out.print("goal: " + ", ".join(result.goal.text()))
    if result.parsed.problem:
        out.print(f"plan: {result.parsed.problem}", style="red")
    said = "left out" if not result.strict else "not read"
    for piece in result.unread:
        out.print(f"{said}, {piece}", style="yellow" if not result.strict else "red")
    _print_verdict(out, "plan", result.verdict, result)
    if result.repaired is None:
        _print_plan(out, result.verdict)
    else:
        for edit in result.edits:
            out.print(f"  {edit}", style="cyan")
        _print_diff(out, result)
        _print_verdict(out, "repaired plan", result.repaired.verdict, result)
    wrong = complaint(result.final, profile=result.profile)
    if wrong is not None:
        out.print("\n" + wrong.text(), style="dim")


def _print_verdict(out: Console, name: str, verdict: Verdict, result: Verified) -> None:
    missing = f"{len(result.unread)} piece{'s' * (len(result.unread) != 1)} of it could not be read"
    if verdict.valid and not (result.strict and result.unread):
        without = f" ({missing} and left out)" if result.unread else ""
        cost = f"{verdict.cost:.4g} {result.unit}"
        out.print(f"{name}: valid, {len(verdict.plan)} steps, {cost}{without}", style="bold green")
        return
    if verdict.valid and verdict is not result.verdict:
        out.print(f"{name}: valid, but not passed: {missing.replace('of it', 'of the plan')}", style="bold red")
        return
    if verdict.valid:
        out.print(f"{name}: invalid: {missing}; the steps that were read are valid", style="bold red")
        return
    out.print(f"{name}: invalid{f': {missing}' * bool(result.unread)}", style="bold red")
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
