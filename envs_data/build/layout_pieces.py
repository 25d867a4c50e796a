"""The contents of each scene as pieces to lay out: bddl's counts and bounding boxes, with a role for every category.

Source: bddl 3.6.0, `combined_room_object_list.json` (room -> category-model -> count) and `object_inventory.json`
(`bounding_box_sizes`, metres, x = depth along the front, y = width, z = height). Roles: `layout_rules.json`.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Literal, NamedTuple

import msgspec

from gavel_env.errors import UnknownScene
from gavel_env.world_model.ontology import Mount, default_ontology

__all__ = ["Contents", "Piece", "Rules", "Size", "contents_of", "floor_extents", "rules", "source_scenes"]

Size = tuple[float, float, float]
Group = Literal["furniture", "item", "building", "door", "scenery"]

FLOOR_CATEGORIES = ("floors", "lawn", "driveway")


class Rules(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How categories are stood in a room (`layout_rules.json`).

    Attributes:
        format: version of the file.
        about: what the file is.
        building: parts of the building; the room outline stands for them.
        doors: door leaves; the openings stand for them.
        scenery: plants and awnings that overhang the floor without closing it.
        roles: role -> categories.
        wall: wall-mounted category -> height of its lower side, metres.
        near: category -> categories that it is put near.
        bases: categories that a countertop is laid over.
        keeps_nothing: categories that no movable is put on or in, though one could be.
        stands_on: category -> categories that it stands on, best first; `floor` for what looks at the sofa.
        spin: categories that may turn a side to the wall.
        hubs: room types that one walks through, first the one that others hang on (generated outlines).
        hangs_on: room type -> room types that its door leads to, best first (generated outlines).
        orders: orders of the floor roles in which a room is furnished, the usual one first.
        last_orders: orders for rooms that none of these fills.
    """

    format: Literal["gavel-layout-rules/1"]
    about: str
    building: tuple[str, ...]
    doors: tuple[str, ...]
    scenery: tuple[str, ...]
    roles: dict[str, tuple[str, ...]]
    wall: dict[str, float]
    near: dict[str, tuple[str, ...]]
    bases: tuple[str, ...]
    keeps_nothing: tuple[str, ...]
    stands_on: dict[str, tuple[str, ...]]
    spin: tuple[str, ...]
    hubs: tuple[str, ...]
    hangs_on: dict[str, tuple[str, ...]]
    orders: tuple[tuple[str, ...], ...]
    last_orders: tuple[tuple[str, ...], ...]


class Piece(NamedTuple):
    """One instance to be laid out; `size_m` is (depth along the front, width, height)."""

    category: str
    model: str
    room: str
    size_m: Size
    role: str
    group: Group
    mount: Mount

    @property
    def key(self) -> tuple[str, str]:
        """Category and model."""
        return self.category, self.model

    @property
    def area_m2(self) -> float:
        """Footprint, square metres."""
        return self.size_m[0] * self.size_m[1]


class Contents(NamedTuple):
    """A room of the source: its pieces and the extents of its floors, metres."""

    room: str
    pieces: tuple[Piece, ...]
    floors_m: tuple[tuple[float, float], ...]


@cache
def rules() -> Rules:
    """Return the layout rules, read once."""
    path = resources.files("envs_data.build") / "layout_rules.json"
    return msgspec.json.decode(path.read_bytes(), type=Rules)


@cache
def _bddl(name: str) -> dict[str, object]:
    path = resources.files("bddl") / "generated_data" / name
    loaded: dict[str, object] = json.loads(path.read_text())
    return loaded


def _rooms() -> dict[str, dict[str, dict[str, int]]]:
    scenes = _bddl("combined_room_object_list.json")["scenes"]
    return scenes  # type: ignore[return-value]


def _boxes() -> dict[str, list[float]]:
    boxes = _bddl("object_inventory.json")["bounding_box_sizes"]
    return boxes  # type: ignore[return-value]


def source_scenes() -> tuple[str, ...]:
    """Return the names of the 51 scenes of bddl, sorted."""
    return tuple(sorted(_rooms()))


@cache
def _role_of() -> dict[str, str]:
    return {category: role for role, categories in rules().roles.items() for category in categories}


def _classify(category: str, size: Size) -> tuple[str, Group, Mount]:
    """Return role, group and mount of a category: the rules first, then the ontology, then the size."""
    table = rules()
    known = default_ontology()[category]
    if category in table.building:
        return "building", "building", "structure"
    if category in table.doors:
        return "door", "door", "structure"
    if category in table.wall:
        return "wall", "furniture", "structure" if known.mount == "structure" else "wall"
    role = _role_of().get(category)
    if role == "ceiling":
        return role, "furniture", "ceiling"
    if category in table.scenery:
        return "scenery", "scenery", "structure"
    if known.graspable:
        return "item", "item", "floor"
    if role is not None:
        return role, "furniture", "carpet" if role == "carpet" or known.mount == "carpet" else "floor"
    if known.mount == "ceiling":
        return "ceiling", "furniture", "ceiling"
    if known.mount == "carpet" or size[2] <= 0.03:
        return "carpet", "furniture", "carpet"
    if known.mount == "wall":
        return "wall", "furniture", "wall"
    small = max(size[0], size[1]) < 0.6 and size[2] < 0.5
    return ("corner" if small else "free"), "furniture", "floor"


def _oriented(role: str, box: list[float]) -> Size:
    """Return (depth, width, height); flat models of things that hang are modelled lying down."""
    x, y, z = (round(v, 3) for v in box)
    if role == "wall" and z < 0.1 and x > 0.2:
        x, z = z, x
    return max(x, 0.01), max(y, 0.01), max(z, 0.01)


def contents_of(scene: str) -> tuple[Contents, ...]:
    """Return the rooms of a scene with all their pieces, in the order of the room names.

    Raises:
        UnknownScene: bddl has no such scene.
    """
    if scene not in _rooms():
        raise UnknownScene(scene, source_scenes())
    boxes = _boxes()
    found = []
    for room, counts in sorted(_rooms()[scene].items()):
        pieces: list[Piece] = []
        for name, count in sorted(counts.items()):
            category, model = name.rsplit("-", 1)
            role, group, mount = _classify(category, _oriented("", boxes[model]))
            size = _oriented(role, boxes[model])
            pieces += [Piece(category, model, room, size, role, group, mount)] * count
        found.append(Contents(room, tuple(pieces), floor_extents(counts)))
    return tuple(found)


def floor_extents(counts: dict[str, int]) -> tuple[tuple[float, float], ...]:
    """Return the (x, y) extents in metres of the floors that a room lists, largest first."""
    found = []
    for name in sorted(counts):
        category, model = name.rsplit("-", 1)
        if category in FLOOR_CATEGORIES:
            box = _boxes()[model]
            found.append((round(box[0], 3), round(box[1], 3)))
    return tuple(sorted(found, key=lambda extent: (-extent[0] * extent[1], extent)))
