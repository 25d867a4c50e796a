"""`gavel scenes`: list the scenes, draw one, import an OmniGibson one."""

from __future__ import annotations

import argparse
from typing import Any

from gavel_env.scenes import load_scene, scene_names

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel scenes`."""
    family = subparsers.add_parser("scenes", help="houses, shops and offices: list, show, import").add_subparsers(
        title="scene commands", metavar="COMMAND", required=True
    )

    listing = family.add_parser("list", help="table of the shipped scenes")
    listing.set_defaults(run=_list)


def _list(arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Scenes")
    for name in ("scene", "outline"):
        table.add_column(name)
    for name in ("rooms", "area m²", "pieces", "items"):
        table.add_column(name, justify="right")
    for name in scene_names():
        scene = load_scene(name)
        area_m2 = sum(room.area_m2 for room in scene.rooms)
        counts = (len(scene.rooms), f"{area_m2:.0f}", len(scene.furniture), len(scene.items))
        table.add_row(scene.scene, scene.outline, *map(str, counts))
    Console().print(table)
    return 0
