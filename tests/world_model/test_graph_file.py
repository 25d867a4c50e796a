"""Graphs of one's own: JSON and networkx to and fro, every fault with its place, travel costs, and speed."""

from __future__ import annotations

import copy
import json
import math
import runpy
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema
import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.counting import calls_of
from support.worlds import kitchen

from gavel_env.errors import GavelError, GraphError, UndeclaredCategory
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.actions import Action, parse_action
from gavel_env.world_model.goals import as_goal
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import default_ontology
from gavel_env.world_model.travel import travel_cost
from gavel_env.world_model.verdict import validate

SCHEMAS = Path(__file__).parents[2] / "docs" / "reference" / "schemas"
LAB: dict[str, Any] = {
    "format": "gavel-graph/1",
    "rooms": [
        {"id": "lab", "position": [0, 0, 0], "footprint": [[-4, -4], [4, -4], [4, 4], [-4, 4]]},
        {"id": "store_1", "type": "storage_room"},
        {"id": "hall"},
    ],
    "connections": [{"rooms": ["lab", "hall"], "distance_m": 5.0}, {"rooms": ["store_1", "hall"], "distance_m": 7.5}],
    "categories": {"vial": {"like": "bottle", "words": ["sample glass"]}, "rack": {"surface": True}},
    "nodes": [
        {"id": "bench", "category": "lab_table", "room": "lab", "position": [1, 0, 0.4]},
        {"id": "cupboard", "category": "bottom_cabinet", "room": "store_1", "flags": ["open"], "position": [9, 9, 0]},
        {"id": "rack", "category": "rack", "on_top": "bench", "room": "lab", "position": [1, 0.2, 0.9]},
        {"id": "vial", "category": "vial", "inside": "cupboard", "flags": ["dirty"]},
        {"id": "lost", "category": "vial"},
        {"id": "mug", "category": "mug", "held": True},
        {"id": "stool", "category": "armchair", "room": "lab", "fixed": True, "position": [-2, 0, 0]},
    ],
    "robot": {"room": "lab", "near": ["bench"], "position": [0, 0, 0]},
    "next_to": [["stool", "bench"]],
}


