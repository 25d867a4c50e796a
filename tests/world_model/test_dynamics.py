"""Every effect, what is safe to leave, and what no sequence of actions may break."""

from __future__ import annotations

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from support.worlds import kitchen, opened

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model import dynamics
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.dynamics import RULES, Violation, ViolationKind, apply, first_violation, unsafe
from gavel_env.world_model.goals import parse_goal
from gavel_env.world_model.graph import Flag, Node, Relation, SceneGraph, Support
from gavel_env.world_model.ontology import default_ontology

K = ViolationKind


# --- effects -------------------------------------------------------------------------------------------------------


def run(graph: SceneGraph, *plan: str) -> SceneGraph:
    end, violation = dynamics.rollout(graph, [parse_action(text) for text in plan])
    assert violation is None, violation
    return end


def test_navigate_brings_near_the_target_its_contents_its_holders_and_the_load() -> None:
    graph = run(
        kitchen({"apple_0": "on floor_lamp_0", "bowl_0": "held", "teacup_0": "in bowl_0"} | {}),
        "NAVIGATE_TO(backpack_0)",
    )
    assert graph.near == {"backpack_0", "textbook_0", "breakfast_table_0", "bowl_0", "teacup_0"}
    assert graph.robot_room == "kitchen_0"
    assert run(graph, "NAVIGATE_TO(bookcase_0)").robot_room == "living_room_0"


def test_navigate_to_what_is_held_changes_nothing() -> None:
    graph = kitchen({"bowl_0": "held"})
    assert run(graph, "NAVIGATE_TO(bowl_0)") is graph


def test_a_load_travels_with_what_holds_it() -> None:
    graph = run(
        kitchen({"apple_0": "in bowl_0"}), "GRASP(bowl_0)", "NAVIGATE_TO(bookcase_0)", "PLACE_INSIDE(bookcase_0)"
    )
    assert graph.room_of("apple_0") == "living_room_0"
    assert graph.supports["apple_0"] == Support(Relation.INSIDE, "bowl_0")
    assert graph.holding is None


def test_release_puts_on_the_floor_beside_what_stands_near() -> None:
    start = kitchen({"bowl_0": "held"}, near=("breakfast_table_0", "backpack_0", "bowl_0"))
    graph = run(start, "RELEASE")
    assert graph.supports["bowl_0"] == Support(Relation.FLOOR, "kitchen_0")
    assert graph.beside("bowl_0", "breakfast_table_0")
    assert not graph.beside("bowl_0", "backpack_0"), "the backpack is on the table, not on the floor"
    assert graph.beneath("bowl_0", "breakfast_table_0") == graph.category("breakfast_table_0").clearance
    lifted = run(graph, "GRASP(bowl_0)")
    assert not lifted.next_to
    assert lifted.holding == "bowl_0"


def test_opening_switches_off_only_what_needs_a_shut_door() -> None:
    graph = kitchen(flags={"toggled": ("microwave_0", "oven_0")})
    graph = run(graph, "OPEN(microwave_0)", "OPEN(oven_0)")
    assert not graph.has(Flag.TOGGLED, "microwave_0")
    assert graph.has(Flag.TOGGLED, "oven_0")


@pytest.mark.parametrize(("verb", "flag", "value"), [("OPEN", Flag.OPEN, True), ("CLOSE", Flag.OPEN, False)])
def test_doing_it_twice_changes_nothing(verb: str, flag: Flag, value: bool) -> None:
    once = run(kitchen(), f"{verb}(fridge_0)")
    assert run(once, f"{verb}(fridge_0)") == once
    assert once.has(flag, "fridge_0") is value


