"""Instructions as people say them: classes of phrasing, accounting, questions and answers, bad input, floors, speed."""

from __future__ import annotations

import sys
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.people import Said, denoted, house, sentences

from eval.studies.understanding import evaluate
from gavel_agents.understanding import Question, RulesUnderstanding
from gavel_agents.understanding.pairs import read_samples
from gavel_agents.understanding.rules.lexer import tokens_of
from gavel_agents.understanding.rules.spelling import Speller, distance
from gavel_env.world_model.graph import SceneGraph

RULES = RulesUnderstanding()
PEOPLE = list(sentences())
cached_house = cache(house)


def rooms(scene: str = "Beechwood_0_int") -> SceneGraph:
    return cached_house(scene)


@pytest.mark.parametrize("said", [s for s in PEOPLE if s.goals], ids=lambda said: ascii(said.text[:40]))
def test_people_are_understood(said: Said) -> None:
    graph = cached_house(said.scene)
    got = RULES.understand(said.text, rooms=graph.world.rooms)
    assert not got.refused
    asked = {denoted(graph, literal) for task in got.tasks for literal in task.goal.literals}
    assert asked == {denoted(graph, literal) for literal in said.goals}


@pytest.mark.parametrize("said", [s for s in PEOPLE if s.refused], ids=lambda said: ascii(said.text[:40]))
def test_what_is_refused_is_asked(said: Said) -> None:
    got = RULES.understand(said.text, rooms=cached_house(said.scene).world.rooms)
    assert got.tasks == ()
    assert got.refused.partition(":")[0] == said.refused
    if said.refused not in ("foreign", "not_text", "empty", "too_long"):
        assert isinstance(got.question, Question)
        assert got.question.asks


# --- accounting -----------------------------------------------------------------------------------------------------

THINGS = ("mug", "bowl", "laptop", "umbrella", "notebook", "saucer", "candle holder", "teapot")
PIECES = ("desk", "sofa", "coffee table", "breakfast table", "piano", "ottoman", "armchair")
FORMS = (
    "Put the {0} on the {2} and the {1} on the {3}.",
    "the {0} goes on the {2}, the {1} on the {3}",
    "{0} -> {2}\n{1} -> {3}",
    "- {0}: {2}\n- {1}: {3}",
    "I'd like the {0} on the {2}; also, could you get the {1} onto the {3}?",
    "THE {0} BELONGS ON THE {2}! AND THE {1} ON THE {3}!",
    "could the {0} be moved to the {2} and might the {1} be put on the {3}, please",
    "{0} on the {2} pls, n the {1} on the {3} thx",
)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.sampled_from(FORMS),
    st.permutations(THINGS).map(lambda names: names[:2]),
    st.permutations(PIECES).map(lambda names: names[:2]),
)
def test_no_conjunct_is_lost(form: str, things: list[str], pieces: list[str]) -> None:
    got = RULES.understand(form.format(*things, *pieces), rooms=rooms().world.rooms)
    asked = {(lit.subject.name, lit.object.name) for t in got.tasks for lit in t.goal.literals if lit.object}
    assert asked == {(t.replace(" ", "_"), p.replace(" ", "_")) for t, p in zip(things, pieces, strict=True)}


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(THINGS), st.sampled_from(["zorp", "florbinator", "mug rack", "gizmotron"]))
def test_an_unknown_thing_is_asked_about(thing: str, unknown: str) -> None:
    got = RULES.understand(f"Put the {thing} and the {unknown} on the desk.", rooms=rooms().world.rooms)
    assert got.tasks == ()
    assert got.question is not None


def test_what_was_passed_over_is_reported() -> None:
    text = "Since my sister is coming tonight, please put the bouquet on the piano; not on the sofa."
    got = RULES.understand(text, rooms=rooms().world.rooms)
    assert [t.goal.text() for t in got.tasks] == [("on_top(bouquet, piano)",)]
    assert any("sister" in passed for passed in got.passed_over)
    assert any("sofa" in passed for passed in got.passed_over)


def test_a_place_within_a_room_is_noted() -> None:
    got = RULES.understand("Put the mug on the desk by the window.", rooms=rooms().world.rooms)
    assert [t.goal.text() for t in got.tasks] == [("on_top(mug, desk)",)]
    assert any("by the window" in note for note in got.notes)


def test_the_house_settles_rooms() -> None:
    text = "Put the mug on the desk in the office."
    [task] = RULES.understand(text, rooms=rooms().world.rooms).tasks
    assert task.goal.text() == ("on_top(mug, desk@private_office)",)


