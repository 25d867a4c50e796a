"""Errands by construction: goals, reference plans, placements, drafts and the generator."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter

import msgspec
import numpy as np
import pytest

from gavel_env.errors import InstructionError, UnknownScene
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.assembly import assemble, initial_graph
from gavel_env.tasks.drafts import Draft, pair_split
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.generator import LONG_SHAPES, SHORT_SHAPES, Knobs, generate
from gavel_env.tasks.judging import judge
from gavel_env.tasks.placements import House, load_house, pick
from gavel_env.tasks.recipes import HOUSES, house_names
from gavel_env.tasks.shapes import SHAPES, draw_errand
from gavel_env.tasks.statistics import CONFERRED
from gavel_env.world_model.goals import parse_goal
from gavel_env.world_model.ontology import default_ontology

# Pomaria_1_int has every appliance, so it affords every shape.
HOUSE = "Pomaria_1_int"

STEPS = {
    "to_support": {4},
    "to_container": {4},
    "out_of_container": {4},
    "away": {6},
    "switch_on": {2},
    "wash_dish": {8},
    "wash_clothes": {8},
    "dry_clothes": {8},
    "counter_heat": {9, 13},
    "fridge_heat": {11, 15},
    "put_two_away": {12, 14},
    "take_two_out": {12},
    "bring_three": {12, 14},
    "carry_two": {8},
    "carry_two_and_switch": {10, 12},
    "swap": {12, 16},
    "tray": {9},
    "load_dishwasher": {12},
    "wash_then_dry": {17},
}
LITERALS = {"put_two_away": 2, "bring_three": 3, "carry_two_and_switch": 3, "load_dishwasher": 4, "wash_then_dry": 3}


def drawn(shape: str, seed: int, house: str = HOUSE) -> tuple[Draft, Errand]:
    draft = Draft(load_house(house), np.random.default_rng(seed))
    errand = draw_errand(draft, shape, attempts=300)
    assert errand is not None, f"{house} affords no {shape}"
    return draft, errand


@pytest.mark.parametrize("shape", SHAPES)
def test_reference_plan_meets_the_goal_and_has_the_length_of_its_shape(shape: str) -> None:
    for seed in range(6):
        draft, errand = drawn(shape, seed)
        record = assemble(draft, [errand], draft.rng, identifier="x")
        graph = initial_graph(draft, record)
        plan, goal = record.tasks[0].parsed_plan(), record.tasks[0].parsed_goal()
        assert judge(graph, plan, goal).kind == "valid"
        assert len(plan) in STEPS[shape]
        assert len(goal.literals) == LITERALS.get(shape, len(goal.literals))
        assert SHAPES[shape].confers == any(lit.predicate.value in CONFERRED for lit in goal.literals)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_step_of_a_reference_plan_is_needed(shape: str) -> None:
    """Idle are only: shutting what is opened again at once, and switching off what opening switches off."""
    draft, errand = drawn(shape, 3)
    record = assemble(draft, [errand], draft.rng, identifier="x")
    graph = initial_graph(draft, record)
    plan, goal = record.tasks[0].parsed_plan(), record.tasks[0].parsed_goal()
    idle = [i for i in range(len(plan)) if judge(graph, plan[:i] + plan[i + 1 :], goal).kind == "valid"]
    assert all(plan[i].primitive.name in ("CLOSE", "OPEN", "NAVIGATE_TO", "TOGGLE_OFF") for i in idle)
    assert len(idle) <= 3


def test_shares_are_those_of_the_description() -> None:
    assert sum(LONG_SHAPES.values()) == 100
    assert sum(SHORT_SHAPES.values()) == 140
    assert set(LONG_SHAPES) | set(SHORT_SHAPES) == set(SHAPES)


def test_no_movable_of_the_scene_is_drawn_and_none_twice() -> None:
    house = load_house("Rs_int")
    own = {house.graph.category(obj).name for obj in house.graph.world.nodes}
    draft = Draft(house, np.random.default_rng(0))
    for _ in range(12):
        draw_errand(draft, "to_support")
    names = [thing.category for thing in draft.things]
    assert len(names) == len(set(names))
    assert not own & set(names)


def test_a_furniture_category_keeps_its_room_and_its_name_within_a_draft() -> None:
    draft = Draft(load_house("Wainscott_0_int"), np.random.default_rng(4), say_room=0.5)
    errands = [e for _ in range(15) if (e := draw_errand(draft, "to_support")) is not None]
    meant: dict[str, set[tuple[str, str | None]]] = {}
    for errand in errands:
        for reference in errand.references():
            meant.setdefault(reference.piece.category, set()).add((reference.piece.room, reference.room))
    assert len(errands) >= 10
    assert all(len(ways) == 1 for ways in meant.values())


def test_a_source_with_a_door_is_the_only_one_that_fits() -> None:
    house = load_house(HOUSE)
    for seed in range(25):
        _, errand = drawn("take_two_out", seed)
        source = errand.things[0].source
        assert source is not None
        assert len(house.rooms_with(source.piece.category, source.room)) == 1


def test_likely_places_are_likely_and_others_happen() -> None:
    """Milk starts in the fridge more often than anywhere else; a surprise puts it elsewhere."""
    house = load_house(HOUSE)
    places, weights = house.places("jug_of_milk")
    best = max(zip(weights, places, strict=True), key=lambda pair: pair[0])[1]
    assert best.piece is not None
    assert best.piece.category == "fridge"
    draft = Draft(house, np.random.default_rng(1), surprise=1.0)
    starts = Counter(draft.start("jug_of_milk", lambda place: place.relation != "floor") for _ in range(40))
    assert len(starts) > 5


def test_destinations_are_plausible_and_starts_are_reachable() -> None:
    house = load_house("Merom_1_int")
    assert house.floor is not None
    for category in ("steak", "bath_towel", "teddy_bear", "mug"):
        places, weights = house.places(category, as_goal=True)
        for place, weight in zip(places, weights, strict=True):
            assert weight == 0 or house.suits(place, category)
            assert place.piece is None or house.floor.stances(place.piece.id).size
    beds = [p for p in house.places("steak", as_goal=True)[0] if p.piece and p.piece.category == "bed"]
    assert beds
    assert not any(house.suits(bed, "steak") for bed in beds)


def test_destination_is_the_nearest_of_those_that_fit() -> None:
    house = load_house("Beechwood_0_int")
    for seed in range(20):
        draft = Draft(house, np.random.default_rng(seed), say_room=0.0)
        errand = draw_errand(draft, "to_support")
        assert errand is not None
        thing, reference = errand.things[0], errand.targets[0].reference
        rivals = [p for p in house.pieces if p.category == reference.piece.category]
        rivals = [p for p in rivals if reference.room in (None, p.room_type)]
        if thing.source is None:
            chosen = house.travel_m(thing.start, reference.piece)
            assert chosen <= min(house.travel_m(thing.start, p) for p in rivals) + 1e-9


def test_pick_follows_the_weights() -> None:
    rng = np.random.default_rng(0)
    counts = Counter(pick(rng, "abc", [1.0, 0.0, 3.0]) for _ in range(4000))
    assert counts["b"] == 0
    assert counts["c"] / counts["a"] == pytest.approx(3.0, rel=0.15)


def test_pair_splits_are_fixed_symmetric_and_of_the_stated_shares() -> None:
    names = list(load_house("Rs_int").vocabulary.movables)[:120]
    shares = Counter(pair_split(a, b) for a in names for b in names if a < b)
    total = sum(shares.values())
    assert shares["benchmark"] / total == pytest.approx(0.46, abs=0.02)
    assert shares["validation"] / total == pytest.approx(0.14, abs=0.02)
    assert pair_split("mug", "bed") == pair_split("bed", "mug")


# --- generator ------------------------------------------------------------------------------------------------------


def test_knobs_are_kept() -> None:
    knobs = Knobs(count=6, seed=3, houses=("Merom_1_int", "house_single_floor"), horizon=(12, 20), rooms=(3, 5))
    records = list(generate(knobs))
    assert len(records) == 6
    for record in records:
        assert 12 <= len(record.reference_plan()) <= 20
        assert 2 <= len(record.tasks) <= 5
    singles = list(generate(Knobs(kind="single", count=3, houses=("Rs_int",), distractors=4)))
    assert all(len(record.tasks) == 1 for record in singles)
    placed = [sum(str(p.id) not in str(r.tasks) for p in r.placements) for r in singles]
    assert placed == [4, 4, 4]


def test_instruction_i_does_not_depend_on_those_before_it() -> None:
    few = list(generate(Knobs(count=3, seed=11, houses=("Rs_int",))))
    more = list(generate(Knobs(count=5, seed=11, houses=("Rs_int",))))
    assert more[:3] == few
    assert list(generate(Knobs(count=3, seed=12, houses=("Rs_int",)))) != few


def test_same_seed_same_bytes_in_another_process_and_hash_seed() -> None:
    code = (
        "import sys, msgspec; from gavel_env.tasks.generator import Knobs, generate;"
        "knobs = Knobs(count=4, seed=5, houses=('Rs_int', 'Ihlen_1_int'));"
        "sys.stdout.buffer.write(b''.join(msgspec.json.encode(r) for r in generate(knobs)))"
    )
    here = b"".join(msgspec.json.encode(r) for r in generate(Knobs(count=4, seed=5, houses=("Rs_int", "Ihlen_1_int"))))
    environment = {**os.environ, "PYTHONHASHSEED": "4242"}
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=environment).stdout
    assert there == here


def test_impossible_knobs_say_why() -> None:
    with pytest.raises(InstructionError, match=r"Rs_int.*rooms outside 9-9"):
        list(generate(Knobs(count=1, houses=("Rs_int",), rooms=(9, 9))))
    with pytest.raises(UnknownScene, match="Rs_int"):
        list(generate(Knobs(count=1, houses=("Rs_imt",))))


def test_held_out_houses_are_no_twins_of_the_benchmark() -> None:
    held_out = house_names(["held-out"])
    assert not {name.split("_int")[0].split("_garden")[0] for name in held_out} & {n.split("_int")[0] for n in HOUSES}
    assert set(house_names(["all"])) > set(held_out) | set(HOUSES)
    assert house_names(["Rs_int", "benchmark"])[0] == "Rs_int"


def test_a_house_without_a_map_serves_pairs() -> None:
    house = House(load_house("Rs_int").scene)
    assert house.floor is None
    errand = draw_errand(Draft(house, np.random.default_rng(0)), "to_support")
    assert errand is not None
    assert parse_goal(errand.goal).literals


def test_what_is_drawn_to_be_washed_or_dried_may_be_asked_for() -> None:
    drawn = [name for name, noun in default_vocabulary().movables.items() if noun.theme in ("dish", "tray", "laundry")]
    assert len(drawn) > 50
    assert all(default_ontology()[name].washable for name in drawn)
