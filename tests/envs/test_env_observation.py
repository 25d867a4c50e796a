"""What an environment shows: the observation says what the observed graph says."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from support.houses import INSTRUCTIONS, make, send, start, steps, unwrapped

from gavel_env.envs.spaces import (
    AFFORDANCES,
    MAX_CATEGORIES,
    NO_ROOM,
    NODE_COLUMNS,
    ROOM_TYPES,
    EdgeType,
    NodeKind,
)
from gavel_env.errors import BadObservation
from gavel_env.exchange import Observation, view
from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.ontology import default_ontology

COLUMN = {name: i for i, name in enumerate(NODE_COLUMNS)}


def relations(env: gym.Env[Any, Any], observation: dict[str, Any]) -> set[tuple[str, str, str]]:
    graph = observation["graph"]

    def name(node: int) -> str:
        return unwrapped(env).node_name(int(node)) or "robot"

    return {
        (EdgeType(kind).name.lower(), name(a), name(b))
        for kind, (a, b) in zip(graph.edges, graph.edge_links, strict=True)
    }


def test_an_observation_carries_its_view_in_names() -> None:
    env = make()
    first, info = env.reset(seed=1, options={"instruction": next(iter(INSTRUCTIONS))})
    assert first.observed is info["observed"] is unwrapped(env).observed
    assert first in env.observation_space
    copies = (copy.copy(first), copy.deepcopy(first))  # both by what a pickle would hold
    for other in copies:
        assert isinstance(other, Observation)
        assert other.keys() == first.keys()
        assert other.observed.graph == first.observed.graph
    later = env.step(env.action_space.sample())[0]
    assert later.observed is unwrapped(env).observed is not first.observed


def test_what_is_no_observation_has_no_view() -> None:
    with pytest.raises(BadObservation, match=r"gavel_env\.Observation .* got dict"):
        view({"holding": 0})


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_graph_observation_agrees_with_the_observed_graph(name: str) -> None:
    env = make()
    observation, info = env.reset(seed=1, options={"instruction": name})
    plan = INSTRUCTIONS[name].reference_plan()
    seen: list[str] = []
    for action in (None, *plan):
        if action is not None:
            observation, *_, info = env.step(send(env, action))
        graph = info["observed"].graph
        nodes = observation["graph"].nodes
        first = 1 + len(graph.world.rooms)
        names = list(graph.world.nodes)
        assert names[: len(seen)] == seen, "a node keeps its index"
        seen = names
        assert relations(env, observation) == set(graph.edges())
        assert nodes.shape == (first + len(names), len(NODE_COLUMNS))
        for row, obj in zip(nodes[first:], names, strict=True):
            node = graph.world.nodes[obj]
            assert row[COLUMN["kind"]] == NodeKind.OBJECT
            assert default_ontology().index[node.category.name] == row[COLUMN["type"]]
            assert tuple(row[[COLUMN["x_m"], COLUMN["y_m"]]]) == pytest.approx(info["observed"].positions[obj])
            room = graph.room_of(obj)
            assert row[COLUMN["room"]] == (-1 if room is None else 1 + list(graph.world.rooms).index(room))
            assert (row[COLUMN["near"]], row[COLUMN["held"]]) == (obj in graph.near, obj == graph.holding)
            assert row[COLUMN["fixed"]] == node.fixed
            for flag in Flag:
                assert row[COLUMN[flag.name.lower()]] == graph.has(flag, obj)
            for affordance in AFFORDANCES:
                assert row[COLUMN[affordance]] == getattr(node.category, affordance)
        for row, room_id in zip(nodes[1:first], graph.world.rooms, strict=True):
            assert row[COLUMN["kind"]] == NodeKind.ROOM
            assert ROOM_TYPES[int(row[COLUMN["type"]])] == graph.world.rooms[room_id].type
            assert row[COLUMN["searched"]] == (room_id in info["observed"].searched)


def test_small_observation_says_the_rest() -> None:
    env = start("rs_apple_to_table", observation="symbolic")
    observation, *_, info = steps(env, "NAVIGATE_TO(apple)", "GRASP(apple)")
    observed = info["observed"]
    assert "graph" not in observation
    assert unwrapped(env).node_name(observation["holding"]) == "apple_0"
    assert observation["instruction"] == INSTRUCTIONS["rs_apple_to_table"].text
    assert observation["metres"] == pytest.approx([observed.metres])
    assert tuple(observation["pose"][:2]) == pytest.approx(observed.layout.point(observed.cell))
    rooms = list(observed.graph.world.rooms)
    assert rooms[observation["room"]] == observed.graph.robot_room
    assert {rooms[i] for i in np.flatnonzero(observation["searched"])} == observed.searched
    assert NO_ROOM not in range(len(rooms))


def test_all_shipped_scenes_fit_the_vocabulary() -> None:
    for name in scene_names():
        assert {room.type for room in load_scene(name).rooms} <= set(ROOM_TYPES)
    assert len(default_ontology()) <= MAX_CATEGORIES
