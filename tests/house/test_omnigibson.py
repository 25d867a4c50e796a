"""A small OmniGibson scene folder, written here, is read into rooms, openings and poses; broken ones are refused."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from eval.cli import main
from gavel_env.errors import SceneError
from gavel_env.house.omnigibson.scene_folder import import_scene, save_scene
from gavel_env.house.scenes import Scene, load_scene

SIDE_PX = 800  # 8 x 8 m, the origin in the middle
CATEGORIES = ("bedroom", "kitchen", "living_room")


def pixels(x0: float, y0: float, x1: float, y1: float) -> tuple[slice, slice]:
    column0, row0, column1, row1 = (round(v * 100 + SIDE_PX / 2) for v in (x0, y0, x1, y1))
    return slice(row0, row1), slice(column0, column1)


BEDROOM = (-3.0, -2.0, -0.05, 2.0)
KITCHEN = (0.05, -2.0, 3.0, 0.0)
LIVING_ROOM = (0.05, 0.0, 3.0, 2.0)  # open to the kitchen along its whole side
DOORWAY = (-0.05, 0.5, 0.05, 1.3)  # bedroom - living room, through a wall of 0.1 m


def turned(yaw_deg: float) -> list[float]:
    return [0.0, 0.0, math.sin(math.radians(yaw_deg) / 2), math.cos(math.radians(yaw_deg) / 2)]


def thing(
    category: str, model: str, room: str | None, pos: list[float], yaw: float = 0.0, **args: Any
) -> dict[str, Any]:
    rooms = {} if room is None else {"in_rooms": [room]}
    return {"args": {"category": category, "model": model, **rooms, **args}, "pos": pos, "ori": turned(yaw)}


OBJECTS = {
    "floors_a_0": thing("floors", "aaaaaa", "kitchen_0", [1.5, -1, 0], fixed_base=True, bounding_box=[3, 2, 0.01]),
    "bed_b_0": thing("bed", "bbbbbb", "bedroom_0", [-1.5, 0, 0.3], 90, fixed_base=True, bounding_box=[2, 1.5, 0.6]),
    "fridge_c_0": thing("fridge", "cccccc", "kitchen_0", [2.6, -1.6, 0.9], 180, scale=[1, 1, 2], fixed_base=True),
    "table_d_0": thing("breakfast_table", "dddddd", "living_room_0", [1.5, 1, 0.4], bounding_box=[1, 1, 0.8]),
    "oven_e_0": thing("microwave", "eeeeee", "living_room_0", [1.3, 1, 0.95], bounding_box=[0.3, 0.4, 0.3]),
    "apple_f_1": thing("apple", "ffffff", "living_room_0", [1.7, 1.2, 0.84], bounding_box=[0.07, 0.07, 0.07]),
    "apple_f_0": thing("apple", "ffffff", "kitchen_0", [2.6, -1.6, 0.5], bounding_box=[0.07, 0.07, 0.07]),
    "apple_f_2": thing("apple", "ffffff", None, [-2.5, -1.5, 0.04], bounding_box=[0.07, 0.07, 0.07]),
    "widget_g_0": thing("no_such_category", "gggggg", "kitchen_0", [1, -1, 0]),
}


class Folder:
    """A scene folder in the data set's format; change its parts, then `write`."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.path = root / "scenes" / "Tiny_int"
        self.objects: dict[str, dict[str, Any]] = {name: json.loads(json.dumps(o)) for name, o in OBJECTS.items()}
        self.maps = {name: np.zeros((SIDE_PX, SIDE_PX), np.uint8) for name in ("insseg", "semseg", "trav_no_obj")}
        for value, room in enumerate((BEDROOM, KITCHEN, LIVING_ROOM), start=1):
            self.maps["insseg"][pixels(*room)] = value
            self.maps["semseg"][pixels(*room)] = value
            self.maps["trav_no_obj"][pixels(*room)] = 255
        self.maps["trav_no_obj"][pixels(*DOORWAY)] = 255
        self.older = False
        self.categories: tuple[str, ...] | None = CATEGORIES
        self.scene: dict[str, Any] = {}

    def write(self) -> Path:
        (self.path / "layout").mkdir(parents=True)
        (self.path / "json").mkdir()
        for name, image in self.maps.items():
            cv2.imwrite(str(self.path / "layout" / f"floor_{name}_0.png"), image)
        registry = {n: {"root_link": {"pos": o["pos"], "ori": o["ori"]}} for n, o in self.objects.items() if "pos" in o}
        init = {n: {"class_name": "DatasetObject", "args": o["args"]} for n, o in self.objects.items()}
        init["robot0"] = {"class_name": "Fetch", "args": {}}
        state = {"object_registry": registry} if self.older else {"registry": {"object_registry": registry}}
        content = {"objects_info": {"init_info": init}, "state": state, **self.scene}
        (self.path / "json" / "Tiny_int_best.json").write_text(json.dumps(content))
        if self.categories is not None:
            (self.root / "metadata").mkdir()
            (self.root / "metadata" / "room_categories.txt").write_text("\n".join(self.categories) + "\n")
        return self.path


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def test_rooms_have_outline_area_and_type(folder: Folder) -> None:
    scene = import_scene(folder.write())
    assert (scene.scene, scene.outline) == ("Tiny_int", "imported")
    assert [(room.id, room.type) for room in scene.rooms] == [
        ("bedroom_0", "bedroom"),
        ("kitchen_0", "kitchen"),
        ("living_room_0", "living_room"),
    ]
    for room, (x0, y0, x1, y1) in zip(scene.rooms[1:2], (KITCHEN,), strict=True):
        xs, ys = zip(*room.polygon, strict=True)
        assert (min(xs), min(ys), max(xs), max(ys)) == pytest.approx((x0, y0, x1, y1), abs=0.02)
    areas = [room.area_m2 for room in scene.rooms]
    assert areas == pytest.approx([2.95 * 4.0 + 0.04, 2.95 * 2.0, 2.95 * 2.0 + 0.04], abs=0.02), "doorway: half each"


