"""Voices: what is kept of blind readings, and what goes back, each for its own reason."""

from __future__ import annotations

import msgspec
import pytest

from envs_data.build.voices.merge import Rejected, merge, split
from envs_data.build.voices.readings import Reading, ReadTask
from envs_data.build.voices.scenarios import draw
from gavel_env.instructions.record import Instruction, TaskSpec

MILK = msgspec.convert(
    {
        "id": "milk",
        "scene": "Rs_int",
        "text": "",
        "placements": [{"category": "carton_of_milk", "relation": "in", "target": "fridge", "id": "carton_of_milk_0"}],
        "tasks": [
            {
                "text": "",
                "goal": ["on_top(carton_of_milk, breakfast_table)"],
                "reference_plan": [
                    "NAVIGATE_TO(fridge_0)",
                    "OPEN(fridge_0)",
                    "GRASP(carton_of_milk_0)",
                    "CLOSE(fridge_0)",
                    "NAVIGATE_TO(breakfast_table_0)",
                    "PLACE_ON_TOP(breakfast_table_0)",
                ],
            }
        ],
        "meta": {"voice": "curt", "shapes": ["take_out"]},
    },
    Instruction,
)
TEXT = "milk, out of the fridge, table"
FRIDGE = ("inside(carton_of_milk, fridge@kitchen)",)


def reading(*literals: str, stated: tuple[str, ...] = FRIDGE) -> Reading:
    return Reading("milk", (ReadTask(literals, stated),))


def test_what_both_understand_is_kept_with_how_far_the_word_reaches() -> None:
    narrow = reading("on_top(carton_of_milk|jug_of_milk, breakfast_table@kitchen|breakfast_table)")
    wide = reading("at(carton_of_milk, breakfast_table|coffee_table)")
    record = merge(MILK, TEXT, narrow, wide)
    [target] = record.meta["targets"]
    assert record.text == record.tasks[0].text == TEXT
    assert target["relations"] == ["inside(carton_of_milk, fridge)"]
    [claim] = target["denotes"]
    assert claim["subject"] == {"least": ["carton_of_milk_0"], "most": ["carton_of_milk_0"]}
    assert set(claim["object"]["least"]) < set(claim["object"]["most"])
    assert claim["predicates"] == ["inside", "on_top"]
    assert record.tasks[0].goal[0].startswith("on_top(carton_of_milk, ")


@pytest.mark.parametrize(
    ("second", "why"),
    [
        (reading("on_top(carton_of_milk, coffee_table)"), "readers"),
        (reading("on_top(carton_of_milk, breakfast_table)", "open(fridge)"), "readers"),
        (Reading("milk", unclear="no idea"), "unclear"),
        (reading("on_top(carton_of_milk, breakfast_tabel)"), "notation"),
        (reading("on_top(carton_of_milk, breakfast_table)", stated=()), "hidden"),
    ],
)
def test_what_is_read_differently_goes_back(second: Reading, why: str) -> None:
    with pytest.raises(Rejected, match=f"^{why}: "):
        merge(MILK, TEXT, reading("on_top(carton_of_milk, breakfast_table)"), second)


def test_a_reading_on_which_both_are_wrong_goes_back() -> None:
    wrong = reading("on_top(carton_of_milk, coffee_table)")
    with pytest.raises(Rejected, match=r"^scenario: not so after the certified plan"):
        merge(MILK, TEXT, wrong, wrong)


def test_false_statements_go_back() -> None:
    said = reading("on_top(carton_of_milk, breakfast_table)", stated=("inside(carton_of_milk, top_cabinet)",))
    with pytest.raises(Rejected, match=r"^(stated|notation): "):
        merge(MILK, TEXT, said, said)


def test_halves_are_even_within_kind_and_voice_and_do_not_depend_on_order() -> None:
    records = [
        Instruction(f"r{i}", "Rs_int", "", (), (TaskSpec("", (), ()),), meta={"voice": "curt"}) for i in range(20)
    ]
    halves = split(records)
    assert sorted(halves.values()) == ["dev"] * 10 + ["test"] * 10
    assert split(reversed(records)) == halves


def test_the_same_seed_draws_the_same_scenarios() -> None:
    once, again = (list(draw("single", 2, 5, ("Rs_int",))) for _ in range(2))
    assert msgspec.json.encode(once) == msgspec.json.encode(again)
    assert once[0].goal() != once[1].goal()
