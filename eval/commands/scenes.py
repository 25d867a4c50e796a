"""`gavel scenes`: list the scenes, draw one, import an OmniGibson one."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from gavel_env.house.scenes import Scene, load_scene, scene_names

__all__ = ["register"]


def register(subparsers: Any) -> None:
    """Add `gavel scenes`."""
    family = subparsers.add_parser("scenes", help="houses, shops and offices: list, show, import").add_subparsers(
        title="scene commands", metavar="COMMAND", required=True
    )

    listing = family.add_parser("list", help="table of the shipped scenes")
    listing.set_defaults(run=_list)

    show = family.add_parser("show", help="rooms and furniture of a scene, or a picture of it")
    show.add_argument("scene", help="name of a shipped scene, or a scene file (.json)")
    show.add_argument("--png", type=Path, metavar="FILE", help="draw it into this file")
    show.add_argument("--pixels-per-m", type=float, metavar="N", help="scale of the picture")
    show.add_argument("--no-labels", action="store_true", help="leave out the names of rooms and pieces")
    show.set_defaults(run=_show)

    imported = family.add_parser(
        "import-omnigibson", help="read a scene folder of the BEHAVIOR-1K data set (scenes/NAME) into a scene file"
    )
    imported.add_argument("path", type=Path, help="the folder, with `layout` and `json` in it")
    imported.add_argument("--out", type=Path, metavar="FILE", help="scene file to write (default: NAME.json)")
    imported.add_argument(
        "--objects", type=Path, metavar="DIR", help="the data set's `objects` folder, for exact sizes"
    )
    imported.set_defaults(run=_import)


def _floor_m2(scene: Scene) -> float:
    return sum(room.area_m2 for room in scene.rooms)


def _list(arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    table = Table("scene", "outline")
    for name in ("rooms", "area m²", "pieces", "items"):
        table.add_column(name, justify="right")
    scenes = [load_scene(name) for name in scene_names()]
    for scene in scenes:
        counts = (len(scene.rooms), f"{_floor_m2(scene):.0f}", len(scene.furniture), len(scene.items))
        table.add_row(scene.scene, scene.outline, *map(str, counts))
    # Into a file or a pipe, names are not cut to the 80 columns that rich assumes there.
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    rooms, pieces = sum(len(scene.rooms) for scene in scenes), sum(len(scene.furniture) for scene in scenes)
    print(f"{len(scenes)} scenes, {rooms} rooms, {pieces} pieces, {sum(len(scene.items) for scene in scenes)} items")
    return 0


def _show(arguments: argparse.Namespace) -> int:
    scene = load_scene(arguments.scene)
    if arguments.png is None:
        _print_contents(scene)
        return 0
    from gavel_env.render import draw_scene, save_png

    picture = draw_scene(scene, pixels_per_m=arguments.pixels_per_m, labels=not arguments.no_labels)
    save_png(picture, arguments.png)
    print(f"{arguments.png}: {scene.scene}, {picture.shape[1]} × {picture.shape[0]} pixels")
    return 0


def _print_contents(scene: Scene) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("room", "m²", "leads to", "furniture", show_lines=True)
    for room in scene.rooms:
        ends = [opening.rooms for opening in scene.openings if room.id in opening.rooms]
        neighbours = sorted({end for pair in ends for end in pair} - {room.id})
        pieces = sorted(piece.id for piece in scene.furniture if piece.room == room.id)
        table.add_row(room.id, f"{room.area_m2:.1f}", ", ".join(neighbours), ", ".join(pieces))
    Console().print(table)
    print(f"{scene.scene}: {_floor_m2(scene):.0f} m², outline {scene.outline}; {scene.source}")
    if scene.items:
        print(f"{len(scene.items)} items: " + ", ".join(f"{i.id} {i.relation} {i.holder}" for i in scene.items))
    for left_out in scene.not_placed:
        print(f"not placed in {left_out.room}: {left_out.count} × {left_out.category} ({left_out.reason})")


def _import(arguments: argparse.Namespace) -> int:
    from gavel_env.house.omnigibson.scene_folder import import_scene, save_scene

    scene = import_scene(arguments.path, arguments.objects)
    out = arguments.out or Path(f"{scene.scene}.json")
    save_scene(scene, out)
    counts = f"{len(scene.rooms)} rooms, {len(scene.openings)} openings, {len(scene.furniture)} pieces"
    print(f"{out}: {counts}, {len(scene.items)} items; look at it with: gavel scenes show {out} --png FILE")
    reasons: dict[str, int] = {}
    for entry in scene.not_placed:
        reasons[entry.reason] = reasons.get(entry.reason, 0) + entry.count
    for reason, count in sorted(reasons.items()):
        print(f"left out: {count} ({reason})")
    return 0