def test_openings_are_where_free_floor_connects_rooms(folder: Folder) -> None:
    openings = import_scene(folder.write()).openings
    assert [(o.rooms, o.kind) for o in openings] == [
        (("bedroom_0", "living_room_0"), "doorway"),
        (("kitchen_0", "living_room_0"), "open"),
    ]
    door, side = openings
    assert door.width_m == pytest.approx(0.8, abs=0.02)
    assert np.array(door.segment) == pytest.approx(np.array([[0.0, 0.5], [0.0, 1.3]]), abs=0.03)
    assert side.width_m == pytest.approx(2.95, abs=0.02)
    assert np.array(side.segment) == pytest.approx(np.array([[0.05, 0.0], [3.0, 0.0]]), abs=0.03)


def test_shut_wall_and_gap_too_narrow_are_no_openings(folder: Folder) -> None:
    free = folder.maps["trav_no_obj"]
    free[pixels(*DOORWAY)] = 0
    free[pixels(-0.05, 0.5, 0.05, 0.8)] = 255
    assert [o.rooms for o in import_scene(folder.write()).openings] == [("kitchen_0", "living_room_0")]


def test_two_doorways_between_the_same_rooms_stay_two(folder: Folder) -> None:
    folder.maps["trav_no_obj"][pixels(-0.05, 1.4, 0.05, 1.95)] = 255
    doors = [o for o in import_scene(folder.write()).openings if o.kind == "doorway"]
    assert [o.rooms for o in doors] == [("bedroom_0", "living_room_0")] * 2
    assert sorted(o.width_m for o in doors) == pytest.approx([0.55, 0.8], abs=0.02)


