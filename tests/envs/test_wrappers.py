"""Text actions, flat actions with masks, observations of fixed shape, videos."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Dict, MultiDiscrete
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo
from support.houses import FILE, INSTRUCTIONS, make, send, unwrapped

from gavel_env import FlatActions, PaddedGraph, TextActions
from gavel_env.exchange import EnvAction
from gavel_env.sim.sensor import observed_part
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import first_violation

PLAN = ("navigate to the apple", "PickUp(apple)", "NAVIGATE_TO(coffee_table)", "put on top of the coffee table")


def text_episode(env: gym.Env[Any, Any]) -> dict[str, Any]:
    wrapped = TextActions(env)
    wrapped.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    for text in PLAN:
        assert text in wrapped.action_space
        *_, terminated, _, info = wrapped.step(text)
    assert terminated
    return info


def test_text_actions_carry_out_an_instruction() -> None:
    assert text_episode(make())["success"]


def test_wrappers_are_for_gavel_environments() -> None:
    for wrapper in (TextActions, FlatActions, PaddedGraph):
        with pytest.raises(TypeError, match="CartPole"):
            wrapper(gym.make("CartPole-v1"))
    with pytest.raises(TypeError, match="observation='graph'"):
        PaddedGraph(make(observation="symbolic"))


# --- flat actions --------------------------------------------------------------------------------------------------


def test_masks_allow_exactly_what_the_world_model_allows() -> None:
    env = FlatActions(make())
    env.reset(seed=0, options={"instruction": "benevolence_cook_apple"})
    checked = {True: 0, False: 0}
    for action in INSTRUCTIONS["benevolence_cook_apple"].reference_plan():
        *_, info = env.env.step(send(env, action))
        info = env._with_masks(info)
        graph = info["observed"].graph
        joint = info["joint_mask"]
        for index, obj in enumerate(graph.world.nodes, start=1 + len(graph.world.rooms)):
            for primitive in Primitive:
                if primitive.takes_target:
                    allowed = first_violation(graph, Action(primitive, obj)) is None
                    assert joint[primitive, index] == allowed
                    checked[allowed] += 1
        assert joint[Primitive.RELEASE].any() == (graph.holding is not None)
        assert joint[Primitive.NAVIGATE_TO, unwrapped(env).max_nodes :].all()
        assert not joint[Primitive.GRASP, unwrapped(env).max_nodes :].any()
    assert checked[True] > 100
    assert checked[False] > 100


def test_masks_have_the_forms_that_are_promised() -> None:
    env = FlatActions(make(), categories=["apple", "fridge"])
    _, info = env.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    targets = 512 + 2
    assert isinstance(env.action_space, MultiDiscrete)
    assert env.action_space.nvec.tolist() == [9, targets]
    assert info["action_mask"].shape == (9 + targets,)
    assert info["action_mask"].dtype == np.int8
    assert (info["action_mask"] == env.action_masks()).all()
    assert info["joint_mask"].shape == (9, targets)
    env.action_space.seed(0)
    for _ in range(50):
        primitive, target = env.action_space.sample(mask=env.sample_mask())
        assert info["action_mask"][primitive]
        assert info["action_mask"][9 + target]


def test_random_masked_play_is_refused_by_geometry_alone() -> None:
    env = FlatActions(make(on_violation="noop", max_nodes=128), categories=["fridge", "apple"])
    _, info = env.reset(seed=3, options={"instruction": "rs_two_apples"})
    rng = np.random.default_rng(0)
    taken = set()
    for _ in range(150):
        pairs = np.argwhere(info["joint_mask"])
        primitives = sorted({int(p) for p, _ in pairs})
        primitive = primitives[int(rng.integers(len(primitives)))]
        choices = pairs[pairs[:, 0] == primitive]
        action = choices[int(rng.integers(len(choices)))]
        *_, terminated, truncated, info = env.step(action)
        assert info["outcome"] in ("ok", "unreachable")
        taken.add(Primitive(primitive))
        if terminated or truncated:
            break
    assert {Primitive.NAVIGATE_TO, Primitive.GRASP, Primitive.OPEN} <= taken


# --- fixed shapes --------------------------------------------------------------------------------------------------


def test_padding_keeps_every_node_and_edge() -> None:
    plain, padded = make(), PaddedGraph(make())
    one, _ = plain.reset(seed=0, options={"instruction": "rs_two_apples"})
    two, info = padded.reset(seed=0, options={"instruction": "rs_two_apples"})
    assert "observed" not in info
    for text in ("", *PLAN):
        if text:
            one = plain.step(EnvAction.of(parse_action(text)))[0]
            two = padded.step(EnvAction.of(parse_action(text)))[0]
        count, edges = len(one["graph"].nodes), len(one["graph"].edges)
        assert (two["node_mask"].sum(), two["edge_mask"].sum()) == (count, edges)
        assert (two["nodes"][:count] == one["graph"].nodes).all()
        assert not two["nodes"][count:].any()
        assert (two["edges"][:edges, 0] == one["graph"].edges).all()
        assert (two["edges"][:edges, 1:] == one["graph"].edge_links).all()
        assert two in padded.observation_space


@pytest.mark.parametrize("mode", ["sync", "async"])
@pytest.mark.parametrize("wrappers", [[PaddedGraph], [PaddedGraph, FlatActions], [FlatActions, PaddedGraph]])
def test_padded_vector_environments_work_with_the_defaults(mode: str, wrappers: list[Any]) -> None:
    envs = gym.make_vec(
        "Gavel-SingleTask-v0",
        num_envs=2,
        vectorization_mode=mode,
        wrappers=wrappers,
        instructions=str(FILE),
        on_violation="noop",
    )
    observation, info = envs.reset(seed=7)
    envs.action_space.seed(1)
    for _ in range(4):
        observation, *_, info = envs.step(envs.action_space.sample())
    assert isinstance(envs.single_observation_space, Dict)
    columns = envs.single_observation_space["nodes"].shape
    assert columns is not None
    assert observation["nodes"].shape == (2, 512, columns[1])
    assert observation["node_mask"].sum(axis=1).min() > 10
    assert ("action_mask" in info) == (FlatActions in wrappers)
    envs.close()


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version.*:UserWarning")
@pytest.mark.parametrize("wrapper", [PaddedGraph, FlatActions])
def test_check_env_on_wrapped_environments(wrapper: Any) -> None:
    check_env(wrapper(make(on_violation="noop")), skip_render_check=True)


def test_wrapped_environments_can_be_made_again_from_their_spec() -> None:
    env = FlatActions(PaddedGraph(make(), max_edges=900), categories=["apple"])
    assert env.spec is not None
    again = gym.make(env.spec)
    assert again.observation_space == env.observation_space
    assert again.action_space == env.action_space


# --- videos --------------------------------------------------------------------------------------------------------


def test_gymnasium_records_videos(tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="videos need the package moviepy")
    env = RecordVideo(make(render_mode="rgb_array"), str(tmp_path / "videos"), disable_logger=True)
    text_episode(env)
    env.close()  # type: ignore[no-untyped-call]
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_what_is_observed_is_the_hidden_world_as_far_as_it_was_seen() -> None:
    """Random play with and without masks: the view never drifts from the world, and positions are the real ones."""
    env = FlatActions(make(on_violation="noop"))
    rng = np.random.default_rng(2)
    for seed in range(4):
        _, info = env.reset(seed=seed)
        for _ in range(40):
            if rng.random() < 0.8:
                pairs = np.argwhere(info["joint_mask"][:, : unwrapped(env).max_nodes])
                action = pairs[int(rng.integers(len(pairs)))]
            else:
                action = np.array([rng.integers(9), rng.integers(100)])
            *_, terminated, _, info = env.step(action)
            privileged = unwrapped(env).privileged_state()
            observed = info["observed"]
            assert observed_part(privileged.graph, dict.fromkeys(observed.graph.world.nodes)) == observed.graph
            assert all(privileged.executor.position(obj) == at for obj, at in observed.positions.items())
            if terminated:
                break
