"""Pictures show what the scene says: floors, walls, doorways, furniture and its fronts, names, the episode."""

from __future__ import annotations

import hashlib
import itertools
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from eval.cli import main
from gavel_env.errors import SceneError
from gavel_env.house.scenes import Furniture, Opening, RoomOutline, Scene, scene_names
from gavel_env.render import EpisodeView, Marker, RobotPose, ScenePicture, SeenFloor, draw_episode_frame, draw_scene
from gavel_env.render import labels as labels_module
from gavel_env.render.canvas import stamp
from gavel_env.render.floor import door_leaf
from gavel_env.render.style import INK, KIND_COLOURS, PAPER, WALL, Kind, floor_of, kind_of, room_title


def rectangle(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)


def flat(*furniture: Furniture, openings: tuple[Opening, ...] | None = None) -> Scene:
    """A kitchen (4 x 3 m) and, behind a wall of 0.1 m, a bathroom (2 x 3 m), joined by a doorway."""
    doorway = Opening(("bathroom_0", "kitchen_0"), ((4.0, 1.0), (4.0, 1.8)), 0.8, "doorway")
    return Scene(
        format="gavel-scene/1",
        scene="flat",
        outline="generated",
        source="written by hand",
        rooms=(
            RoomOutline("kitchen_0", "kitchen", rectangle(0, 0, 4, 3), 12.0),
            RoomOutline("bathroom_0", "bathroom", rectangle(4.1, 0, 6.1, 3), 6.0),
        ),
        openings=(doorway,) if openings is None else openings,
        furniture=furniture,
    )


def piece(name: str, x: float, y: float, yaw: float, size: tuple[float, float, float], **rest: object) -> Furniture:
    return Furniture(name, name.rsplit("_", 1)[0], "model", "kitchen_0", x, y, yaw, size, **rest)  # type: ignore[arg-type]


def at(picture: ScenePicture, x: float, y: float, image: np.ndarray | None = None) -> np.ndarray:
    column, row = picture.view.pixel(x, y)
    colour: np.ndarray = (picture.background if image is None else image)[int(row), int(column)].astype(int)
    return colour


def test_size_follows_the_scale() -> None:
    small = draw_scene(flat(), pixels_per_m=50, legend=False)
    large = draw_scene(flat(), pixels_per_m=100, legend=False)
    assert small.dtype == np.uint8
    assert small.shape[2] == 3
    assert (large.shape[0] - small.shape[0], large.shape[1] - small.shape[1]) == (150, 305)


def test_floor_wall_paper_and_doorway_stand_where_the_scene_says() -> None:
    picture = ScenePicture(flat(), pixels_per_m=100, labels=False)
    assert np.abs(at(picture, 1.0, 2.0) - floor_of("kitchen").colour).max() < 25
    assert np.abs(at(picture, 5.2, 2.2) - floor_of("bathroom").colour).max() < 25
    assert np.abs(at(picture, 4.05, 0.5) - WALL).max() < 10, "wall between the rooms"
    assert np.abs(at(picture, 2.0, -0.05) - WALL).max() < 10, "outer wall"
    assert at(picture, 4.05, 1.4).min() > 180, "the doorway is not a wall"
    assert tuple(picture.background[2, 2]) == PAPER


def test_open_side_is_floor_through_and_through() -> None:
    side = Opening(("bathroom_0", "kitchen_0"), ((4.0, 0.5), (4.0, 2.5)), 2.0, "open")
    picture = ScenePicture(flat(openings=(side,)), pixels_per_m=100, labels=False)
    assert np.abs(at(picture, 4.05, 1.5) - floor_of("bathroom").colour).max() < 8
    assert np.abs(at(picture, 4.05, 0.2) - WALL).max() < 10


def test_rooms_that_share_an_edge_still_have_a_wall() -> None:
    scene = flat(openings=())
    rooms = (scene.rooms[0], RoomOutline("bathroom_0", "bathroom", rectangle(4, 0, 6, 3), 6.0))
    picture = ScenePicture(Scene(**{name: getattr(scene, name) for name in scene.__struct_fields__} | {"rooms": rooms}))
    assert np.abs(at(picture, 4.0, 1.5) - WALL).max() < 25


def test_furniture_is_drawn_in_the_colour_of_its_kind() -> None:
    table = piece("breakfast_table_0", 2, 1.5, 0, (1.0, 1.0, 0.7))
    picture = ScenePicture(flat(table), pixels_per_m=100, labels=False)
    with_table, without = at(picture, 2, 1.5), at(ScenePicture(flat(), pixels_per_m=100, labels=False), 2, 1.5)
    assert np.abs(with_table - without).max() > 15
    assert np.abs(at(picture, 2.475, 1.5) - KIND_COLOURS[Kind.TABLE]).max() < 30


