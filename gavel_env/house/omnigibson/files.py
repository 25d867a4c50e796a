"""The files of an OmniGibson scene, read and checked.

`json/<S>_best.json` has each object's category, model, scale and rooms in `objects_info.init_info[name].args`, and its
pose in `state.registry.object_registry[name].root_link` (older: `state.object_registry`), quaternions as x, y, z, w.
`objects/<category>/<model>/misc/metadata.json` has the unscaled bounding box.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from gavel_env.data import decode, read_bytes
from gavel_env.errors import SceneError
from gavel_env.house.scenes import MOST_METRES

__all__ = ["NativeBox", "Quaternion", "SourceFile", "SourceObject", "Vector", "read_native_box", "read_objects"]

T = TypeVar("T")

_FOLDER_NAME = re.compile(r"|\w[\w.-]{0,99}")

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class NativeBox(msgspec.Struct, frozen=True):
    """A model's unscaled bounding box, metres, and its centre's offset from the base link, negated."""

    bbox_size: Vector
    base_link_offset: Vector = (0.0, 0.0, 0.0)


class SourceObject(NamedTuple):
    """One object of the file."""

    category: str
    model: str
    scale: Vector
    fixed_base: bool
    rooms: tuple[str, ...]
    bounding_box: Vector | None
    position: Vector
    orientation: Quaternion


class SourceFile(NamedTuple):
    """The objects of a scene file, by name."""

    file: Path
    objects: dict[str, SourceObject]


class _Args(msgspec.Struct):
    category: str | None = None
    model: str = ""
    scale: float | Vector | None = None
    fixed_base: bool = False
    in_rooms: list[str] | str | None = None
    bounding_box: Vector | None = None


class _Init(msgspec.Struct):
    args: _Args
    class_name: str = "DatasetObject"


class _ObjectsInfo(msgspec.Struct):
    init_info: dict[str, _Init]


class _Link(msgspec.Struct):
    pos: Vector
    ori: Quaternion


class _ObjectState(msgspec.Struct):
    root_link: _Link


class _Registry(msgspec.Struct):
    object_registry: dict[str, _ObjectState]


class _State(msgspec.Struct):
    registry: _Registry | None = None
    object_registry: dict[str, _ObjectState] | None = None


class _SceneFile(msgspec.Struct):
    objects_info: _ObjectsInfo
    state: _State


def read_objects(file: Path) -> SourceFile:
    """Read `<scene>_best.json`; robots, lights and whatever else is not of the data set are left out.

    Raises:
        SceneError: the file is missing or malformed, or an object lacks its category, pose or a sound size.
    """
    content = _read(file, _SceneFile, "expected json/<scene>_best.json")
    poses = content.state.registry.object_registry if content.state.registry else content.state.object_registry
    if poses is None:
        raise SceneError(f"{file}: state has neither registry.object_registry nor object_registry")
    entries = {k: v.args for k, v in content.objects_info.init_info.items() if v.class_name == "DatasetObject"}
    return SourceFile(file, {name: _source_object(file, name, args, poses) for name, args in entries.items()})


def _read(file: Path, form: type[T], expected: str) -> T:
    try:
        return decode(read_bytes(file, "scene folder's file", SceneError), form)
    except SceneError as error:
        raise SceneError(f"{error}; {expected}") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SceneError(f"{file} is malformed: {error}") from error


def _source_object(file: Path, name: str, args: _Args, poses: dict[str, _ObjectState]) -> SourceObject:
    if not args.category:
        raise SceneError(f"{file}: objects_info.init_info[{name!r}].args has no category")
    for field, value in (("category", args.category), ("model", args.model)):
        if not _FOLDER_NAME.fullmatch(value):
            raise SceneError(f"{file}: {name!r} has the {field} {value[:80]!r}; expected a name as of a folder")
    if name not in poses:
        raise SceneError(f"{file}: {name!r} is in objects_info, but the state has no pose of it")
    link = poses[name].root_link
    if not math.isclose(math.hypot(*link.ori), 1.0, abs_tol=0.01):
        raise SceneError(f"{file}: {name!r} has the orientation {link.ori}; expected a unit quaternion x, y, z, w")
    plain = 1.0 if args.scale is None else args.scale
    scale = plain if isinstance(plain, tuple) else (plain, plain, plain)
    for field, numbers in (("scale", scale), ("bounding_box", args.bounding_box or (1.0,))):
        if not all(0 < number <= MOST_METRES for number in numbers):
            raise SceneError(
                f"{file}: {name!r} has the {field} {numbers}; expected positive numbers, to {MOST_METRES:g}"
            )
    if max(map(abs, link.pos)) > MOST_METRES:
        raise SceneError(f"{file}: {name!r} is at {link.pos}; expected metres, to {MOST_METRES} either way")
    rooms = args.in_rooms.split(",") if isinstance(args.in_rooms, str) else args.in_rooms or []
    return SourceObject(
        args.category,
        args.model,
        scale,
        args.fixed_base,
        tuple(room.strip() for room in rooms if room.strip()),
        args.bounding_box,
        link.pos,
        link.ori,
    )


def read_native_box(objects: Path, category: str, model: str) -> NativeBox:
    """Read a model's bounding box from the data set's `objects` folder.

    Raises:
        SceneError: its metadata is missing or malformed.
    """
    file = objects / category / model / "misc" / "metadata.json"
    box = _read(file, NativeBox, "the objects folder has <category>/<model>/misc/metadata.json")
    if not all(0 < size <= MOST_METRES for size in box.bbox_size):
        raise SceneError(f"{file}: bbox_size is {box.bbox_size}; expected positive metres")
    if max(map(abs, box.base_link_offset)) > MOST_METRES:
        raise SceneError(f"{file}: base_link_offset is {box.base_link_offset}; expected metres, to {MOST_METRES}")
    return box
