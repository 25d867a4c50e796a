"""`gavel export-plan`: a plan in the form of OmniGibson, PDDL or ROS 2; `gavel import-graph`: others' scene graphs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from eval.commands.verify import read_own_graph, read_plan
from gavel_env.errors import BadOption, DataError

__all__ = ["register"]

_FORMS = ("omnigibson", "pddl", "ros")
_SOURCES = ("virtualhome", "ai2thor", "procthor", "conceptgraphs", "hydra")


def register(subparsers: Any) -> None:
    """Add `gavel export-plan` and `gavel import-graph`."""
    parser = subparsers.add_parser(
        "export-plan",
        help="write a plan as OmniGibson calls, a PDDL plan or a behaviour tree",
        description="The plan must be readable whole. With --instruction, or --graph and --goal, it must be valid too; "
        "else nothing but its reading is checked. Exit status: 0 = written, 1 = not readable or not valid, 2 = wrong "
        "use or bad input.",
    )
    parser.add_argument("plan", metavar="PLAN", help="file with the plan, in any form; - = standard input")
    parser.add_argument("--to", required=True, choices=_FORMS, help="ros: BehaviorTree.CPP XML")
    world = parser.add_mutually_exclusive_group()
    world.add_argument("--instruction", metavar="ID|FILE", help="check the plan against this instruction first")
    world.add_argument("--graph", metavar="FILE", help="your own graph; names are read by it")
    parser.add_argument(
        "--goal", action="append", metavar="LITERAL", help="check the plan against this goal on --graph"
    )
    parser.add_argument("--categories", metavar="FILE", help="your own categories for --graph: TOML or JSON")
    parser.add_argument("--out", metavar="FILE", help="where to write; default: standard output")
    parser.set_defaults(run=_export)
    parser = subparsers.add_parser(
        "import-graph",
        help="turn a VirtualHome, AI2-THOR, ProcTHOR, ConceptGraphs or Hydra graph into one of this project",
    )
    parser.add_argument("graph", metavar="FILE", help="JSON as that project writes it")
    parser.add_argument("--from", dest="source", required=True, choices=_SOURCES)
    parser.add_argument("--relations", metavar="FILE", help="conceptgraphs: the relations between its objects")
    parser.add_argument("--out", metavar="FILE", required=True, help="where to write the graph")
    parser.set_defaults(run=_import)


def _export(arguments: argparse.Namespace) -> int:
    from gavel_agents.verification import read_plan_strictly, verify
    from gavel_env.exporters import EXPORTERS, UNCHECKED
    from gavel_env.world_model.goals import parse_goal

    text = read_plan(arguments.plan)
    if (arguments.goal or arguments.categories) and not arguments.graph:
        raise BadOption("--goal and --categories go with --graph")
    graph = None if arguments.graph is None else read_own_graph(arguments.graph, arguments.categories)
    checked = UNCHECKED
    if arguments.instruction is not None or arguments.goal:
        goal = [lit for given in arguments.goal or () for lit in parse_goal(given).literals] or None
        found = verify(instruction=arguments.instruction, graph=graph, goal=goal, plan=text, repair=False)
        if not found.passed:
            print(found.complaint, file=sys.stderr)
            return 1
        plan, graph = found.plan, found.verdict.trace[0]
        checked = (
            f"preconditions, goal and safety on the graph ({found.profile.value} rules); "
            "not geometry, reach, grasps or paths"
        )
    else:
        plan, missed = read_plan_strictly(text, graph)
        if missed:
            print("Not read as steps:", *missed, sep="\n", file=sys.stderr)
            return 1
    _write(EXPORTERS[arguments.to](plan, graph, checked), arguments.out)
    return 0


def _import(arguments: argparse.Namespace) -> int:
    from gavel_env.importers import IMPORTERS, from_conceptgraphs

    source = Path(arguments.graph)
    if arguments.source == "conceptgraphs":
        found = from_conceptgraphs(source, None if arguments.relations is None else Path(arguments.relations))
    elif arguments.relations is not None:
        raise BadOption("--relations goes with --from conceptgraphs")
    else:
        found = IMPORTERS[arguments.source](source)
    try:
        found.save(arguments.out)
    except OSError as error:
        raise DataError(f"{arguments.out} cannot be written: {error.strerror}") from error
    own = f", {len(found.file.categories)} categories of its own" if found.file.categories else ""
    print(f"{arguments.out}: {len(found.file.rooms)} rooms, {len(found.file.nodes)} things{own}")
    return 0


def _write(text: str, path: str | None) -> None:
    if path is None:
        sys.stdout.write(text)
        return
    try:
        Path(path).write_text(text, "utf-8")
    except OSError as error:
        raise DataError(f"{path} cannot be written: {error.strerror}") from error
