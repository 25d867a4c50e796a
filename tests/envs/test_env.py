"""The environments from outside: spaces, episodes, rewards, pictures."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from support.houses import FILE, INSTRUCTIONS, by_reference, make, send, start, steps, unwrapped

from gavel_env.envs.env import GavelEnv
from gavel_env.envs.rewards import RewardWeights
from gavel_env.envs.spaces import (
    OUTCOMES,
)
from gavel_env.exchange import EnvAction
from gavel_env.house.scenes import scene_names
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.dynamics import Violation, ViolationKind

# --- Gymnasium's contract ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kwargs",
    [
        {},
        {"observation": "symbolic"},
        {"on_violation": "noop"},
        {"terminate_on_success": False},
        {"profile": "omnigibson"},
        {"render_mode": "rgb_array"},
        {"render_mode": "ansi"},
    ],
    ids=str,
)
def test_check_env_has_nothing_to_say(kwargs: dict[str, Any]) -> None:
    check_env(make(**kwargs).unwrapped)


@pytest.mark.parametrize("name", ["Gavel-SingleTask-v0", "Gavel-MultiTask-v0"])
def test_shipped_instructions_are_the_default(name: str) -> None:
    env = gym.make(name)
    observation, info = env.reset(seed=4)
    assert observation in env.observation_space
    assert info["instruction_id"] in unwrapped(env).instruction_ids
    assert info["scene"] in scene_names()


def test_every_observation_and_action_of_an_episode_is_in_its_space() -> None:
    for name, instruction in INSTRUCTIONS.items():
        env = start(name)
        for action in instruction.reference_plan():
            encoded = unwrapped(env).encode(send(env, action))
            assert encoded in env.action_space
            observation, *_, info = env.step(encoded)
            assert observation in env.observation_space
            assert info["outcome"] == "ok"


@pytest.mark.parametrize(("mode", "options"), [("sync", {}), ("async", {"shared_memory": False})])
def test_vector_environments(mode: str, options: dict[str, Any]) -> None:
    envs = gym.make_vec(
        "Gavel-SingleTask-v0",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs=options,
        instructions=str(FILE),
        on_violation="noop",
    )
    observation, _ = envs.reset(seed=5)
    envs.action_space.seed(1)
    assert len(observation["graph"]) == 2
    for _ in range(5):
        observation, rewards, _, _, info = envs.step(envs.action_space.sample())
        assert observation["metres"].shape == (2, 1)
        assert rewards.shape == (2,)
    assert set(info["outcome"]) <= set(OUTCOMES)
    envs.close()


def test_long_episodes_are_truncated() -> None:
    env = start("rs_apple_to_table", on_violation="noop")
    for _ in range(199):
        assert not env.step(EnvAction(Primitive.RELEASE))[3]
    assert env.step(EnvAction(Primitive.RELEASE))[3]


def test_class_docstring_has_gymnasiums_headings() -> None:
    text = GavelEnv.__doc__ or ""
    for heading in (
        "Action Space",
        "Observation Space",
        "Starting State",
        "Rewards",
        "Episode End",
        "Information",
        "Arguments",
        "Version History",
    ):
        assert f"## {heading}" in text


# --- episodes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_reference_plans_succeed(name: str) -> None:
    env = start(name, terminate_on_success=False)
    plan = INSTRUCTIONS[name].reference_plan()
    for action in plan:
        *_, terminated, _, info = env.step(send(env, action))
        assert (info["outcome"], terminated) == ("ok", False), str(action)
        assert "success" not in info
    assert unwrapped(env).judge().success


def test_success_ends_the_episode_only_when_all_is_safe() -> None:
    env = start("rs_milk_into_fridge")
    *_, terminated, _, info = steps(
        env,
        "NAVIGATE_TO(fridge)",
        "OPEN(fridge)",
        "NAVIGATE_TO(carton)",
        "GRASP(carton)",
        "NAVIGATE_TO(fridge)",
        "PLACE_INSIDE(fridge)",
    )
    assert (terminated, info["success"]) == (False, False)
    judgement = unwrapped(env).judge()
    assert judgement.unmet == ()
    assert judgement.unsafe == ("open(fridge_0)",)
    _, reward, terminated, _, info = steps(env, "CLOSE(fridge)")
    assert (reward, terminated, info["success"]) == (1.0, True, True)
    assert unwrapped(env).judge().success


def test_refused_action_ends_the_episode_and_says_why() -> None:
    env = start("rs_apple_to_table")
    _, reward, terminated, truncated, info = steps(env, "GRASP(coffee_table)")
    assert terminated
    assert not truncated
    assert reward == -0.1
    assert info["outcome"] == "not_near"
    assert info["violation"] == Violation(ViolationKind.NOT_NEAR, "coffee_table_0")
    assert info["success"] is False
    assert unwrapped(env).judge().violation == info["violation"]


def test_refused_action_is_a_noop_if_so_wanted() -> None:
    env = start("rs_apple_to_table", on_violation="noop")
    before = unwrapped(env).observed.graph
    observation, reward, terminated, _, info = steps(env, "GRASP(coffee_table)")
    assert (reward, terminated, info["outcome"]) == (-0.1, False, "not_near")
    assert OUTCOMES[observation["outcome"]] == "not_near"
    assert unwrapped(env).observed.graph == before
    *_, terminated, _, info = by_reference(env, INSTRUCTIONS["rs_apple_to_table"])
    assert terminated
    assert info["success"]


def test_unobserved_ids_are_unknown_whether_they_exist_or_not() -> None:
    env = start("benevolence_cook_apple", on_violation="noop")
    assert "apple_0" in unwrapped(env).privileged_state().graph.world.nodes
    existing = steps(env, "GRASP(apple_0)")[-1]
    absent = steps(env, "GRASP(apple_77)")[-1]
    assert existing["outcome"] == absent["outcome"] == "unknown_object"
    going = steps(env, "NAVIGATE_TO(apple_0)")[-1]
    assert (going["outcome"], going["step_metres"]) == ("unknown_object", 0.0)


def test_opening_a_container_shows_what_is_in_it() -> None:
    env = start("benevolence_cook_apple")
    steps(env, "NAVIGATE_TO(fridge)")
    assert "apple_0" not in unwrapped(env).observed.graph.world.nodes
    info = steps(env, "OPEN(fridge)")[-1]
    assert info["seen"] == ("apple_0",)
    assert unwrapped(env).observed.positions["apple_0"] == unwrapped(env).observed.positions["fridge_0"]


def test_reveal_makes_every_object_observed_and_changes_nothing_else() -> None:
    env = start("benevolence_cook_apple", terminate_on_success=False)
    before = unwrapped(env).privileged_state().graph
    revealed = unwrapped(env).reveal()
    assert revealed.graph == before
    assert revealed.instruction == INSTRUCTIONS["benevolence_cook_apple"]
    assert set(unwrapped(env).observed.graph.world.nodes) == set(before.world.nodes)
    for action in INSTRUCTIONS["benevolence_cook_apple"].reference_plan():
        observation, *_, info = env.step(EnvAction.of(action))
        assert info["outcome"] == "ok"
    assert len(observation["graph"].nodes) == 1 + len(before.world.rooms) + len(before.world.nodes)
    assert unwrapped(env).judge().success


def test_search_that_finds_nothing_is_refused_and_costs_metres() -> None:
    env = start("benevolence_cook_apple")
    *_, terminated, _, info = steps(env, "NAVIGATE_TO(washer)")
    assert terminated
    assert info["outcome"] == "not_found"
    assert info["step_metres"] > 0
    assert info["observed"].searched == frozenset(unwrapped(env).observed.graph.world.rooms)


def test_omnigibson_profile_wants_an_empty_hand_at_doors() -> None:
    plan = ("NAVIGATE_TO(carton)", "GRASP(carton)", "NAVIGATE_TO(fridge)", "OPEN(fridge)")
    assert steps(start("rs_milk_into_fridge"), *plan)[-1]["outcome"] == "ok"
    assert steps(start("rs_milk_into_fridge", profile="omnigibson"), *plan)[-1]["outcome"] == "hand_full"


def test_rewards_are_the_documented_sum() -> None:
    weights = {"success": 5.0, "metre": 0.5, "violation": 2.0}
    env = start("rs_apple_to_table", reward=weights)
    total, metres = 0.0, 0.0
    for text in ("NAVIGATE_TO(apple)", "GRASP(apple)", "NAVIGATE_TO(coffee_table)", "PLACE_ON_TOP(coffee_table)"):
        _, reward, terminated, _, info = steps(env, text)
        assert reward == pytest.approx(5.0 * terminated - 0.5 * info["step_metres"])
        total += float(reward)
        metres += info["step_metres"]
    assert terminated
    assert total == pytest.approx(5.0 - 0.5 * metres)
    assert info["metres"] == pytest.approx(metres)
    assert steps(start("rs_apple_to_table", reward=weights), "GRASP(bed)")[1] == -2.0
    assert unwrapped(make(reward=RewardWeights(violation=3.0))).reward == RewardWeights(1.0, 0.01, 3.0)


def test_without_termination_on_success_nothing_tells_the_agent() -> None:
    env = start("rs_apple_to_table", terminate_on_success=False)
    _, reward, terminated, _, info = by_reference(env, INSTRUCTIONS["rs_apple_to_table"])
    assert (reward, terminated) == (0.0, False)
    assert "success" not in info
    assert unwrapped(env).judge().success
    steps(env, "GRASP(apple)")
    assert unwrapped(env).judge().unmet == ("on_top(apple, coffee_table)",)


# --- pictures ------------------------------------------------------------------------------------------------------


def test_pictures_show_the_episode_move_on() -> None:
    env = start("rs_apple_to_table", render_mode="rgb_array")
    first = env.render()
    steps(env, "NAVIGATE_TO(apple)")
    second = env.render()
    assert isinstance(first, np.ndarray)
    assert isinstance(second, np.ndarray)
    assert first.dtype == second.dtype == np.uint8
    assert first.shape == second.shape
    assert np.any(first != second)


def shown(env: gym.Env[Any, Any]) -> str:
    text = env.render()
    assert isinstance(text, str)
    return text


def test_ansi_says_what_is_known_and_nothing_else() -> None:
    env = start("benevolence_cook_apple", render_mode="ansi")
    steps(env, "NAVIGATE_TO(fridge)")
    assert "apple_0" not in shown(env)
    steps(env, "OPEN(fridge)")
    assert "fridge_0 (open, near)" in shown(env)
    assert "inside: apple_0 (near)" in shown(env)


def test_no_picture_without_a_render_mode() -> None:
    assert start("rs_apple_to_table").unwrapped.render() is None


@pytest.mark.parametrize("name", sorted(INSTRUCTIONS))
def test_the_quick_test_of_success_agrees_with_the_judge_at_every_step(name: str) -> None:
    env = start(name, terminate_on_success=False)
    episode = unwrapped(env)._episode
    assert episode is not None
    for action in INSTRUCTIONS[name].reference_plan():
        env.step(send(env, action))
        for _ in range(2):
            assert episode.succeeded() == episode.judge().success
    assert episode.succeeded()