# --- questions and answers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "answer", "goal"),
    [
        ("Put the zorp in the fridge.", "mug", "inside(mug, fridge)"),
        ("Put the mug in the sink or the dishwasher.", "the dishwasher", "inside(mug, dishwasher)"),
        ("Put the mug on the desk and put the mug in the fridge.", "in the fridge", "inside(mug, fridge)"),
        ("Take the mug from the kitchen.", "on the desk", "on_top(mug, desk)"),
        ("Put the sofa in the mug.", "Put the pillow on the sofa", "on_top(pillow, sofa)"),
    ],
)
def test_an_answer_lets_it_go_on(text: str, answer: str, goal: str) -> None:
    asked = RULES.understand(text, rooms=rooms().world.rooms)
    assert asked.question is not None
    got = RULES.understand(text, rooms=rooms().world.rooms, answers={asked.question.key: answer})
    assert goal in [literal for task in got.tasks for literal in task.goal.text()]


@pytest.mark.parametrize(
    "text",
    [
        "Put the mug on a table, kitchen or dining room.",
        "Put the mug on a table in the kitchen or in the dining room.",
        "The mug should be on a table, either in the kitchen or the dining room.",
    ],
)
def test_either_of_two_rooms_will_do(text: str) -> None:
    [task] = RULES.understand(text, rooms=rooms().world.rooms).tasks
    assert task.goal.text() == ("on_top(mug, any_table@kitchen|dining_room)",)


def test_an_answer_that_leads_nowhere_is_asked_again() -> None:
    asked = RULES.understand("Put the zorp in the fridge.")
    assert asked.question is not None
    got = RULES.understand("Put the zorp in the fridge.", answers={asked.question.key: "florbinator"})
    assert got.question is not None
    assert "florbinator" in got.question.key


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "language"),
    [
        ("Mets la pomme dans le frigo.", "French"),
        ("Stell bitte die Tasse auf den Tisch.", "German"),
        ("Pon la taza en el fregadero, por favor.", "Spanish"),
        ("Metti la tazza nel lavandino per favore.", "Italian"),
        ("把苹果放进冰箱", "Chinese"),
        ("りんごを冷蔵庫に入れて", "Japanese"),
        ("Положи яблоко в холодильник", "Cyrillic"),
    ],
)
def test_other_languages_are_named(text: str, language: str) -> None:
    refused = RULES.understand(text).refused
    assert refused.startswith("foreign")
    assert language in refused


def test_a_megabyte_is_refused_without_being_read() -> None:
    reads: list[str] = []
    sys.setprofile(lambda frame, event, _: reads.append(frame.f_code.co_name) if event == "call" else None)
    try:
        got = RULES.understand("put the mug on the desk " * 45_000)
    finally:
        sys.setprofile(None)
    assert got.refused.startswith("too_long")
    assert "tokens_of" not in reads


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.one_of(st.text(max_size=300), st.binary(max_size=200).map(lambda b: b.decode("latin-1"))))
def test_any_text_is_read_or_refused_in_a_house(text: str) -> None:
    got = RULES.understand(text, rooms=rooms().world.rooms)
    assert bool(got.tasks) != bool(got.refused)
    assert got == RULES.understand(text, rooms=rooms().world.rooms)


# --- spelling -------------------------------------------------------------------------------------------------------


def test_one_slip_in_short_words_and_two_in_long_ones() -> None:
    speller = Speller(["table", "dishwasher", "cable"])
    assert distance("tabel", "table") == 1
    assert speller.nearest("tabel") == ("table",)
    assert speller.nearest("dishwahser") == speller.nearest("dishwaser") == ("dishwasher",)
    assert Speller(["lamp", "lamb"]).nearest("lamq") == ("lamb", "lamp")
    assert speller.nearest("tbl") == ()


@pytest.mark.parametrize(
    ("said", "meant"), [("hamer", "hammer"), ("egs", "eggs"), ("dumplng", "dumpling"), ("towl", "towel")]
)
def test_a_letter_left_out_is_the_likeliest_slip(said: str, meant: str) -> None:
    [token] = tokens_of(said)
    assert token.text == meant


# --- floors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("split", "exact", "wrong"), [("dev", 0.50, 0.12), ("test", 0.36, 0.16)])
def test_floors_of_the_voices(split: str, exact: float, wrong: float) -> None:
    report = evaluate(RULES, [sample for sample in read_samples("voices") if sample.split == split])
    assert report.goals_exact >= exact * report.instructions
    assert report.silently_wrong <= wrong * report.instructions
