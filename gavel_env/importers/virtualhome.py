"""VirtualHome environment graphs: `{"nodes": [...], "edges": [...]}`, as its simulator and its data sets write them."""

from __future__ import annotations

import itertools
from typing import Any

import msgspec

from gavel_env.importers.building import Box, Builder, Imported, Source, decode

__all__ = ["from_virtualhome"]


class _Bounds(msgspec.Struct):
    center: tuple[float, float, float]
    size: tuple[float, float, float]


class _Node(msgspec.Struct):
    id: int
    class_name: str
    category: str = ""
    properties: list[str] = []
    states: list[str] = []
    bounding_box: _Bounds | None = None


class _Edge(msgspec.Struct):
    from_id: int
    to_id: int
    relation_type: str


class _Graph(msgspec.Struct):
    nodes: list[_Node]
    edges: list[_Edge]


_STRUCTURE = frozenset(("Walls", "Wall", "Floor", "Floors", "Ceiling", "Ceilings", "Doors", "Windows"))
_FACTS = {
    "GRABBABLE": "graspable",
    "SURFACES": "surface",
    "CONTAINERS": "interior",
    "CAN_OPEN": "openable",
    "HAS_SWITCH": "toggleable",
}
_FLAGS = {"OPEN": "open", "ON": "toggled", "DIRTY": "dirty"}


def from_virtualhome(source: Source) -> Imported:
    """Import a VirtualHome graph.

    Rooms are the nodes of category `Rooms`; walls, floors, doors and windows are left out, and what is on a floor is on
    the floor of its room. A door between two rooms connects them. Affordances are the nodes' `properties`, states their
    `states`. y is up there, z here.

    Raises:
        GraphError: malformed, or an edge names a node that is not there.
    """
    graph = decode(source, _Graph, "VirtualHome graph")
    to = Builder("VirtualHome")
    kinds: dict[int, _Node] = {}
    robot: int | None = None
    for node in graph.nodes:
        kinds[node.id] = node
        if node.category == "Rooms":
            to.room(str(node.id), node.class_name, **({"position": _box(node).centre} if node.bounding_box else {}))
        elif node.category == "Characters" or node.class_name == "character":
            robot = node.id
        elif node.category not in _STRUCTURE and node.class_name not in ("floor", "wall", "ceiling"):
            facts = {fact: name in node.properties for name, fact in _FACTS.items()} if node.properties else {}
            flags = tuple(flag for name, flag in _FLAGS.items() if name in node.states)
            name = to.thing(str(node.id), node.class_name, facts, flags=flags)
            if node.bounding_box is not None:
                to.boxes[name] = _box(node)
    for i, edge in enumerate(graph.edges):
        for end in (edge.from_id, edge.to_id):
            if end not in kinds:
                to.known(str(end), f"$.edges[{i}]")
    _connect(graph, kinds, to)
    _place(graph, kinds, to, robot)
    return to.finish()


def _box(node: _Node) -> Box:
    assert node.bounding_box is not None
    (x, y, z), (w, h, d) = node.bounding_box.center, node.bounding_box.size
    return Box((x, z, y), (w, d, h))


def _connect(graph: _Graph, kinds: dict[int, _Node], to: Builder) -> None:
    """Connect the rooms that a door is between."""
    between: dict[int, list[str]] = {}
    for edge in graph.edges:
        if edge.relation_type == "BETWEEN" and kinds[edge.to_id].category == "Rooms":
            between.setdefault(edge.from_id, []).append(to.known(str(edge.to_id), "$.edges"))
    for rooms in between.values():
        for a, b in itertools.pairwise(rooms):
            to.connect(a, b)


def _place(graph: _Graph, kinds: dict[int, _Node], to: Builder, robot: int | None) -> None:
    rooms: dict[str, str] = {}
    on_floor: list[str] = []
    state: dict[str, Any] = {"room": None, "near": []}
    for edge in sorted(graph.edges, key=lambda e: (e.relation_type != "ON", e.relation_type)):
        a, b = str(edge.from_id), str(edge.to_id)
        held = edge.relation_type in ("HOLDS_RH", "HOLDS_LH")
        if edge.from_id == robot:
            if edge.relation_type == "INSIDE" and to.has(b) and to.known(b, "") in to.room_entries:
                state["room"] = to.known(b, "")
            elif edge.relation_type == "CLOSE" and to.has(b) and to.known(b, "") in to.things():
                state["near"].append(to.known(b, ""))
            elif held and to.has(b):
                to.put(to.known(b, ""), held=True)
            continue
        if not to.has(a) or to.known(a, "") in to.room_entries:
            continue
        name = to.known(a, "")
        if edge.relation_type == "ON" and not to.has(b):
            on_floor.append(name)
        elif edge.relation_type == "INSIDE" and to.has(b) and to.known(b, "") in to.room_entries:
            rooms[name] = to.known(b, "")
        elif edge.relation_type in ("ON", "INSIDE") and to.has(b) and kinds[edge.to_id].category != "Rooms":
            to.put(name, **{"on_top" if edge.relation_type == "ON" else "inside": to.known(b, "")})
    for name, room in rooms.items():
        to.put(name, room=room)
    near = tuple(sorted(set(state["near"])))
    to.robot = msgspec.structs.replace(to.robot, room=state["room"], near=near)