def changed(path: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    """Return the lab with one value changed or added."""
    data = copy.deepcopy(LAB)
    at: Any = data
    for key in path[:-1]:
        at = at[key]
    if isinstance(at, list) and path[-1] == "+":
        at.append(value)
    else:
        at[path[-1]] = value
    return data


def test_a_graph_says_what_its_file_says() -> None:
    graph = SceneGraph.from_json(LAB)
    assert graph.room_of("vial") == "store_1"
    assert graph.supports["rack"] == (Relation.ON_TOP, "bench")
    assert graph.contents == {"bench": ("rack",), "cupboard": ("vial",)}
    assert (graph.holding, graph.robot_room, graph.near) == ("mug", "lab", frozenset({"bench"}))
    assert graph.has(Flag.OPEN, "cupboard")
    assert not graph.is_shut("cupboard")
    assert graph.supports.get("lost") is None
    assert graph.category("vial").graspable
    assert graph.world.nodes["stool"].fixed
    assert graph.beside("bench", "stool")
    assert graph.world.layout.positions["rack"] == (1.0, 0.2, 0.9)
    assert graph.world.layout.distances_m == {("hall", "lab"): 5.0, ("hall", "store_1"): 7.5}


def test_json_and_networkx_go_to_and_fro(tmp_path: Path) -> None:
    graph = SceneGraph.from_json(LAB)
    text = graph.to_json()
    assert SceneGraph.from_json(text) == graph
    assert SceneGraph.from_json(text.encode()) == graph
    (tmp_path / "lab.json").write_text(text)
    assert SceneGraph.from_json(tmp_path / "lab.json") == SceneGraph.from_json(str(tmp_path / "lab.json")) == graph
    drawn = graph.to_networkx()
    assert drawn.nodes["rack"]["position"] == (1, 0.2, 0.9)
    assert SceneGraph.from_networkx(drawn, default_ontology().extend(LAB["categories"])) == graph


@pytest.mark.parametrize("scene", ["Rs_int", "Beechwood_0_int"])
def test_the_shipped_houses_survive_the_round_trip(scene: str) -> None:
    graph = scene_graph(load_scene(scene), default_ontology())
    assert SceneGraph.from_json(graph.to_json()) == graph
    assert SceneGraph.from_networkx(graph.to_networkx()) == graph


def test_the_hand_written_kitchen_survives_the_round_trip() -> None:
    graph = kitchen(flags={"open": ["fridge_0"], "toggled": ["oven_0"]}, next_to=[("fridge_0", "oven_0")])
    assert SceneGraph.from_json(graph.to_json()) == graph
    assert SceneGraph.from_networkx(graph.to_networkx()) == graph


def test_networkx_may_be_written_by_hand() -> None:
    drawn = nx.DiGraph()
    drawn.add_node("lab", kind="room")
    drawn.add_node("bench", category="lab_table", position=(1.0, 2.0))
    drawn.add_node("mug", category="mug")
    drawn.add_edge("bench", "lab", relation="in_room")
    drawn.add_edge("mug", "bench", relation="on")
    graph = SceneGraph.from_networkx(drawn)
    assert graph.room_of("mug") == "lab"
    assert graph.world.layout.positions == {"bench": (1.0, 2.0, 0.0)}
    drawn.add_edge("mug", "lab", relation="above")
    with pytest.raises(GraphError, match="unknown relation 'above'"):
        SceneGraph.from_networkx(drawn)
    drawn.add_edge("mug", "lab")
    del drawn.edges["mug", "lab"]["relation"]
    with pytest.raises(GraphError, match="unknown relation ''"):
        SceneGraph.from_networkx(drawn)


WRONG = [
    (("nodes", 3, "inside"), "vial", r"\$\.nodes\[3\]: cycle of supports: vial"),
    (("nodes", 0), {"id": "bench", "category": "lab_table", "on_top": "rack"}, r"\$\.nodes\[0\]: cycle of supports: "),
    (("nodes", 3, "on_top"), "bench", r"\$\.nodes\[3\]: 'vial' has two supports, on_top and inside"),
    (("nodes", 3, "inside"), "cupbord", r"\$\.nodes\[3\]\.inside: unknown node 'cupbord'; did you mean 'cupboard'"),
    (("nodes", 0, "room"), "labb", r"\$\.nodes\[0\]\.room: unknown room 'labb'; did you mean 'lab'"),
    (("nodes", 2, "room"), "hall", r"\$\.nodes\[2\]\.room: 'hall', but 'bench' is in 'lab'"),
    (("nodes", 0, "position"), [1, math.nan, 0], r"\$\.nodes\[0\]\.position: .*not a point"),
    (("nodes", 0, "position"), [1, math.inf, 0], r"\$\.nodes\[0\]\.position: .*not a point"),
    (("nodes", 0, "position"), [1, 0], r"length 3.*\$\.nodes\[0\]\.position"),
    (("nodes", 0, "footprint"), [[0, 0], [1, 1]], r"\$\.nodes\[0\]\.footprint: .*three corners"),
    (("nodes", 1, "id"), "bench", r"\$\.nodes\[1\]\.id: duplicate id 'bench'"),
    (("nodes", 1, "id"), "hall", r"\$\.nodes\[1\]\.id: duplicate id 'hall'"),
    (("nodes", 1, "id"), "robot", "the robot's own id"),
    (("nodes", 4, "id"), "Lost Vial #2", r"\$\.nodes\[4\]\.id: .* write 'lost_vial_2'"),
    (("nodes", 4, "id"), "", r"\$\.nodes\[4\]\.id"),
    (("nodes", 4, "held"), True, None),
    (("nodes", 0, "flags"), ["opne"], r"\$\.nodes\[0\]\.flags\[0\]: unknown flag 'opne'; did you mean 'open'"),
    (("nodes", 0, "colour"), "red", "unknown field `colour`"),
    (("rooms", 1, "id"), "lab", r"\$\.rooms\[1\]\.id: duplicate room id 'lab'"),
    (("connections", 0), ["lab", "moon"], r"\$\.connections\[0\]: unknown room 'moon'"),
    (("connections", 0), ["lab", "lab"], r"\$\.connections\[0\]: 'lab' is connected to itself"),
    (("connections", 0, "distance_m"), -1.0, r"\$\.connections\[0\]\.distance_m: -1.0 is not a length"),
    (("robot", "room"), "moon", r"\$\.robot\.room: unknown room"),
    (("robot", "near"), ["moon"], r"\$\.robot\.near\[0\]: unknown node"),
    (("next_to", 0), ["stool", "moon"], r"\$\.next_to\[0\]: unknown node"),
    (("format",), "gavel-graph/9", r"\$\.format: 'gavel-graph/9'; this version reads 'gavel-graph/1'"),
    (("categories", "vial", "like"), "botle", r"\$\.categories\.vial\.like: unknown category 'botle'; did you mean"),
    (("categories", "vial"), {"likes": "bottle"}, "unknown field `likes`.*"),
]


@pytest.mark.parametrize(("path", "value", "message"), WRONG, ids=[str(w[0]) + str(w[1])[:20] for w in WRONG])
def test_every_fault_is_said_with_its_place(path: tuple[str | int, ...], value: Any, message: str | None) -> None:
    if message is None:
        value, message = True, r"\$\.nodes\[5\]\.held: the robot holds 'lost' already"
    with pytest.raises(GavelError, match=message):
        SceneGraph.from_json(changed(path, value))


@pytest.mark.parametrize("metres", [0, 0.5, 1e6])
def test_any_length_that_is_not_negative_is_a_distance(metres: float) -> None:
    graph = SceneGraph.from_json(changed(("connections", 0, "distance_m"), metres))
    assert graph.world.layout.distances_m["hall", "lab"] == metres


def test_an_unknown_category_shows_the_three_lines_that_add_it() -> None:
    with pytest.raises(UndeclaredCategory) as caught:
        SceneGraph.from_json(changed(("nodes", 4, "category"), "pipette_rack"))
    message = str(caught.value)
    assert "$.nodes[4].category" in message
    lines = [line.strip() for line in message.splitlines()[-3:]]
    assert lines[0] == "[categories.pipette_rack]"
    assert lines[2] == 'words = ["pipette rack"]'
    added = default_ontology().extend({"pipette_rack": {"like": lines[1].split('"')[1], "words": ["pipette rack"]}})
    assert added.concepts.meaning("pipette racks").thing == "pipette_rack"
    assert lines[1].endswith('rack"')


def test_what_is_no_json_is_a_typed_error(tmp_path: Path) -> None:
    for text in ("{", '{"format": 3}', "{}", '{"format": "gavel-graph/1", "nodes": [{"id": "a"}]}'):
        with pytest.raises(GraphError, match="malformed"):
            SceneGraph.from_json(text)
    with pytest.raises(GraphError, match="cannot be read"):
        SceneGraph.from_json(tmp_path / "none.json")
    (tmp_path / "bad.json").write_bytes(b"\xff")
    with pytest.raises(GraphError, match=r"bad\.json"):
        SceneGraph.from_json(tmp_path / "bad.json")


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-3, 9)
    | st.floats()
    | st.sampled_from(["lab", "bench", "vial", "", "open"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["id", "room", "x"]), inner, max_size=3)
    ),
    max_leaves=6,
)
PLACES = [
    (key, *rest)
    for key, entry in LAB.items()
    for rest in ([()] + [(i, f) for i, part in enumerate(entry) for f in (part if isinstance(part, dict) else ())])
    if not isinstance(entry, dict)
] + [
    ("nodes", i, f)
    for i in range(7)
    for f in ("id", "category", "room", "on_top", "inside", "held", "flags", "position")
]