@pytest.mark.parametrize("yaw", [0, 90, 180, 270, 35])
def test_front_marker_points_along_yaw(yaw: float) -> None:
    fridge = piece("fridge_0", 2, 1.5, yaw, (0.8, 0.8, 1.8))
    picture = ScenePicture(flat(fridge), pixels_per_m=100, labels=False)
    cos, sin = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    front, back = (at(picture, 2 + side * 0.34 * cos, 1.5 + side * 0.34 * sin) for side in (1, -1))
    assert front.sum() + 100 < back.sum(), "the dark marker is at the front"


def test_depth_lies_along_yaw_and_width_across() -> None:
    sofa = piece("sofa_0", 2, 1.5, 90, (0.6, 2.0, 0.8))
    empty, full = (ScenePicture(scene, pixels_per_m=100, labels=False) for scene in (flat(), flat(sofa)))
    assert (at(full, 2.9, 1.5) != at(empty, 2.9, 1.5)).any(), "2 m wide across yaw 90 degrees: along x"
    assert (at(full, 2.0, 2.3) == at(empty, 2.0, 2.3)).all(), "0.6 m deep along y"


def test_what_stands_on_a_piece_is_drawn_over_it() -> None:
    counter = piece("countertop_0", 2, 1.5, 0, (1.2, 1.2, 0.9))
    oven = piece("microwave_0", 2, 1.5, 0, (0.5, 0.5, 0.3), z=0.9, on="countertop_0")
    for order in ((counter, oven), (oven, counter)):
        picture = ScenePicture(flat(*order), pixels_per_m=100, labels=False)
        colour = at(picture, 2, 1.5)
        assert colour[2] > colour[0], "the appliance's grey-blue, not the counter's brown"


def test_door_leaf_avoids_furniture() -> None:
    doorway = flat().openings[0]
    free = door_leaf(doorway, flat())
    assert np.mean([x for x, _ in free[1:]]) > 4.1, "swings into the bathroom, the smaller room"
    tub = Furniture("bathtub_0", "bathtub", "model", "bathroom_0", 4.9, 1.5, 0, (1.5, 2.9, 0.6))
    assert np.mean([x for x, _ in door_leaf(doorway, flat(tub))[1:]]) < 4.0, "then into the kitchen"
    assert door_leaf(doorway, flat(tub, piece("sofa_0", 3.3, 1.5, 0, (1.3, 2.9, 0.8)))) == []


def test_names_do_not_overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[tuple[int, int, int, int]] = []

    def record(image: np.ndarray, letters: np.ndarray, corner: tuple[int, int], *colours: object) -> None:
        assert 0 <= corner[0] <= image.shape[1] - letters.shape[1]
        assert 0 <= corner[1] <= image.shape[0] - letters.shape[0]
        written.append((*corner, corner[0] + letters.shape[1], corner[1] + letters.shape[0]))
        stamp(image, letters, corner, *colours)  # type: ignore[arg-type]

    monkeypatch.setattr(labels_module, "stamp", record)
    chairs = [piece(f"straight_chair_{i}", 0.4 + 0.45 * i, 1.5, 90, (0.4, 0.4, 0.9)) for i in range(8)]
    draw_scene(flat(*chairs), pixels_per_m=60)
    assert len(written) >= 2 + 4, "both rooms and at least half of the chairs"
    for first, second in itertools.combinations(written, 2):
        assert first[0] >= second[2] or second[0] >= first[2] or first[1] >= second[3] or second[1] >= first[3]


def test_labels_can_be_left_out() -> None:
    bed = piece("bed_0", 2, 1.5, 0, (2, 1.6, 0.5))
    assert (draw_scene(flat(bed), pixels_per_m=80) != draw_scene(flat(bed), pixels_per_m=80, labels=False)).any()


@pytest.mark.parametrize(
    ("category", "kind"),
    [
        ("fridge", Kind.APPLIANCE), ("microwave", Kind.APPLIANCE), ("washer", Kind.APPLIANCE),
        ("bottom_cabinet", Kind.STORAGE), ("coffee_table", Kind.TABLE), ("swivel_chair", Kind.SEAT),
        ("furniture_sink", Kind.BATH), ("table_lamp", Kind.LAMP), ("pot_plant", Kind.PLANT),
        ("no_such_thing", Kind.OTHER),
    ],
)  # fmt: skip
def test_kind_of(category: str, kind: Kind) -> None:
    assert kind_of(category) is kind


def test_room_title_drops_the_index_of_an_only_room() -> None:
    assert room_title("living_room_0", alone=True) == "living room"
    assert room_title("living_room_1", alone=False) == "living room 1"


def test_unknown_room_type_has_a_light_floor_of_its_own() -> None:
    first, second = floor_of("aviary").colour, floor_of("foundry").colour
    assert first != second
    assert min(first + second) > 150


def test_bad_input_is_a_typed_error() -> None:
    scene = flat()
    fields = {name: getattr(scene, name) for name in scene.__struct_fields__}
    with pytest.raises(SceneError, match="'flat' has no rooms"):
        draw_scene(Scene(**fields | {"rooms": (), "openings": ()}))
    with pytest.raises(SceneError, match="pixels_per_m is -3; it must be positive"):
        draw_scene(scene, pixels_per_m=-3)


