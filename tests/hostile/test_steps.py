"""Whatever is given to `step` and `reset` is carried out or a typed error."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hostile import fuzzed, harmless

import gavel_env  # noqa: F401  (registers the environments)
from gavel_env.exchange import EnvAction, ReturnWhen
from gavel_env.world_model.actions import Primitive

pytestmark = pytest.mark.hostile

JUNK = st.sampled_from(
    [
        None,
        True,
        -1,
        10**30,
        1.5,
        float("nan"),
        "",
        "fridge",
        "\ud800",
        b"x",
        (),
        [],
        {},
        {"a": 1},
        object(),
        np.zeros(3),
    ]
)
ACTIONS = st.builds(
    EnvAction,
    st.sampled_from(list(Primitive)) | JUNK,
    st.sampled_from(["fridge", "bed@bedroom", "any_cabinet", "@", "x@y@z", "robot"]) | JUNK,
    st.none() | st.dictionaries(st.sampled_from(["bedroom_0", "nowhere"]) | st.integers(), st.floats() | JUNK) | JUNK,
    st.sampled_from([(), ("fridge_0",), [3], 3, "x", None]),
    st.none() | st.builds(ReturnWhen, st.sampled_from([(), ("apple",), ("@",), (3,)])) | JUNK,
)
DICTS = st.dictionaries(st.sampled_from(["primitive", "target", "search_prior", "other"]), JUNK | st.integers(-9, 9999))


@pytest.fixture(scope="module")
def env() -> gym.Env[Any, Any]:
    return gym.make(
        "Gavel-SingleTask-v0", scenes="Rs_int", observation="symbolic", on_violation="noop", max_episode_steps=10**9,
        disable_env_checker=True,
    )  # fmt: skip


@given(st.lists(ACTIONS | DICTS | JUNK, min_size=1, max_size=4))
@fuzzed(60, 10_000)
def test_no_action_raises_anything_else(env: gym.Env[Any, Any], actions: list[Any]) -> None:
    env.reset(seed=0)
    for action in actions:
        found = harmless(env.step, action)
        if not isinstance(found, Exception) and found[2]:
            break


@given(st.dictionaries(st.sampled_from(["instruction", "other"]), JUNK))
@fuzzed(60, 5_000)
def test_no_option_raises_anything_else(env: gym.Env[Any, Any], options: dict[str, Any]) -> None:
    harmless(env.reset, seed=0, options=options)
