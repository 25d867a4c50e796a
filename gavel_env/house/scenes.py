"""Scenes: rooms, walls, doorways and furniture of the 51 BEHAVIOR-1K scenes.

One JSON file per scene (`envs_data/scenes/<name>.json`, format `gavel-scene/1`, docs/howto/scenes.md), read into the
frozen structs below. Units are metres; x points right, y points down, yaw is degrees clockwise on the picture.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
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

MOST_METRES = 1000.0
"""Largest coordinate or size of anything in a scene file."""

_WIDEST_M = 250.0
_MOST_WALL_M = 50_000.0
_MOST_CORNERS = 200_000
_NAME = re.compile(r"\w[\w.-]{0,99}")

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
        try:
            modified_ns = Path(scene).stat().st_mtime_ns
        except (OSError, ValueError):
            modified_ns = 0  # reading says what is wrong
        return _read(str(scene), modified_ns)
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
    _check_names(scene, place)
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
    _check_extents(scene, place)
    for opening in scene.openings:
        for room_id in opening.rooms:
            if room_id not in rooms:
                raise SceneError(f"{place}: an opening leads to {room_id!r}; rooms are {', '.join(sorted(rooms))}")
    for piece in scene.furniture:
        if piece.room not in rooms:
            raise SceneError(f"{place}: {piece.id} is in room {piece.room!r}; rooms are {', '.join(sorted(rooms))}")
        if piece.on is not None and piece.on not in pieces:
            raise SceneError(f"{place}: {piece.id} stands on {piece.on!r}, which is not a piece of this scene")
    holders = pieces | {i.id for i in scene.items}
    for item in scene.items:
        known = rooms if item.relation == "floor" else holders
        if item.holder not in known:
            raise SceneError(f"{place}: {item.id} is {item.relation} {item.holder!r}, which is not in this scene")
    _check_support(scene, place)


def _check_names(scene: Scene, place: str) -> None:
    """Check that ids can stand in goals, actions and tables."""
    if not scene.rooms:
        raise SceneError(f"{place}: there is no room")
    named = [(room.id, room.type) for room in scene.rooms]
    named += [(piece.id, piece.category) for piece in scene.furniture]
    named += [(item.id, item.category) for item in scene.items]
    for name, kind in named:
        for value in (name, kind):
            if not _NAME.fullmatch(value):
                wanted = "letters, digits, '_', '-' and '.', at most 100 of them"
                raise SceneError(f"{place}: {value[:80]!r} cannot name a room or an object; expected {wanted}")
        if name == "robot":
            raise SceneError(f"{place}: 'robot' is the robot's own id")


def _check_extents(scene: Scene, place: str) -> None:
    """Check that everything is as large as a building at most; grids are drawn of it."""
    for what, numbers in _numbers(scene):
        if not all(abs(number) <= MOST_METRES for number in numbers):
            raise SceneError(f"{place}: {what} has {max(numbers, key=abs)!r}; expected metres, to {MOST_METRES:g}")
    for piece in scene.furniture:
        if not (min(piece.size_m) > 0 and math.isfinite(piece.yaw)):
            raise SceneError(
                f"{place}: {piece.id} has the size {piece.size_m}, yaw {piece.yaw}; expected sizes above 0"
            )
    for opening in scene.openings:
        if not opening.width_m > 0:
            raise SceneError(f"{place}: the opening {' - '.join(opening.rooms)} has the width {opening.width_m}")
    corners = [point for room in scene.rooms for point in room.polygon]
    for axis in (0, 1):
        widest = max((point[axis] for point in corners), default=0.0) - min(
            (point[axis] for point in corners), default=0.0
        )
        if widest > _WIDEST_M:
            raise SceneError(f"{place}: the rooms extend over {widest:g} m; at most {_WIDEST_M:g}")
    rings = [ring for room in scene.rooms for ring in (room.polygon, *room.holes)]
    if sum(map(len, rings)) > _MOST_CORNERS:
        raise SceneError(f"{place}: the outlines have {sum(map(len, rings))} corners; at most {_MOST_CORNERS}")
    wall_m = sum(math.dist(a, b) for ring in rings for a, b in zip(ring, (*ring[1:], *ring[:1]), strict=True))
    if wall_m > _MOST_WALL_M:
        raise SceneError(f"{place}: the outlines are {wall_m:g} m long; at most {_MOST_WALL_M:g}")


def _numbers(scene: Scene) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield every length and coordinate, with what it is of."""
    for room in scene.rooms:
        for ring in (room.polygon, *room.holes):
            yield f"room {room.id!r}", tuple(number for point in ring for number in point) or (0.0,)
    for opening in scene.openings:
        yield f"the opening {' - '.join(opening.rooms)}", (*opening.segment[0], *opening.segment[1], opening.width_m)
    for piece in scene.furniture:
        yield f"piece {piece.id!r}", (piece.x, piece.y, piece.z, *piece.size_m)


def _check_support(scene: Scene, place: str) -> None:
    """Check that following what stands on or in what ends at a floor."""
    holder = {f.id: f.on for f in scene.furniture if f.on} | {
        i.id: i.holder for i in scene.items if i.relation != "floor"
    }
    sound: set[str] = set()
    for name in holder:
        path: dict[str, None] = {}
        at: str | None = name
        while at is not None and at not in sound:
            if at in path:
                raise SceneError(f"{place}: {at} stands on itself: {' on '.join([*path, at])[:200]}")
            path[at] = None
            at = holder.get(at)
        sound.update(path)
