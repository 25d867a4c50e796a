"""Nothing that an agent is handed, and no public attribute of an environment, leads to what is hidden."""

from __future__ import annotations

import re
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from support.houses import INSTRUCTIONS, make, send, unwrapped

from gavel_env import FlatActions, PaddedGraph
from gavel_env.exchange import Observed

ID = re.compile(r"[a-z0-9_]+_\d+")
PLAIN = (np.random.Generator, str, int, float, complex, bool, type(None), bytes, np.generic, re.Pattern)


def reachable_texts(*roots: Any) -> Iterator[tuple[str, str]]:
    """Yield (path, text) of every text that public names lead to; methods are not called."""
    stack = [(f"root{i}", root) for i, root in enumerate(roots)]
    seen: dict[int, Any] = {}
    while stack:
        path, value = stack.pop()
        if isinstance(value, str):
            yield path, value
        if isinstance(value, PLAIN) or id(value) in seen:
            continue
        seen[id(value)] = value
        if isinstance(value, np.ndarray):
            if value.dtype.kind in "OUS":
                stack += [(f"{path}[]", item) for item in value.ravel().tolist()]
            continue
        if isinstance(value, Mapping):
            for key, item in value.items():
                stack += [(f"{path}.key", key), (f"{path}[{key!r}]", item)]
        elif isinstance(value, list | tuple | set | frozenset):
            stack += [(f"{path}[{i}]", item) for i, item in enumerate(value)]
        if isinstance(value, type | types.ModuleType) or callable(value):
            continue
        for name in dir(value):
            if not name.startswith("_"):
                stack.append((f"{path}.{name}", getattr(value, name, None)))


def leaks(hidden: set[str], *roots: Any) -> list[str]:
    return [
        f"{path}: {match}" for path, text in reachable_texts(*roots) for match in ID.findall(text) if match in hidden
    ]


def hidden_ids(env: gym.Env[Any, Any]) -> set[str]:
    everything = set(unwrapped(env).privileged_state().graph.world.nodes)
    return everything - set(unwrapped(env).observed.graph.world.nodes)


WRAPPED: dict[str, Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]]] = {
    "plain": lambda env: env,
    "flat": FlatActions,
    "padded": lambda env: PaddedGraph(env, keep_observed=True),
}


@pytest.mark.parametrize("wrap", WRAPPED)
@pytest.mark.parametrize("name", ["benevolence_cook_apple", "pomaria_two_errands"])
def test_hidden_objects_cannot_be_reached(name: str, wrap: str) -> None:
    env = WRAPPED[wrap](make(render_mode="ansi"))
    observation, info = env.reset(seed=0, options={"instruction": name})
    hidden = hidden_ids(env)
    assert len(hidden) > 10
    assert not leaks(hidden, observation, info, env, env.unwrapped)
    inner = env
    if wrap != "plain":
        assert isinstance(env, gym.Wrapper)
        inner = env.env
    for action in INSTRUCTIONS[name].reference_plan():
        observation, *_, info = inner.step(send(env, action))
        assert not leaks(hidden_ids(env), observation, info, env.unwrapped, env.render())


def test_refusals_do_not_name_hidden_objects() -> None:
    env = make(on_violation="noop")
    env.reset(seed=0, options={"instruction": "benevolence_cook_apple"})
    env.action_space.seed(2)
    for _ in range(60):
        observation, *_, info = env.step(env.action_space.sample())
        assert not leaks(hidden_ids(env), observation, info)


def test_the_walk_finds_what_is_there_to_be_found() -> None:
    env = make()
    env.reset(seed=0, options={"instruction": "benevolence_cook_apple"})
    privileged = unwrapped(env).privileged_state()
    hidden = hidden_ids(env)
    assert {leak.split(": ")[1] for leak in leaks(hidden, privileged)} == hidden
    assert leaks(hidden, {"a": [({"b": np.array(["apple_0"], object)},)]})
    assert leaks(hidden, types.SimpleNamespace(note="see apple_0 there"))


def test_the_known_layout_is_an_empty_house() -> None:
    env = make()
    _, info = env.reset(seed=0, options={"instruction": "benevolence_cook_apple"})
    observed: Observed = info["observed"]
    assert not observed.layout.pieces
    assert not observed.layout.scene.furniture
    assert not observed.layout.scene.items
    assert not observed.layout.scene.not_placed
    assert not observed.layout.obstacle.any()


def test_agents_cannot_change_the_hidden_world_through_their_view() -> None:
    env = make()
    _, info = env.reset(seed=0, options={"instruction": "benevolence_cook_apple"})
    before = unwrapped(env).privileged_state().graph
    supports = info["observed"].graph.supports
    copy = dict(supports)
    if isinstance(supports, dict):
        supports.clear()
    assert unwrapped(env).privileged_state().graph == before
    assert before.supports.keys() > copy.keys()
    with pytest.raises(AttributeError):
        info["observed"].metres = 0.0
