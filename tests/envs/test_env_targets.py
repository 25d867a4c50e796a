"""What an action's target may be: ids, designators, rooms, weights; in names and in the spaces' own form."""

from __future__ import annotations

import numpy as np
import pytest
from support.houses import make, start, steps, unwrapped

from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Primitive

GO, GRASP = Primitive.NAVIGATE_TO, Primitive.GRASP


def test_other_than_goes_to_another_instance() -> None:
    env = start("rs_two_apples")
    first = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    again = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    other = env.step(EnvAction(GO, "apple", other_than=(first,)))[-1]["observed"].reached
    assert first == again
    assert {first, other} == {"apple_0", "apple_1"}


def test_designators_with_a_room_mean_instances_there() -> None:
    env = start("rs_steak_on_floor")
    assert steps(env, "NAVIGATE_TO(countertop@kitchen)")[-1]["observed"].reached == "countertop_0"
    assert steps(env, "NAVIGATE_TO(countertop@living_room_0)")[-1]["observed"].reached == "countertop_1"
    assert steps(env, "NAVIGATE_TO(countertop@bathroom)")[-1]["outcome"] == "not_found"


@pytest.mark.parametrize(
    "target", ["countertop@kitchen", "countertop@living_room", "countertop@bathroom", "countertop", "countertop_1"]
)
def test_the_dict_form_does_what_the_names_do(target: str) -> None:
    named, encoded = start("rs_steak_on_floor"), start("rs_steak_on_floor")
    action = EnvAction(GO, target, {"kitchen_0": 3.0, "bedroom_0": 1.0})
    first = named.step(action)[-1]
    second = encoded.step(unwrapped(encoded).encode(action))[-1]
    assert first["route"] == second["route"]
    assert first["observed"].reached == second["observed"].reached
    assert first["outcome"] == second["outcome"]


def test_rooms_of_negative_weight_are_not_meant() -> None:
    env = start("rs_steak_on_floor")
    rooms = list(unwrapped(env).observed.graph.world.rooms)
    action = unwrapped(env).encode(EnvAction(GO, "countertop"))
    for excluded, reached in (("kitchen_0", "countertop_1"), ("living_room_0", "countertop_0")):
        action["search_prior"] = np.array([-1.0 * (room == excluded) for room in rooms] + [0.0] * (64 - len(rooms)))
        assert env.step(action)[-1]["observed"].reached == reached
        assert unwrapped(env).decode(action).target == "countertop"


def test_encode_and_decode_are_inverse() -> None:
    env = unwrapped(start("rs_steak_on_floor"))
    rooms = list(env.observed.graph.world.rooms)
    for action in (
        EnvAction(Primitive.RELEASE),
        EnvAction(GO, "sofa_0"),
        EnvAction(GRASP, "apple"),
        EnvAction(GO, "kitchen_0"),
        EnvAction(GO, "apple", {rooms[0]: 0.25, rooms[2]: 1.0}),
    ):
        assert env.decode(env.encode(action)) == action
    assert env.encode(EnvAction(GO, "apple"), {rooms[1]: 0.5})["search_prior"].tolist()[:2] == [0.0, 0.5]


@pytest.mark.parametrize(("where", "elsewhere"), [("bathroom_0", "kitchen_0"), ("kitchen_0", "bathroom_0")])
def test_heavier_rooms_are_searched_first(where: str, elsewhere: str) -> None:
    placements = [{"category": "apple", "relation": "floor", "target": where}]
    task = {"text": "Bring it.", "goal": ["on_top(apple, sofa)"], "reference_plan": ["NAVIGATE_TO(apple_0)"]}
    record = {"id": "x", "scene": "Rs_int", "text": "Bring it.", "placements": placements, "tasks": [task]}
    metres = {}
    for likely, unlikely in ((where, elsewhere), (elsewhere, where)):
        env = make()
        env.reset(seed=0, options={"instruction": record})
        assert not {where, elsewhere} & unwrapped(env).observed.searched
        info = env.step(EnvAction(GO, "apple", {likely: 1.0, unlikely: 0.5}))[-1]
        assert info["outcome"] == "ok"
        metres[likely] = info["step_metres"]
    assert metres[where] < metres[elsewhere]


def test_categories_stand_for_something_near_in_other_primitives() -> None:
    env = start("rs_two_apples")
    reached = steps(env, "NAVIGATE_TO(apple)")[-1]["observed"].reached
    assert steps(env, "GRASP(apple)")[-1]["action"] == f"GRASP({reached})"
