"""Gavel-RL-v0: masks, slots, observations, rewards, and that learners can use it without options."""

from __future__ import annotations

import pickle
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Discrete
from support.houses import unwrapped
from support.slot_expert import follow

import gavel_env
from gavel_env.envs.env import BadEnvironmentOption
from gavel_env.envs.levels import LEVELS, UnknownLevel
from gavel_env.envs.rl import SlotEnv
from gavel_env.envs.slot_features import LITERAL_COLUMNS, ROBOT_COLUMNS, SLOT_COLUMNS
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import first_violation
from gavel_env.world_model.goals import Literal, unmet


def make(level: str = "easy", **options: Any) -> SlotEnv:
    env = gym.make("Gavel-RL-v0", level=level, disable_env_checker=True, **options)
    assert isinstance(env, gym.Wrapper)
    wrapped = env.env
    assert isinstance(wrapped, SlotEnv)
    return wrapped


def width(env: SlotEnv) -> int:
    shape = env.observation_space.shape
    assert shape is not None
    return shape[0]


def allowed(info: dict[str, Any], rng: np.random.Generator) -> int:
    return int(rng.choice(np.flatnonzero(info["action_mask"])))


def random_play(env: SlotEnv, steps: int, seed: int = 0) -> list[tuple[np.ndarray, float, dict[str, Any]]]:
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    taken = [(observation, 0.0, info)]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(allowed(info, rng))
        taken.append((observation, reward, info))
        if terminated or truncated:
            observation, info = env.reset()
    return taken


# --- masks ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", ["easy", "medium", "hard"])
def test_masks_are_what_the_world_model_accepts_in_the_observed_graph(level: str) -> None:
    env = make(level)
    rng = np.random.default_rng(1)
    _, info = env.reset(seed=1)
    assert isinstance(env.action_space, Discrete)
    seen = {True: 0, False: 0}
    for _ in range(60):
        observed = unwrapped(env).observed
        graph = observed.graph
        for action in range(env.action_space.n):
            primitive, index = divmod(action, env.slots)
            slot = env.slots_now[index]
            if not Primitive(primitive).takes_target:
                expected = index == 0 and graph.holding is not None
            elif slot.instance is not None:
                expected = first_violation(graph, Action(Primitive(primitive), slot.instance)) is None
                if (
                    primitive == Primitive.NAVIGATE_TO
                    and not unwrapped(env).privileged_state().executor.stances(slot.instance).size
                ):
                    continue  # what has no stance is not offered again once that was found out
            else:
                rooms = [
                    r.id
                    for r in graph.world.rooms.values()
                    if slot.designator and slot.designator.room in (None, r.id, r.type)
                ]
                expected = primitive == Primitive.NAVIGATE_TO and bool(set(rooms) - observed.searched)
            assert info["action_mask"][action] == expected, (Primitive(primitive).name, slot)
            seen[expected] += 1
        _, _, terminated, truncated, info = env.step(allowed(info, rng))
        if terminated or truncated:
            _, info = env.reset()
    assert seen[True] > 100
    assert seen[False] > 1000


def test_both_forms_of_the_mask_agree() -> None:
    env = make()
    for _, _, info in random_play(env, 30)[-1:]:
        assert info["action_mask"].dtype == np.int8
        assert env.action_masks().dtype == np.bool_
        assert (env.action_masks() == info["action_mask"]).all()
        assert env.action_space.contains(env.action_space.sample(info["action_mask"]))


def test_masked_random_play_is_refused_by_geometry_alone() -> None:
    outcomes = [info["outcome"] for _, _, info in random_play(make("medium"), 150)[1:]]
    assert set(outcomes) <= {"ok", "unreachable", "not_found", ""}
    assert outcomes.count("ok") > 130


def test_what_has_no_route_is_not_offered_again() -> None:
    env = make("easy", scenes=["hotel_suite_small"], slots=24)
    _, info = env.reset(seed=0)
    [lamp] = [i for i, slot in enumerate(env.slots_now) if slot.instance == "wall_mounted_light_0"]
    assert info["action_mask"][lamp]
    *_, info = env.step(lamp)
    assert info["outcome"] == "unreachable"
    assert not info["action_mask"][lamp]


