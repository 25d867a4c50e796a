"""Importers, each on a small file in the published form of its project."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gavel_agents
from gavel_env.errors import GavelError, GraphError
from gavel_env.importers import IMPORTERS, Imported, from_ai2thor, from_conceptgraphs, from_hydra, from_virtualhome
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import default_ontology


def box(center: list[float], size: list[float]) -> dict[str, list[float]]:
    return {"center": center, "size": size}


VIRTUALHOME: dict[str, Any] = {
    "nodes": [
        {"id": 11, "class_name": "kitchen", "category": "Rooms", "properties": [], "states": [], "prefab_name": "K",
         "bounding_box": box([0, 1, 0], [6, 3, 6])},
        {"id": 12, "class_name": "bedroom", "category": "Rooms", "properties": [], "states": []},
        {"id": 20, "class_name": "door", "category": "Doors", "properties": ["CAN_OPEN"], "states": ["OPEN"]},
        {"id": 21, "class_name": "floor", "category": "Floors", "properties": ["SURFACES"], "states": []},
        {"id": 1, "class_name": "character", "category": "Characters", "properties": [], "states": []},
        {"id": 162, "class_name": "fridge", "category": "Appliances", "properties": ["CAN_OPEN", "CONTAINERS"],
         "states": ["CLOSED"], "bounding_box": box([2, 0.9, 1], [0.8, 1.8, 0.7])},
        {"id": 123, "class_name": "kitchentable", "category": "Furniture", "properties": ["SURFACES"], "states": []},
        {"id": 163, "class_name": "salmon", "category": "Food", "properties": ["GRABBABLE"], "states": []},
        {"id": 164, "class_name": "plate", "category": "Props", "properties": ["GRABBABLE", "SURFACES"],
         "states": ["DIRTY"]},
        {"id": 165, "class_name": "mug", "category": "Props", "properties": ["GRABBABLE"], "states": []},
        {"id": 166, "class_name": "rug", "category": "Decor", "properties": [], "states": []},
        {"id": 167, "class_name": "towel", "category": "Props", "properties": ["GRABBABLE"], "states": []},
    ],
    "edges": [
        {"from_id": 1, "to_id": 11, "relation_type": "INSIDE"},
        {"from_id": 1, "to_id": 162, "relation_type": "CLOSE"},
        {"from_id": 1, "to_id": 167, "relation_type": "HOLDS_RH"},
        {"from_id": 20, "to_id": 11, "relation_type": "BETWEEN"},
        {"from_id": 20, "to_id": 12, "relation_type": "BETWEEN"},
        {"from_id": 162, "to_id": 11, "relation_type": "INSIDE"},
        {"from_id": 123, "to_id": 11, "relation_type": "INSIDE"},
        {"from_id": 163, "to_id": 162, "relation_type": "INSIDE"},
        {"from_id": 163, "to_id": 11, "relation_type": "INSIDE"},
        {"from_id": 164, "to_id": 123, "relation_type": "ON"},
        {"from_id": 165, "to_id": 164, "relation_type": "ON"},
        {"from_id": 166, "to_id": 21, "relation_type": "ON"},
        {"from_id": 166, "to_id": 12, "relation_type": "INSIDE"},
        {"from_id": 163, "to_id": 164, "relation_type": "FACING"},
    ],
}  # fmt: skip


def at(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


PROCTHOR = {
    "rooms": [
        {"id": "room|2", "roomType": "Kitchen", "ceilings": [], "children": [],
         "floorPolygon": [at(0, 0, 0), at(0, 0, 4), at(4, 0, 4), at(4, 0, 0)]},
        {"id": "room|3", "roomType": "LivingRoom",
         "floorPolygon": [at(4, 0, 0), at(4, 0, 4), at(9, 0, 4), at(9, 0, 0)]},
    ],
    "doors": [
        {"id": "door|2|3", "room0": "room|2", "room1": "room|3", "openable": False},
        {"id": "door|1|2", "room0": "exterior", "room1": "room|2"},
    ],
    "walls": [],
    "windows": [],
    "objects": [
        {"id": "DiningTable|2|0", "assetId": "Dining_Table_1", "kinematic": True, "position": at(1, 0.4, 3),
         "rotation": at(0, 90, 0), "children": [
            {"id": "surface|2|0|apple", "assetId": "Apple_1", "kinematic": False, "objectType": "Apple",
             "position": at(1, 0.8, 3)}]},
        {"id": "Fridge|2|1", "assetId": "Fridge_4", "kinematic": True, "position": at(3, 0.9, 3), "openness": 0.7,
         "children": [{"id": "Egg|2|1|0", "assetId": "Egg_1", "kinematic": False, "position": at(3, 1, 3)}]},
        {"id": "Sofa|3|0", "assetId": "Sofa_1", "kinematic": True, "position": at(7, 0.3, 2), "children": []},
    ],
    "metadata": {"schema": "1.0.0"},
}  # fmt: skip

THOR = {
    "objects": [
        {"objectId": "CounterTop|-00.1|+01.2|+00.5", "objectType": "CounterTop", "position": at(0, 1, 0),
         "pickupable": False, "moveable": False, "receptacle": True, "openable": False, "toggleable": False,
         "receptacleObjectIds": ["Mug|1"], "parentReceptacles": ["Floor|0"]},
        {"objectId": "Mug|1", "objectType": "Mug", "position": at(0, 1.1, 0), "pickupable": True, "receptacle": True,
         "openable": False, "toggleable": False, "isDirty": True, "parentReceptacles": ["CounterTop|-00.1|+01.2|+00.5"],
         "axisAlignedBoundingBox": {"center": at(0, 1.15, 0), "size": at(0.1, 0.1, 0.2), "cornerPoints": []}},
        {"objectId": "Microwave|2", "objectType": "Microwave", "position": at(1, 1, 0), "pickupable": False,
         "receptacle": True, "openable": True, "toggleable": True, "isOpen": True, "isToggled": False},
        {"objectId": "Floor|0", "objectType": "Floor", "position": at(0, 0, 0)},
    ],
    "sceneName": "FloorPlan1",
}  # fmt: skip

CONCEPTGRAPHS = {
    "object_1": {"id": 1, "object_tag": "coffee table", "object_caption": "a low table", "bbox_volume": 0.4,
                 "bbox_extent": [1.2, 0.6, 0.5], "bbox_center": [0, 0, 0.25]},
    "object_2": {"id": 2, "object_tag": "mug", "bbox_extent": [0.1, 0.1, 0.12], "bbox_center": [0.2, 0.1, 0.55]},
    "object_3": {"id": 3, "object_tag": "bottom cabinet", "bbox_extent": [0.8, 0.6, 0.9], "bbox_center": [3, 0, 0.45]},
    "object_4": {"id": 4, "object_tag": "plate", "bbox_extent": [0.2, 0.2, 0.03], "bbox_center": [3, 0, 0.4]},
    "object_5": {"id": 5, "object_tag": "invalid", "bbox_extent": [1, 1, 1], "bbox_center": [0, 0, 0]},
    "object_6": {"id": 6, "object_tag": "spoon", "bbox_extent": [0.1, 0.1, 0.02], "bbox_center": [5, 5, 0.01]},
}  # fmt: skip
RELATIONS = [
    {"object1": {"id": 6, "bbox_extent": [0.1, 0.1, 0.02], "bbox_center": [5, 5, 0.01], "object_tag": "spoon"},
     "object2": {"id": 2, "bbox_extent": [0.1, 0.1, 0.12], "bbox_center": [0.2, 0.1, 0.55], "object_tag": "mug"},
     "object_relation": "a in b", "reason": "spoons go in mugs"},
]  # fmt: skip

ROOM, PLACE, OBJECT = (ord(letter) << 56 for letter in "RpO")
HYDRA: dict[str, Any] = {
    "directed": False,
    "layer_ids": [2, 3, 4],
    "nodes": [
        {"id": ROOM, "layer": 4, "attributes": {"type": "RoomNodeAttributes", "name": "kitchen", "semantic_label": 0,
                                                "position": [0, 0, 1]}},
        {"id": ROOM + 1, "layer": 4, "attributes": {"type": "RoomNodeAttributes", "name": "R(1)", "semantic_label": 1,
                                                    "position": [3, 4, 1]}},
        {"id": PLACE, "layer": 3, "attributes": {"type": "PlaceNodeAttributes", "position": [0, 0, 0]}},
        {"id": OBJECT, "layer": 2, "attributes": {"type": "ObjectNodeAttributes", "name": "coffee table",
            "position": [0, 0, 0.25], "bounding_box": {"type": "AABB", "dimensions": [1, 1, 0.5],
                                                       "world_P_center": [0, 0, 0.25]}}},
        {"id": OBJECT + 1, "layer": 2, "attributes": {"type": "ObjectNodeAttributes", "name": "", "semantic_label": 7,
            "position": [0, 0, 0.55], "bounding_box": {"type": "AABB", "dimensions": [0.1, 0.1, 0.1],
                                                       "world_P_center": [0, 0, 0.55]}}},
        {"id": OBJECT + 2, "layer": 2, "attributes": {"type": "ObjectNodeAttributes", "name": "sofa",
            "position": [3, 4, 0.4]}},
    ],
    "edges": [
        {"source": ROOM, "target": ROOM + 1, "info": {"weight": 1.0}},
        {"source": ROOM, "target": PLACE},
        {"source": PLACE, "target": OBJECT},
        {"source": PLACE, "target": OBJECT + 1},
        {"source": ROOM + 1, "target": OBJECT + 2},
    ],
}  # fmt: skip


def places(graph: SceneGraph) -> dict[str, tuple[Relation, str]]:
    return {o: (s.relation, s.holder) for o, s in graph.supports.items()}


def test_virtualhome() -> None:
    found = from_virtualhome(VIRTUALHOME)
    graph = found.graph()
    assert places(graph) == {
        "fridge_0": (Relation.FLOOR, "kitchen_0"),
        "kitchentable_0": (Relation.FLOOR, "kitchen_0"),
        "salmon_0": (Relation.INSIDE, "fridge_0"),
        "plate_0": (Relation.ON_TOP, "kitchentable_0"),
        "mug_0": (Relation.ON_TOP, "plate_0"),
        "rug_0": (Relation.FLOOR, "bedroom_0"),
        "towel_0": (Relation.HELD, "robot"),
    }
    assert graph.world.connections == {("bedroom_0", "kitchen_0")}
    assert (graph.robot_room, graph.near, graph.holding) == ("kitchen_0", frozenset({"fridge_0"}), "towel_0")
    assert graph.is_shut("fridge_0")
    assert graph.has(Flag.DIRTY, "plate_0")
    assert graph.category("kitchentable_0").surface
    assert graph.world.layout.positions["fridge_0"] == (2.0, 1.0, 0.9)
    assert found.names["fridge_0"] == "162"


def test_procthor() -> None:
    graph = from_ai2thor(PROCTHOR).graph()
    assert places(graph) == {
        "dining_table_0": (Relation.FLOOR, "kitchen_0"),
        "apple_0": (Relation.ON_TOP, "dining_table_0"),
        "fridge_0": (Relation.FLOOR, "kitchen_0"),
        "egg_0": (Relation.INSIDE, "fridge_0"),
        "sofa_0": (Relation.FLOOR, "living_room_0"),
    }
    assert graph.world.connections == {("kitchen_0", "living_room_0")}
    assert graph.has(Flag.OPEN, "fridge_0")
    assert graph.world.layout.positions["sofa_0"] == (7.0, 2.0, 0.3)
    assert graph.world.rooms["living_room_0"].type == "living_room"
    assert graph.category("egg_0").liftable


def test_the_metadata_of_ai2thor() -> None:
    graph = from_ai2thor(THOR).graph()
    assert places(graph) == {
        "counter_top_0": (Relation.FLOOR, "room_0"),
        "mug_0": (Relation.ON_TOP, "counter_top_0"),
        "microwave_0": (Relation.FLOOR, "room_0"),
    }
    assert graph.category("counter_top_0").surface
    assert (graph.has(Flag.DIRTY, "mug_0"), graph.has(Flag.OPEN, "microwave_0")) == (True, True)
    assert graph.world.layout.positions["mug_0"] == (0.0, 0.0, 1.1)


def test_conceptgraphs() -> None:
    graph = from_conceptgraphs(CONCEPTGRAPHS, RELATIONS).graph()
    assert places(graph) == {
        "coffee_table_0": (Relation.FLOOR, "room_0"),
        "mug_0": (Relation.ON_TOP, "coffee_table_0"),
        "bottom_cabinet_0": (Relation.FLOOR, "room_0"),
        "plate_0": (Relation.INSIDE, "bottom_cabinet_0"),
        "spoon_0": (Relation.INSIDE, "mug_0"),
    }
    assert graph.world.layout.positions["mug_0"] == (0.2, 0.1, 0.55)
    assert places(from_conceptgraphs(list(CONCEPTGRAPHS.values())).graph())["spoon_0"] == (Relation.FLOOR, "room_0")


def test_hydra() -> None:
    graph = from_hydra(HYDRA, labels={7: "mug", 1: "living room"}).graph()
    assert places(graph) == {
        "coffee_table_0": (Relation.FLOOR, "kitchen_0"),
        "mug_0": (Relation.ON_TOP, "coffee_table_0"),
        "sofa_0": (Relation.FLOOR, "living_room_0"),
    }
    assert graph.world.layout.distances_m == {("kitchen_0", "living_room_0"): 5.0}
    with pytest.raises(GraphError, match=r"\$\.nodes\[4\]: no name, and no label for 7"):
        from_hydra(HYDRA)


SOURCES = [
    (from_virtualhome, VIRTUALHOME),
    (from_ai2thor, PROCTHOR),
    (from_ai2thor, THOR),
    (from_conceptgraphs, CONCEPTGRAPHS),
    (lambda source: from_hydra(source, labels={7: "mug"}), HYDRA),
]


@pytest.mark.parametrize(("importer", "source"), SOURCES)
def test_what_is_imported_is_saved_and_read_again(
    importer: Callable[..., Imported], source: Any, tmp_path: Path
) -> None:
    (tmp_path / "theirs.json").write_text(json.dumps(source))
    found = importer(tmp_path / "theirs.json")
    found.save(tmp_path / "ours.json")
    assert SceneGraph.from_json(tmp_path / "ours.json") == found.graph(default_ontology()) == importer(source).graph()


@pytest.mark.parametrize(("importer", "source"), SOURCES)
def test_what_is_malformed_is_a_typed_error(importer: Callable[..., Imported], source: Any, tmp_path: Path) -> None:
    malformed: list[Any] = [{}, [1], {"nodes": 3}, {"objects": [{}]}, "{", b"\xff", tmp_path / "none.json"]
    for broken in malformed:
        if broken == {} and importer is from_conceptgraphs:
            continue
        with pytest.raises(GavelError):
            importer(broken)
    text = json.dumps(source)
    for cut in range(1, len(text), len(text) // 25):
        with pytest.raises(GavelError):
            importer(text[:cut])


ODD: st.SearchStrategy[Any] = (
    st.none()
    | st.booleans()
    | st.integers(-2, 3)
    | st.floats()
    | st.sampled_from(["", "|", "a b", "Rooms"])
    | st.just([])
)


def spots(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield every path inside a JSON value."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield (*path, key)
        yield from spots(inner, (*path, key))


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_no_source_is_worse_than_a_typed_error(data: st.DataObject) -> None:
    importer, source = data.draw(st.sampled_from(SOURCES))
    changed = copy.deepcopy(source)
    *path, last = data.draw(st.sampled_from(list(spots(source))))
    at = changed
    for key in path:
        at = at[key]
    at[last] = data.draw(ODD)
    try:
        found = importer(changed)
    except GavelError:
        return
    assert SceneGraph.from_json(found.graph().to_json()) == found.graph()


def test_edges_to_nowhere_are_said() -> None:
    lost = {"from_id": 162, "to_id": 999, "relation_type": "INSIDE"}
    with pytest.raises(GraphError, match=r"\$\.edges\[14\]: unknown id '999'"):
        from_virtualhome({**VIRTUALHOME, "edges": [*VIRTUALHOME["edges"], lost]})
    with pytest.raises(GraphError, match=r"\$\.doors\[0\]: unknown id 'room\|9'"):
        from_ai2thor({**PROCTHOR, "doors": [{"room0": "room|9", "room1": "room|2"}]})
    with pytest.raises(GraphError, match=r"\$\.edges\[5\] names a node"):
        from_hydra({**HYDRA, "edges": [*HYDRA["edges"], {"source": 1, "target": 2}]}, labels={7: "mug"})


def test_plans_are_verified_and_repaired_on_what_was_imported() -> None:
    graph = from_virtualhome({**VIRTUALHOME, "edges": [e for e in VIRTUALHOME["edges"] if e["to_id"] != 167]}).graph()
    found = gavel_agents.verify(graph=graph, goal="on_top(salmon_0, kitchentable_0)", plan="GRASP(salmon)")
    assert not found.valid
    assert found.passed


def test_every_importer_has_a_name() -> None:
    assert set(IMPORTERS.values()) == {from_virtualhome, from_ai2thor, from_conceptgraphs, from_hydra}
