"""The learned reader beside the rules: its arithmetic, its options, its account of things, and what two readers say."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from support.people import house

from eval.studies.understanding import evaluate
from gavel_agents.understanding import Decomposition, TaskUnderstanding, load_understanding
from gavel_agents.understanding.asking import question_of, with_answers
from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.learned.decode import Decision, Meant
from gavel_agents.understanding.learned.encoder import input_of
from gavel_agents.understanding.learned.network import Scores, mean, rooms_in, scores
from gavel_agents.understanding.learned.options import (
    MOST_KINDS,
    NO_ROOM,
    UNNAMED_ROOMS,
    groups,
    kinds_for,
    own_kinds,
    rooms_for,
)
from gavel_agents.understanding.learned.pieces import Pieces
from gavel_agents.understanding.learned.reader import LearnedReader, Reading, load_reader
from gavel_agents.understanding.learned.spotted import pair_features, spotted
from gavel_agents.understanding.learned.weights import load, save
from gavel_agents.understanding.pairs import read_samples
from gavel_agents.understanding.second_reader import TwoReaders, alike, combined, stands, taken
from gavel_env.errors import DataError
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import Goal, parse_literal

HOUSE = Counter({"kitchen": 1, "bedroom": 2, "living_room": 1})
TEXT = "The mug from the bedroom, put it in the kitchen sink, and the TV off."
DATA = Path(__file__).parent / "data" / "learned_scores.json"


def test_numpy_computes_what_torch_computed() -> None:
    every = json.loads(DATA.read_text(encoding="utf-8"))
    for network, stored in zip(load_reader().networks, every, strict=True):
        said = scores(spotted(TEXT, HOUSE), network)
        np.testing.assert_allclose(said.pairs, np.array(stored["pairs"]), atol=0.4)  # of up to 20, in eight bits
        np.testing.assert_allclose(said.whole, stored["whole"], atol=0.4)
        for name, values in stored["mentions"].items():
            np.testing.assert_allclose(said.mentions[name], np.array(values), atol=0.4)


def test_several_networks_are_asked_where_the_first_is_not_sure() -> None:
    def alike(a: Scores, b: Scores) -> None:
        np.testing.assert_allclose(a.pairs, b.pairs)
        np.testing.assert_allclose(a.whole, b.whole)
        for name, values in a.mentions.items():
            np.testing.assert_allclose(values, b.mentions[name])

    read = spotted(TEXT, HOUSE)
    one, *_ = load_reader().networks
    own = scores(read, one)
    alike(mean([own, own]), own)
    other = Scores(-own.pairs, {name: -values for name, values in own.mentions.items()}, -own.whole)
    alike(mean([own, other]), mean([other, own]))
    assert not mean([own, other]).pairs.any()
    sure, unsure = "Put the mug on the bed.", "Mug, the bed thing, not where Ann had the scarf, or was it the bowl."
    alone = LearnedReader([one])
    assert alone.read(sure, HOUSE).meant == load_reader().read(sure, HOUSE).meant
    assert alone.read(unsure, HOUSE).meant.sure != load_reader().read(unsure, HOUSE).meant.sure


def test_things_that_are_called_thing_are_told_by_what_their_kind_can_do() -> None:
    scarf, cardigan = (spotted(f"Put the {word} in the sink.", HOUSE) for word in ("scarf", "cardigan"))
    assert [m.name for m in scarf.mentions] == ["scarf", "furniture_sink"]
    network = load_reader().networks[0]
    one, two = (input_of(read, network.pieces, network.values) for read in (scarf, cardigan))
    assert one.pieces.tolist() != two.pieces.tolist()
    one, two = (
        input_of(read, network.pieces, network.values, unnamed=[m.token for m in read.mentions])
        for read in (scarf, cardigan)
    )
    np.testing.assert_array_equal(one.pieces, two.pieces)
    np.testing.assert_array_equal(one.features, two.features)
    np.testing.assert_array_equal(pair_features(scarf), pair_features(cardigan))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("Tofu on the baking sheet, the sheet into the cabinet.", ["tofu", "baking_sheet"]),
        ("Wash the mixing bowls, then the bowls go on the bed.", ["mixing_bowl"]),
        ("Put the sheet on the bed, and then the baking sheet.", ["bed_sheet", "baking_sheet"]),
        ("The baking sheet goes on the bed, the bowl in the sink.", ["baking_sheet", "bowl"]),
    ],
)
def test_the_last_word_of_a_name_speaks_of_the_thing_once_it_was_named(text: str, names: list[str]) -> None:
    assert [group.name for group in groups(spotted(text, HOUSE))] == names


@pytest.mark.parametrize(
    ("text", "rooms"),
    [
        ("a table, kitchen or bedroom", ["kitchen|bedroom"] * 2),
        ("a table in the kitchen, the bedroom or the living room", ["kitchen|bedroom|living_room"] * 3),
        ("a table, kitchen/bedroom; the book in the bedroom", ["kitchen|bedroom", "kitchen|bedroom", "bedroom"]),
        ("from the kitchen to the bedroom or not", ["kitchen", "bedroom"]),
        ("the kitchen, the bedroom", ["kitchen", "bedroom"]),
        ("in the kitchen the light or in the bedroom the lamp", ["kitchen", "bedroom"]),
    ],
)
def test_rooms_of_which_either_will_do_are_one_choice(text: str, rooms: list[str]) -> None:
    assert [m.name for m in spotted(text, HOUSE).mentions if m.room] == rooms


def test_a_mention_may_be_a_kind_or_stand_in_a_room_that_no_word_names() -> None:
    read = spotted("The mug on the big table in the kitchen, the bowl on the countertop.", HOUSE)
    mug, table, kitchen, _, countertop = read.mentions
    assert kinds_for(table)[:2] == ("", "breakfast_table")
    assert len(kinds_for(table)) <= MOST_KINDS
    assert own_kinds(table) == 1
    assert kinds_for(mug) == kinds_for(kitchen) == kinds_for(countertop) == ("",)
    assert rooms_for(read, mug) == [(NO_ROOM, None)]
    named = [type_ for _, type_ in rooms_for(read, table)]
    assert named == [None, "kitchen", "bedroom", "living_room"]
    order = rooms_in(*(np.zeros((1, n), dtype=np.float32) for n in (len(read.mentions), len(UNNAMED_ROOMS), 1)))
    for at, type_ in rooms_for(read, table):
        order[0, at] += 1 if type_ is not None else 2  # each index is one place of what is scored
    assert sorted(order[0].tolist()) == sorted([2.0] + [1.0] * 3 + [0.0] * (order.shape[1] - 4))
    assert all(UNNAMED_ROOMS[-2 - at] == type_ for at, type_ in rooms_for(read, table) if at < NO_ROOM)


def test_a_slip_in_one_word_is_not_two_words() -> None:
    for text, name in (("the pinapple", "pineapple"), ("no irons here", "iron"), ("the livingroom", "living_room")):
        assert [m.name for m in spotted(text, HOUSE).mentions] == [name]


def test_words_come_apart_into_pieces_by_the_longest_match() -> None:
    pieces = Pieces({"[UNK]": 1, "dish": 2, "##wash": 3, "##washer": 4, "dis": 5, "!": 6})
    assert pieces.of("Dishwasher!") == (2, 4, 6)
    assert pieces.of("zebra") == pieces.of("") == (1,)
    assert len(pieces.of("dish " * 50)) == 6


def test_a_text_that_is_too_long_is_not_read() -> None:
    with pytest.raises(Abstention, match="word pieces"):
        load_reader().read("Put the mug on the bed. " * 100, HOUSE)


def test_weights_survive_being_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    tensors = {
        "word": rng.normal(size=(300, 64)).astype(np.float32), "first.bias": rng.normal(size=9).astype(np.float32),
        "layer.0.up": rng.normal(size=(64, 256)).astype(np.float32),
    }  # fmt: skip
    save(tmp_path / "w.safetensors", tensors, Pieces({"[PAD]": 0, "mug": 1}), {"and": 1})
    network = load(tmp_path / "w.safetensors")
    assert network.pieces.vocabulary == {"[PAD]": 0, "mug": 1}
    assert network.values == {"and": 1}
    words = network.shared["word"] * network.shared["word.scale"][:, None]
    for was, now in ((tensors["word"], words), (tensors["layer.0.up"], network.layers[0]["up"])):
        assert np.abs(was - now).max() <= np.abs(was).max() / 127
    np.testing.assert_allclose(network.shared["first.bias"], tensors["first.bias"], atol=2e-3)


@pytest.mark.parametrize(
    ("text", "things"),
    [
        ("The coffee cup is dirty. Put the cup in the sink.", [("coffee_cup", 2)]),
        ("Mayonnaise on the table, I mean the bottle.", [("any_mayonnaise", 2)]),
        ("Put the mug and the bowl on the bed.", [("mug", 1), ("bowl", 1)]),
    ],
)
def test_a_wider_word_speaks_of_the_one_thing_that_it_may_mean(text: str, things: list[tuple[str, int]]) -> None:
    assert [(g.name, len(g.mentions)) for g in groups(spotted(text, HOUSE))] == things


def test_the_same_text_is_read_the_same() -> None:
    one, two = (load_reader().read(TEXT, HOUSE) for _ in range(2))
    assert one.meant == two.meant


def _reading(text: str, *goals: str, sure: float) -> Reading:
    literals = tuple((0, parse_literal(goal)) for goal in goals)
    return Reading(spotted(text, HOUSE), Meant(literals, (), (Decision(0, (), sure),)))


def test_a_thing_for_which_nothing_is_asked_is_said_to_be_passed_over() -> None:
    text = "Put the mug and the bowl on the bed."
    got = taken(text, _reading(text, "on_top(mug, bed)", sure=1.0))
    assert got is not None
    assert got.passed_over == ("bowl",)
    got = taken(text, _reading(text, "on_top(mug, bed)", "on_top(bowl, bed)", sure=1.0))
    assert got is not None
    assert not got.passed_over
    assert [t.goal.text() for t in got.tasks] == [("on_top(mug, bed)", "on_top(bowl, bed)")]


def test_the_words_of_a_task_end_where_the_next_one_begins() -> None:
    text = "Mug into the sink pls, and my bowl on the bed."
    mug, bowl = (i for i, m in enumerate(spotted(text, HOUSE).mentions) if m.movable)
    goals = ((mug, parse_literal("inside(mug, any_sink)")), (bowl, parse_literal("on_top(bowl, bed)")))
    got = taken(text, Reading(spotted(text, HOUSE), Meant(goals, (), (Decision(0, (), 1.0),))))
    assert got is not None
    assert [task.text for task in got.tasks] == ["Mug into the sink pls.", "Bowl on the bed."]


def test_what_cannot_be_is_not_taken() -> None:
    text = "Put the mug in the book."
    assert taken(text, _reading(text, "inside(mug, hardback)", sure=1.0)) is None


def _said(*goals: str) -> Decomposition:
    return Decomposition((TaskUnderstanding("", (), (), Goal(tuple(map(parse_literal, goals)))),))


def test_an_unsure_reading_becomes_a_question() -> None:
    text = "Put the mug on the bed."
    refused = Decomposition((), "unparsed: hm")
    got = combined(text, refused, _reading(text, "on_top(mug, bed)", sure=0.1))
    assert got.refused.startswith("unsure")
    assert got.question is not None
    assert combined(text, refused, _reading(text, "on_top(mug, bed)", sure=0.999)).tasks


def test_readers_that_differ_are_believed_only_where_the_second_is_sure() -> None:
    text = "My cousin hollers: put the mug on the bed."
    first = _said("on_top(mug, bed)")
    alike = combined(text, first, _reading(text, "on_top(mug, any_bed)", sure=0.01))
    assert [t.goal.text() for t in alike.tasks] == [("on_top(mug, any_bed)",)]
    other = _reading(text, "washed(mug)", sure=0.999)
    assert [t.goal.text() for t in combined(text, first, other).tasks] == [("washed(mug)",)]
    assert combined(text, first, _reading(text, "washed(mug)", sure=0.49)).question is not None
    assert not stands(first, text)
    assert stands(first, "Put the mug on the bed.")  # every word is accounted for
    assert not stands(Decomposition((), "unparsed: hm"), "Put the mug on the bed.")


@pytest.mark.parametrize(
    ("one", "two", "same"),
    [
        (("on_top(mug, bed)",), ("on_top(mug, any_bed)",), True),
        (("on_top(mug, bed)",), ("inside(mug, bed)",), False),
        (("on_top(mug, bed@bedroom)",), ("on_top(mug, bed)",), True),
        (("on_top(mug, bed@bedroom)",), ("on_top(mug, bed@childs_room)",), False),
        (("toggled(standing_tv)",), ("not toggled(standing_tv)",), False),
        (("on_top(mug, bed)", "washed(mug)"), ("on_top(mug, bed)",), False),
        (("washed(mug)",), ("on_top(mug, bed)", "washed(mug)"), False),
    ],
)
def test_readings_are_alike_where_they_ask_for_the_same(one: tuple[str, ...], two: tuple[str, ...], same: bool) -> None:
    assert alike(_said(*one), _said(*two)) == same


def test_what_is_asked_is_the_least_sure_choice_and_an_answer_settles_it() -> None:
    text = "The mug belongs on the bed or in the sink."
    read = spotted(text, HOUSE)
    on, inside = parse_literal("on_top(mug, any_bed)"), parse_literal("inside(mug, furniture_sink)")
    reading = Reading(read, Meant(((0, on),), (), (Decision(0, (on,), 0.4, (inside,)), Decision(1, (), 0.9))))
    question = question_of(reading)
    assert question is not None
    assert question.choices == ("put it on the bed", "put it in the furniture sink")
    rooms = house("Beechwood_0_int").world.rooms
    for answer, goals in (("in the sink", [inside]), ("nothing", []), ("put it on the bed", [on])):
        settled = with_answers(reading, {question.key: answer}, rooms).meant
        assert [literal for _, literal in settled.goals] == goals
        assert settled.decisions[0].probability == 1.0
    assert with_answers(reading, {question.key: "qwertz"}, rooms).meant == reading.meant


@pytest.mark.parametrize("reason", ["empty: e", "too_long: l", "not_text: n", "foreign: German"])
def test_what_is_no_text_of_ours_is_not_read_again(reason: str) -> None:
    class Refuses:
        name = "refuses"

        def understand(self, text: str, **_: object) -> Decomposition:
            return Decomposition((), reason)

    both = TwoReaders(load_reader(), Refuses())  # type: ignore[arg-type]
    assert both.understand("Put the mug on the bed.", rooms=house("Beechwood_0_int").world.rooms).refused == reason


@pytest.mark.parametrize("text", ["", "Bitte stell die Tasse in den Schrank.", "Put the sofa in the mug.", "\x00\x01"])
def test_bad_input_stays_refused(text: str) -> None:
    got = load_understanding("rules").understand(text, rooms=house("Beechwood_0_int").world.rooms)
    assert got.refused
    assert not got.tasks


def test_weights_of_another_format_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "weights.safetensors").write_bytes(b"none")
    with pytest.raises(DataError, match="weights of the learned reader"):
        load_reader((tmp_path / "weights.safetensors",))


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


@pytest.mark.parametrize(("split", "exact", "wrong"), [("dev", 0.86, 0.09), ("test", 0.81, 0.12)])
def test_floors_of_the_voices(split: str, exact: float, wrong: float) -> None:
    report = evaluate(load_understanding("rules"), [s for s in read_samples("voices") if s.split == split])
    assert report.goals_exact >= exact * report.instructions
    assert report.silently_wrong <= wrong * report.instructions