def test_what_a_goal_names_by_its_id_is_not_searched_for() -> None:
    task = {"text": "Apple.", "goal": ["on_top(apple, countertop_0)"], "reference_plan": []}
    apple = {"category": "apple", "relation": "on", "target": "bed"}
    record = {"id": "x", "scene": "Rs_int", "text": "Apple.", "placements": [apple], "tasks": [task]}
    env = make(instructions=[record])
    _, info = env.reset(seed=0)
    assert [slot.instance for slot in env.slots_now[:2]] == ["apple_0", None]
    assert info["action_mask"][:2].tolist() == [1, 0]
    *_, info = env.step(0)
    assert info["outcome"] == "ok"


# --- slots and observations ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("level", "sample"), [("easy", 1), ("medium", 4), ("hard", 10)])
def test_reference_plans_can_be_said_in_slots(level: str, sample: int) -> None:
    env = make(level)
    for instruction in unwrapped(env).instruction_ids[::sample]:
        assert follow(env, instruction), instruction


def test_slots_keep_what_they_stand_for() -> None:
    env = make("medium")
    rng = np.random.default_rng(0)
    _, info = env.reset(seed=4)
    history = [env.slots_now]
    for _ in range(40):
        _, _, terminated, truncated, info = env.step(allowed(info, rng))
        history.append(env.slots_now)
        if terminated or truncated:
            break
    named = sum(slot.designator is not None for slot in history[0])
    assert named >= 2
    for before, after in pairwise(history):
        for old, new in zip(before[:named], after[:named], strict=True):
            assert new.designator == old.designator
            assert new.instance == old.instance or old.instance is None
        bound = [slot.instance for slot in after if slot.instance is not None]
        assert len(set(bound)) == len(bound)


def test_observations_say_goal_and_state() -> None:
    env = make()
    for observation, _, _ in random_play(env, 60):
        assert env.observation_space.contains(observation)
    assert width(env) < 2000
    env.reset(seed=0)
    parts = env.parts(env.reset(seed=0, options={"instruction": "easy-train-001"})[0])
    goal = unwrapped(env).privileged_state().instruction.goal()
    [literal] = goal.literals
    row = dict(zip(LITERAL_COLUMNS, parts["literals"][0], strict=False))
    assert (row["used"], row["unmet"], row["negated"], row[literal.predicate.value]) == (1, 1, 0, 1)
    pointers = parts["literals"][0][len(LITERAL_COLUMNS) :].reshape(2, env.slots)
    assert pointers.argmax(axis=1).tolist() == [0, 1]
    assert not parts["literals"][1:].any()
    slots = [dict(zip(SLOT_COLUMNS, row, strict=True)) for row in parts["slots"]]
    graph = unwrapped(env).observed.graph
    for row, slot in zip(slots, env.slots_now, strict=True):
        assert row["known"] == (slot.instance is not None)
        assert row["goal"] == (slot.designator is not None)
        if slot.instance is not None:
            assert row["surface"] == graph.category(slot.instance).surface
            assert row["near"] == (slot.instance in graph.near)
    assert dict(zip(ROBOT_COLUMNS, parts["robot"], strict=True))["unmet"] == 1


def test_info_is_slim() -> None:
    info = random_play(make(), 10)[-1][2]
    assert set(info) == {"action_mask", "outcome", "metres", "instruction_id", "success"}
    assert len(pickle.dumps(info)) < 1000


def test_same_seed_same_episode() -> None:
    one, two = (random_play(make("medium"), 60, seed=3) for _ in range(2))
    for (a, r, _), (b, s, _) in zip(one, two, strict=True):
        assert (a == b).all()
        assert r == s


# --- rewards -------------------------------------------------------------------------------------------------------


