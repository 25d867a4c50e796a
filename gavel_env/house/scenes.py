"""Scenes: rooms, walls, doorways and furniture of the 51 BEHAVIOR-1K scenes.

One JSON file per scene (`envs_data/scenes/<name>.json`, format `gavel-scene/1`, docs/scenes.md), read into the frozen
structs below. Units are metres; x points right, y points down, yaw is degrees clockwise on the picture.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Literal

import msgspec

from gavel_env.data import read_json, shipped_data
from gavel_env.errors import SceneError, UnknownScene
from gavel_env.world_model.ontology import Mount

__all__ = [
    "BENCHMARK_HOUSES",
    "Furniture",
    "Item",
    "NotPlaced",
    "Opening",
    "RoomOutline",
    "Scene",
    "load_scene",
    "scene_names",
]

FORMAT = "gavel-scene/1"

BENCHMARK_HOUSES = (
    "Beechwood_0_int",
    "Pomaria_1_int",
    "Wainscott_0_int",
    "Ihlen_1_int",
    "Rs_int",
    "Benevolence_1_int",
    "Merom_1_int",
    "Wainscott_1_int",
    "Beechwood_1_int",
    "Pomaria_0_int",
)
"""The ten houses of the benchmarks; location priors never see them, nor their garden twins."""

Point = tuple[float, float]


class RoomOutline(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A room: id as bddl names it (`kitchen_0`), type (`kitchen`), its floor as a closed polygon, and pillars in it."""

    id: str
    type: str
    polygon: tuple[Point, ...]
    area_m2: float
    holes: tuple[tuple[Point, ...], ...] = ()


class Opening(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A passage between two rooms: a doorway, or an open side without a wall."""

    rooms: tuple[str, str]
    segment: tuple[Point, Point]
    width_m: float
    kind: Literal["doorway", "open"]


class Furniture(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A fixed piece.

    Attributes:
        id: `<category>_<index>`, unique in the scene.
        category: name in the ontology.
        model: BEHAVIOR model id (its bounding box gives `size_m`).
        room: id of the room it belongs to.
        x, y: centre of the footprint, metres.
        yaw: degrees clockwise; its front looks along (cos, sin) of yaw.
        size_m: (depth along the front direction, width across it, height), metres.
        z: height of its lower side above the floor, metres.
        mount: how it is fixed; only "floor" pieces without `on` block the way.
        on: id of the piece it stands on (a microwave on a countertop), or None.
    """

    id: str
    category: str
    model: str
    room: str
    x: float
    y: float
    yaw: float
    size_m: tuple[float, float, float]
    z: float = 0.0
    mount: Mount = "floor"
    on: str | None = None

    @property
    def blocks(self) -> bool:
        """True if the robot cannot drive through it."""
        return self.mount == "floor" and self.on is None


class Item(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A movable of the scene's own contents, and what holds it (`floor`: the room itself)."""

    id: str
    category: str
    model: str
    room: str
    relation: Literal["on", "in", "floor"]
    holder: str


class NotPlaced(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pieces of the source that the layout leaves out, and why."""

    category: str
    model: str
    room: str
    count: int
    reason: str


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A house (or shop, office, ...) as the executor drives in it."""

    format: str
    scene: str
    outline: Literal["measured", "generated", "imported"]
    source: str
    rooms: tuple[RoomOutline, ...]
    openings: tuple[Opening, ...]
    furniture: tuple[Furniture, ...]
    items: tuple[Item, ...] = ()
    not_placed: tuple[NotPlaced, ...] = ()


def scene_names() -> tuple[str, ...]:
    """Return the names of the shipped scenes, sorted."""
    return tuple(sorted(path.stem for path in shipped_data("scenes").glob("*.json")))


def load_scene(scene: str | Path) -> Scene:
    """Read and validate a scene by shipped name, or a scene file by path.

    Raises:
        UnknownScene: no shipped scene has this name (the message gives the nearest).
        SceneError: the file is unreadable, malformed or inconsistent.
    """
    if isinstance(scene, Path) or str(scene).endswith(".json"):
        return _read(str(scene), Path(scene).stat().st_mtime_ns if Path(scene).exists() else 0)
    if scene not in scene_names():
        raise UnknownScene(scene, scene_names())
    return _read(str(shipped_data("scenes", f"{scene}.json")), 0)


@lru_cache(maxsize=64)
def _read(path: str, _modified_ns: int) -> Scene:
    scene = read_json(path, Scene, "scene file", SceneError, version=FORMAT)
    check_scene(scene, path)
    return scene


def check_scene(scene: Scene, place: str) -> None:
    """Check that every reference inside a scene resolves.

    Raises:
        SceneError: names the file, the field and the value.
    """
    rooms = {r.id for r in scene.rooms}
    pieces = {f.id for f in scene.furniture}
    if len(rooms) != len(scene.rooms):
        raise SceneError(f"{place}: two rooms share an id")
    names = [f.id for f in scene.furniture] + [i.id for i in scene.items]
    if len(set(names)) != len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise SceneError(f"{place}: two objects share the id {twice!r}")
    if both := sorted(rooms.intersection(names)):
        raise SceneError(f"{place}: {both[0]!r} is the id of a room and of an object")
    for room in scene.rooms:
        if len(room.polygon) < 3:
            raise SceneError(f"{place}: room {room.id!r} has {len(room.polygon)} corners; a polygon needs 3")
    for opening in scene.openings:
        for room_id in opening.rooms:
            if room_id not in rooms:
                raise SceneError(f"{place}: an opening leads to {room_id!r}; rooms are {', '.join(sorted(rooms))}")
    for piece in scene.furniture:
        if piece.room not in rooms:
            raise SceneError(f"{place}: {piece.id} is in room {piece.room!r}; rooms are {', '.join(sorted(rooms))}")
        if piece.on is not None and piece.on not in pieces:
            raise SceneError(f"{place}: {piece.id} stands on {piece.on!r}, which is no piece of this scene")
    holders = pieces | {i.id for i in scene.items}
    for item in scene.items:
        known = rooms if item.relation == "floor" else holders
        if item.holder not in known:
            raise SceneError(f"{place}: {item.id} is {item.relation} {item.holder!r}, which is not in this scene")
