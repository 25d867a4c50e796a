"""Observations for PyTorch Geometric (needs the extra [gnn])."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.houses import make

from gavel_env import PaddedGraph, observation_to_pyg
from gavel_env.envs.pyg import PYG_COLUMNS
from gavel_env.envs.spaces import NODE_COLUMNS, EdgeType
from gavel_env.errors import BadOption, NotInstalled
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import parse_action

try:
    import torch_geometric  # noqa: F401
except ImportError:
    INSTALLED = False
else:
    INSTALLED = True

needs_pyg = pytest.mark.skipif(not INSTALLED, reason="needs the extra [gnn]")


def played(*plan: str, **options: Any) -> tuple[Any, dict[str, Any]]:
    env = make(**options)
    observation, _ = env.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    for text in plan:
        observation = env.step(EnvAction.of(parse_action(text)))[0]
    return env.unwrapped, observation


@pytest.mark.skipif(INSTALLED, reason="torch_geometric is installed")
def test_without_it_the_error_says_what_to_install() -> None:
    with pytest.raises(NotInstalled, match=r"gavel-env\[gnn\]"):
        observation_to_pyg(played()[1])


@needs_pyg
def test_nodes_and_edges_have_their_types() -> None:
    env, observation = played("go to apple", "take apple")
    data = observation_to_pyg(observation, max_objects=None)
    graph = observation["graph"]
    assert {name: len(data[name].x) for name in data.node_types} == {
        "robot": 1,
        "room": len(env.observed.graph.world.rooms),
        "object": len(env.observed.graph.world.nodes),
    }
    assert data["object"].x.shape[1] == len(PYG_COLUMNS)
    apple = [env.node_name(int(node)) for node in data["object"].node].index("apple_0")
    assert data["object"].x[apple, PYG_COLUMNS.index("held")] == 1
    row = graph.nodes[int(data["object"].node[apple])]
    assert data["object"].category[apple] == row[NODE_COLUMNS.index("type")] + 1
    found = {
        (EdgeType[relation.upper()], int(data[a].node[int(i)]), int(data[b].node[int(j)]))
        for a, relation, b in data.edge_types
        for i, j in data[a, relation, b].edge_index.T
    }
    assert found == {(e, int(a), int(b)) for e, (a, b) in zip(graph.edges, graph.edge_links, strict=True)}
    assert ("robot", "holding", "object") in data.edge_types
    assert ("object", "room_inside", "room") in data.edge_types


@needs_pyg
def test_few_objects_are_kept_by_default_with_what_holds_them() -> None:
    env, observation = played("go to apple", "go to fridge")
    data = observation_to_pyg(observation, max_objects=5)
    names = [env.node_name(int(node)) for node in data["object"].node]
    graph = env.observed.graph
    assert graph.near <= set(names)
    assert 5 <= len(names) < len(graph.world.nodes)
    for name in names:
        assert all(holder in names for _, holder in graph.holders(name))


@needs_pyg
def test_padded_observations_give_the_same() -> None:
    _, observation = played("go to apple")
    env = PaddedGraph(make())
    padded, _ = env.reset(seed=0, options={"instruction": "rs_apple_to_table"})
    padded = env.step(EnvAction.of(parse_action("go to apple")))[0]
    one, two = observation_to_pyg(observation), observation_to_pyg(padded)
    assert one.edge_types == two.edge_types
    for name in one.node_types:
        assert np.array_equal(one[name].x, two[name].x)
    with pytest.raises(BadOption, match="observation='graph'"):
        observation_to_pyg(played(observation="symbolic")[1])