def test_shaping_telescopes_to_the_potential_of_the_start() -> None:
    """sum of gamma^t F_t = gamma^T Phi(s_T) - Phi(s_0), so policies are ranked as without shaping."""
    gamma = 0.9
    shaped, plain = make(gamma=gamma), make(shaping=0.0)
    for instruction in unwrapped(shaped).instruction_ids[:10]:
        rewards: list[list[float]] = [[], []]
        assert follow(shaped, instruction, rewards[0])
        assert follow(plain, instruction, rewards[1])
        difference = sum(gamma**t * (a - b) for t, (a, b) in enumerate(zip(*rewards, strict=True)))
        shaped.reset(seed=0, options={"instruction": instruction})
        graph = unwrapped(shaped).observed.graph
        missing = unmet(unwrapped(shaped).privileged_state().instruction.goal(), graph)
        first = missing[0]
        assert isinstance(first, Literal)
        start = -(0.75 if graph.world.by_category.get(first.subject.name) else 1.0)
        assert difference == pytest.approx(-start)


def test_a_door_left_open_lowers_the_potential() -> None:
    env = make("medium", reward={"metre": 0.0}, gamma=1.0)
    for instruction in unwrapped(env).instruction_ids:
        _, info = env.reset(seed=0, options={"instruction": instruction})
        for slot in env.slots_now:
            if slot.instance is None or not unwrapped(env).observed.graph.category(slot.instance).openable:
                continue
            going = env.action_of(Primitive.NAVIGATE_TO, slot.instance)
            *_, info = env.step(going)
            if info["outcome"] != "ok":
                break
            _, opened, _, _, _ = env.step(env.action_of(Primitive.OPEN, slot.instance))
            _, closed, _, _, _ = env.step(env.action_of(Primitive.CLOSE, slot.instance))
            literals = len(unwrapped(env).privileged_state().instruction.goal().literals)
            assert opened <= -1 / literals + 0.5  # what it shows may be worth something
            assert closed == pytest.approx(1 / literals)
            return
    pytest.fail("no door was found")


# --- options -------------------------------------------------------------------------------------------------------


def test_levels_grow() -> None:
    sizes = [width(make(level)) for level in LEVELS]
    assert sizes == [427, 779, 1391, 1807]
    assert all(len(unwrapped(make(level)).instruction_ids) >= 50 for level in LEVELS)
    assert set(unwrapped(make("easy", split="test")).instruction_ids).isdisjoint(
        unwrapped(make("easy")).instruction_ids
    )


def test_bad_options_are_typed_errors() -> None:
    with pytest.raises(UnknownLevel, match="did you mean 'easy'"):
        make("esay")
    with pytest.raises(UnknownLevel, match="'train' or 'test'"):
        make(split="dev")
    with pytest.raises(BadEnvironmentOption, match="slots"):
        make(slots=0)
    with pytest.raises(BadEnvironmentOption, match=r"slots >= \d"):
        make(slots=1).reset(seed=0)
    with pytest.raises(BadEnvironmentOption, match="quantified"):
        make(instructions="behavior", slots=64, literals=64).reset(seed=0)
    with pytest.raises(TypeError, match="CartPole"):
        SlotEnv(gym.make("CartPole-v1"))


def test_episodes_are_cut_at_the_levels_limit() -> None:
    env = make(max_steps=3)
    _, info = env.reset(seed=0)
    ends = [env.step(int(np.flatnonzero(info["action_mask"])[0]))[3] for _ in range(3)]
    assert ends == [False, False, True]


# --- vector environments -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vector_environments_need_no_options(mode: str) -> None:
    envs = gym.make_vec("Gavel-RL-v0", num_envs=2, vectorization_mode=mode)
    try:
        observation, info = envs.reset(seed=0)
        shape = envs.single_observation_space.shape
        assert shape is not None
        assert observation.shape == (2, *shape)
        rng = np.random.default_rng(0)
        for _ in range(50):
            actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in info["action_mask"]])
            observation, rewards, _, _, info = envs.step(actions)
        assert observation.dtype == np.float32
        assert rewards.shape == (2,)
    finally:
        envs.close()


def test_it_is_remade_from_its_spec() -> None:
    env = gym.make("Gavel-RL-v0", level="medium", slots=20)
    assert env.spec is not None
    again = gym.make(env.spec)
    assert again.get_wrapper_attr("slots") == 20
    assert again.observation_space == env.observation_space
    assert gavel_env.SlotEnv is SlotEnv
