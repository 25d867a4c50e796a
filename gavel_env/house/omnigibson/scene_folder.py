"""Import of an OmniGibson scene folder, for those who own the BEHAVIOR-1K data set.

A folder `scenes/<S>` has `layout/*.png` (read by `omnigibson_layout`) and `json/<S>_best.json` (`omnigibson_files`).
Sizes come from the data set's `objects` folder if it is given, else from a bounding box in the file, else from the
shipped scenes (same model), else from the ontology (same category).

The world's x points right and its y down in the layout maps, as in this project's scenes, so that poses carry over: an
object's x axis is its front, and yaw its rotation about z.
"""

from __future__ import annotations

import math
from collections import Counter
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec

from gavel_env.errors import SceneError
from gavel_env.house.omnigibson.files import NativeBox, Quaternion, SourceObject, Vector, read_native_box, read_objects
from gavel_env.house.omnigibson.layout_maps import Layout, read_layout
from gavel_env.house.scenes import FORMAT, Furniture, Item, NotPlaced, Scene, check_scene, load_scene, scene_names
from gavel_env.world_model.ontology import Mount, Ontology, default_ontology

__all__ = ["import_scene", "save_scene"]

_SUPPORT_GAP_M = 0.12  # how far a lower side may be off the top it stands on
_HANGS_FROM_M = 0.3  # a piece with nothing under it whose lower side is higher than this hangs on a wall


class _Solid(NamedTuple):
    """An object's upright bounding box: centre, metres; yaw, degrees; (depth, width, height)."""

    name: str
    source: SourceObject
    room: str
    centre: Vector
    yaw: float
    size_m: Vector

    @property
    def bottom_m(self) -> float:
        return self.centre[2] - self.size_m[2] / 2

    @property
    def top_m(self) -> float:
        return self.centre[2] + self.size_m[2] / 2

    def covers(self, x: float, y: float) -> bool:
        """True if a point lies on the footprint."""
        angle = math.radians(self.yaw)
        dx, dy = x - self.centre[0], y - self.centre[1]
        u, v = dx * math.cos(angle) + dy * math.sin(angle), dy * math.cos(angle) - dx * math.sin(angle)
        return abs(u) <= self.size_m[0] / 2 and abs(v) <= self.size_m[1] / 2


def import_scene(path: Path, objects: Path | None = None, ontology: Ontology | None = None) -> Scene:
    """Read an OmniGibson scene folder.

    Args:
        path: the folder `scenes/<S>`.
        objects: the data set's `objects` folder, for exact sizes, or None.
        ontology: categories; default: the shipped ones.

    Returns:
        The scene, `outline` "imported". What has no place in it is listed in `not_placed` with the reason.

    Raises:
        SceneError: a file is missing, malformed, or contradicts another; names the file and what was expected.
    """
    ontology = ontology or default_ontology()
    if not path.is_dir():
        raise SceneError(f"{path} is not a folder; expected an OmniGibson scene folder with `layout` and `json`")
    if objects is not None and not objects.is_dir():
        raise SceneError(f"{objects} is not a folder; expected the data set's `objects` folder")
    name = path.resolve().name
    source = read_objects(path / "json" / f"{name}_best.json")
    categories = path.resolve().parent.parent / "metadata" / "room_categories.txt"
    named = frozenset(room for entry in source.objects.values() for room in entry.rooms)
    layout = read_layout(path / "layout", named, categories if categories.is_file() else None)
    solids: list[_Solid] = []
    left_out: list[tuple[str, str, str, str]] = []
    for key, entry in sorted(source.objects.items()):
        room = _room_of(source.file, key, entry, layout)
        placed = _place(key, entry, room, objects, ontology)
        if isinstance(placed, str):
            left_out.append((entry.category, entry.model, room, placed))
        else:
            solids.append(placed)
    scene = _assemble(name, layout, solids, left_out, ontology)
    check_scene(scene, str(path))
    return scene