@pytest.mark.parametrize("older", [False, True])
def test_furniture_has_pose_size_and_support(folder: Folder, older: bool) -> None:
    folder.older = older
    scene = import_scene(folder.write())
    pieces = {piece.id: piece for piece in scene.furniture}
    assert sorted(pieces) == ["bed_0", "breakfast_table_0", "fridge_0", "microwave_0"]
    bed = pieces["bed_0"]
    assert (bed.x, bed.y, bed.yaw, bed.room, bed.model) == (-1.5, 0.0, 90.0, "bedroom_0", "bbbbbb")
    assert bed.size_m == (2.0, 1.5, 0.6)
    assert bed.z == pytest.approx(0.0)
    assert pieces["fridge_0"].yaw == 180.0
    assert pieces["microwave_0"].on == "breakfast_table_0"
    assert pieces["microwave_0"].z == pytest.approx(0.8)
    assert not pieces["microwave_0"].blocks
    assert pieces["breakfast_table_0"].on is None


def test_size_of_an_unknown_model_is_that_of_its_category_scaled(folder: Folder) -> None:
    from gavel_env.world_model.ontology import default_ontology

    fridge = next(piece for piece in import_scene(folder.write()).furniture if piece.category == "fridge")
    depth, width, height = default_ontology()["fridge"].size_m or (0, 0, 0)
    assert fridge.size_m == pytest.approx((depth, width, 2 * height), abs=0.002)


def test_size_of_a_shipped_model_is_its_own(folder: Folder) -> None:
    shipped = next(piece for piece in load_scene("Rs_int").furniture if piece.category == "fridge")
    folder.objects["fridge_c_0"]["args"] |= {"model": shipped.model, "scale": None}
    imported = next(piece for piece in import_scene(folder.write()).furniture if piece.category == "fridge")
    assert imported.size_m == pytest.approx(shipped.size_m)


def test_items_know_what_holds_them(folder: Folder) -> None:
    held = {item.id: (item.relation, item.holder) for item in import_scene(folder.write()).items}
    assert held == {
        "apple_0": ("in", "fridge_0"),
        "apple_1": ("on", "breakfast_table_0"),
        "apple_2": ("floor", "bedroom_0"),
    }


def test_what_has_no_place_is_listed_with_the_reason(folder: Folder) -> None:
    reasons = {entry.category: (entry.count, entry.reason) for entry in import_scene(folder.write()).not_placed}
    assert reasons == {
        "floors": (1, "part of the building; the room outlines stand for it"),
        "no_such_category": (1, "category is not in the ontology"),
    }


def write_metadata(root: Path, category: str, model: str, **content: Any) -> Path:
    file = root / "objects" / category / model / "misc" / "metadata.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(content))
    return root / "objects"


def test_objects_folder_gives_exact_boxes(folder: Folder) -> None:
    """Size = bbox_size * scale; the centre is the base link less the scaled offset, turned with the object."""
    folder.objects = {"fridge_c_0": folder.objects["fridge_c_0"]}
    folder.objects["fridge_c_0"]["args"]["in_rooms"] = "kitchen_0,living_room_0"
    objects = write_metadata(
        folder.root, "fridge", "cccccc", bbox_size=[0.7, 0.6, 0.5], base_link_offset=[0.1, 0, -0.2]
    )
    (fridge,) = import_scene(folder.write(), objects).furniture
    assert fridge.size_m == (0.7, 0.6, 1.0)
    assert (fridge.x, fridge.y) == (2.7, -1.6), "offset -0.1 along x, turned by 180 degrees"
    assert fridge.z == pytest.approx(0.9 + 0.4 - 0.5)
    assert fridge.room == "kitchen_0"


def test_lying_model_is_boxed_as_it_hangs(folder: Folder) -> None:
    """A flat picture (0.6 x 0.4 x 0.02) turned about y by 90 degrees looks along x: its thickness is the depth."""
    folder.objects = {
        "picture_h_0": thing("picture", "hhhhhh", "bedroom_0", [-2.9, 0, 1.5], bounding_box=[0.6, 0.4, 0.02]),
    }
    folder.objects["picture_h_0"]["ori"] = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]
    (picture,) = import_scene(folder.write()).furniture
    assert picture.size_m == (0.02, 0.4, 0.6)
    assert picture.yaw == 0.0
    assert picture.mount == "wall"


