"""Observations for graph neural networks, as PyTorch Geometric has them; needs the extra `[gnn]`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gavel_env.envs.spaces import NODE_COLUMNS, EdgeType, NodeKind
from gavel_env.errors import BadOption, NotInstalled

if TYPE_CHECKING:
    from torch_geometric.data import HeteroData

__all__ = ["PYG_COLUMNS", "observation_to_pyg"]

PYG_COLUMNS = tuple(name for name in NODE_COLUMNS if name not in ("kind", "type", "room"))
"""Columns of `x`: those of a node but for what node types, `category` and edges say."""

_KINDS = {NodeKind.ROBOT: "robot", NodeKind.ROOM: "room", NodeKind.OBJECT: "object"}
_COLUMN = {name: i for i, name in enumerate(NODE_COLUMNS)}


def observation_to_pyg(observation: Mapping[str, Any], max_objects: int | None = 64) -> HeteroData:
    """Return the graph of an observation with its node and edge types.

    Args:
        observation: of a `GavelEnv` with the Graph observation, or of `PaddedGraph`.
        max_objects: of more objects, only so many are kept: what is held or near first, then movables, then the nearest
            to the robot; and what they are on or in. None = all.

    Returns:
        `HeteroData` with the node types `robot`, `room` and `object`. Each has `x` (n, `PYG_COLUMNS`) float32,
        `category` (n,) int64 (the column `type`, 0 = unknown, else one more) and `node` (n,) int64, the index that
        `target` of the action space takes. Edge types are (source, relation, target), relations those of `EdgeType` in
        lower case.

    Raises:
        NotInstalled: torch_geometric is not installed.
        BadOption: the observation has no graph.
    """
    try:
        import torch
        from torch_geometric.data import HeteroData
    except ImportError as error:
        raise NotInstalled(f"{error.name} is not installed; pip install 'gavel-env[gnn]'") from error
    nodes, relations, links = _graph(observation)
    kept = np.ones(len(nodes), np.bool_) if max_objects is None else _chosen(nodes, relations, links, max_objects)
    kinds = nodes[:, _COLUMN["kind"]].astype(int)
    place = np.zeros(len(nodes), np.int64)  # of a node among the kept ones of its kind
    data = HeteroData()
    columns = [_COLUMN[name] for name in PYG_COLUMNS]
    for kind, name in _KINDS.items():
        rows = np.flatnonzero(kept & (kinds == kind))
        place[rows] = np.arange(len(rows))
        data[name].x = torch.from_numpy(nodes[rows][:, columns].astype(np.float32))
        data[name].category = torch.from_numpy(nodes[rows, _COLUMN["type"]].astype(np.int64) + 1)
        data[name].node = torch.from_numpy(rows.astype(np.int64))
    inside = kept[links].all(axis=1)
    for relation in EdgeType:
        chosen = links[inside & (relations == relation)]
        ends = kinds[chosen]
        for source, target in sorted({(int(a), int(b)) for a, b in ends}):
            pairs = chosen[(ends == (source, target)).all(axis=1)]
            ends_in = (_KINDS[NodeKind(source)], relation.name.lower(), _KINDS[NodeKind(target)])
            data[ends_in].edge_index = torch.from_numpy(np.ascontiguousarray(place[pairs].T))
    return data


def _graph(observation: Mapping[str, Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return nodes (n, columns), relations (m,) and links (m, 2)."""
    if "graph" in observation:
        graph = observation["graph"]
        return graph.nodes, graph.edges, graph.edge_links.astype(np.int64).reshape(-1, 2)
    if "nodes" in observation and "edges" in observation:
        edges = observation["edges"][observation["edge_mask"].astype(np.bool_)]
        return observation["nodes"][observation["node_mask"].astype(np.bool_)], edges[:, 0], edges[:, 1:]
    raise BadOption(f"an observation with the parts {sorted(observation)} has no graph; use observation='graph'")


def _chosen(nodes: NDArray[Any], relations: NDArray[Any], links: NDArray[Any], max_objects: int) -> NDArray[np.bool_]:
    objects = np.flatnonzero(nodes[:, _COLUMN["kind"]] == NodeKind.OBJECT)
    kept: NDArray[np.bool_] = nodes[:, _COLUMN["kind"]] != NodeKind.OBJECT
    at_hand = (nodes[:, _COLUMN["near"]] + nodes[:, _COLUMN["held"]]) > 0
    away = np.hypot(*(nodes[:, [_COLUMN["x_m"], _COLUMN["y_m"]]] - nodes[0, [_COLUMN["x_m"], _COLUMN["y_m"]]]).T)
    order = np.lexsort((objects, away[objects], nodes[objects, _COLUMN["fixed"]], ~at_hand[objects]))
    kept[objects[order[:max_objects]]] = True
    on_or_in = links[np.isin(relations, (EdgeType.ON_TOP, EdgeType.OBJECT_INSIDE))]
    for _ in range(len(on_or_in)):  # what holds the kept, and what holds that
        holders = on_or_in[kept[on_or_in[:, 0]], 1]
        if kept[holders].all():
            break
        kept[holders] = True
    return kept
