"""Facts about the 51 shipped scenes: complete, inside their rooms, passable, and rebuilt to the same bytes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec
import pytest

from envs_data.build.layout_checks import blocking_overlaps, check_layout, footprint, free_map
from envs_data.build.manifest import check_manifest, compute
from gavel_env.errors import DataError
from gavel_env.house.floor_map import floor_map
from gavel_env.house.scenes import BENCHMARK_HOUSES, Scene, load_scene, scene_names
from gavel_env.world_model.ontology import default_ontology

SCENES = scene_names()
MEASURED = tuple(name for name in SCENES if load_scene(name).outline == "measured")
BENCHMARK = BENCHMARK_HOUSES
REBUILT = ("Rs_int", "Benevolence_2_int", "Pomaria_0_int", "hotel_suite_small")


def _moved(scene: Scene, piece: str, x: float, y: float) -> Scene:
    furniture = tuple(msgspec.structs.replace(f, x=x, y=y) if f.id == piece else f for f in scene.furniture)
    return msgspec.structs.replace(scene, furniture=furniture)


def test_all_scenes_are_shipped() -> None:
    assert len(SCENES) == 51
    assert len(MEASURED) == 15
    assert set(BENCHMARK) <= set(MEASURED)


@pytest.mark.parametrize("name", SCENES)
def test_layout_has_no_problem(name: str) -> None:
    """Nothing overlaps or leaves its room, doorways are free, every room and interactable piece is reached."""
    assert check_layout(load_scene(name)) == []


@pytest.mark.parametrize("name", MEASURED)
def test_executor_finds_a_stance_for_every_floor_piece(name: str) -> None:
    scene = load_scene(name)
    drawn = floor_map(scene)
    assert [r.id for r in scene.rooms if not drawn.room_cells[r.id].size] == []
    assert [f.id for f in scene.furniture if f.mount == "floor" and not len(drawn.stances(f.id))] == []


@pytest.mark.data
@pytest.mark.parametrize("name", SCENES)
def test_every_real_piece_is_accounted_for(name: str) -> None:
    common = pytest.importorskip("envs_data.build.common")
    scene = load_scene(name)
    told: Counter[tuple[str, str, str]] = Counter()
    told.update((f.room, f.category, f.model) for f in scene.furniture)
    told.update((i.room, i.category, i.model) for i in scene.items)
    for missing in scene.not_placed:
        told[(missing.room, missing.category, missing.model)] += missing.count
    real: Counter[tuple[str, str, str]] = Counter()
    for room, counts in common.room_objects()[name].items():
        for key, count in counts.items():
            category, model = key.rsplit("-", 1)
            real[(room, category, model)] += count
    assert told == real


@pytest.mark.parametrize("name", SCENES)
def test_what_is_left_out_is_little_and_says_why(name: str) -> None:
    scene = load_scene(name)
    assert all(n.count > 0 and n.reason for n in scene.not_placed)
    building = {n.reason for n in scene.not_placed if "building" in n.reason or "door leaf" in n.reason}
    lost = sum(n.count for n in scene.not_placed if n.reason not in building)
    assert lost <= 0.05 * (lost + len(scene.furniture)) or (name == "Benevolence_0_int" and lost == 1)


@pytest.mark.parametrize("name", SCENES)
def test_items_have_a_support_of_their_room(name: str) -> None:
    scene = load_scene(name)
    ontology = default_ontology()
    pieces = {f.id: f for f in scene.furniture}
    for item in scene.items:
        assert ontology[item.category].graspable, item
        if item.relation == "floor":
            assert item.holder == item.room
            continue
        holder = pieces[item.holder]
        assert holder.room == item.room
        assert ontology[holder.category].surface if item.relation == "on" else ontology[holder.category].interior


@pytest.mark.parametrize("name", SCENES)
def test_things_on_others_stay_within_them(name: str) -> None:
    scene = load_scene(name)
    pieces = {f.id: f for f in scene.furniture}
    for piece in scene.furniture:
        if piece.on is None:
            continue
        base = pieces[piece.on]
        assert base.room == piece.room
        assert piece.z >= base.z + base.size_m[2] - 0.01, piece.id
        assert footprint(piece).intersects(footprint(base)), piece.id
        if piece.category != "countertop":
            assert footprint(base).buffer(0.101, join_style="mitre").covers(footprint(piece)), piece.id


def test_mounted_things_hang_and_do_not_block() -> None:
    for name in BENCHMARK:
        for piece in load_scene(name).furniture:
            if piece.mount != "floor":
                assert not piece.blocks
            if piece.category == "top_cabinet":
                assert piece.mount == "wall"
                assert piece.z >= 1.2


def test_beds_and_sofas_look_into_the_room() -> None:
    """The floor before the front of a sofa or bed is floor of its own room."""
    for name in BENCHMARK:
        scene = load_scene(name)
        free = free_map(scene)
        assert free.label.max() > 0
        rooms = {r.id: i for i, r in enumerate(scene.rooms)}
        for piece in scene.furniture:
            if piece.category not in ("sofa", "bed"):
                continue
            step = piece.size_m[0] / 2 + 0.2
            dx, dy = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}[int(piece.yaw)]
            column = int((piece.x + dx * step - free.origin[0]) / 0.1)
            row = int((piece.y + dy * step - free.origin[1]) / 0.1)
            assert free.room[row, column] == rooms[piece.room], (name, piece.id)


def test_most_chairs_of_dining_rooms_stand_at_a_table() -> None:
    scene = load_scene("Wainscott_0_int")
    tables = [footprint(f).buffer(0.15) for f in scene.furniture if "table" in f.category and f.room == "dining_room_0"]
    chairs = [f for f in scene.furniture if f.category == "straight_chair" and f.room == "dining_room_0"]
    assert len(chairs) >= 6
    assert sum(any(t.intersects(footprint(c)) for t in tables) for c in chairs) == len(chairs)


def test_checks_see_a_piece_on_another() -> None:
    scene = load_scene("Rs_int")
    bed = next(f for f in scene.furniture if f.category == "bed")
    moved = _moved(scene, "bottom_cabinet_0", bed.x, bed.y)
    assert any(bed.id in (p.subject, p.detail.split()[0]) for p in blocking_overlaps(moved))


def test_checks_see_a_lamp_inside_a_cupboard() -> None:
    scene = load_scene("Rs_int")
    tall = max((f for f in scene.furniture if f.category == "bookcase"), key=lambda f: f.size_m[2])
    problems = check_layout(_moved(scene, "table_lamp_0", tall.x, tall.y))
    assert ("collision", "table_lamp_0", tall.id) in problems


def test_checks_see_a_piece_in_a_doorway_and_a_room_cut_off() -> None:
    scene = load_scene("Rs_int")
    door = next(o for o in scene.openings if o.rooms == ("bathroom_0", "bedroom_0"))
    x = (door.segment[0][0] + door.segment[1][0]) / 2
    y = (door.segment[0][1] + door.segment[1][1]) / 2 + 0.5
    problems = check_layout(_moved(scene, "shower_stall_0", x, y))
    assert {"doorway", "room unreached"} <= {p.kind for p in problems}


def test_checks_see_a_piece_beyond_the_wall() -> None:
    scene = load_scene("Rs_int")
    sofa = next(f for f in scene.furniture if f.category == "sofa")
    back_x, back_y = {0: (-1, 0), 90: (0, -1), 180: (1, 0), 270: (0, 1)}[int(sofa.yaw)]
    moved = _moved(scene, sofa.id, sofa.x + 0.5 * back_x, sofa.y + 0.5 * back_y)
    assert ("outside", sofa.id) in {p[:2] for p in check_layout(moved)}


@pytest.mark.data
@pytest.mark.parametrize("name", REBUILT)
def test_rebuild_gives_the_same_bytes(name: str) -> None:
    scenes = pytest.importorskip("envs_data.build.scenes")
    shipped = Path(scenes.SCENES / f"{name}.json").read_bytes()
    assert scenes.encode(scenes.build_scene(name)) == shipped


def test_manifest_names_every_data_file() -> None:
    assert check_manifest() == ()


def test_manifest_check_sees_every_kind_of_difference(tmp_path: Path) -> None:
    for name in ("a.json", "b.json"):
        (tmp_path / name).write_text("{}")
    files = compute(tmp_path)
    assert list(files) == ["a.json", "b.json"]
    files["gone.json"] = files.pop("a.json")
    (tmp_path / "MANIFEST.json").write_bytes(msgspec.json.encode({"format": "gavel-manifest/1", "files": files}))
    (tmp_path / "b.json").write_text("[]")
    found = check_manifest(tmp_path)
    assert [line.split(":")[0] for line in found] == ["gone.json", "a.json", "b.json"]


def test_missing_manifest_is_a_named_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"MANIFEST\.json cannot be read"):
        check_manifest(tmp_path)
