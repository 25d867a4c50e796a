"""3-D scene graphs built by robots: ConceptGraphs (objects with boxes and relations) and Hydra (spark_dsg layers)."""

from __future__ import annotations

from typing import Any

import msgspec

from gavel_env.errors import GraphError
from gavel_env.importers.building import Box, Builder, Imported, Source, decode
from gavel_env.world_model.layout import Point

__all__ = ["from_conceptgraphs", "from_hydra"]


# --- ConceptGraphs ---------------------------------------------------------------------------------------------------


class _Detected(msgspec.Struct):
    bbox_center: Point
    bbox_extent: Point
    id: int | str | None = None
    object_tag: str = ""
    class_name: str = ""


class _Relation(msgspec.Struct):
    object1: _Detected
    object2: _Detected
    object_relation: str


def from_conceptgraphs(source: Source, relations: Source | None = None, room: str = "room") -> Imported:
    """Import the objects of a ConceptGraphs map, with their relations if there are any.

    Args:
        source: `{"object_1": {"id", "object_tag", "bbox_center", "bbox_extent", …}, …}`, or a list of such objects.
        relations: `[{"object1", "object2", "object_relation": "a on b" | "b on a" | "a in b" | "b in a" | …}]`.
        room: type of the one room; such a map has none.

    What no relation speaks of stands where its box says: on what is beneath it, inside what is around it, or on the
    floor. z is up.

    Raises:
        GraphError: malformed, or a relation names an object that is not there.
    """
    raw = decode(source, dict[str, _Detected] | list[_Detected], "ConceptGraphs map")  # type: ignore[arg-type]
    entries: list[tuple[str, _Detected]] = (
        list(raw.items()) if isinstance(raw, dict) else [(str(i), entry) for i, entry in enumerate(raw)]
    )
    to = Builder("ConceptGraphs")
    place = to.room("room", room)
    for key, entry in entries:
        word = entry.object_tag or entry.class_name
        if not word or word == "invalid":
            continue
        name = to.thing(_key(entry, key), word, {})
        to.boxes[name] = Box(entry.bbox_center, entry.bbox_extent)
    links = [] if relations is None else decode(relations, list[_Relation], "ConceptGraphs relations")
    for i, link in enumerate(links):
        ends = {
            "a": to.known(_key(link.object1, ""), f"$[{i}].object1"),
            "b": to.known(_key(link.object2, ""), f"$[{i}].object2"),
        }
        subject, _, rest = link.object_relation.partition(" ")
        relation, _, holder = rest.partition(" ")
        if subject in ends and holder in ends and relation in ("on", "in"):
            to.put(ends[subject], **{"on_top" if relation == "on" else "inside": ends[holder]})
    to.settle(place)
    return to.finish()


def _key(entry: _Detected, otherwise: str) -> str:
    return otherwise if entry.id is None else str(entry.id)


# --- Hydra -----------------------------------------------------------------------------------------------------------


class _Attributes(msgspec.Struct):
    position: Point
    name: str = ""
    semantic_label: int | None = None
    bounding_box: dict[str, Any] | None = None


class _Node(msgspec.Struct):
    id: int
    layer: int
    attributes: _Attributes


class _Edge(msgspec.Struct):
    source: int
    target: int


class _Layers(msgspec.Struct):
    nodes: list[_Node]
    edges: list[_Edge] = []


_OBJECTS, _PLACES, _ROOMS = 2, 3, 4


def from_hydra(source: Source, labels: dict[int, str] | None = None) -> Imported:
    """Import a dynamic scene graph of Hydra, as `spark_dsg` saves it to JSON.

    Objects (layer 2) are in the room (layer 4) to which edges lead, through their places (layer 3) if need be; rooms
    are connected by the edges between them, with the distance of their centres. What stands on what comes from the
    boxes. z is up.

    Args:
        source: `{"nodes": [{"id", "layer", "attributes": {"name", "position", "bounding_box", …}}], "edges": […]}`.
        labels: semantic label -> name of the category, for objects that carry no `name`.

    Raises:
        GraphError: malformed, an edge names a node that is not there, or an object has neither name nor label.
    """
    graph = decode(source, _Layers, "Hydra scene graph")
    to = Builder("Hydra")
    nodes = {node.id: node for node in graph.nodes}
    for node in graph.nodes:
        attributes = node.attributes
        if node.layer == _ROOMS:
            to.room(str(node.id), _room_type(attributes, labels), position=attributes.position)
    for i, node in enumerate(graph.nodes):
        if node.layer != _OBJECTS:
            continue
        label = node.attributes.semantic_label
        word = node.attributes.name or (labels or {}).get(-1 if label is None else label, "")
        if not word:
            raise GraphError(f"Hydra scene graph: $.nodes[{i}]: no name, and no label for {label}")
        name = to.thing(str(node.id), word, {}, position=node.attributes.position)
        box = _box(node.attributes)
        if box is not None:
            to.boxes[name] = box
    above: dict[int, list[int]] = {}
    for i, edge in enumerate(graph.edges):
        ends = [nodes.get(end) for end in (edge.source, edge.target)]
        if ends[0] is None or ends[1] is None:
            raise GraphError(f"Hydra scene graph: $.edges[{i}] names a node that is not there")
        low, high = sorted((ends[0], ends[1]), key=lambda node: node.layer)
        if low.layer == high.layer == _ROOMS:
            a, b = low.attributes.position, high.attributes.position
            metres = sum((p - q) ** 2 for p, q in zip(a, b, strict=True)) ** 0.5
            to.connect(to.known(str(low.id), ""), to.known(str(high.id), ""), metres)
        elif low.layer != high.layer:
            above.setdefault(low.id, []).append(high.id)
    to.settle(None)
    for node in graph.nodes:
        room = _room_above(node.id, nodes, above)
        if node.layer == _OBJECTS and room is not None:
            to.put(to.known(str(node.id), ""), room=to.known(str(room), ""))
    return to.finish()


def _room_type(attributes: _Attributes, labels: dict[int, str] | None) -> str:
    named = attributes.name.strip()
    # `R(3)` is Hydra's own number of a room, not what it is.
    return named if named and "(" not in named else (labels or {}).get(attributes.semantic_label or -1, "room")


def _box(attributes: _Attributes) -> Box | None:
    box = attributes.bounding_box
    if box is None or "dimensions" not in box:
        return None
    centre = box.get("world_P_center", attributes.position)
    try:
        return Box(msgspec.convert(centre, Point), msgspec.convert(box["dimensions"], Point))
    except msgspec.ValidationError as problem:
        raise GraphError(f"Hydra scene graph: bounding_box of {attributes.name!r}: {problem}") from problem


def _room_above(start: int, nodes: dict[int, _Node], above: dict[int, list[int]]) -> int | None:
    """Return the first room to which edges lead up from a node, nearest layer first."""
    waiting = list(above.get(start, ()))
    while waiting:
        waiting.sort(key=lambda node: (-nodes[node].layer, node))
        found = waiting.pop(0)
        if nodes[found].layer == _ROOMS:
            return found
        waiting += above.get(found, ())
    return None
