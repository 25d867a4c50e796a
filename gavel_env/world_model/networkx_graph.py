"""Graphs from networkx: what `SceneGraph.to_networkx` writes, and what people build by hand in that form."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec
import networkx as nx

from gavel_env.errors import GraphError, nearest_names
from gavel_env.world_model.graph import ROBOT, SceneGraph
from gavel_env.world_model.graph_file import FORMAT, GraphFile, graph_from
from gavel_env.world_model.ontology import Ontology

__all__ = ["graph_from_networkx"]

_RELATIONS = {
    "on_top": "on_top",
    "ontop": "on_top",
    "on": "on_top",
    "inside": "inside",
    "object_inside": "inside",
    "in": "inside",
    "room_inside": "room",
    "in_room": "room",
    "room_connect": "connect",
    "connected": "connect",
    "next_to": "next_to",
    "near": "near",
    "holding": "held",
    "under": "",
}
"""Name of an edge's relation -> what it says; `under` follows from the others."""

_ROOM = ("position", "footprint")
_NODE = ("category", "fixed", "flags", "position", "footprint")


def graph_from_networkx(graph: nx.Graph[Any], ontology: Ontology | None = None) -> SceneGraph:
    """Read a graph; `SceneGraph.from_networkx` is the same.

    Nodes carry `kind` ("room", "object" or "robot"; default "object"), `category` (a room's type), and if known
    `flags`, `fixed`, `position` (x, y[, z] in metres) and `footprint`. Edges carry `relation` (or it is
    their key): `on_top` and `inside` from the thing to its holder, `room_inside` to its room, `room_connect` between
    rooms (with `distance_m` if known), `next_to`, `near` and `holding` from the robot. Others are passed over.

    Raises:
        GraphError, UndeclaredCategory: as `SceneGraph.from_json`; places are those in the JSON of the same graph.
    """
    entries: dict[str, dict[str, dict[str, Any]]] = {"room": {}, "object": {}, "robot": {}}
    kinds: dict[str, str] = {}
    for name, data in graph.nodes(data=True):
        kind = data.get("kind", "robot" if name == ROBOT else "object")
        if not isinstance(name, str) or kind not in entries:
            raise GraphError(f"networkx node {name!r}: ids are text, and kind is room, object or robot, not {kind!r}")
        fields = _ROOM if kind == "room" else ("position",) if kind == "robot" else _NODE
        entry = {"id": name, **{f: _plain(f, data[f]) for f in fields if data.get(f) is not None}}
        if kind == "room" and data.get("category"):
            entry["type"] = data["category"]
        entries[kind][name], kinds[name] = entry, kind
    robot: dict[str, Any] = next((dict(r) for r in entries["robot"].values()), {})
    robot.pop("id", None)
    connections: list[Any] = []
    next_to: list[tuple[str, str]] = []
    for a, b, relation, data in _edges(graph):
        said = _said(relation, a, b)
        if said == "connect":
            metres = data.get("distance_m")
            connections.append((a, b) if metres is None else {"rooms": (a, b), "distance_m": metres})
        elif said == "next_to":
            next_to.append((a, b))
        elif said == "near":
            robot.setdefault("near", []).append(b)
        elif said == "held":
            _set(entries["object"], b, "held", True, relation)
        elif said == "room" and kinds.get(a) == "robot":
            robot["room"] = b
        elif said:
            _set(entries["object"], a, said, b, relation)
    raw = {
        "format": FORMAT,
        "rooms": list(entries["room"].values()),
        "connections": connections,
        "nodes": list(entries["object"].values()),
        "robot": robot,
        "next_to": next_to,
    }
    for entry in entries["object"].values():
        if entry.get("held"):
            entry.pop("room", None)
    try:
        file = msgspec.convert(raw, GraphFile)
    except msgspec.ValidationError as problem:
        raise GraphError(f"networkx graph is malformed: {problem}") from problem
    return graph_from(file, ontology, "networkx graph")


def _edges(graph: nx.Graph[Any]) -> Iterator[tuple[str, str, str, dict[str, Any]]]:
    if graph.is_multigraph():
        for a, b, key, data in graph.edges(keys=True, data=True):
            yield a, b, str(data.get("relation", key)), data
    else:
        for a, b, data in graph.edges(data=True):
            yield a, b, str(data.get("relation", "")), data


def _said(relation: str, a: str, b: str) -> str:
    if relation not in _RELATIONS:
        near = nearest_names(relation, _RELATIONS) or tuple(_RELATIONS)
        raise GraphError(f"networkx edge {a!r} -> {b!r}: unknown relation {relation!r}; known: {', '.join(near)}")
    return _RELATIONS[relation]


def _set(entries: dict[str, dict[str, Any]], name: str, field: str, value: object, relation: str) -> None:
    if name not in entries:
        raise GraphError(f"networkx edge {relation!r}: {name!r} is not an object")
    if entries[name].get(field, value) != value:
        raise GraphError(f"networkx graph: {name!r} has two supports, {entries[name][field]!r} and {value!r}")
    entries[name][field] = value


def _plain(field: str, value: Any) -> Any:
    """Return an attribute in builtin types; a point in the plane gets z = 0."""
    if field == "position":
        point = [_number(v) for v in value]
        return [*point, 0.0] if len(point) == 2 else point
    if field == "footprint":
        return [[_number(v) for v in corner] for corner in value]
    return list(value) if field == "flags" else value


def _number(value: Any) -> Any:
    """Return a number, of numpy or not, as a float; anything else as it is, to be refused with its place."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return value
