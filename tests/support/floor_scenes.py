"""A small flat drawn by hand, with walls that are hard to keep shut: no thickness, a thin gap, a thick wall."""

from __future__ import annotations

from gavel_env.house.scenes import FORMAT, Furniture, Item, Opening, RoomOutline, Scene, check_scene


def _room(name: str, x0: float, y0: float, x1: float, y1: float) -> RoomOutline:
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return RoomOutline(id=name, type=name.rsplit("_", 1)[0], polygon=corners, area_m2=(x1 - x0) * (y1 - y0))


def flat() -> Scene:
    """Four rooms in a row of three and one above; the pantry has no way in for the robot.

    kitchen | hall : walls without thickness, doorway of 0.8 m.
    hall | living room : a wall 0.06 m thick (less than a cell), doorway of 0.9 m.
    hall / study : a wall 0.2 m thick, the opening drawn in its middle.
    kitchen / pantry : an opening of 0.3 m, too narrow to drive through.
    """
    scene = Scene(
        format=FORMAT,
        scene="flat",
        outline="generated",
        source="drawn by hand for the tests",
        rooms=(
            _room("kitchen_0", 0.0, 0.0, 4.0, 5.0),
            _room("hall_0", 4.0, 0.0, 6.0, 5.0),
            _room("living_room_0", 6.06, 0.0, 13.0, 5.0),
            _room("study_0", 4.0, -4.2, 8.0, -0.2),
            _room("pantry_0", 0.0, 5.0, 2.0, 7.0),
        ),
        openings=(
            Opening(rooms=("hall_0", "kitchen_0"), segment=((4.0, 2.0), (4.0, 2.8)), width_m=0.8, kind="doorway"),
            Opening(rooms=("hall_0", "living_room_0"), segment=((6.03, 3.5), (6.03, 4.4)), width_m=0.9, kind="doorway"),
            Opening(rooms=("hall_0", "study_0"), segment=((4.5, -0.1), (5.4, -0.1)), width_m=0.9, kind="doorway"),
            Opening(rooms=("kitchen_0", "pantry_0"), segment=((0.5, 5.0), (0.8, 5.0)), width_m=0.3, kind="doorway"),
        ),
        furniture=(
            _piece("countertop_0", "kitchen_0", 0.35, 1.5, 0.0, (0.65, 2.4, 0.9)),
            _piece("microwave_0", "kitchen_0", 0.3, 0.7, 0.0, (0.34, 0.5, 0.3), on="countertop_0"),
            _piece("fridge_0", "kitchen_0", 0.4, 3.6, 0.0, (0.7, 0.7, 1.7)),
            _piece("breakfast_table_0", "kitchen_0", 2.4, 3.4, 30.0, (0.75, 1.2, 0.7)),
            _piece("sofa_0", "living_room_0", 9.0, 0.6, 90.0, (1.0, 2.4, 0.8)),
            _piece("bookcase_0", "living_room_0", 12.8, 2.5, 180.0, (0.35, 1.6, 1.8)),
            _piece("bottom_cabinet_0", "study_0", 6.0, -4.0, 90.0, (0.3, 0.6, 0.7)),
            _piece("table_lamp_0", "study_0", 6.0, -4.0, 90.0, (0.15, 0.15, 0.36), on="bottom_cabinet_0"),
            _piece("shelf_0", "pantry_0", 1.0, 6.8, 270.0, (0.3, 1.2, 0.1)),
        ),
        items=(
            _item("apple_0", "kitchen_0", "in", "fridge_0"),
            _item("bowl_0", "kitchen_0", "on", "breakfast_table_0"),
            _item("apple_1", "kitchen_0", "in", "bowl_0"),
            _item("plate_0", "living_room_0", "in", "bookcase_0"),
            _item("tray_0", "study_0", "floor", "study_0"),
            _item("apple_2", "pantry_0", "on", "shelf_0"),
        ),
    )
    check_scene(scene, "flat")
    return scene


def _piece(
    name: str, room: str, x: float, y: float, yaw: float, size_m: tuple[float, float, float], on: str | None = None
) -> Furniture:
    category = name.rsplit("_", 1)[0]
    return Furniture(id=name, category=category, model="x", room=room, x=x, y=y, yaw=yaw, size_m=size_m, on=on)


def _item(name: str, room: str, relation: str, holder: str) -> Item:
    category = name.rsplit("_", 1)[0]
    return Item(id=name, category=category, model="x", room=room, relation=relation, holder=holder)  # type: ignore[arg-type]


def empty_room() -> Scene:
    """One rectangular room with nothing in it."""
    room = _room("hall_0", 0.0, 0.0, 4.0, 3.0)
    return Scene(
        format=FORMAT, scene="box", outline="generated", source="tests", rooms=(room,), openings=(), furniture=()
    )


def room_with_niche() -> Scene:
    """A hall of 10 m by 5 m with a niche around a corner, less than a twentieth of its floor, and lamps in it."""
    corners = ((0.0, 0.0), (10.0, 0.0), (10.0, 7.2), (9.0, 7.2), (9.0, 5.0), (0.0, 5.0))
    room = RoomOutline(id="hall_0", type="hall", polygon=corners, area_m2=52.2)
    deep = _piece("floor_lamp_0", "hall_0", 9.2, 7.0, 0.0, (0.3, 0.3, 0.5))
    corner = _piece("table_lamp_0", "hall_0", 9.15, 5.6, 0.0, (0.1, 0.1, 0.3))
    return Scene(
        format=FORMAT,
        scene="niche",
        outline="generated",
        source="tests",
        rooms=(room,),
        openings=(),
        furniture=(deep, corner),
    )


def two_lobes() -> Scene:
    """A room whose far lobe, behind a bent neck of 0.3 m, can only be looked into from another room.

    The hall is (0..4, 0..4), its neck bends at x = 5, its far lobe is (5..7, 3..5) with a lamp; the study (7..10) has
    a slit of 0.3 m to it; the corridor joins hall and study.
    """
    near = ((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (5.3, 1.0), (5.3, 3.0), (7.0, 3.0), (7.0, 5.0), (5.0, 5.0))
    hall = RoomOutline(
        id="hall_0", type="hall", polygon=(*near, (5.0, 1.3), (4.0, 1.3), (4.0, 4.0), (0.0, 4.0)), area_m2=20.9
    )
    return Scene(
        format=FORMAT,
        scene="lobes",
        outline="generated",
        source="tests",
        rooms=(hall, _room("study_0", 7.0, 0.0, 10.0, 5.5), _room("corridor_0", 0.0, -2.0, 10.0, 0.0)),
        openings=(
            Opening(rooms=("corridor_0", "hall_0"), segment=((1.0, 0.0), (2.0, 0.0)), width_m=1.0, kind="doorway"),
            Opening(rooms=("corridor_0", "study_0"), segment=((8.0, 0.0), (9.0, 0.0)), width_m=1.0, kind="doorway"),
            Opening(rooms=("hall_0", "study_0"), segment=((7.0, 3.5), (7.0, 3.8)), width_m=0.3, kind="doorway"),
        ),
        furniture=(_piece("floor_lamp_0", "hall_0", 5.3, 4.7, 0.0, (0.3, 0.3, 1.3)),),
    )
