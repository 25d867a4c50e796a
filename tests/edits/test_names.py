"""Names that models write and the graph does not have."""

import pytest

from gavel_agents.beliefs.believed_graph import believed_graph
from gavel_agents.edits.names import meant_by
from gavel_agents.edits.repair import repair
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.world_model.goals import Designator, parse_goal
from gavel_env.world_model.graph import Room, SceneGraph
from gavel_env.world_model.ontology import default_ontology

ROOMS = {f"{kind}_0": Room(f"{kind}_0", kind) for kind in ("kitchen", "bathroom", "bedroom", "utility_room")}


def believed(*names: str, goal: tuple[str, ...] = ()) -> SceneGraph:
    task = TaskUnderstanding("", tuple(map(Designator.parse, names)), (), parse_goal(goal))
    return believed_graph(ROOMS, frozenset(), [task], default_ontology(), "kitchen_0")


# The five names of real 8B plans that failed after repair, and what they stood for.
MEASURED = [
    ("tshirt", "t_shirt"),
    ("shampoo_water_bottle", "bottle_of_shampoo"),
    ("shampoo_water_bottle", "shampoo_bottle"),
    ("dryer", "clothes_dryer"),
    ("trash_can", "public_trash_can"),
    ("cabinet", "any_cabinet@kitchen"),
    ("cabinet", "bottom_cabinet_no_top"),
]


@pytest.mark.parametrize(("written", "node"), MEASURED)
def test_measured_names_reach_their_node(written: str, node: str) -> None:
    assert meant_by(written, believed("apple", node, "bed", "floor_lamp")) == [node]


def test_a_read_name_is_a_step_of_the_edit_trace_and_holds_for_the_whole_plan() -> None:
    goal = ("inside(t_shirt, clothes_dryer)", "dried(t_shirt)")
    graph = believed("t_shirt", "clothes_dryer", goal=goal)
    text = "NAVIGATE_TO tshirt\nGRASP tshirt\nNAVIGATE_TO dryer\nOPEN dryer\nPLACE_INSIDE dryer\nCLOSE dryer\n" \
           "TOGGLE_ON dryer\nTOGGLE_OFF dryer"  # fmt: skip
    plan = parse_plans(text, graph).plan
    assert plan[0].target == "tshirt"  # a method without repair gets what the model wrote
    repaired = repair(graph, plan, parse_goal(goal))
    assert repaired.verdict.valid
    assert repaired.trace == (
        "step 1: unknown_object(tshirt) -> read tshirt as t_shirt",
        "step 3: unknown_object(dryer) -> read dryer as clothes_dryer",
    )
    assert [edit.rule for edit in repaired.edits] == ["read_name", "read_name"]


def test_a_name_that_several_nodes_fit_is_left_to_the_model() -> None:
    graph = believed("floor_lamp", "table_lamp")
    plan = parse_plans("NAVIGATE_TO lamp\nTOGGLE_ON lamp", graph).plan
    assert meant_by("lamp", graph) == ["floor_lamp", "table_lamp"]
    assert repair(graph, plan, parse_goal(())).plan == plan


def test_what_the_plan_does_with_a_name_and_what_the_goal_speaks_of_tell_nodes_apart() -> None:
    graph = believed("breakfast_table", "coffee_table", "mug", goal=("on_top(mug, coffee_table)",))
    plan = parse_plans("NAVIGATE_TO mug\nGRASP mug\nNAVIGATE_TO table\nPLACE_ON_TOP table", graph).plan
    repaired = repair(graph, plan, parse_goal(("on_top(mug, coffee_table)",)))
    assert repaired.verdict.valid
    assert "read table as coffee_table" in repaired.trace[0]
    graph = believed("clothes_dryer", "hair_dryer")
    assert repair(
        graph, parse_plans("NAVIGATE_TO blow_dryer\nGRASP blow_dryer", graph).plan, parse_goal(())
    ).verdict.app


@pytest.mark.parametrize(
    ("written", "node"),
    [
        ("cupboard_in_the_kitchen", "any_cabinet@kitchen"),
        ("bed@bathroom", None),
        ("zorgle", None),
        ("imaginary_bed", None),
        ("bottle", None),
    ],
)
def test_rooms_count_and_nonsense_names_nothing(written: str, node: str | None) -> None:
    graph = believed("any_cabinet@kitchen", "bed@bedroom")
    assert meant_by(written, graph) == ([] if node is None else [node])


def test_a_room_of_the_house_counts_though_no_word_of_people_is_known_for_it() -> None:
    rooms = ROOMS | {"zorgroom_0": Room("zorgroom_0", "zorgroom")}
    task = TaskUnderstanding("", (Designator("mug", "zorgroom"), Designator("mug", "kitchen")), (), parse_goal(()))
    graph = believed_graph(rooms, frozenset(), [task], default_ontology(), None)
    assert meant_by("mug_in_the_zorgroom", graph) == ["mug@zorgroom"]
    assert meant_by("mug_in_the_kitchen", graph) == ["mug@kitchen"]
    assert meant_by("mug", graph) == ["mug@zorgroom", "mug@kitchen"]
