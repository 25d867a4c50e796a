"""Categories of one's own: what they inherit, what they are called, and what is said of a wrong table."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gavel_env.errors import CategoryError, GavelError
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.own_categories import OwnCategory

SHIPPED = default_ontology()


def test_a_category_inherits_and_differs() -> None:
    own = SHIPPED.extend(
        {
            "vial": {"like": "bottle", "words": ["sample glass"]},
            "big_vial": {"like": "vial", "graspable": False, "carryable": True},
            "fume_hood": {"openable": True, "interior": True, "toggleable": True},
            "autoclave": {"like": "oven", "heat": False, "washes": True},
        }
    )
    assert own["vial"].graspable
    assert own["big_vial"].heatable == own["vial"].heatable
    assert (own["big_vial"].graspable, own["big_vial"].liftable) == (False, True)
    assert own["fume_hood"].has_door
    assert not own["fume_hood"].graspable
    assert own["autoclave"].heat is None
    assert own["autoclave"].washes
    assert own["autoclave"].toggleable == SHIPPED["oven"].toggleable
    assert own["fume_hood"].source == "user"
    assert own["vial"].source == f"user, like {own.kinds('any_bottle')[0].name}"


def test_it_does_not_matter_which_of_them_is_said_first() -> None:
    vial, flask = {"like": "bottle", "mass_kg": 0.1}, {"like": "vial", "wipes": True}
    own, turned = SHIPPED.extend({"vial": vial, "flask": flask}), SHIPPED.extend({"flask": flask, "vial": vial})
    for name in ("vial", "flask"):
        assert own[name] == turned[name]
    assert turned["flask"].mass_kg == 0.1
    assert turned["flask"].source == "user, like vial"
    assert own.provenance == SHIPPED.provenance != ""


def test_the_largest_and_heaviest_things_are_still_things() -> None:
    own = SHIPPED.extend({"ship": {"size_m": [1000, 100, 1], "mass_kg": 1e6}})
    assert (own["ship"].size_m, own["ship"].mass_kg) == ((1000.0, 100.0, 1.0), 1e6)


def test_words_name_it_and_the_shipped_ones_stay_as_they_are() -> None:
    own = SHIPPED.extend({"vial": {"like": "bottle", "words": ["sample glass"]}})
    assert own.concepts.meaning("sample glasses").thing == "vial"
    assert own.concepts.meaning("vial").thing == "vial"
    assert "vial" not in SHIPPED
    assert own["vial"].is_a("any_bottle")
    assert all(own[name] == SHIPPED[name] for name in SHIPPED)


def test_like_takes_a_category_a_concept_or_a_word() -> None:
    for like in ("mug", "any_mug") if SHIPPED.knows("any_mug") else ("mug",):
        assert SHIPPED.extend({"lab_mug": {"like": like}})["lab_mug"].graspable
    assert SHIPPED.extend({"case": {"like": "backpack"}})["case"].interior


def test_entries_may_be_objects_with_the_fields_as_attributes() -> None:
    said = {"like": "bottle", "mass_kg": 0.1}
    for entry in (OwnCategory(like="bottle", mass_kg=0.1), SimpleNamespace(**said)):
        assert SHIPPED.extend({"vial": entry})["vial"] == SHIPPED.extend({"vial": said})["vial"]


@pytest.mark.parametrize("ending", ["toml", "json"])
def test_a_file_says_the_same_as_a_table(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"lab.{ending}"
    table = {"vial": {"like": "bottle", "words": ["sample glass"]}, "rack": {"surface": True}}
    toml = '[categories.vial]\nlike = "bottle"\nwords = ["sample glass"]\n[categories.rack]\nsurface = true\n'
    path.write_text(toml if ending == "toml" else json.dumps({"categories": table}))
    read, said = SHIPPED.extend(path), SHIPPED.extend(table)
    assert (read["vial"], read["rack"]) == (said["vial"], said["rack"])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"vial": {"like": "botle"}}, r"\$\.categories\.vial\.like: unknown category 'botle'; did you mean"),
        ({"vial": {"like": "vial"}}, "unknown category 'vial'|in a circle"),
        ({"vial": {"like": "qqqqqqqq"}}, "like: unknown category 'qqqqqqqq'$"),
        ({"a": {"like": "b"}, "b": {"like": "a"}}, "in a circle: a -> b -> a"),
        ({"vial": {"opneable": True}}, "unknown field `opneable`.*did you mean openable"),
        ({"vial": {"surface": "yes"}}, r"Expected `bool \| null`, got `str` - at `\$\.surface`$"),
        ({"Vial": {}}, r"\$\.categories\.Vial"),
        ({"any_vial": {}}, r"\$\.categories\.any_vial"),
        ({"vial": []}, "categories"),
        ({"vial": {"size_m": [1]}}, "length 3"),
        ({"vial": {"size_m": [1, 1, 0]}}, r"\$\.categories\.vial\.size_m: .*above 0, to 1000"),
        ({"vial": {"size_m": [1000.1, 1, 1]}}, r"\$\.categories\.vial\.size_m: .*above 0, to 1000"),
        ({"vial": {"mass_kg": 0}}, r"\$\.categories\.vial\.mass_kg: 0.*above 0, to 1e\+06"),
        ({"vial": {"mass_kg": 1000000.5}}, r"\$\.categories\.vial\.mass_kg: .*above 0, to 1e\+06"),
    ],
)
def test_a_wrong_table_is_said_with_its_place(table: dict[str, Any], message: str) -> None:
    with pytest.raises(CategoryError, match=message):
        SHIPPED.extend(table)


def test_a_wrong_file_is_a_typed_error(tmp_path: Path) -> None:
    for name, content in (("a.toml", b"[cat"), ("b.toml", b"\xff"), ("c.json", b"{"), ("d.toml", b"[other]\n")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CategoryError, match=name[0]):
            SHIPPED.extend(tmp_path / name)
    with pytest.raises(GavelError):
        SHIPPED.extend(tmp_path / "none.toml")


def test_an_unknown_field_of_a_file_is_said_with_the_one_that_was_meant(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text("[categories.vial]\nopneable = true\n")
    with pytest.raises(CategoryError, match=r"lab\.toml is malformed: .*`opneable`.*did you mean openable"):
        SHIPPED.extend(path)
