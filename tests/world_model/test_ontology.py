"""The shipped ontology and placement evidence: what they say, where it comes from, and that they rebuild."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gavel_env.errors import DataError, UnknownCategory, UnknownConcept
from gavel_env.tasks.evidence import load_evidence
from gavel_env.world_model.ontology import (
    Category,
    Ontology,
    TemperatureSource,
    category_of,
    default_ontology,
    load_ontology,
)

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "envs_data"

needs_bddl = [
    pytest.mark.data,
    pytest.mark.skipif(importlib.util.find_spec("bddl") is None, reason="rebuilding needs the extra 'data' (bddl)"),
]

# bddl 3.6.0, properties_to_synsets.json: every openable synset.
OPENABLE = frozenset(
    {
        "backpack.n.01", "blender.n.01", "cabinet.n.01", "cabinet.n.03", "car.n.01", "carton.n.02",
        "cedar_chest.n.01", "clothes_dryer.n.01", "compartment.n.02", "cooler.n.01", "dishwasher.n.01",
        "door.n.01", "electric_cauldron.n.01", "electric_refrigerator.n.01", "gate.n.01", "hinged_jar.n.01",
        "laptop.n.01", "mailbox.n.01", "microwave.n.02", "openable_window.n.01", "oven.n.01",
        "recreational_vehicle.n.01", "recycling_bin.n.01", "rice_cooker.n.01", "tank.n.02", "toaster_oven.n.01",
        "toolbox.n.01", "violin_case.n.01", "washer.n.03",
    }
)  # fmt: skip


@pytest.fixture(scope="module")
def ontology() -> Ontology:
    return default_ontology()


def names(ontology: Ontology, flag: str) -> set[str]:
    return {name for name, category in ontology.items() if getattr(category, flag)}


def conditions(source: TemperatureSource | None) -> tuple[bool, bool, bool]:
    assert source is not None
    return source.requires_toggled_on, source.requires_closed, source.requires_inside


def test_file_is_broad_sorted_and_small(ontology: Ontology) -> None:
    assert len(ontology) > 1500
    assert list(ontology) == sorted(ontology)
    assert (SHIPPED / "ontology.json").stat().st_size < 1_500_000
    assert len(names(ontology, "graspable")) > 1000


def test_every_entry_says_synset_and_source(ontology: Ontology) -> None:
    for category in ontology.values():
        assert ".n." in category.synset
        assert category.source.startswith("bddl: ")
        decided = [("surface", category.surface), ("interior", category.interior), ("graspable", category.graspable)]
        for word, holds in decided:
            assert (f"{word}: " in category.source) == holds, category.name


def test_openable_is_annotated_never_invented(ontology: Ontology) -> None:
    opened = {ontology[name].synset for name in names(ontology, "openable")}
    assert opened <= OPENABLE
    missing = {name for name, c in ontology.items() if c.synset in OPENABLE and not c.openable}
    assert not missing


def test_requires_closed_is_bddls_list(ontology: Ontology) -> None:
    assert names(ontology, "requires_closed") == {"blender", "clothes_dryer", "dishwasher", "microwave", "washer"}
    assert ontology["oven"].toggleable
    assert not ontology["oven"].requires_closed


@pytest.mark.parametrize(
    ("name", "on_closed_inside"),
    [
        ("oven", (True, True, True)),
        ("microwave", (True, True, True)),
        ("toaster_oven", (True, True, True)),
        ("toaster", (True, False, True)),
        ("coffee_maker", (True, False, True)),
        ("stove", (True, False, False)),
        ("burner", (True, False, False)),
    ],
)
def test_heat_sources_have_bddls_conditions(
    ontology: Ontology, name: str, on_closed_inside: tuple[bool, bool, bool]
) -> None:
    category = ontology[name]
    assert conditions(category.heat) == on_closed_inside
    assert category.safety_critical
    if category.heat is not None and category.heat.requires_inside:
        assert category.interior


def test_cold_sources(ontology: Ontology) -> None:
    assert conditions(ontology["fridge"].cold) == (False, True, True)
    fridge, cooler = ontology["fridge"].cold, ontology["cooler"].cold
    assert fridge is not None
    assert fridge.freezes
    assert cooler is not None
    assert not cooler.freezes


def test_what_washes_and_dries(ontology: Ontology) -> None:
    assert names(ontology, "washes") == {"dishwasher", "washer"}
    assert names(ontology, "dries") == {"clothes_dryer"}
    assert "rule of the paper" in ontology["dishwasher"].source


def test_what_is_washable_is_carried_and_is_neither_eaten_nor_paper_nor_a_package(ontology: Ontology) -> None:
    washable = names(ontology, "washable")
    assert washable >= {"t_shirt", "quilt", "plate", "casserole", "tray", "wok", "teddy_bear", "gym_shoe", "backpack"}
    assert washable.isdisjoint(names(ontology, "cookable") - {"casserole"})
    assert washable <= names(ontology, "graspable") - names(ontology, "toggleable")
    assert not washable & {
        "newspaper", "hardback", "butter", "armchair", "wardrobe", "paper_towel", "wrapping_paper", "bottle_of_milk",
        "shampoo_bottle", "battery", "pillar_candle", "pot_plant", "violin", "bed", "straight_chair",
    }  # fmt: skip
    assert not any("__" in ontology[name].synset for name in washable)


@pytest.mark.parametrize(
    "name", ["bookcase", "drop_in_sink", "furniture_sink", "pedestal_sink", "hamper", "trash_can", "wicker_basket"]
)
def test_doorless_containers(ontology: Ontology, name: str) -> None:
    assert ontology[name].interior
    assert not ontology[name].openable
    assert not ontology[name].has_door


@pytest.mark.parametrize(
    "name",
    ["bottom_cabinet", "top_cabinet", "fridge", "oven", "microwave", "dishwasher", "washer", "clothes_dryer", "carton"],
)
def test_containers_with_a_door(ontology: Ontology, name: str) -> None:
    assert ontology[name].has_door


@pytest.mark.parametrize("name", ["door", "sliding_door", "openable_window", "garage_door", "gate"])
def test_doors_and_windows_hold_nothing(ontology: Ontology, name: str) -> None:
    category = ontology[name]
    assert category.openable
    assert not category.interior
    assert not category.surface
    assert category.mount == "structure"


@pytest.mark.parametrize(
    "name",
    [
        "bed", "pool_table", "breakfast_table", "coffee_table", "conference_table", "console_table", "desk",
        "countertop", "sofa", "straight_chair", "stove", "shelf", "tray", "plate", "bottom_cabinet", "nightstand",
        "bar", "bench", "ottoman",
    ],
)  # fmt: skip
def test_surfaces(ontology: Ontology, name: str) -> None:
    assert ontology[name].surface


@pytest.mark.parametrize(
    "name",
    ["wall_mounted_tv", "picture", "mirror", "ceiling_fan", "walls", "floors", "table_lamp", "top_cabinet"],
)
def test_not_surfaces(ontology: Ontology, name: str) -> None:
    assert not ontology[name].surface


@pytest.mark.parametrize(
    "name",
    [
        "apple", "plate", "tray", "laptop", "hardback", "notebook", "stockpot", "bowl", "mug", "t_shirt", "jeans",
        "sock", "teddy_bear", "pillow", "blanket", "broom", "wine_bottle", "hammer", "apple_pie", "cell_phone",
    ],
)  # fmt: skip
def test_graspable(ontology: Ontology, name: str) -> None:
    assert ontology[name].graspable
    assert ontology[name].mount == "floor"


@pytest.mark.parametrize(
    "name",
    [
        "fridge", "breakfast_table", "straight_chair", "armchair", "floor_lamp", "table_lamp", "trash_can", "hamper",
        "drop_in_sink", "toilet", "microwave", "toaster", "picture", "carpet", "walls", "pot_plant", "bicycle",
        "standing_tv", "toolbox",
    ],
)  # fmt: skip
def test_not_graspable(ontology: Ontology, name: str) -> None:
    assert not ontology[name].graspable


@pytest.mark.parametrize("name", ["tray", "plate", "bowl", "chopping_board", "casserole"])
def test_a_graspable_thing_can_hold_others(ontology: Ontology, name: str) -> None:
    assert ontology[name].graspable
    assert ontology[name].surface


def test_trays_have_no_inside(ontology: Ontology) -> None:
    assert not ontology["tray"].interior


def test_safety_critical_is_heat_water_or_conferring(ontology: Ontology) -> None:
    critical = names(ontology, "safety_critical")
    assert {"oven", "stove", "microwave", "drop_in_sink", "showerhead", "dishwasher", "washer", "iron"} <= critical
    assert not {"table_lamp", "floor_lamp", "standing_tv", "ceiling_fan", "laptop", "electric_fan"} & critical
    assert critical <= names(ontology, "toggleable")


@pytest.mark.parametrize(
    ("name", "mount"),
    [
        ("picture", "wall"), ("mirror", "wall"), ("standing_mirror", "floor"), ("top_cabinet", "wall"),
        ("wall_mounted_tv", "wall"), ("electric_switch", "wall"), ("ceiling_fan", "ceiling"), ("downlight", "ceiling"),
        ("carpet", "carpet"), ("walls", "structure"), ("floors", "structure"), ("ceilings", "structure"),
        ("bottom_cabinet", "floor"), ("wall_mounted_sink", "floor"), ("pillar", "floor"), ("towel_rack", "wall"),
    ],
)  # fmt: skip
def test_mount(ontology: Ontology, name: str, mount: str) -> None:
    assert ontology[name].mount == mount


def test_lamps_are_switched_where_they_stand(ontology: Ontology) -> None:
    for name in ("table_lamp", "floor_lamp"):
        assert ontology[name].toggleable
        assert not ontology[name].graspable


def test_food_is_cookable_and_the_rest_is_not(ontology: Ontology) -> None:
    assert {"apple", "potato", "steak", "chicken", "apple_pie"} <= names(ontology, "cookable")
    assert not {"plate", "hardback", "sofa", "soccer_ball"} & names(ontology, "cookable")


def test_sizes_and_masses_are_plausible(ontology: Ontology) -> None:
    for category in ontology.values():
        assert category.size_m is not None
        assert min(category.size_m) >= 0
        assert category.mass_kg is not None
        if category.graspable:
            assert category.mass_kg <= 8.0
            assert max(category.size_m) <= 2.5
    depth, width, height = ontology["fridge"].size_m or (0, 0, 0)
    assert 0.5 < depth < 1.0
    assert 0.5 < width < 1.0
    assert 1.4 < height < 2.0


def test_categories_are_numbered_in_their_order(ontology: Ontology) -> None:
    assert [ontology.index[name] for name in ontology] == list(range(len(ontology)))


def test_unknown_category_offers_the_nearest(ontology: Ontology) -> None:
    with pytest.raises(UnknownCategory, match="fridge") as caught:
        ontology["frigde"]
    assert "fridge" in caught.value.nearest
    assert "frigde" not in ontology
    alone = Ontology((ontology["mug"],))
    with pytest.raises(UnknownConcept, match=r"'any_bottle'.* this ontology"):
        alone.kinds("any_bottle")
    with pytest.raises(UnknownConcept, match=r"any_bottel.*did you mean 'any_bottle'"):
        ontology.kinds("any_bottel")


def test_category_of_strips_the_index_only() -> None:
    assert category_of("bottom_cabinet_3") == "bottom_cabinet"
    assert category_of("t_shirt") == "t_shirt"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"{", "malformed"),
        (b'{"format":"gavel-ontology/9","provenance":"","categories":[]}', "gavel-ontology/9"),
        (b'{"format":"gavel-ontology/1","provenance":"","categories":[{"name":"x"}]}', "synset"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(DataError, match=words) as caught:
        load_ontology(path)
    assert "broken.json" in str(caught.value)


@pytest.mark.parametrize(
    ("categories", "words"),
    [
        ([{"name": "a cup"}], "'a cup' cannot name a category"),
        ([{"name": "robot"}], "'robot' cannot name a category"),
        ([{"name": "cup"}, {"name": "cup"}], "the category 'cup' stands twice"),
        ([{"name": "cup", "size_m": [0.1, -0.1, 0.1]}], "'cup' has the size_m"),
        ([{"name": "cup", "size_m": [0.1, 0.1, 1000.1]}], "'cup' has the size_m"),
        ([{"name": "cup", "mass_kg": -0.1}], "'cup' has the mass_kg -0.1"),
        ([{"name": "cup", "mass_kg": 1e7}], "'cup' has the mass_kg"),
    ],
)
def test_what_no_category_can_be_is_said_with_the_file(
    tmp_path: Path, categories: list[dict[str, Any]], words: str
) -> None:
    path = tmp_path / "own.json"
    plain = {"synset": "cup.n.01", "source": "tests"}
    file = {"format": "gavel-ontology/1", "provenance": "drawn up", "categories": [plain | c for c in categories]}
    path.write_text(json.dumps(file))
    with pytest.raises(DataError, match=words) as caught:
        load_ontology(path)
    assert str(path) in str(caught.value)
    file["categories"] = [plain | {"name": "cup", "size_m": [1000.0, 0.0, 1.0], "mass_kg": 1e6}]
    path.write_text(json.dumps(file))
    assert load_ontology(path).provenance == "drawn up"


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"absent\.json"):
        load_ontology(tmp_path / "absent.json")
    with pytest.raises(DataError, match=r"absent\.json"):
        load_evidence(tmp_path / "absent.json")


# --- placement evidence ---------------------------------------------------------------------------------------------


def test_evidence_counts_all_scene_contents() -> None:
    evidence = load_evidence()
    assert len(evidence.room_types) == 39
    assert sum(r.rooms for r in evidence.room_types.values()) == 374
    assert sum(n for r in evidence.room_types.values() for n, _ in r.contents.values()) == 36_164
    for contents in evidence.room_types.values():
        for instances, rooms in contents.contents.values():
            assert 1 <= rooms <= min(instances, contents.rooms)


def test_evidence_names_known_categories(ontology: Ontology) -> None:
    evidence = load_evidence()
    contents = {name for room in evidence.room_types.values() for name in room.contents}
    assert len(contents) == 585
    assert contents <= set(ontology)
    assert {name for kind in evidence.kinds.values() for name in kind} <= set(ontology)
    assert {"desk", "coffee_table"} <= set(evidence.kinds["table.n.02"])


def test_evidence_puts_bowls_into_kitchen_fridges() -> None:
    rows = [r for r in load_evidence().placed if r.thing == "bowl.n.01" and r.holder == "electric_refrigerator.n.01"]
    kitchen = [r for r in rows if r.room == "kitchen" and r.relation == "in"]
    assert len(kitchen) == 1
    assert kitchen[0].at_start == max(r.at_start for r in rows)
    assert kitchen[0].at_start >= 58


def affords(category: Category, relation: str) -> bool:
    return {"on": category.surface, "in": category.interior, "under": category.clearance}[relation]


def test_whatever_an_activity_does_with_furniture_is_possible(ontology: Ontology) -> None:
    """Every row of the evidence has a category that affords it, walls' dartboards excepted."""
    evidence = load_evidence()
    impossible = {
        (row.relation, row.holder)
        for row in evidence.placed
        if row.relation != "floor" and not any(affords(ontology[n], row.relation) for n in evidence.kinds[row.holder])
    }
    assert impossible <= {("on", "dartboard.n.01")}


# --- rebuilding -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "file"),
    [
        pytest.param("ontology", "ontology.json", marks=needs_bddl),
        pytest.param("evidence", "placement_evidence.json", marks=needs_bddl),
        pytest.param("concepts", "concepts.json", marks=needs_bddl),
    ],
)
@pytest.mark.parametrize("hash_seed", ["0", "4242"])
def test_rebuild_is_byte_identical(module: str, file: str, hash_seed: str) -> None:
    code = f"import sys; from envs_data.build import {module}; sys.stdout.buffer.write({module}.build())"
    built = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        check=True,
    ).stdout
    assert built == (SHIPPED / file).read_bytes()