CONFERRED = {
    "microwave cooks inside": ("microwave_0", {"apple_0": "in microwave_0"}, (), "cooked", {"apple_0"}),
    "microwave leaves what is on it": ("microwave_0", {"apple_0": "on microwave_0"}, (), "cooked", set()),
    "microwave cooks in a bowl": (
        "microwave_0",
        {"apple_0": "in bowl_0", "bowl_0": "in microwave_0"},
        (),
        "cooked",
        {"apple_0"},
    ),
    "microwave cannot cook through a lid": (
        "microwave_0",
        {"apple_0": "in backpack_0", "backpack_0": "in microwave_0"},
        (),
        "cooked",
        set(),
    ),
    "oven cooks when shut": ("oven_0", {"apple_0": "in oven_0"}, (), "cooked", {"apple_0"}),
    "oven does not cook when open": ("oven_0", {"apple_0": "in oven_0"}, ("oven_0",), "cooked", set()),
    "stove cooks on top": ("stove_0", {"apple_0": "on stove_0"}, (), "cooked", {"apple_0"}),
    "stove cooks in a bowl on it": (
        "stove_0",
        {"apple_0": "in bowl_0", "bowl_0": "on stove_0"},
        (),
        "cooked",
        {"apple_0"},
    ),
    "stove does not cook two levels down": (
        "stove_0",
        {"apple_0": "in teacup_0", "teacup_0": "in bowl_0", "bowl_0": "on stove_0"},
        (),
        "cooked",
        set(),
    ),
    "dishwasher washes": ("dishwasher_0", {"bowl_0": "in dishwasher_0"}, (), "washed", {"bowl_0"}),
    "dishwasher leaves what is on it": ("dishwasher_0", {"bowl_0": "on dishwasher_0"}, (), "washed", set()),
    "dishwasher does not cook": ("dishwasher_0", {"apple_0": "in dishwasher_0"}, (), "cooked", set()),
    "washer washes": ("washer_0", {"bowl_0": "in washer_0"}, (), "washed", {"bowl_0"}),
    "dryer dries": ("clothes_dryer_0", {"bowl_0": "in clothes_dryer_0"}, (), "dried", {"bowl_0"}),
    "dryer does not wash": ("clothes_dryer_0", {"bowl_0": "in clothes_dryer_0"}, (), "washed", set()),
    "only the cookable cooks": ("stove_0", {"bowl_0": "on stove_0"}, (), "cooked", set()),
    "a lamp confers nothing": ("floor_lamp_0", {"apple_0": "on floor_lamp_0"}, (), "cooked", set()),
}


@pytest.mark.parametrize("name", CONFERRED)
def test_switching_on_confers_states(name: str) -> None:
    appliance, moved, open_doors, state, expected = CONFERRED[name]
    graph = run(opened(*open_doors, moved=moved), f"TOGGLE_ON({appliance})")
    assert graph.flags[Flag[state.upper()]] == expected
    assert graph.has(Flag.TOGGLED, appliance)


def test_washing_removes_dirt_and_drying_does_not() -> None:
    moved = {"bowl_0": "in dishwasher_0", "teacup_0": "in clothes_dryer_0"}
    graph = kitchen(moved, flags={"dirty": ("bowl_0", "teacup_0")})
    graph = run(graph, "TOGGLE_ON(dishwasher_0)", "TOGGLE_ON(clothes_dryer_0)")
    assert graph.flags[Flag.DIRTY] == {"teacup_0"}


def test_states_stay_when_the_appliance_is_switched_off() -> None:
    graph = run(kitchen({"apple_0": "in oven_0"}), "TOGGLE_ON(oven_0)", "TOGGLE_OFF(oven_0)")
    assert graph.has(Flag.COOKED, "apple_0")
    assert not graph.has(Flag.TOGGLED, "oven_0")


COLD = {"apple_0": "held", "freezer_0": "floor kitchen_0", "cooler_0": "floor kitchen_0"}


def test_cold_sources_freeze_once_shut_or_at_once_without_a_door() -> None:
    graph = kitchen(COLD, flags={"open": ("fridge_0",)})
    inside = run(graph, "PLACE_INSIDE(fridge_0)")
    assert not inside.flags[Flag.FROZEN]
    assert run(inside, "CLOSE(fridge_0)").flags[Flag.FROZEN] == {"apple_0", "steak_0"}
    assert run(graph, "PLACE_INSIDE(freezer_0)").flags[Flag.FROZEN] == {"apple_0"}
    cooled = run(graph, "OPEN(cooler_0)", "PLACE_INSIDE(cooler_0)", "CLOSE(cooler_0)")
    assert not cooled.flags[Flag.FROZEN], "a cool box is not below zero"
    assert not run(graph, "PLACE_ON_TOP(fridge_0)", "CLOSE(fridge_0)").has(Flag.FROZEN, "apple_0")


def test_heat_thaws_and_cold_cools() -> None:
    graph = kitchen({"apple_0": "in microwave_0"}, flags={"frozen": ("apple_0",)})
    graph = run(graph, "TOGGLE_ON(microwave_0)")
    assert (graph.has(Flag.HOT, "apple_0"), graph.has(Flag.FROZEN, "apple_0")) == (True, False)
    graph = run(graph, "OPEN(microwave_0)", "GRASP(apple_0)", "OPEN(fridge_0)", "PLACE_INSIDE(fridge_0)")
    graph = run(graph, "CLOSE(fridge_0)")
    assert (graph.has(Flag.HOT, "apple_0"), graph.has(Flag.FROZEN, "apple_0")) == (False, True)