def test_frame_shows_robot_heading_seen_floor_and_markers() -> None:
    picture = ScenePicture(flat(), pixels_per_m=60, labels=False, legend=False, caption_lines=1)
    before = picture.background.copy()
    seen = SeenFloor(np.zeros((30, 61), np.bool_), (0.0, 0.0), 0.1)
    seen.mask[:, :20] = True
    view = EpisodeView(
        robot=RobotPose(1.0, 1.0, 90.0), seen=seen, markers=(Marker(5.0, 2.5, "plate_1"),),
        trail=((0.4, 0.4), (1.0, 0.4), (1.0, 1.0)), route=((1.0, 1.0), (3.0, 1.0)), caption=("step 3",),
    )  # fmt: skip
    frame = draw_episode_frame(picture, view)
    assert (picture.background == before).all(), "the cached background is not drawn on"
    assert frame.shape == before.shape
    assert (at(picture, 0.5, 2.5, frame) == at(picture, 0.5, 2.5)).all(), "seen floor is as it was"
    assert at(picture, 3.5, 2.5, frame).sum() < at(picture, 3.5, 2.5).sum() - 100, "unseen floor is dimmed"
    assert (at(picture, 1.0, 2.0, frame) != at(picture, 1.0, 2.0)).any(), "the camera's wedge looks down"
    assert (at(picture, 1.0, 0.7, frame) != at(picture, 1.0, 0.7)).any(), "the trail"
    assert (at(picture, 1.6, 1.6, frame) == at(picture, 1.6, 1.6)).all(), "nothing beside the wedge"
    red, green, blue = at(picture, 5.0, 2.5, frame)
    assert red > 180 > max(green, blue)
    column, row = picture.caption_at
    assert frame[row : row + 22, column : column + 60].min() < max(INK) < before[row : row + 22].min()


def test_long_captions_are_cut_to_the_picture() -> None:
    picture = ScenePicture(flat(), pixels_per_m=40, legend=False, caption_lines=1)
    frame = draw_episode_frame(picture, EpisodeView(caption=("put everything away " * 20,)))
    assert (frame[-30:, -10:] == PAPER).all()


def test_a_frame_draws_what_changes_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Walls, furniture and labels are drawn once for a house, not once for a frame."""
    picture = ScenePicture(flat(), pixels_per_m=100)
    seen = SeenFloor(np.ones((30, 61), np.bool_), (0.0, 0.0), 0.1)
    view = EpisodeView(robot=RobotPose(1, 1, 0), seen=seen, route=((1, 1), (3, 1)), markers=(Marker(2, 2, "mug_1"),))
    first = draw_episode_frame(picture, view)
    for name in ("draw_house", "draw_furniture", "draw_labels"):
        monkeypatch.delattr(f"gavel_env.render.picture.{name}")
    assert (draw_episode_frame(picture, view) == first).all()
    with pytest.raises(NameError):
        ScenePicture(flat(), pixels_per_m=100)


def test_same_picture_in_another_process_and_hash_seed() -> None:
    code = (
        "import hashlib; from gavel_env.render import draw_scene; from gavel_env.house.scenes import load_scene;"
        "print(hashlib.sha256(draw_scene(load_scene('Rs_int'), pixels_per_m=40).tobytes()).hexdigest())"
    )
    digests = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        digests.add(done.stdout.strip())
    assert len(digests) == 1
    assert len(digests.pop()) == hashlib.sha256().digest_size * 2


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_can_be_drawn(name: str) -> None:
    from gavel_env.house.scenes import load_scene

    scene = load_scene(name)
    picture = ScenePicture(scene, pixels_per_m=30)
    assert len(np.unique(picture.background.reshape(-1, 3), axis=0)) > 200


def test_show_writes_a_png(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "rs.png"
    assert main(["scenes", "show", "Rs_int", "--png", str(target), "--pixels-per-m", "30"]) == 0
    stored = cv2.imread(str(target))
    assert stored is not None
    assert f"{stored.shape[1]} × {stored.shape[0]} pixels" in capsys.readouterr().out
    assert tuple(stored[2, 2][::-1]) == PAPER, "red and blue are not swapped"


def test_show_and_list_print_tables(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "show", "Rs_int"]) == 0
    assert "fridge_0" in capsys.readouterr().out
    assert main(["scenes", "list"]) == 0
    listing = capsys.readouterr().out
    assert all(name in listing for name in scene_names())


def test_command_line_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "show", "Rs_itn"]) == 2
    assert "did you mean 'Rs_int'" in capsys.readouterr().err
    assert main(["scenes", "show", "Rs_int", "--png", str(tmp_path / "no" / "rs.png")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert main(["scenes", "show", str(tmp_path / "missing.json")]) == 2
    assert "missing.json" in capsys.readouterr().err
