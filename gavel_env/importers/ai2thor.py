"""AI2-THOR and ProcTHOR: a house (`rooms`, `doors`, `objects` with children), or the metadata of an event."""

from __future__ import annotations

import msgspec

from gavel_env.errors import GraphError
from gavel_env.importers.building import Box, Builder, Imported, Source, decode
from gavel_env.world_model.layout import Point

__all__ = ["from_ai2thor"]


class _Vector(msgspec.Struct):
    x: float
    y: float
    z: float

    @property
    def point(self) -> Point:
        return (self.x, self.z, self.y)


class _Room(msgspec.Struct, rename="camel"):
    id: str
    room_type: str
    floor_polygon: list[_Vector] = []


class _Door(msgspec.Struct):
    room0: str
    room1: str


class _Bounds(msgspec.Struct):
    center: _Vector
    size: _Vector


class _Object(msgspec.Struct, rename="camel"):
    id: str = ""
    position: _Vector | None = None
    kinematic: bool | None = None
    children: list[_Object] = []
    openness: float | None = None
    # Metadata of an event says these instead.
    object_id: str = ""
    object_type: str = ""
    parent_receptacles: list[str] | None = None
    pickupable: bool | None = None
    moveable: bool | None = None
    receptacle: bool | None = None
    openable: bool | None = None
    toggleable: bool | None = None
    is_open: bool = False
    is_toggled: bool = False
    is_dirty: bool = False
    is_cooked: bool = False
    is_picked_up: bool = False
    axis_aligned_bounding_box: _Bounds | None = None

    @property
    def key(self) -> str:
        return self.id or self.object_id

    @property
    def kind(self) -> str:
        return self.object_type or self.key.partition("|")[0]


class _House(msgspec.Struct):
    objects: list[_Object]
    rooms: list[_Room] = []
    doors: list[_Door] = []


_STRUCTURE = frozenset(("Floor", "Wall", "Ceiling", "Door", "Doorway", "Doorframe", "Window", "StandardWallSize"))


def from_ai2thor(source: Source) -> Imported:
    """Import a ProcTHOR house or the metadata of an AI2-THOR event.

    In a house, children are on their parent, or inside it if it can be opened; its objects say no affordances but
    whether they are bolted down (`kinematic`), so those of the known category of that name are taken. An event's
    metadata says what each thing affords, and its receptacles. What is on the floor is in the room whose outline it is
    in; an event without rooms has one. y is up there, z here.

    Raises:
        GraphError: malformed, or a door names a room that is not there.
    """
    house = decode(source, _House, "AI2-THOR house")
    to = Builder("AI2-THOR")
    outlines: dict[str, list[tuple[float, float]]] = {}
    for room in house.rooms:
        outline = tuple(corner.point[:2] for corner in room.floor_polygon)
        name = to.room(room.id, room.room_type, **({"footprint": outline} if len(outline) >= 3 else {}))
        outlines[name] = list(outline)
    if not house.rooms:
        outlines[to.room("room", "room")] = []
    for i, door in enumerate(house.doors):
        rooms = [to.known(room, f"$.doors[{i}]") for room in (door.room0, door.room1) if room != "exterior"]
        if len(rooms) == 2:
            to.connect(rooms[0], rooms[1])
    parents = {o.key: o.parent_receptacles[-1] for o in _all(house.objects) if o.parent_receptacles}
    for i, thing in enumerate(house.objects):
        if not thing.key:
            raise GraphError(f"AI2-THOR house: $.objects[{i}] has neither id nor objectId")
        if thing.kind not in _STRUCTURE:
            _add(thing, None, to, outlines)
    for key, parent in parents.items():
        if to.has(key) and to.has(parent):
            _put_into(to, to.known(key, ""), to.known(parent, ""))
    for name in to.things():
        to.put(name, room=_room_of(to, name, outlines))
    return to.finish()


def _all(objects: list[_Object]) -> list[_Object]:
    return [each for thing in objects for each in (thing, *_all(thing.children))]


def _add(thing: _Object, parent: str | None, to: Builder, outlines: dict[str, list[tuple[float, float]]]) -> None:
    stated = {
        "graspable": thing.pickupable,
        "openable": thing.openable,
        "toggleable": thing.toggleable,
    }
    if thing.receptacle is not None:
        stated |= {"interior" if thing.openable else "surface": thing.receptacle}
    facts = {fact: value for fact, value in stated.items() if value is not None}
    is_open = thing.is_open or bool(thing.openness)
    held = {"open": is_open, "toggled": thing.is_toggled, "dirty": thing.is_dirty, "cooked": thing.is_cooked}
    flags = tuple(flag for flag, value in held.items() if value)
    fixed = {"fixed": True} if thing.kinematic and thing.children else {}
    where = {} if thing.position is None else {"position": thing.position.point}
    name = to.thing(thing.key, thing.kind, facts, flags=flags, **fixed, **where)
    bounds = thing.axis_aligned_bounding_box
    if bounds is not None:
        (w, h, d) = (bounds.size.x, bounds.size.y, bounds.size.z)
        to.boxes[name] = Box(bounds.center.point, (w, d, h))
    if thing.is_picked_up:
        to.put(name, held=True)
    if parent is not None:
        _put_into(to, name, parent)
    for child in thing.children:
        _add(child, name, to, outlines)


def _put_into(to: Builder, name: str, holder: str) -> None:
    category = to.category(holder)
    inside = category.openable and category.interior
    to.put(name, **{"inside" if inside or (not category.surface and category.interior) else "on_top": holder})


def _room_of(to: Builder, name: str, outlines: dict[str, list[tuple[float, float]]]) -> str:
    point = to.position(name)
    for room, outline in outlines.items():
        if point is not None and outline and _within(point[0], point[1], outline):
            return room
    # `Bed|4|1`: the second part of a ProcTHOR id is the number of its room.
    number = to.names[name].split("|")[1:2]
    named = f"room|{number[0]}" if number else ""
    return to.known(named, "") if to.has(named) else next(iter(outlines))


def _within(x: float, y: float, outline: list[tuple[float, float]]) -> bool:
    """Return whether a point is inside a polygon, by counting crossings."""
    inside = False
    for (ax, ay), (bx, by) in zip(outline, [*outline[1:], outline[0]], strict=True):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            inside = not inside
    return inside
