"""Nothing that an agent is given can be changed, and what it is given can be sent and copied."""

from __future__ import annotations

import copy
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import gavel_env  # noqa: F401  (registers the environments)
from gavel_env.exchange import EnvAction, Observed
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.graph import Relation, Room, Support

pytestmark = pytest.mark.hostile

CHANGES: list[Callable[[Observed], Any]] = [
    lambda seen: seen.graph.world.rooms.update(x=Room("x", "y")),  # type: ignore[attr-defined]
    lambda seen: seen.graph.world.rooms.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.graph.world.nodes.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.graph.world.by_category.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.graph.supports.pop(next(iter(seen.graph.supports))),  # type: ignore[attr-defined]
    lambda seen: seen.graph.supports.__setitem__("x", Support(Relation.FLOOR, "y")),  # type: ignore[index]
    lambda seen: seen.graph.contents.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.positions.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.layout.pieces.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.layout.room_index.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.layout.room_cells.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.layout.room_points.clear(),  # type: ignore[attr-defined]
    lambda seen: seen.layout.free.fill(False),
    lambda seen: seen.layout.rooms.fill(0),
    lambda seen: seen.layout.reachable.fill(False),
    lambda seen: setattr(seen, "metres", 0.0),
    lambda seen: setattr(seen.graph, "holding", None),
    lambda seen: setattr(seen.layout, "scene", None),
    lambda seen: setattr(seen.layout.scene, "rooms", ()),
]


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_observed_cannot_be_changed(change: Callable[[Observed], Any]) -> None:
    env = gym.make("Gavel-SingleTask-v0", scenes="Rs_int", observation="symbolic")
    _, info = env.reset(seed=0)
    for _ in range(2):
        with pytest.raises((AttributeError, TypeError, ValueError)):
            change(info["observed"])
        info = env.step(EnvAction(Primitive.NAVIGATE_TO, "fridge"))[4]


def test_what_is_observed_goes_to_processes_and_is_copied() -> None:
    env = gym.make("Gavel-SingleTask-v0", scenes="Rs_int", observation="symbolic")
    env.reset(seed=0)
    seen = env.step(EnvAction(Primitive.NAVIGATE_TO, "fridge"))[4]["observed"]
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        returned = process.submit(copy.copy, seen).result()
    for again in (returned, copy.deepcopy(seen)):
        assert again.graph.supports == seen.graph.supports
        assert again.graph.world.rooms == seen.graph.world.rooms
        assert again.positions == seen.positions
        assert np.array_equal(again.layout.free, seen.layout.free)
        with pytest.raises((AttributeError, TypeError)):
            again.graph.world.rooms["x"] = Room("x", "y")
