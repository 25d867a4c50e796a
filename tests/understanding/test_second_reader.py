"""The learned reader beside the rules: its arithmetic, its options, its account of things, and what two readers say."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from support.people import house

from eval.studies.understanding import evaluate
from gavel_agents.understanding import Decomposition, load_understanding
from gavel_agents.understanding.learned.decode import Decision, Meant
from gavel_agents.understanding.learned.network import scores
from gavel_agents.understanding.learned.reader import Reading, load_reader
from gavel_agents.understanding.learned.spotted import pair_features, spotted
from gavel_agents.understanding.pairs import read_samples
from gavel_agents.understanding.second_reader import asks_second, combined, taken
from gavel_env.errors import DataError
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import parse_literal

HOUSE = Counter({"kitchen": 1, "bedroom": 2, "living_room": 1})
TEXT = "The mug from the bedroom, put it in the kitchen sink, and the TV off."
DATA = Path(__file__).parent / "data" / "learned_scores.json"


def test_numpy_computes_what_torch_computed() -> None:
    stored = json.loads(DATA.read_text(encoding="utf-8"))
    reader = load_reader()
    assert len(stored) == len(reader.networks)
    every = scores(spotted(TEXT, HOUSE), reader.networks, reader.words, reader.values)
    for said, expected in zip(every, stored, strict=True):
        np.testing.assert_allclose(said.pairs, np.array(expected["pairs"]), atol=2e-3)
        for name, values in expected["mentions"].items():
            np.testing.assert_allclose(said.mentions[name], np.array(values), atol=2e-3)


def test_a_thing_is_read_by_what_its_kind_can_do_and_not_by_its_name() -> None:
    mug, cup = (spotted(f"Put the {word} in the sink.", HOUSE) for word in ("scarf", "cardigan"))
    assert [m.name for m in mug.mentions] == ["scarf", "furniture_sink"]
    assert mug.words == cup.words
    np.testing.assert_array_equal(mug.features, cup.features)
    np.testing.assert_array_equal(pair_features(mug), pair_features(cup))


def test_the_same_text_is_read_the_same() -> None:
    one, two = (load_reader().read(TEXT, HOUSE) for _ in range(2))
    assert one.meant == two.meant


def _reading(text: str, *goals: str, sure: float) -> Reading:
    literals = tuple((0, parse_literal(goal)) for goal in goals)
    return Reading(spotted(text, HOUSE), Meant(literals, (), (Decision(0, (), sure),)))


def test_what_leaves_a_thing_out_is_not_taken() -> None:
    text = "Put the mug and the bowl on the bed."
    assert taken(text, _reading(text, "on_top(mug, bed)", sure=1.0)) is None
    got = taken(text, _reading(text, "on_top(mug, bed)", "on_top(bowl, bed)", sure=1.0))
    assert got is not None
    assert [t.goal.text() for t in got.tasks] == [("on_top(mug, bed)", "on_top(bowl, bed)")]


def test_what_cannot_be_is_not_taken() -> None:
    text = "Put the mug in the book."
    assert taken(text, _reading(text, "inside(mug, hardback)", sure=1.0)) is None


def test_an_unsure_reading_is_not_believed() -> None:
    text = "Put the mug on the bed."
    refused = Decomposition((), "unparsed: hm")
    assert combined(text, refused, _reading(text, "on_top(mug, bed)", sure=0.1)) == refused
    assert combined(text, refused, _reading(text, "on_top(mug, bed)", sure=0.999)).tasks


@pytest.mark.parametrize("reason", ["contradiction: c", "cannot_hold: c", "foreign: German", "unknown_word: 'zorp'"])
def test_only_refusals_for_want_of_structure_are_read_again(reason: str) -> None:
    assert not asks_second(Decomposition((), reason))
    assert asks_second(Decomposition((), "unparsed: hm"))


@pytest.mark.parametrize("text", ["", "Bitte stell die Tasse in den Schrank.", "Put the sofa in the mug.", "\x00\x01"])
def test_bad_input_stays_refused(text: str) -> None:
    got = load_understanding("rules").understand(text, rooms=house("Beechwood_0_int").world.rooms)
    assert got.refused
    assert not got.tasks


def test_weights_of_another_format_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "weights.safetensors").write_bytes(b"none")
    with pytest.raises(DataError, match="weights of the learned reader"):
        load_reader(tmp_path / "weights.safetensors")


def test_a_noun_of_two_categories_is_either_of_them() -> None:
    house = Counter({"kitchen": 1})
    for text, members in (
        ("Put the cutting boards in the sink.", {"cutting_board", "chopping_board"}),
        ("Put the tissue box on the desk.", {"box_of_tissues", "tissue_dispenser"}),
        ("The honey jar goes on the desk.", {"honey_jar", "jar_of_honey"}),
    ):
        meant = default_concepts().categories(spotted(text, house).mentions[0].name)
        assert members <= set(meant), text
        assert spotted(text, house).mentions[0].movable


# --- floors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("split", "exact", "wrong"), [("dev", 0.56, 0.12), ("test", 0.43, 0.17)])
def test_floors_of_the_voices(split: str, exact: float, wrong: float) -> None:
    report = evaluate(load_understanding("rules"), [s for s in read_samples("voices") if s.split == split])
    assert report.goals_exact >= exact * report.instructions
    assert report.silently_wrong <= wrong * report.instructions
