"""`gavel activities`: BEHAVIOR's activities, their definitions, and how they are grounded in a scene."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gavel_env.activities.definitions import Activity

__all__ = ["register"]

GROUPS = ("core", "extended", "other")


def register(subparsers: Any) -> None:
    """Add `gavel activities`."""
    family = subparsers.add_parser("activities", help="BEHAVIOR's activities: list, show, ground").add_subparsers(
        title="activity commands", metavar="COMMAND", required=True
    )
    listing = family.add_parser("list", help="one line per activity: whether its goal is expressible, where shipped")
    listing.add_argument("--group", choices=GROUPS, help="only these")
    listing.add_argument("--scene", help="only those that fit this scene")
    listing.set_defaults(run=_list)
    show = family.add_parser("show", help="an activity's definition, or how it is grounded in a scene")
    show.add_argument("name", help="such as putting_away_toys")
    show.add_argument("--scene", help="ground it in this scene: text, placements and goal")
    show.set_defaults(run=_show)


def _list(arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    from gavel_env.activities import Ungroundable, ground, load_activities
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.record import read_instructions, shipped

    certified = {str(r.meta["activity"]): r for r in read_instructions(shipped("behavior")).values()}
    if arguments.scene is not None:
        load_scene(arguments.scene)
    table = Table("activity", "group", "shipped in", "needs")
    table.add_column("steps", justify="right")
    chosen: list[Activity] = []
    for activity in load_activities().activities:
        if arguments.group not in (None, activity.group):
            continue
        if arguments.scene is not None:
            if not activity.expressible:
                continue
            try:
                ground(activity, arguments.scene)
            except Ungroundable:
                continue
        chosen.append(activity)
        record = certified.get(activity.name)
        steps = "" if record is None else str(len(record.reference_plan()))
        scene = "" if record is None else record.scene
        table.add_row(activity.name, activity.group, scene, ", ".join(activity.needs), steps)
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    count = sum(activity.name in certified for activity in chosen)
    print(f"{len(chosen)} activities, {sum(a.expressible for a in chosen)} expressible, {count} shipped and certified")
    return 0


def _show(arguments: argparse.Namespace) -> int:
    from gavel_env.activities import ground, load_activities, text_of
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import instruction_graph
    from gavel_env.instructions.record import Instruction, TaskSpec
    from gavel_env.world_model.conditions import conjuncts

    activity = load_activities()[arguments.name]
    if not activity.expressible:
        print(f"{activity.name}: its goal needs {', '.join(activity.needs)}, which graphs do not have")
        return 1
    if arguments.scene is None:
        problem = activity.problem()
        print(f"{activity.name} ({activity.group})")
        print("objects: " + ", ".join(name for name in problem.names()))
        print("init:")
        for fact in problem.init:
            print(f"  {fact}")
        print("goal:")
        for part in problem.goal.parts if problem.goal.head == "and" else (problem.goal,):
            print(f"  {part}")
        return 0
    scene = load_scene(arguments.scene)
    grounding = ground(activity, scene)
    task = TaskSpec(activity.name, (), (), (grounding.goal,))
    draft = Instruction(activity.name, scene.scene, "", grounding.placements, (task,), "behavior", grounding.initial)
    print(text_of(grounding, instruction_graph(scene, draft)))
    print("placements:")
    for placement in grounding.placements:
        states = f" ({', '.join(placement.states)})" if placement.states else ""
        print(f"  {placement.id} {placement.relation} {placement.target}{states}")
    for title, lines in (("initial", grounding.initial), ("left out", grounding.left_out)):
        if lines:
            print(f"{title}: {', '.join(lines)}")
    print("goal:")
    for condition in conjuncts(grounding.goal):
        print(f"  {condition}")
    return 0
