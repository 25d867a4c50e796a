"""Instructions that cannot be are rejected with the place, the value and the alternatives; all that ship are sound."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hostile import fuzzed, harmless, times

import gavel_env  # noqa: F401  (registers the environments)
from gavel_env.errors import GavelError, InstructionError
from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import parse_instruction, read_instructions, shipped

pytestmark = pytest.mark.hostile

GOOD: dict[str, Any] = {
    "id": "mine-1",
    "scene": "Rs_int",
    "text": "Put the apple in the fridge.",
    "placements": [{"category": "apple", "relation": "on", "target": "countertop"}],
    "tasks": [{"text": "Put the apple in the fridge.", "goal": ["inside(apple, fridge)"], "reference_plan": []}],
}


def world(record: Any) -> Any:
    instruction = parse_instruction(record, "line 1")
    return instruction_graph(load_scene(instruction.scene), instruction)


def changed(**fields: Any) -> dict[str, Any]:
    return {**GOOD, **fields}


def placed(*placements: dict[str, Any]) -> dict[str, Any]:
    return changed(placements=[*GOOD["placements"], *placements])


def wanting(*goal: str) -> dict[str, Any]:
    return changed(tasks=[{"text": "Do it.", "goal": list(goal), "reference_plan": []}])


def on(category: str, target: str, relation: str = "on", **more: Any) -> dict[str, Any]:
    return {"category": category, "relation": relation, "target": target, **more}


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no id": (changed(id=""), "the id '' cannot be used"),
    "an id with a newline": (changed(id="a\nb"), "that print"),
    "a long id": (changed(id="x" * 100_000), "the id 'x+' cannot be used"),
    "no text": (changed(text=" "), "text has 1 characters"),
    "a scene of 300 characters": (changed(scene="x" * 300), "the scene 'x+' cannot be used"),
    "a scene with NUL": (changed(scene="Rs\0int.json"), "that print"),
    "a scene that is a folder": (changed(scene="/"), "unknown scene"),
    "a scene that is a device": (changed(scene="/dev/zero"), "unknown scene"),
    "two tasks of one": (changed(tasks=GOOD["tasks"] * 2), "2 tasks and the kind 'single'"),
    "an object called as a room": (placed(on("apple", "countertop", id="kitchen_0")), "that of a room"),
    "an object called as a category": (placed(on("apple", "countertop", id="fridge")), "means a category"),
    "an object called robot": (placed(on("apple", "countertop", id="robot")), "means the robot"),
    "an object without a name": (placed(on("apple", "countertop", id="")), "the id"),
    "an object with a newline": (placed(on("apple", "countertop", id="a\nb")), "cannot be used"),
    "a long name": (placed(on("apple", "countertop", id="a" * 100_000)), "cannot be used"),
    "two trays on each other": (
        placed(on("tray", "tray_b", id="tray_a"), on("tray", "tray_a", id="tray_b")),
        "in a circle: tray_a on tray_b on tray_a",
    ),
    "a tray on itself": (placed(on("tray", "tray_a", id="tray_a")), "in a circle"),
    "a fridge on a countertop": (placed(on("fridge", "countertop")), "cannot be lifted"),
    "a wall on a countertop": (placed(on("walls", "countertop")), "cannot be lifted"),
    "a category that nobody knows": (placed(on("frige", "countertop")), "did you mean 'fridge'"),
    "a goal of an unknown category": (wanting("inside(unicorn, fridge)"), "nothing is called 'unicorn'"),
    "a goal in an unknown room": (wanting("inside(apple, fridge@ballroom)"), "no room 'ballroom'; rooms: "),
    "an apple that is open": (wanting("open(apple)"), "'apple' is not openable"),
    "a fridge that is cooked": (wanting("cooked(fridge)"), "'fridge' is not cookable"),
    "a wardrobe that is washed": (wanting("washed(wardrobe)"), "'wardrobe' is not washable"),
    "a sofa that is dried": (wanting("dried(sofa)"), "'sofa' is not washable"),
    "a newspaper that is washed": (wanting("washed(newspaper)"), "'newspaper' is not washable"),
    "butter that is dried": (wanting("dried(butter)"), "'butter' is not washable"),
    "an armchair that is washed": (wanting("washed(armchair)"), "'armchair' is not washable"),
    "a book that is washed": (wanting("washed(hardback)"), "'hardback' is not washable"),
    "a laptop that is washed": (wanting("washed(laptop)"), "'laptop' is not washable"),
    "a lamp that is inside an apple": (wanting("inside(floor_lamp, apple)"), "'apple' has no interior"),
    "two places at once": (wanting("inside(apple, fridge)", "on_top(apple, countertop)"), "two places"),
    "a contradiction": (wanting("inside(apple, fridge)", "not inside(apple, fridge)"), "contrary"),
    "an unknown predicate": (wanting("eaten(apple)"), "unknown predicate 'eaten'"),
    "a wrong arity": (wanting("open(fridge, apple)"), "takes 1 argument"),
    "a place that is none": (placed(on("apple", "@@")), "needs the form name"),
}


@pytest.mark.parametrize("name", BAD)
def test_an_instruction_that_cannot_be_is_rejected(name: str) -> None:
    record, reason = BAD[name]
    with pytest.raises(GavelError, match=reason):
        world(record)
    env = gym.make("Gavel-SingleTask-v0", scenes="Rs_int", observation="symbolic")
    with pytest.raises(GavelError, match=reason):
        env.reset(options={"instruction": record})


def test_the_instruction_that_the_others_are_changed_from_is_sound() -> None:
    assert world(GOOD).room_of("apple_0") is not None


@pytest.mark.parametrize("name", ["single", "multi", "behavior", "rl"])
def test_every_shipped_instruction_is_sound(name: str) -> None:
    records = read_instructions(shipped(name))
    assert not records.rejected
    for instruction in list(records.values())[:: times(7, 1)]:
        instruction_graph(load_scene(instruction.scene), instruction)


def test_a_bad_line_is_counted_and_hangs_nothing(tmp_path: Path) -> None:
    lines = [msgspec.json.encode(record) for record, _ in BAD.values()]
    path = tmp_path / "mine.jsonl"
    path.write_bytes(b"\n".join([msgspec.json.encode(GOOD), *lines, b"\xff\xfe", b"[" * 100_000, b"null", b"{}"]))
    records = read_instructions(path)
    assert "mine-1" in records
    assert len(records) + len(records.rejected) == 1 + len(lines) + 4


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-5, 10**20)
    | st.floats(allow_nan=False)
    | st.text(max_size=8)
    | st.sampled_from(["apple", "tray", "fridge", "kitchen_0", "robot", "on", "in", "floor", "Rs_int", "multi"])
    | st.sampled_from(["inside(apple, fridge)", "open(fridge)", "not open(apple)", "cooked(apple)", "GRASP(apple)"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)
FIELDS = st.sampled_from(["id", "scene", "text", "placements", "tasks", "kind", "initial", "meta", "other"])
PLACES = st.fixed_dictionaries(
    {
        "category": st.sampled_from(["apple", "tray", "mug", "fridge", "wardrobe", "walls", "bowl"]),
        "relation": st.sampled_from(["on", "in", "floor"]),
        "target": st.sampled_from(["countertop", "tray", "mug", "bowl", "fridge", "kitchen", "bed", "a", "b", "apple"]),
    },
    optional={"id": st.sampled_from(["a", "b", "tray", "", "robot", "a_1"]), "states": st.lists(st.text(max_size=6))},
)


@given(st.dictionaries(FIELDS, VALUES, max_size=4))
@fuzzed(150, 40_000)
def test_no_field_of_a_record_raises_anything_else(fields: dict[str, Any]) -> None:
    harmless(world, changed(**fields))


@given(st.lists(PLACES, max_size=6))
@fuzzed(150, 40_000)
def test_no_placement_hangs(placements: list[dict[str, Any]]) -> None:
    graph = harmless(world, changed(placements=placements, tasks=[{**GOOD["tasks"][0], "goal": ["open(fridge)"]}]))
    if not isinstance(graph, Exception):
        for obj in graph.world.nodes:
            assert graph.room_of(obj) is not None


@given(st.binary(max_size=200) | VALUES.map(msgspec.json.encode))
@fuzzed(300, 60_000)
def test_no_line_raises_anything_else(line: bytes) -> None:
    found = harmless(parse_instruction, line, "line 1")
    assert not isinstance(found, Exception) or isinstance(found, InstructionError)


@pytest.mark.parametrize("scene", ["Rs_int", "grocery_store_cafe"] if times(0, 1) == 0 else scene_names())
def test_a_plain_environment_takes_every_shipped_scene(scene: str) -> None:
    floor = load_scene(scene).rooms[0].id
    doors = [p.id for p in load_scene(scene).furniture if p.category in ("fridge", "bottom_cabinet", "door")]
    goal = [f"open({doors[0]})"] if doors else ["in_room(apple, nowhere)"]
    record = changed(
        scene=scene,
        placements=[on("apple", floor, "floor")],
        tasks=[{"text": "Do.", "goal": goal, "reference_plan": []}],
    )
    env = gym.make("Gavel-SingleTask-v0", instructions=[record], observation="symbolic")
    found = harmless(env.reset, seed=0)
    assert not isinstance(found, Exception) or "nowhere" in str(found)
