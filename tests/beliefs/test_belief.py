"""The belief over rooms: what is stated, what is seen, what is ruled out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.counting import calls_of

from gavel_agents.beliefs.belief import Belief, load_prior
from gavel_agents.rsn import RoomInfo
from gavel_env.house.floor_map import known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.world_model.graph import Node, Relation, Room, SceneGraph, Support, World
from gavel_env.world_model.ontology import category_of, default_ontology

HOUSE = (
    RoomInfo("kitchen_0", "kitchen", 14.0),
    RoomInfo("bathroom_0", "bathroom", 6.0),
    RoomInfo("bathroom_1", "bathroom", 6.0),
    RoomInfo("bedroom_0", "bedroom", 15.0),
    RoomInfo("living_room_0", "living_room", 30.0),
)
NAMES = tuple(room.id for room in HOUSE)
ROOMS = {room.id: Room(room.id, room.type) for room in HOUSE}


@dataclass(frozen=True)
class Seen:
    """An observation: what the belief reads of it."""

    graph: SceneGraph
    searched: frozenset[str] = field(default=frozenset())


def believed(nodes: Iterable[str], supports: Mapping[str, tuple[Relation, str]] | None = None) -> SceneGraph:
    """Return a believed graph over designators `category` or `category@room`."""
    ontology = default_ontology()
    entries = {}
    for text in nodes:
        name, _, room = text.partition("@")
        category = ontology[name]
        entries[text] = Node(text, category, not category.graspable, room or None)
    graph = SceneGraph(World.of(ROOMS, frozenset(), entries), {}, {}, robot_room="kitchen_0")
    for node, (relation, holder) in (supports or {}).items():
        graph = graph.place(node, Support(relation, holder))
    return graph


def sight(places: Mapping[str, str] | None = None, searched: Iterable[str] = ()) -> Seen:
    """Return an observation of instances `id -> room or holder it stands on`, and of searched rooms."""
    ontology = default_ontology()
    nodes = {}
    for instance in places or {}:
        category = ontology[category_of(instance)]
        nodes[instance] = Node(instance, category, not category.graspable)
    graph = SceneGraph(World.of(ROOMS, frozenset(), nodes), {}, {}, robot_room="kitchen_0")
    for instance, place in (places or {}).items():
        graph = graph.place(instance, Support(Relation.FLOOR if place in ROOMS else Relation.ON_TOP, place))
    return Seen(graph, frozenset(searched))


def flat(category: str, rooms: Sequence[RoomInfo]) -> NDArray[np.float64]:
    """A prior that prefers earlier rooms: 5/15, 4/15, ... over five."""
    weights = np.arange(len(rooms), 0, -1, dtype=np.float64)
    shares: NDArray[np.float64] = weights / weights.sum()
    return shares


def start(graph: SceneGraph) -> Belief:
    return Belief.over(graph, HOUSE, flat)


def of(belief: Belief, node: str) -> dict[str, object]:
    return {room: pytest.approx(p) for room, p in belief.priors()[node].items()}


def test_nothing_stated_is_the_prior() -> None:
    belief = start(believed(["apple"]))
    np.testing.assert_allclose(belief["apple"], np.array([5, 4, 3, 2, 1]) / 15)
    assert belief.most_likely("apple") == "kitchen_0"
    assert belief.likely()["apple"] == list(NAMES)
    assert not belief.refuted


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ("apple@bedroom", {"bedroom_0": 1.0}),
        ("apple@bedroom_0", {"bedroom_0": 1.0}),
        ("apple@bathroom", {"bathroom_0": 4 / 7, "bathroom_1": 3 / 7}),
    ],
)
def test_stated_room_bounds_the_belief(node: str, expected: dict[str, float]) -> None:
    assert start(believed([node])).priors()[node] == {r: pytest.approx(p) for r, p in expected.items()}


def test_stated_room_that_cannot_be_reached_leaves_the_prior() -> None:
    belief = start(believed(["apple@garage"]))
    np.testing.assert_allclose(belief["apple@garage"], flat("apple", HOUSE))


def test_stated_room_that_the_prior_rules_out_is_still_believed() -> None:
    belief = Belief.over(believed(["apple@bathroom"]), HOUSE, lambda _, rooms: np.eye(len(rooms))[0])
    assert belief.priors()["apple@bathroom"] == {"bathroom_0": 0.5, "bathroom_1": 0.5}


def test_contents_inherit_the_belief_of_what_holds_them() -> None:
    graph = believed(
        ["steak", "countertop@bathroom", "bowl"],
        {"steak": (Relation.ON_TOP, "bowl"), "bowl": (Relation.ON_TOP, "countertop@bathroom")},
    )
    belief = start(graph)
    for node in ("steak", "bowl"):
        np.testing.assert_array_equal(belief[node], belief["countertop@bathroom"])


def test_searched_room_leaves_the_support() -> None:
    graph = believed(["apple"])
    belief = start(graph).update(graph, sight(searched=["kitchen_0", "bathroom_0"]), {})
    assert belief.priors()["apple"] == {
        "bathroom_1": pytest.approx(3 / 6),
        "bedroom_0": pytest.approx(2 / 6),
        "living_room_0": pytest.approx(1 / 6),
    }


def test_bound_object_is_where_it_was_seen_also_in_a_searched_room() -> None:
    graph = believed(["apple"])
    belief = start(graph).update(graph, sight({"apple_3": "bedroom_0"}, ["bedroom_0"]), {"apple": "apple_3"})
    assert belief.priors()["apple"] == {"bedroom_0": 1.0}


def test_seen_candidate_localises_and_one_of_a_wrong_room_does_not() -> None:
    graph = believed(["apple", "bowl@kitchen"])
    belief = start(graph).update(graph, sight({"apple_3": "bedroom_0", "bowl_0": "bedroom_0"}), {})
    assert belief.priors()["apple"] == {"bedroom_0": 1.0}
    assert belief.priors()["bowl@kitchen"] == {"kitchen_0": 1.0}


def test_instance_that_another_object_is_bound_to_is_no_candidate() -> None:
    graph = believed(["apple", "apple@bedroom"])
    belief = start(graph).update(graph, sight({"apple_3": "bedroom_0"}), {"apple@bedroom": "apple_3"})
    assert len(belief.priors()["apple"]) == len(HOUSE)


def test_several_candidates_share_by_the_prior() -> None:
    graph = believed(["bookcase"])
    belief = start(graph).update(graph, sight({"bookcase_0": "kitchen_0", "bookcase_1": "living_room_0"}), {})
    assert belief.priors()["bookcase"] == {"kitchen_0": pytest.approx(5 / 6), "living_room_0": pytest.approx(1 / 6)}


def test_open_piece_is_where_its_unseen_contents_are() -> None:
    """A countertop without the steak is not the countertop with the steak."""
    graph = believed(["steak", "countertop"], {"steak": (Relation.ON_TOP, "countertop")})
    belief = start(graph).update(graph, sight({"countertop_0": "kitchen_0"}, ["kitchen_0"]), {})
    for node in ("steak", "countertop"):
        assert belief.priors()[node].get("kitchen_0", 0.0) == 0.0
        assert "bathroom_0" in belief.priors()[node]
    seen = sight({"countertop_1": "living_room_0", "steak_0": "countertop_1"}, ["kitchen_0"])
    found = belief.update(graph, seen, {})
    assert found.priors()["steak"] == found.priors()["countertop"] == {"living_room_0": 1.0}


def test_search_does_not_refute_what_stands_behind_a_door() -> None:
    graph = believed(["steak", "fridge"], {"steak": (Relation.INSIDE, "fridge")})
    belief = start(graph).update(graph, sight({"fridge_0": "kitchen_0"}, ["kitchen_0"]), {})
    assert belief.priors()["steak"] == belief.priors()["fridge"] == {"kitchen_0": 1.0}
    assert not belief.refuted


def test_contents_follow_a_bound_container() -> None:
    graph = believed(["steak", "fridge"], {"steak": (Relation.INSIDE, "fridge")})
    seen = sight({"fridge_0": "kitchen_0", "fridge_1": "bedroom_0"}, ["kitchen_0", "bedroom_0"])
    belief = start(graph).update(graph, seen, {"fridge": "fridge_1"})
    assert belief.priors()["steak"] == {"bedroom_0": 1.0}


def test_refuted_statement_falls_back_to_rooms_not_searched_then_to_all() -> None:
    graph = believed(["apple@bedroom"])
    belief = start(graph).update(graph, sight(searched=["bedroom_0", "kitchen_0"]), {})
    assert belief.refuted == {"apple@bedroom"}
    assert sorted(belief.priors()["apple@bedroom"]) == ["bathroom_0", "bathroom_1", "living_room_0"]
    assert belief["apple@bedroom"].sum() == pytest.approx(1.0)
    lost = belief.update(graph, sight(searched=NAMES), {})
    assert lost.refuted == {"apple@bedroom"}
    np.testing.assert_allclose(lost["apple@bedroom"], 0.2)


def test_refuted_floor_and_its_dependents_are_flagged() -> None:
    graph = believed(
        ["steak", "countertop"], {"steak": (Relation.ON_TOP, "countertop"), "countertop": (Relation.FLOOR, "bedroom_0")}
    )
    belief = start(graph)
    assert belief.priors()["steak"] == {"bedroom_0": 1.0}
    belief = belief.update(graph, sight(searched=["bedroom_0"]), {})
    assert belief.refuted == {"steak", "countertop"}
    assert belief["steak"][NAMES.index("bedroom_0")] == 0.0


def test_what_is_held_is_where_the_robot_is() -> None:
    graph = believed(["apple"]).place("apple", Support(Relation.HELD, "robot"))
    assert start(graph).priors()["apple"] == {"kitchen_0": 1.0}


def test_what_is_held_is_there_also_in_a_room_that_was_searched() -> None:
    graph = believed(["apple"]).place("apple", Support(Relation.HELD, "robot"))
    belief = start(graph).update(graph, sight(searched=NAMES[:2]), {})
    assert belief.priors()["apple"] == {"kitchen_0": 1.0}
    assert not belief.refuted


def test_an_instance_of_no_known_room_is_passed_over() -> None:
    graph = believed(["apple"])
    seen = sight({"apple_0": "bowl_9", "apple_1": "bedroom_0"})
    assert seen.graph.room_of("apple_0") is None
    assert start(graph).update(graph, seen, {}).priors()["apple"] == {"bedroom_0": 1.0}


def test_likely_rooms_are_the_possible_ones_by_decreasing_belief() -> None:
    weights = np.array([0.1, 0.4, 0.0, 0.4, 0.1])
    belief = Belief.over(believed(["apple"]), HOUSE, lambda _, rooms: weights)
    assert belief.likely() == {"apple": ["bathroom_0", "bedroom_0", "kitchen_0", "living_room_0"]}


def test_collapsed_commits_to_the_most_likely_room() -> None:
    graph = believed(["apple", "bowl@bathroom"])
    belief = start(graph).collapsed()
    assert belief.priors() == {"apple": {"kitchen_0": 1.0}, "bowl@bathroom": {"bathroom_0": 1.0}}


def test_vectors_cannot_be_written() -> None:
    belief = start(believed(["apple"]))
    with pytest.raises(ValueError, match="read-only"):
        belief["apple"][0] = 1.0


def test_no_reachable_room_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one reachable room"):
        Belief.over(believed(["apple"]), [], flat)


def test_initial_reads_the_layout() -> None:
    layout = known_layout(load_scene("Rs_int"))
    rooms = tuple(r for r in layout.room_ids if layout.room_points[r] is not None)
    belief = Belief.initial(believed(["toilet", "oven"]), layout, rooms, load_prior("choice"))
    assert belief.rooms == rooms
    asked: list[RoomInfo] = []

    def prior(category: str, rooms: Sequence[RoomInfo]) -> NDArray[np.float64]:
        asked.extend(rooms)
        return flat(category, rooms)

    Belief.initial(believed(["toilet"]), layout, rooms, prior)
    areas = {room.id: (room.type, room.area_m2) for room in layout.scene.rooms}
    assert {info.id: (info.type, info.area_m2) for info in asked} == {room: areas[room] for room in rooms}
    assert belief.most_likely("toilet") == "bathroom_0"
    assert belief.most_likely("oven") == "kitchen_0"


NODES = ("apple", "steak", "bowl@bathroom", "countertop", "fridge", "bookcase@garage")


@st.composite
def situations(draw: st.DrawFn) -> tuple[SceneGraph, list[Seen], dict[str, str]]:
    """Draw a believed graph, a growing observation and bindings."""
    supports = {}
    if draw(st.booleans()):
        supports["steak"] = (Relation.ON_TOP, "countertop")
    if draw(st.booleans()):
        supports["apple"] = (Relation.INSIDE, "fridge")
    if draw(st.booleans()):
        supports["fridge"] = (Relation.FLOOR, draw(st.sampled_from(NAMES)))
    places: dict[str, str] = {}
    searched: set[str] = set()
    seen = []
    for _ in range(draw(st.integers(1, 4))):
        searched |= draw(st.sets(st.sampled_from(NAMES)))
        for category in draw(st.sets(st.sampled_from(["apple", "steak", "bowl", "countertop", "fridge"]))):
            places.setdefault(f"{category}_{draw(st.integers(0, 1))}", draw(st.sampled_from(NAMES)))
        seen.append(sight(places, searched))
    ids = sorted(places)
    bound = {}
    for node in ("apple", "countertop"):
        options = [i for i in ids if category_of(i) == node]
        if len(options) > 0 and draw(st.booleans()):
            bound[node] = draw(st.sampled_from(options))
    return believed(NODES, supports), seen, bound


@given(situations())
@settings(max_examples=300, deadline=None)
def test_update_keeps_its_promises(situation: tuple[SceneGraph, list[Seen], dict[str, str]]) -> None:
    graph, sights, bound = situation
    belief = start(graph)
    for seen in sights:
        belief = belief.update(graph, seen, bound if seen is sights[-1] else {})
        assert set(belief) == set(NODES)
        for vector in belief.values():
            assert vector.min() >= 0.0
            assert vector.sum() == pytest.approx(1.0, abs=1e-9)
    final = sights[-1]
    categories = {final.graph.category(i).name for i in final.graph.world.nodes}
    for node, vector in belief.items():
        if node in bound:
            assert belief.most_likely(node) == final.graph.room_of(bound[node])
            assert vector.max() == 1.0
        elif graph.category(node).name not in categories and node not in graph.supports:
            contents = [c for c in graph.contents.get(node, ()) if c not in bound]
            if any(graph.category(c).name in categories for c in contents):
                continue
            left = [i for i, room in enumerate(NAMES) if room not in final.searched]
            for i, room in enumerate(NAMES):
                if room in final.searched and left:
                    assert vector[i] == 0.0
            if not left:
                assert node in belief.refuted


@given(situations())
@settings(max_examples=100, deadline=None)
def test_update_depends_on_all_that_was_observed_and_not_on_the_way(
    situation: tuple[SceneGraph, list[Seen], dict[str, str]],
) -> None:
    graph, sights, bound = situation
    step_by_step = start(graph)
    for seen in sights:
        step_by_step = step_by_step.update(graph, seen, bound if seen is sights[-1] else {})
    at_once = start(graph).update(graph, sights[-1], bound)
    assert step_by_step.refuted == at_once.refuted
    for node in NODES:
        np.testing.assert_array_equal(step_by_step[node], at_once[node])


def test_an_update_takes_work_in_proportion_to_the_nodes() -> None:
    categories = [c.name for c in default_ontology().values() if c.graspable]

    def work(count: int) -> int:
        graph = believed(categories[:count])
        belief = start(graph)
        seen = sight({f"{name}_0": "kitchen_0" for name in categories[:count:2]}, ["kitchen_0", "bedroom_0"])
        return calls_of(lambda: belief.update(graph, seen, {categories[0]: f"{categories[0]}_0"}))

    assert work(80) < 2.2 * work(40)