def save_scene(scene: Scene, path: Path) -> None:
    """Write a scene file that `load_scene` reads.

    Raises:
        SceneError: the file cannot be written.
    """
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(scene), indent=1) + b"\n")
    except OSError as error:
        raise SceneError(f"scene file {path} cannot be written: {error.strerror}") from error


def _room_of(file: Path, name: str, entry: SourceObject, layout: Layout) -> str:
    """Return the object's room: the first it is said to be in, else the one whose floor is nearest."""
    if not entry.rooms:
        return layout.room_at(entry.position[0], entry.position[1])
    known = [room.id for room in layout.rooms]
    if entry.rooms[0] not in known:
        raise SceneError(f"{file}: {name!r} is in room {entry.rooms[0]!r}; the layout has {', '.join(known)}")
    return entry.rooms[0]


def _place(name: str, entry: SourceObject, room: str, objects: Path | None, ontology: Ontology) -> _Solid | str:
    """Return the object where it stands, or why the scene leaves it out."""
    if entry.category not in ontology:
        return "category is not in the ontology"
    size = _native_size(entry, objects, ontology)
    if size is None:
        return "size unknown; give the data set's objects folder"
    solid = _solid(name, entry, room, size)
    if _is_building(solid, ontology):
        return "part of the building; the room outlines stand for it"
    return solid


def _native_size(entry: SourceObject, objects: Path | None, ontology: Ontology) -> NativeBox | None:
    """Return the unscaled bounding box; None if nobody knows it."""
    if objects is not None:
        return read_native_box(objects, entry.category, entry.model)
    if entry.bounding_box is not None:
        # The file gives the scaled box.
        depth, width, height = (b / s for b, s in zip(entry.bounding_box, entry.scale, strict=True))
        return NativeBox((depth, width, height))
    known = _shipped_sizes().get((entry.category, entry.model))
    if known is None:
        known = ontology[entry.category].size_m
    return None if known is None else NativeBox(known)


@cache
def _shipped_sizes() -> dict[tuple[str, str], Vector]:
    """Return the size of each model in the shipped scenes."""
    return {(f.category, f.model): f.size_m for name in scene_names() for f in load_scene(name).furniture}


def _rotate(q: Quaternion, v: Vector) -> Vector:
    """Rotate a vector by a quaternion (x, y, z, w)."""
    x, y, z, w = q
    norm = x * x + y * y + z * z + w * w
    s = 2.0 / norm if norm > 0 else 0.0
    return (
        v[0] * (1 - s * (y * y + z * z)) + v[1] * s * (x * y - z * w) + v[2] * s * (x * z + y * w),
        v[0] * s * (x * y + z * w) + v[1] * (1 - s * (x * x + z * z)) + v[2] * s * (y * z - x * w),
        v[0] * s * (x * z - y * w) + v[1] * s * (y * z + x * w) + v[2] * (1 - s * (x * x + y * y)),
    )