@pytest.mark.parametrize(
    ("written", "better"),
    [("Lab Bench", "lab_bench"), ("+vial+", "vial"), ("'vial'", "vial"), ("a+b", "b"), ("u+v", "u_v"), ("3", "x_3")],
)
def test_an_id_that_plans_cannot_write_is_said_with_one_that_they_can(written: str, better: str) -> None:
    with pytest.raises(
        GraphError, match=rf"^graph: \$\.nodes\[4\]\.id: .*cannot be written in plans; write '{better}'$"
    ):
        SceneGraph.from_json(changed(("nodes", 4, "id"), written))
    SceneGraph.from_json(changed(("nodes", 4, "id"), f"{better}_9"))


def test_a_hundred_things_may_stand_on_each_other_and_no_more() -> None:
    def tower(height: int) -> dict[str, Any]:
        stack = [{"id": f"t{i}", "category": "tray", "on_top": f"t{i - 1}" if i else "bench"} for i in range(height)]
        return changed(("nodes",), [{"id": "bench", "category": "lab_table", "room": "lab"}, *reversed(stack)])

    tall = {key: value for key, value in tower(100).items() if key not in ("next_to", "robot")}
    assert SceneGraph.from_json(tall).room_of("t99") == "lab"
    with pytest.raises(GavelError, match="'t100' stands on 101 others; at most 100"):
        SceneGraph.from_json(tower(101))


@settings(max_examples=120, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PLACES), VALUES), min_size=1, max_size=3))
def test_no_file_is_worse_than_a_typed_error(changes: list[tuple[tuple[str | int, ...], Any]]) -> None:
    data = copy.deepcopy(LAB)
    for path, value in changes:
        at: Any = data
        try:
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = value
        except (KeyError, IndexError, TypeError):
            continue
    try:
        graph = SceneGraph.from_json(data)
    except GavelError:
        return
    assert SceneGraph.from_json(graph.to_json()) == graph
    for obj in graph.world.nodes:
        graph.room_of(obj)


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=40) | st.text(max_size=40))
def test_no_bytes_are_worse_than_a_typed_error(content: bytes | str) -> None:
    with pytest.raises(GavelError):
        SceneGraph.from_json(content if isinstance(content, bytes) else "{" + content)