def test_dirt_comes_off_by_wiping_and_rinsing() -> None:
    ontology = default_ontology()
    wiper = next(c.name for c in ontology.values() if c.wipes and c.graspable)
    rinser = next(c.name for c in ontology.values() if c.rinses and c.toggleable and c.interior and not c.openable)
    places = {
        f"{wiper}_0": "held", f"{rinser}_0": "floor kitchen_0", "bowl_0": f"in {rinser}_0", "mug_0": f"on {rinser}_0",
    }  # fmt: skip
    graph = kitchen(places, flags={"dirty": ("bowl_0", "countertop_0", "stove_0", "mug_0")})
    graph = run(graph, "PLACE_ON_TOP(countertop_0)", f"TOGGLE_ON({rinser}_0)")
    assert graph.flags[Flag.DIRTY] == {"stove_0", "mug_0"}  # nothing runs over what stands beside the basin
    clean_hand = kitchen({"apple_0": "held"}, flags={"dirty": ("countertop_0",)})
    assert run(clean_hand, "PLACE_ON_TOP(countertop_0)").flags[Flag.DIRTY] == {"countertop_0"}


def test_more_things_known_leave_the_house_as_it_is() -> None:
    graph = scene_graph(load_scene("Rs_int"))
    more = graph.with_nodes({"mug_9": Node("mug_9", default_ontology()["mug"], False)})
    assert more.world.connections == graph.world.connections != frozenset()
    assert more.world.rooms == graph.world.rooms
    assert set(more.world.nodes) - set(graph.world.nodes) == {"mug_9"}
    assert "mug_9" in more.world.by_category["mug"]
    assert more.room_of("mug_9") is None


def test_a_thing_is_put_elsewhere_or_nowhere_and_its_holder_knows() -> None:
    graph = kitchen()
    moved = graph.place("bowl_0", Support(Relation.INSIDE, "fridge_0"))
    assert moved.supports["bowl_0"] == (Relation.INSIDE, "fridge_0")
    assert moved.contents["fridge_0"] == ("bowl_0", "steak_0")
    assert moved.contents["breakfast_table_0"] == ("backpack_0",)
    lost = graph.place("textbook_0", None)
    assert "textbook_0" not in lost.supports
    assert "backpack_0" not in lost.contents
    assert lost.room_of("textbook_0") is None
    assert graph.room_of("textbook_0") == "kitchen_0"
    assert lost.place("textbook_0", Support(Relation.INSIDE, "backpack_0")) == graph


def test_rollout_stops_at_the_first_violation_and_says_the_step() -> None:
    plan = [parse_action(t) for t in ("NAVIGATE_TO(fridge_0)", "GRASP(steak_0)", "RELEASE")]
    end, violation = dynamics.rollout(kitchen(), plan)
    assert violation == Violation(K.CLOSED, "steak_0", "fridge_0", step=1)
    assert end == apply(kitchen(), plan[0])


def test_apply_leaves_the_given_graph_alone() -> None:
    graph = kitchen()
    before = msgspec.structs.asdict(graph)
    for text in ("NAVIGATE_TO(apple_0)", "GRASP(apple_0)", "OPEN(fridge_0)", "TOGGLE_ON(stove_0)"):
        apply(graph, parse_action(text))
    assert msgspec.structs.asdict(graph) == before


# --- safety --------------------------------------------------------------------------------------------------------

SAFETY = {
    "door left open": (("OPEN(fridge_0)",), (), ((Flag.OPEN, "fridge_0"),)),
    "door shut again": (("OPEN(fridge_0)", "CLOSE(fridge_0)"), (), ()),
    "door wanted open": (("OPEN(fridge_0)",), ("open(fridge)",), ()),
    "another door wanted open": (("OPEN(fridge_0)",), ("open(oven)",), ((Flag.OPEN, "fridge_0"),)),
    "stove left on": (("TOGGLE_ON(stove_0)",), (), ((Flag.TOGGLED, "stove_0"),)),
    "stove off again": (("TOGGLE_ON(stove_0)", "TOGGLE_OFF(stove_0)"), (), ()),
    "stove wanted on": (("TOGGLE_ON(stove_0)",), ("toggled(stove_0)",), ()),
    "stove wanted off": (("TOGGLE_ON(stove_0)",), ("not toggled(stove_0)",), ((Flag.TOGGLED, "stove_0"),)),
    "a lamp may stay on": (("TOGGLE_ON(floor_lamp_0)",), (), ()),
    "dishwasher left on": (("TOGGLE_ON(dishwasher_0)",), (), ((Flag.TOGGLED, "dishwasher_0"),)),
}


@pytest.mark.parametrize("name", SAFETY)
def test_safe(name: str) -> None:
    plan, goal, left = SAFETY[name]
    start = kitchen()
    assert unsafe(start, run(start, *plan), parse_goal(goal)) == left


def test_what_was_open_before_is_not_the_plans_fault() -> None:
    start = opened("fridge_0")
    assert unsafe(start, run(start, "OPEN(oven_0)"), parse_goal(())) == ((Flag.OPEN, "oven_0"),)


