"""Bad records, arguments and actions: typed errors, and environments that go on."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
from support.houses import FILE, INSTRUCTIONS, make, start, steps, unwrapped

from gavel_env.envs.action_codec import BadAction
from gavel_env.envs.env import BadEnvironmentOption, GavelEnv
from gavel_env.envs.spaces import TooManyNodes
from gavel_env.errors import GavelError, InstructionError, ResetNeeded, UnknownInstruction, UnknownScene
from gavel_env.exchange import EnvAction, ReturnWhen
from gavel_env.house.robot_config import RobotConfig
from gavel_env.world_model.actions import Primitive

GO = Primitive.NAVIGATE_TO

APPLE = {"category": "apple", "relation": "on", "target": "bed_0"}
RECORD = msgspec.to_builtins(INSTRUCTIONS["rs_apple_to_table"])


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"scene": "Rs_in"}, UnknownScene, "Rs_int"),
        ({"tasks": []}, InstructionError, "no tasks"),
        ({"tasks": "none"}, InstructionError, "malformed"),
        ({"placements": [{**APPLE, "category": "aple"}]}, InstructionError, "apple"),
        ({"placements": [{**APPLE, "relation": "in"}]}, InstructionError, "no interior"),
        ({"placements": [{**APPLE, "target": "moon"}]}, InstructionError, "moon"),
        ({"placements": [{**APPLE, "target": "coffee_table_0"}]}, InstructionError, "holds at the start"),
        ({"text": "a" * 5000}, InstructionError, "characters"),
        ({"text": "half \ud83d of one"}, InstructionError, "surrogate"),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_malformed_records_are_typed_errors(change: dict[str, Any], error: type[GavelError], said: str) -> None:
    with pytest.raises(error) as raised:
        make().reset(options={"instruction": RECORD | change})
    assert said in str(raised.value)


def test_an_environment_goes_on_after_a_bad_record() -> None:
    env = make()
    with pytest.raises(InstructionError):
        env.reset(options={"instruction": RECORD | {"tasks": []}})
    with pytest.raises(ResetNeeded, match="call reset"):
        env.unwrapped.step(EnvAction(Primitive.RELEASE))
    assert env.reset(seed=1)[1]["instruction_id"] in INSTRUCTIONS


def test_records_are_taken_in_every_form() -> None:
    for form in ("rs_apple_to_table", RECORD, INSTRUCTIONS["rs_apple_to_table"]):
        assert make().reset(options={"instruction": form})[1]["instruction_id"] == "rs_apple_to_table"
    assert unwrapped(make(instructions=[RECORD])).instruction_ids == ("rs_apple_to_table",)
    assert unwrapped(make(instructions=FILE)).instruction_ids == tuple(INSTRUCTIONS)


def test_unknown_ids_name_the_nearest() -> None:
    with pytest.raises(UnknownInstruction, match="rs_apple_to_table"):
        make().reset(options={"instruction": "rs_aple_to_table"})
    with pytest.raises(UnknownInstruction, match="singel"):
        gym.make("Gavel-SingleTask-v0", instructions="singel")
    with pytest.raises(InstructionError, match="cannot be read"):
        make(instructions="nowhere.jsonl")


@pytest.mark.parametrize(
    ("kwargs", "said"),
    [
        ({"on_violation": "ignore"}, "'terminate'"),
        ({"observation": "pixels"}, "'symbolic'"),
        ({"profile": "strict"}, "'omnigibson'"),
        ({"robot": {"radius": 0.3}}, "robot_radius_m"),
        ({"robot": {"reach_m": "far"}}, "reach_m"),
        ({"reward": {"sucess": 1.0}}, "success"),
    ],
    ids=str,
)
def test_bad_arguments_name_the_alternatives(kwargs: dict[str, Any], said: str) -> None:
    with pytest.raises(BadEnvironmentOption) as raised:
        GavelEnv(FILE, **kwargs)
    assert said in str(raised.value)


def test_scenes_select_instructions() -> None:
    kept = unwrapped(make(scenes=["Benevolence_1_int"])).instruction_ids
    assert unwrapped(make(scenes="Benevolence_1_int")).instruction_ids == kept
    assert kept == ("benevolence_cook_apple",)
    with pytest.raises(InstructionError, match="Benevolence_1_int"):
        make(scenes=["Merom_1_int"])


def test_robot_fields_reach_the_map() -> None:
    env = start("rs_apple_to_table", robot={"cell_m": 0.2, "reach_m": 1.0})
    assert unwrapped(env).observed.layout.robot == RobotConfig(cell_m=0.2, reach_m=1.0)


def test_scenes_larger_than_the_spaces_are_refused_at_reset() -> None:
    with pytest.raises(TooManyNodes, match="max_nodes=20"):
        make(max_nodes=20).reset(seed=0)


def test_steps_outside_an_episode_are_refused() -> None:
    env = make().unwrapped
    with pytest.raises(gym.error.ResetNeeded, match="call reset") as raised:
        env.step(EnvAction(Primitive.RELEASE))
    env.reset(seed=0)
    assert env.step(EnvAction(Primitive.RELEASE))[2]
    assert isinstance(raised.value, GavelError)
    with pytest.raises(ResetNeeded, match="over"):
        env.step(EnvAction(Primitive.RELEASE))
    with pytest.raises(BadEnvironmentOption, match="no option 'scene'"):
        env.reset(options={"scene": "Rs_int"})


@pytest.mark.parametrize(
    "action",
    [
        None,
        3,
        "OPEN(fridge)",
        {},
        {"primitive": 9, "target": 0, "search_prior": np.zeros(64)},
        {"primitive": 0, "target": 10**6, "search_prior": np.zeros(64)},
        {"primitive": 0, "target": 0, "search_prior": np.zeros(3)},
        {"primitive": 0, "target": "fridge", "search_prior": np.zeros(64)},
    ],
    ids=str,
)
def test_actions_of_another_form_are_refused(action: Any) -> None:
    env = start("rs_apple_to_table").unwrapped
    with pytest.raises(BadAction):
        env.step(action)
    assert env.step(EnvAction(GO, "apple"))[-1]["outcome"] == "ok"


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (EnvAction(GO, "frige"), "fridge"),
        (EnvAction(GO, "apple", {"kitchen": 1.0}), "kitchen_0"),
        (EnvAction(GO, "apple", {"kitchen_0": -1.0}), "weights >= 0"),
        (EnvAction(GO, "apple", {"kitchen_0": float("nan")}), "weights >= 0"),
        (EnvAction(GO, "apple", other_than=("apple_0",)), "other_than"),
        (EnvAction(GO, "apple", return_when=ReturnWhen(room_done=True)), "return_when"),
    ],
    ids=str,
)
def test_what_the_action_space_cannot_say(action: EnvAction, said: str) -> None:
    with pytest.raises(BadAction) as raised:
        unwrapped(start("rs_apple_to_table")).encode(action)
    assert said in str(raised.value)


def test_unknown_names_are_a_violation_not_an_error() -> None:
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(frige)")[-1]["outcome"] == "unknown_object"
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(@)")[-1]["outcome"] == "unknown_object"
    assert steps(start("rs_apple_to_table"), "NAVIGATE_TO(kitchen_0)")[-1]["outcome"] == "room_target"
