"""What is known when tasks are ordered: where everything may be that plans go to, and what has to be found."""

from __future__ import annotations

import pytest
from support.floor_scenes import flat
from support.worlds import build

from gavel_agents.beliefs.belief import Belief, load_prior
from gavel_agents.binding import Binder
from gavel_agents.ordering.knowledge import Spot, knowledge, localised
from gavel_env.exchange import Observed
from gavel_env.house.floor_map import FloorMap, known_layout
from gavel_env.world_model.graph import Node
from gavel_env.world_model.ontology import default_ontology

KITCHEN_TABLE, STUDY_TABLE, FRIDGE = (2.4, 3.4), (6.0, -3.0), (0.4, 3.6)
BEHIND_THE_WALL = (4.08, 1.0)
"""Nearer to the hall's free floor than to the kitchen's."""

BELIEVED = build({"steak": "in fridge", "fridge": "floor kitchen_0", "bowl": "held"}).with_nodes(
    {name: Node(name, default_ontology()[name], fixed) for name, fixed in
     {"textbook": False, "shelf": True, "oven": True, "breakfast_table": True, "apple": False}.items()}
)  # fmt: skip


@pytest.fixture(scope="module")
def layout() -> FloorMap:
    return known_layout(flat())


def seen_from(layout: FloorMap, room: str) -> Observed:
    """Return what a robot sees that holds a bowl; the shelf is in a room that it cannot enter."""
    places = {
        "breakfast_table_0": "floor kitchen_0", "breakfast_table_1": "floor study_0", "fridge_0": "floor kitchen_0",
        "oven_0": "floor kitchen_0", "shelf_0": "floor pantry_0", "apple_1": "on breakfast_table_1", "bowl_0": "held",
    }  # fmt: skip
    cell = layout.room_points[room]
    assert cell is not None
    positions = {
        "breakfast_table_0": KITCHEN_TABLE, "breakfast_table_1": STUDY_TABLE, "fridge_0": FRIDGE,
        "oven_0": BEHIND_THE_WALL, "shelf_0": (1.0, 6.8), "apple_1": STUDY_TABLE,
        "bowl_0": layout.point(cell),
    }  # fmt: skip
    graph = build(places, robot_room=room)
    return Observed("", graph, layout, positions, cell, 0.0, layout.floor, frozenset({"hall_0"}), 3.0, "ok", None)


def holding_a_bowl() -> Binder:
    binder = Binder()
    binder.bound["bowl"] = "bowl_0"
    return binder


def test_a_thing_may_be_every_observed_instance_or_else_where_its_holder_is(layout: FloorMap) -> None:
    rooms = [room for room in layout.room_ids if layout.room_points[room] is not None]
    belief = Belief.initial(BELIEVED, layout, rooms, load_prior("uniform"))
    observed = seen_from(layout, "study_0")
    known = knowledge(BELIEVED, belief, holding_a_bowl(), observed)
    assert known.where["breakfast_table"] == [Spot(*KITCHEN_TABLE, "kitchen_0"), Spot(*STUDY_TABLE, "study_0")]
    assert known.where["apple"] == [Spot(*STUDY_TABLE, "study_0")]
    assert known.where["steak"] == known.where["fridge"] == [Spot(*FRIDGE, "kitchen_0")]
    assert known.where["bowl"] == [Spot(*layout.point(observed.cell), "study_0")]
    assert known.where["textbook"] == []
    assert known.root == {node: "fridge" if node == "steak" else node for node in BELIEVED.world.nodes}
    assert known.belief is belief
    assert known.rooms == tuple(rooms)
    assert (known.cell, known.searched, known.holding) == (observed.cell, frozenset({"hall_0"}), "bowl")
    assert known.seen is observed.seen


@pytest.mark.parametrize(("room", "table"), [("study_0", STUDY_TABLE), ("kitchen_0", KITCHEN_TABLE)])
def test_what_is_localised_is_the_nearest_instance_that_can_be_driven_to(
    layout: FloorMap, room: str, table: tuple[float, float]
) -> None:
    observed = seen_from(layout, room)
    cells = localised(BELIEVED, holding_a_bowl(), observed)
    assert cells == {
        "breakfast_table": layout.nearest_reachable(*table, room),
        "apple": layout.nearest_reachable(*STUDY_TABLE, "study_0"),
        "fridge": layout.nearest_reachable(*FRIDGE, "kitchen_0"),
        "oven": layout.nearest_reachable(*BEHIND_THE_WALL, "kitchen_0"),
        "bowl": observed.cell,
    }
    assert cells["oven"] != layout.nearest_reachable(*BEHIND_THE_WALL)