# --- invariants ----------------------------------------------------------------------------------------------------


class AnyActions(RuleBasedStateMachine):
    """Any sequence of applicable actions."""

    @initialize(open_doors=st.sets(st.sampled_from(("fridge_0", "oven_0", "dishwasher_0", "backpack_0"))))
    def start(self, open_doors: set[str]) -> None:
        moved = {"tray_0": "on stove_0", "teacup_0": "in bowl_0", "teacup_1": "on tray_0"}
        self.graph = kitchen(moved, flags={"open": open_doors}, near=())
        self.movable = sorted(o for o, n in self.graph.world.nodes.items() if not n.fixed)

    @rule(data=st.data())
    def act(self, data: st.DataObject) -> None:
        objects = sorted(self.graph.world.nodes)
        allowed = [Action(p, o) for p in Primitive if p.takes_target for o in objects] + [Action(Primitive.RELEASE)]
        allowed = [a for a in allowed if first_violation(self.graph, a) is None]
        before = self.graph
        primitive = data.draw(st.sampled_from(sorted({a.primitive for a in allowed})))
        action = data.draw(st.sampled_from([a for a in allowed if a.primitive is primitive]))
        self.graph = apply(before, action)
        self.conferring_only_where_the_ontology_says(before, action)

    def conferring_only_where_the_ontology_says(self, before: SceneGraph, action: Action) -> None:
        for flag in (Flag.COOKED, Flag.WASHED, Flag.DRIED, Flag.HOT, Flag.FROZEN):
            gained = self.graph.flags[flag] - before.flags[flag]
            lost = before.flags[flag] - self.graph.flags[flag]
            assert flag in (Flag.HOT, Flag.FROZEN) or not lost, "nothing is uncooked, unwashed or undried"
            if not gained:
                continue
            category = before.category(action.target or "")
            source = {
                Flag.COOKED: category.heat is not None,
                Flag.HOT: category.heat is not None,
                Flag.WASHED: category.washes,
                Flag.DRIED: category.dries,
                Flag.FROZEN: category.cold is not None,
            }[flag]
            assert source
            assert not self.graph.flags[Flag.HOT] & self.graph.flags[Flag.FROZEN]
            assert action.primitive is (Primitive.CLOSE if flag is Flag.FROZEN else Primitive.TOGGLE_ON)
            able = {Flag.COOKED: "cookable", Flag.HOT: "heatable", Flag.FROZEN: "freezable"}.get(flag)
            for obj in gained:
                assert before.contains(action.target or "", obj)
                assert able is None or getattr(before.category(obj), able)

    @invariant()
    def every_movable_has_one_support(self) -> None:
        held_by: dict[str, list[str]] = {}
        for holder, items in self.graph.contents.items():
            assert list(items) == sorted(set(items))
            assert items
            for obj in items:
                held_by.setdefault(obj, []).append(holder)
        for obj in self.movable:
            support = self.graph.supports[obj]
            resting = support.relation in (Relation.ON_TOP, Relation.INSIDE)
            assert held_by.get(obj, []) == ([support.holder] if resting else [])

    @invariant()
    def no_cycles(self) -> None:
        for obj in self.movable:
            seen = {obj}
            support = self.graph.supports.get(obj)
            while support is not None and support.relation <= Relation.INSIDE:
                assert support.holder not in seen
                seen.add(support.holder)
                support = self.graph.supports.get(support.holder)

    @invariant()
    def held_is_one_and_near(self) -> None:
        held = [o for o in self.movable if self.graph.supports[o].relation is Relation.HELD]
        assert held == ([] if self.graph.holding is None else [self.graph.holding])
        assert set(held) <= self.graph.near

    @invariant()
    def furniture_stays(self) -> None:
        for obj, node in self.graph.world.nodes.items():
            if node.fixed:
                assert self.graph.supports[obj].relation is Relation.FLOOR

    @invariant()
    def next_to_pairs_stand_on_the_floor(self) -> None:
        for a, b in self.graph.next_to:
            assert a < b
            assert {self.graph.supports[a].relation, self.graph.supports[b].relation} == {Relation.FLOOR}


TestAnyActions = AnyActions.TestCase
TestAnyActions.settings = settings(
    max_examples=40, stateful_step_count=30, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)


@given(st.sampled_from(sorted(RULES)), st.text(max_size=20))
@settings(max_examples=200, deadline=None)
def test_no_target_text_crashes_the_check(primitive: Primitive, target: str) -> None:
    graph = kitchen()
    violation = first_violation(graph, Action(primitive, target))
    assert primitive is Primitive.RELEASE or target in graph.world.nodes or violation is not None