# --- schemas -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["graph", "categories"])
def test_the_schemas_in_the_docs_are_those_of_the_code(name: str) -> None:
    written = runpy.run_path(str(SCHEMAS.parents[1] / "schemas.py"))["schemas"]()
    assert json.loads((SCHEMAS / f"{name}.schema.json").read_text("utf-8")) == written[name]


def test_what_is_written_is_as_the_schema_says() -> None:
    schema = json.loads((SCHEMAS / "graph.schema.json").read_text("utf-8"))
    jsonschema.validate(LAB, schema)
    jsonschema.validate(json.loads(SceneGraph.from_json(LAB).to_json()), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(changed(("nodes", 0, "colour"), "red"), schema)


# --- what driving costs -------------------------------------------------------------------------------------------


def plan(*steps: str) -> tuple[Action, ...]:
    return tuple(map(parse_action, steps))


ROUND = plan("NAVIGATE_TO(vial)", "GRASP(vial)", "NAVIGATE_TO(rack)", "PLACE_ON_TOP(rack)", "NAVIGATE_TO(vial)")


def test_given_distances_are_metres_along_connections() -> None:
    cost = travel_cost(SceneGraph.from_json(LAB))
    assert cost.unit == "metres"
    graph = SceneGraph.from_json(LAB)
    # lab -> hall -> store and back; the vial on the rack is where its bench is, to which the robot has gone already.
    assert cost(graph, ROUND) == pytest.approx(25.0)
    assert cost(graph, plan("NAVIGATE_TO(bench)", "NAVIGATE_TO(stool)")) == pytest.approx(1.0 + 3.0)


def test_without_distances_lines_between_positions_and_without_those_rooms() -> None:
    bare = {**LAB, "connections": [["lab", "hall"], ["hall", "store_1"]], "nodes": LAB["nodes"][:4], "next_to": []}
    graph = SceneGraph.from_json(bare)
    cost = travel_cost(graph)
    assert cost.unit == "metres"
    assert cost(graph, ROUND) == pytest.approx(math.hypot(9, 9) + math.hypot(8, 9))
    nowhere = {**bare, "nodes": [{k: v for k, v in n.items() if k != "position"} for n in bare["nodes"]]}
    graph = SceneGraph.from_json(nowhere)
    cost = travel_cost(graph)
    assert (cost.unit, cost(graph, ROUND)) == ("rooms", 4.0)


# --- size -------------------------------------------------------------------------------------------


def many(count: int) -> str:
    """Return a graph of `count` nodes: tables with mugs on them, in 20 rooms."""
    rooms = [{"id": f"room_{r}"} for r in range(20)]
    tables = [{"id": f"table_{i}", "category": "lab_table", "room": f"room_{i % 20}"} for i in range(count // 10)]
    mugs = [
        {"id": f"mug_{i}", "category": "mug", "on_top": f"table_{i % (count // 10)}"}
        for i in range(count - len(tables))
    ]
    return json.dumps({"format": "gavel-graph/1", "rooms": rooms, "nodes": tables + mugs, "robot": {"room": "room_0"}})


SEVENTEEN = plan(
    *(
        step
        for i in range(4)
        for step in (f"NAVIGATE_TO(mug_{i})", f"GRASP(mug_{i})", "NAVIGATE_TO(table_9)", "PLACE_ON_TOP(table_9)")
    ),
    "NAVIGATE_TO(table_1)",
)


def test_ten_times_the_nodes_take_ten_times_the_calls() -> None:
    """Loading is linear: nothing asks of every node for every node."""
    small, large = many(300), many(3_000)
    SceneGraph.from_json(small)
    assert calls_of(lambda: SceneGraph.from_json(large)) < 11 * calls_of(lambda: SceneGraph.from_json(small))


def test_a_plan_takes_as_many_calls_on_a_large_graph_as_on_a_small_one() -> None:
    goal = as_goal("on_top(mug_0, table_9)")
    counts = []
    for size in (300, 3_000):
        graph = SceneGraph.from_json(many(size))
        validate(graph, SEVENTEEN, goal)
        counts.append(calls_of(partial(validate, graph, SEVENTEEN, goal)))
    # What lies on a table comes near with it, and tables hold nine mugs in both.
    assert counts[0] == counts[1]


def test_a_plan_on_ten_thousand_nodes_is_validated() -> None:
    graph = SceneGraph.from_json(many(10_000))
    assert validate(graph, SEVENTEEN, "on_top(mug_0, table_9), on_top(mug_3, table_9)").valid
    assert len(SEVENTEEN) == 17