def test_rooms_without_objects_get_their_names_from_the_categories(folder: Folder) -> None:
    folder.objects = {"bed_b_0": folder.objects["bed_b_0"]}
    assert [room.id for room in import_scene(folder.write()).rooms] == ["bedroom_0", "kitchen_0", "living_room_0"]


def test_without_categories_the_objects_name_the_rooms(folder: Folder) -> None:
    folder.categories = None
    del folder.maps["semseg"]
    assert [room.type for room in import_scene(folder.write()).rooms] == ["bedroom", "kitchen", "living_room"]


def test_scene_file_round_trip(folder: Folder, tmp_path: Path) -> None:
    scene = import_scene(folder.write())
    save_scene(scene, tmp_path / "tiny.json")
    assert load_scene(tmp_path / "tiny.json") == scene


def test_robot_can_drive_between_all_imported_rooms(folder: Folder) -> None:
    from gavel_env.house.floor_map import known_layout

    layout = known_layout(import_scene(folder.write()))
    count, _ = cv2.connectedComponents(layout.free.astype(np.uint8), connectivity=4)
    assert count - 1 == 1


def without_map(folder: Folder) -> None:
    del folder.maps["trav_no_obj"]


def other_size(folder: Folder) -> None:
    folder.maps["trav_no_obj"] = folder.maps["trav_no_obj"][10:-10, 10:-10]


def not_square(folder: Folder) -> None:
    folder.maps["insseg"] = folder.maps["insseg"][10:]


def empty_map(folder: Folder) -> None:
    folder.maps["insseg"][:] = 0


def no_free_floor(folder: Folder) -> None:
    folder.maps["trav_no_obj"][pixels(*KITCHEN)] = 0


def wrong_category(folder: Folder) -> None:
    folder.maps["semseg"][folder.maps["semseg"] == 2] = 9


def contradicting_category(folder: Folder) -> None:
    folder.maps["semseg"][folder.maps["semseg"] == 2] = 3


def unknown_room(folder: Folder) -> None:
    folder.objects["bed_b_0"]["args"]["in_rooms"] = ["cellar_0"]


def unnamed_rooms(folder: Folder) -> None:
    folder.objects = {"bed_b_0": folder.objects["bed_b_0"]}
    folder.categories = None


def no_pose(folder: Folder) -> None:
    del folder.objects["bed_b_0"]["pos"]


def no_category(folder: Folder) -> None:
    del folder.objects["bed_b_0"]["args"]["category"]


def bad_quaternion(folder: Folder) -> None:
    folder.objects["bed_b_0"]["ori"] = [0, 0, 0, 0]


def bad_scale(folder: Folder) -> None:
    folder.objects["fridge_c_0"]["args"]["scale"] = [1, -1, 1]


def short_position(folder: Folder) -> None:
    folder.objects["bed_b_0"]["pos"] = [1, 2]


def no_registry(folder: Folder) -> None:
    folder.scene["state"] = {}


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (without_map, r"layout: floor_trav_no_obj_0.png missing; a scene's layout folder has"),
        (other_size, r"floor_trav_no_obj_0.png is 780 x 780, floor_insseg_0.png is 800 x 800 pixels"),
        (not_square, r"floor_insseg_0.png is 800 x 790 pixels; a layout map is square"),
        (empty_map, r"floor_insseg_0.png shows no room"),
        (no_free_floor, r"room 'kitchen_0' has no free floor in floor_trav_no_obj_0.png"),
        (wrong_category, r"room 2 of floor_insseg_0.png has category 9; room_categories.txt has lines 1 to 3"),
        (contradicting_category, r"value 2 is 'living_room' in floor_semseg_0.png, and 'kitchen_0' by the objects"),
        (unknown_room, r"'cellar_0'"),
        (unnamed_rooms, r"has rooms 1, 2, 3, the objects name 1 \(bedroom_0\); metadata/room_categories.txt"),
        (no_pose, r"Tiny_int_best.json: 'bed_b_0' is in objects_info, but the state has no pose of it"),
        (no_category, r"init_info\['bed_b_0'\].args has no category"),
        (bad_quaternion, r"'bed_b_0' has the orientation \(0.0, 0.0, 0.0, 0.0\); expected a unit quaternion"),
        (bad_scale, r"'fridge_c_0' has the scale \(1.0, -1.0, 1.0\); expected positive numbers"),
        (short_position, r"Tiny_int_best.json is malformed: Expected `array` of length 3"),
        (no_registry, r"state has neither registry.object_registry nor object_registry"),
    ],
)
def test_broken_folders_are_refused(folder: Folder, damage: Callable[[Folder], None], message: str) -> None:
    damage(folder)
    with pytest.raises(SceneError, match=message):
        import_scene(folder.write())


