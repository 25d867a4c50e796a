"""Facts of the data over all 51 scenes that people asked about: what was left out of which house, and why."""

from __future__ import annotations

from collections import Counter

import pytest

from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.world_model.ontology import default_ontology

pytestmark = pytest.mark.slow

NO_PLACE = "no free place at real size that keeps the room passable"
NO_FLOOR = "the source gives this room no floor"

LEFT_OUT = {
    ("Benevolence_0_int", "bathroom_0", "bathtub", NO_PLACE): 1,
    ("Benevolence_2_int", "bedroom_0", "swivel_chair", NO_PLACE): 1,
    ("Ihlen_0_int", "storage_room_1", "countertop", NO_PLACE): 1,
    ("Ihlen_1_int", "bathroom_0", "shower_stall", NO_PLACE): 1,
    ("Wainscott_1_int", "private_office_0", "breakfast_table", NO_FLOOR): 1,
    ("Wainscott_1_int", "private_office_0", "carpet", NO_FLOOR): 1,
    ("Wainscott_1_int", "private_office_0", "straight_chair", NO_FLOOR): 1,
    ("Wainscott_1_int", "private_office_0", "top_cabinet", NO_FLOOR): 2,
}

ANNOTATED = {
    "bottle_of_soup": set(),
    "sugar_sack": {"fillable", "freezable", "heatable"},
    "swiss_cheese": {"sliceable"},
    "top_cabinet": {"fillable", "freezable", "heatable", "openable"},
    "treadmill": {"toggleable"},
}
"""What BEHAVIOR says of the synsets of five categories, of the abilities that anything here could follow from."""

ABILITIES = {
    "cookable", "coldSource", "fillable", "freezable", "heatSource", "heatable", "openable", "sliceable", "toggleable",
}  # fmt: skip


def test_nine_of_36164_pieces_have_no_place_and_say_why() -> None:
    told: Counter[str] = Counter()
    left: Counter[tuple[str, str, str, str]] = Counter()
    for name in scene_names():
        scene = load_scene(name)
        told.update(furniture=len(scene.furniture), items=len(scene.items))
        for missing in scene.not_placed:
            if missing.reason in (NO_PLACE, NO_FLOOR):
                left[(name, missing.room, missing.category, missing.reason)] += missing.count
            else:
                told["building"] += missing.count
    assert left == LEFT_OUT
    assert told == {"furniture": 11_076, "items": 23_204, "building": 1_875}
    assert told.total() + left.total() == 36_164


def test_a_room_without_a_floor_is_in_no_house() -> None:
    """Nothing stands, hangs or lies in Wainscott_1's private office: there is no such room to be sent to."""
    scene = load_scene("Wainscott_1_int")
    assert "private_office_0" not in {room.id for room in scene.rooms}
    assert "private_office_0" not in {thing.room for thing in scene.furniture}
    assert "private_office_0" not in {thing.room for thing in scene.items}


@pytest.mark.data
def test_the_source_gives_that_office_no_floor_and_every_other_room_one() -> None:
    common = pytest.importorskip("envs_data.build.common")
    bare = {
        (scene, room)
        for scene, rooms in common.room_objects().items()
        for room, counts in rooms.items()
        if not any(key.rsplit("-", 1)[0] in ("floors", "lawn", "driveway") for key in counts)
    }
    assert ("Wainscott_1_int", "private_office_0") in bare
    for scene, room in bare:
        assert room not in {r.id for r in load_scene(scene).rooms} or load_scene(scene).outline == "generated"


@pytest.mark.data
@pytest.mark.parametrize("name", ANNOTATED)
def test_five_categories_afford_what_behavior_says_of_them(name: str) -> None:
    common = pytest.importorskip("envs_data.build.common")
    category = default_ontology()[name]
    assert ABILITIES & set(common.properties(category.synset)) == ANNOTATED[name]
    assert category.openable == ("openable" in ANNOTATED[name])
    assert category.toggleable == ("toggleable" in ANNOTATED[name])
    assert category.heatable == ("heatable" in ANNOTATED[name])
    assert category.freezable == ("freezable" in ANNOTATED[name])
    assert category.interior == ("fillable" in ANNOTATED[name])
    assert not category.cookable
    assert category.graspable == (name in ("bottle_of_soup", "swiss_cheese"))
