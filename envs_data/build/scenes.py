"""Build `envs_data/scenes/*.json`: all 51 scenes, or the ones named.

    python -m envs_data.build.scenes [SCENE ...]

Deterministic: the same sources give the same bytes (docs/howto/scenes.md).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
from shapely.ops import unary_union

from envs_data.build.layout_checks import check_layout
from envs_data.build.layout_furnish import furnish
from envs_data.build.layout_generate import generated_outline
from envs_data.build.layout_items import assign_items
from envs_data.build.layout_mounts import mount_all
from envs_data.build.layout_outline import Outline, measured_outline, measured_scenes, polygon_of
from envs_data.build.layout_pieces import Contents, contents_of, source_scenes
from envs_data.build.layout_poses import RoomLayout
from envs_data.build.layout_space import RoomSpace
from gavel_env.house.scenes import FORMAT, Furniture, NotPlaced, Scene, check_scene

__all__ = ["build_scene", "encode", "main"]

SCENES = Path(__file__).resolve().parent.parent / "scenes"

BUILDING = "part of the building; the room outlines stand for it"
DOOR = "door leaf; its doorway is an opening that stands open"
NO_FLOOR = "the source gives this room no floor"
ENLARGE = 5
NO_PLACE = "no free place at real size that keeps the room passable"


def build_scene(name: str) -> Scene:
    """Lay out one scene.

    A measured outline is taken as it is. In a generated one, rooms whose pieces do not fit are enlarged by a tenth and
    the scene is laid out again, at most `ENLARGE` times.

    Raises:
        UnknownScene: bddl has no such scene.
    """
    contents = contents_of(name)
    if name in measured_scenes():
        return _build(name, contents, measured_outline(name))
    grown: dict[str, float] = {}
    twin = name.replace("_garden", "_int")
    for _ in range(ENLARGE):
        scene = _build(name, contents, generated_outline(name, contents, grown))
        fixed = {r.id for r in measured_outline(twin).rooms} if twin in measured_scenes() else set()
        full = {n.room for n in scene.not_placed if n.reason == NO_PLACE} - fixed
        if not full:
            break
        for room in sorted(full):
            grown[room] = round(grown.get(room, 1.0) * 1.1, 4)
    return scene


def _build(name: str, contents: tuple[Contents, ...], outline: Outline) -> Scene:
    """Lay out one scene on an outline; rooms that fail the independent checks are done again with wider aisles."""
    roomy: set[str] = set()
    while True:
        scene = _assemble(name, contents, outline, roomy)
        where = {f.id: f.room for f in scene.furniture} | {r.id: r.id for r in scene.rooms}
        wrong = {where[p.subject] for p in check_layout(scene) if p.subject in where} - roomy
        if not wrong:
            return scene
        roomy |= wrong


def _assemble(name: str, contents: tuple[Contents, ...], outline: Outline, roomy: set[str]) -> Scene:
    polygons = {room.id: polygon_of(room) for room in outline.rooms}
    house = unary_union([polygons[r] for r in sorted(polygons)])
    left: Counter[tuple[str, str, str, str]] = Counter()
    layouts: dict[str, RoomLayout] = {}
    loose = []
    for room in contents:
        for piece in room.pieces:
            reason = {"building": BUILDING, "door": DOOR}.get(piece.group)
            if room.room not in polygons and reason is None:
                reason = NO_FLOOR
            if reason is not None:
                left[(piece.room, piece.category, piece.model, reason)] += 1
        if room.room not in polygons:
            continue
        layouts[room.room] = _lay_out(room, outline, polygons, house, room.room not in roomy)
        loose += [p for p in room.pieces if p.group == "item"]
        for piece in layouts[room.room].left:
            left[(piece.room, piece.category, piece.model, NO_PLACE)] += 1
    furniture, numbers = _furniture(layouts)
    items = assign_items(loose, furniture, numbers)
    scene = Scene(
        format=FORMAT,
        scene=name,
        outline="measured" if name in measured_scenes() else "generated",
        source=outline.source,
        rooms=outline.rooms,
        openings=outline.openings,
        furniture=furniture,
        items=items,
        not_placed=tuple(
            NotPlaced(category, model, room, count, reason)
            for (room, category, model, reason), count in sorted(left.items())
        ),
    )
    check_scene(scene, name)
    return scene


def _lay_out(room: Contents, outline: Outline, polygons: dict[str, Any], house: Any, tight: bool) -> RoomLayout:
    openings = [o for o in outline.openings if room.room in o.rooms]
    standing = [p for p in room.pieces if p.group == "furniture" and p.role not in ("wall", "ceiling", "carpet", "top")]
    layout = furnish(lambda narrow: RoomSpace(polygons[room.room], openings, house, narrow), standing, tight)
    mount_all(layout, [p for p in room.pieces if p.group in ("furniture", "scenery")])
    return layout


def _furniture(layouts: dict[str, RoomLayout]) -> tuple[tuple[Furniture, ...], Counter[str]]:
    """Number the pieces: rooms by name, then category, model, y, x; no piece gets the id of a room (`bar_0`)."""
    numbers: Counter[str] = Counter()
    for room in layouts:
        stem, _, index = room.rpartition("_")
        numbers[stem] = max(numbers[stem], int(index) + 1)
    found: list[Furniture] = []
    for room in sorted(layouts):
        placed = layouts[room].placed
        order = sorted(
            range(len(placed)),
            key=lambda i: (placed[i].piece.key, placed[i].y, placed[i].x, placed[i].z, placed[i].yaw, i),
        )
        ids: dict[int, str] = {}
        for i in order:
            category = placed[i].piece.category
            ids[i] = f"{category}_{numbers[category]}"
            numbers[category] += 1
        for i in order:
            p = placed[i]
            found.append(
                Furniture(
                    id=ids[i],
                    category=p.piece.category,
                    model=p.piece.model,
                    room=room,
                    x=round(p.x, 3) + 0.0,
                    y=round(p.y, 3) + 0.0,
                    yaw=float(p.yaw),
                    size_m=p.piece.size_m,
                    z=round(p.z, 3) + 0.0,
                    mount=p.piece.mount,
                    on=ids[p.on] if p.on >= 0 else None,
                )
            )
    return tuple(found), numbers


def encode(scene: Scene) -> bytes:
    """Return the bytes of a scene file: one line per room, opening, piece and item."""
    fields: dict[str, Any] = {f: getattr(scene, f) for f in scene.__struct_fields__}
    lines = []
    for name, value in fields.items():
        if isinstance(value, tuple):
            inner = ",\n".join("  " + msgspec.json.encode(v).decode() for v in value)
            lines.append(f'"{name}":[\n{inner}]' if value else f'"{name}":[]')
        else:
            lines.append(f'"{name}":{msgspec.json.encode(value).decode()}')
    return ("{" + ",\n".join(lines) + "}\n").encode()


def report(scene: Scene) -> str:
    """Return one line on how much of a scene was placed."""
    missing = Counter[str]()
    for n in scene.not_placed:
        if n.reason not in (BUILDING, DOOR):
            missing[n.category] += n.count
    total = len(scene.furniture) + sum(missing.values())
    text = (
        f"{scene.scene}: {len(scene.rooms)} rooms, {len(scene.furniture)} of {total} pieces, {len(scene.items)} items"
    )
    if missing:
        text += "; left out: " + ", ".join(f"{c} {n}" for c, n in sorted(missing.items()))
    return text


def main(arguments: list[str] | None = None) -> None:
    """Build the named scenes (default: all) into `envs_data/scenes`."""
    parser = argparse.ArgumentParser(prog="python -m envs_data.build.scenes", description=__doc__)
    parser.add_argument("scene", nargs="*", help="scene names (default: all 51)")
    names = parser.parse_args(arguments).scene or list(source_scenes())
    SCENES.mkdir(exist_ok=True)
    for name in names:
        begun = time.perf_counter()
        scene = build_scene(name)
        (SCENES / f"{name}.json").write_bytes(encode(scene))
        sys.stdout.write(f"{report(scene)} ({time.perf_counter() - begun:.1f} s)\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