def test_missing_or_corrupt_files_are_named(folder: Folder) -> None:
    with pytest.raises(SceneError, match=r"nowhere is not a folder; expected an OmniGibson scene folder"):
        import_scene(folder.root / "nowhere")
    path = folder.write()
    with pytest.raises(SceneError, match=r"no_objects is not a folder"):
        import_scene(path, folder.root / "no_objects")
    objects = write_metadata(folder.root, "bed", "other", bbox_size=[1, 1, 1])
    with pytest.raises(
        SceneError, match=r"metadata.json cannot be read: .*; the objects folder has <category>/<model>"
    ):
        import_scene(path, objects)
    (path / "layout" / "floor_insseg_0.png").write_bytes(b"no picture")
    with pytest.raises(SceneError, match=r"floor_insseg_0.png is not a readable PNG"):
        import_scene(path)
    (path / "json" / "Tiny_int_best.json").unlink()
    with pytest.raises(SceneError, match=r"Tiny_int_best.json cannot be read: No such file"):
        import_scene(path)


@pytest.mark.parametrize("content", [b'{"metadata": "\xff"}', b"\xff\xfe", b'{"state": "\xed\xa0\x80"}'])
def test_a_scene_that_is_not_utf_8_is_named(folder: Folder, content: bytes) -> None:
    path = folder.write()
    (path / "json" / "Tiny_int_best.json").write_bytes(content)
    with pytest.raises(SceneError, match=r"Tiny_int_best\.json is malformed: "):
        import_scene(path)


def test_metadata_and_room_categories_that_are_not_utf_8_are_named(folder: Folder) -> None:
    folder.objects = {"bed_b_0": folder.objects["bed_b_0"]}
    path = folder.write()
    objects = write_metadata(folder.root, "bed", "bbbbbb", bbox_size=[1, 1, 1])
    [metadata] = objects.rglob("metadata.json")
    metadata.write_bytes(b'{"bbox_size": "\xff"}')
    with pytest.raises(SceneError, match=r"metadata\.json is malformed"):
        import_scene(path, objects)
    [categories] = folder.root.rglob("room_categories.txt")
    categories.write_bytes(b"kitchen\n\xff\n")
    with pytest.raises(SceneError, match=r"room_categories\.txt are not UTF-8"):
        import_scene(path)


@pytest.mark.parametrize("content", [{"bbox_size": [1, 1]}, {"bbox_size": [0, 1, 1]}, {}])
def test_broken_metadata_is_refused(folder: Folder, content: dict[str, Any]) -> None:
    folder.objects = {"bed_b_0": folder.objects["bed_b_0"]}
    objects = write_metadata(folder.root, "bed", "bbbbbb", **content)
    with pytest.raises(SceneError, match=r"metadata.json"):
        import_scene(folder.write(), objects)


def test_command_line(folder: Folder, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "tiny.json"
    assert main(["scenes", "import-omnigibson", str(folder.write()), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "3 rooms, 2 openings, 4 pieces, 3 items" in printed
    assert "left out: 1 (category is not in the ontology)" in printed
    assert isinstance(load_scene(out), Scene)
    assert main(["scenes", "show", str(out), "--png", str(tmp_path / "tiny.png")]) == 0
    assert (tmp_path / "tiny.png").stat().st_size > 5000
    assert main(["scenes", "import-omnigibson", str(folder.root)]) == 2
    assert "cannot be read" in capsys.readouterr().err