def _solid(name: str, entry: SourceObject, room: str, native: NativeBox) -> _Solid:
    """Return an object's box where it stands: its centre is the base link's position less the scaled, turned offset.

    A lying object (a flat model hung on a wall) is boxed as it lies in the world: its height is the vertical extent.
    """
    scale, position = entry.scale, entry.position
    offset = _rotate(entry.orientation, (
        -native.base_link_offset[0] * scale[0],
        -native.base_link_offset[1] * scale[1],
        -native.base_link_offset[2] * scale[2],
    ))  # fmt: skip
    centre = (position[0] + offset[0], position[1] + offset[1], position[2] + offset[2])
    extents = [native.bbox_size[i] * scale[i] for i in range(3)]
    axes = [_rotate(entry.orientation, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    upright = max(range(3), key=lambda i: abs(axes[i][2]))
    front = 0 if upright != 0 else 2
    across = 3 - upright - front
    yaw = math.degrees(math.atan2(axes[front][1], axes[front][0]))
    return _Solid(name, entry, room, centre, yaw, (extents[front], extents[across], extents[upright]))


def _is_building(solid: _Solid, ontology: Ontology) -> bool:
    """True for floors, ceilings, walls and door leaves; not for windows, which hang upright above the floor."""
    if ontology[solid.source.category].mount != "structure":
        return False
    depth, width, height = solid.size_m
    return solid.bottom_m < _HANGS_FROM_M or height < min(depth, width)


def _assemble(
    name: str, layout: Layout, solids: list[_Solid], left_out: list[tuple[str, str, str, str]], ontology: Ontology
) -> Scene:
    numbers: Counter[str] = Counter()
    for room in layout.rooms:
        stem, _, index = room.id.rpartition("_")
        numbers[stem] = max(numbers[stem], int(index) + 1)
    ids: dict[str, str] = {}
    for solid in solids:
        category = solid.source.category
        ids[solid.name] = f"{category}_{numbers[category]}"
        numbers[category] += 1
    movable = [s for s in solids if ontology[s.source.category].graspable and not s.source.fixed_base]
    fixed = [s for s in solids if s not in movable]
    furniture = tuple(_furniture(solid, fixed, ids, ontology) for solid in fixed)
    counts = Counter(left_out)
    return Scene(
        format=FORMAT,
        scene=name,
        outline="imported",
        source=f"imported from the OmniGibson scene folder {name}",
        rooms=layout.rooms,
        openings=layout.openings,
        furniture=furniture,
        items=tuple(_item(solid, fixed, ids, ontology) for solid in movable),
        not_placed=tuple(
            NotPlaced(category, model, room, counts[category, model, room, reason], reason)
            for category, model, room, reason in sorted(counts)
        ),
    )


def _support(solid: _Solid, others: list[_Solid]) -> _Solid | None:
    """Return the highest piece under an object's centre on whose top it stands, or None."""
    under = [
        other
        for other in others
        if other is not solid
        and other.covers(solid.centre[0], solid.centre[1])
        and abs(other.top_m - solid.bottom_m) <= _SUPPORT_GAP_M
        and other.size_m[2] > _SUPPORT_GAP_M  # not a carpet
    ]
    return max(under, key=lambda other: (other.top_m, other.name), default=None)


def _furniture(solid: _Solid, fixed: list[_Solid], ids: dict[str, str], ontology: Ontology) -> Furniture:
    category = solid.source.category
    mount: Mount = ontology[category].mount
    support = _support(solid, fixed) if mount == "floor" else None
    if mount == "floor" and support is None and solid.bottom_m > _HANGS_FROM_M:
        mount = "wall"
    depth, width, height = (round(value, 3) for value in solid.size_m)
    return Furniture(
        ids[solid.name],
        category,
        solid.source.model,
        solid.room,
        round(solid.centre[0], 3),
        round(solid.centre[1], 3),
        round(solid.yaw, 1),
        (depth, width, height),
        z=max(0.0, round(solid.bottom_m, 3)),
        mount=mount,
        on=ids[support.name] if support else None,
    )


def _item(solid: _Solid, fixed: list[_Solid], ids: dict[str, str], ontology: Ontology) -> Item:
    """Return a movable and what holds it: in what encloses its centre, else on what is under it, else on the floor."""
    category, (x, y, z) = solid.source.category, solid.centre
    around = [
        other
        for other in fixed
        if ontology[other.source.category].interior
        and other.covers(x, y)
        and other.bottom_m < z < other.top_m - solid.size_m[2] / 4
    ]
    entry = (ids[solid.name], category, solid.source.model, solid.room)
    if around:
        inner = min(around, key=lambda other: (math.prod(other.size_m), other.name))
        return Item(*entry, "in", ids[inner.name])
    support = _support(solid, fixed)
    if support is not None and ontology[support.source.category].surface:
        return Item(*entry, "on", ids[support.name])
    return Item(*entry, "floor", solid.room)
