"""Worlds drawn from the belief: in which rooms, at which points, and what they have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.floor_scenes import flat

from gavel_agents.ordering.knowledge import Knowledge, Spot
from gavel_agents.ordering.simulator import Simulator
from gavel_env.house.floor_map import FloorMap, known_layout

COUNT = 1000


@pytest.fixture(scope="module")
def layout() -> FloorMap:
    return known_layout(flat())


def known_in(layout: FloorMap, beliefs: Mapping[str, Mapping[str, float]], **more: Any) -> Knowledge:
    """Return what is known where nothing was seen, with beliefs by room."""
    rooms = tuple(room for room in layout.room_ids if layout.room_points[room] is not None)
    vectors = {thing: np.array([of.get(room, 0.0) for room in rooms]) for thing, of in beliefs.items()}
    nothing = np.zeros(layout.shape, np.bool_)
    return Knowledge(layout.start, nothing, frozenset(), {}, vectors, {}, rooms, None)._replace(**more)


def drawn(simulator: Simulator, known: Knowledge) -> NDArray[np.int16]:
    """Return (worlds,) places of the one thing."""
    places: NDArray[np.int16] = simulator.worlds(list(known.belief), known).places[:, 0]
    return places


def counts(simulator: Simulator, places: NDArray[np.int16]) -> dict[str, int]:
    """Return in how many worlds a thing is in each room that it is in."""
    rooms = simulator.points.room[places]
    return {simulator.layout.room_ids[room]: int((rooms == room).sum()) for room in np.unique(rooms)}


def test_rooms_are_drawn_as_often_as_they_are_believed(layout: FloorMap) -> None:
    simulator = Simulator(layout, worlds=COUNT)
    belief = {"kitchen_0": 0.5, "study_0": 0.3, "living_room_0": 0.2}
    places = drawn(simulator, known_in(layout, {"a": belief}))
    assert counts(simulator, places) == pytest.approx({room: p * COUNT for room, p in belief.items()}, abs=2)


def test_every_point_of_a_room_is_as_likely(layout: FloorMap) -> None:
    simulator = Simulator(layout, worlds=COUNT)
    inside = np.nonzero(simulator.points.room == layout.room_index["study_0"])[0]
    places = drawn(simulator, known_in(layout, {"a": {"study_0": 1.0}}))
    found, often = np.unique(places, return_counts=True)
    assert found.tolist() == inside.tolist()
    assert often == pytest.approx(np.full(len(inside), COUNT / len(inside)), abs=2)


def test_a_room_counts_by_its_share_of_points_that_still_hide_something(layout: FloorMap) -> None:
    simulator = Simulator(layout, worlds=COUNT)
    kitchen = layout.rooms == layout.room_index["kitchen_0"]
    half = kitchen & (np.arange(layout.shape[0])[:, None] < layout.shape[0] // 2)
    belief = {"kitchen_0": 0.5, "study_0": 0.5}
    places = drawn(simulator, known_in(layout, {"a": belief}, seen=half))
    points = simulator.points
    seen = half.ravel()[points.cells]
    lit = np.array([any(seen[64 * k + bit] for k, word in enumerate(words) for bit in range(64) if word >> bit & 1)
                    for words in points.reveals.tolist()])  # fmt: skip
    mine = points.room == layout.room_index["kitchen_0"]
    share = float((mine & ~lit).sum() / mine.sum())
    assert 0.1 < share < 0.9
    assert not lit[places].any()
    expected = {"kitchen_0": COUNT * share / (share + 1.0), "study_0": COUNT / (share + 1.0)}
    assert counts(simulator, places) == pytest.approx(expected, abs=2)
    _, often = np.unique(places[mine[places]], return_counts=True)
    assert often.max() - often.min() <= 3


def test_where_everything_was_seen_the_thing_is_where_it_is_believed_to_be(layout: FloorMap) -> None:
    simulator = Simulator(layout, worlds=COUNT)
    belief = {"kitchen_0": 0.25, "study_0": 0.75}
    places = drawn(simulator, known_in(layout, {"a": belief}, seen=layout.floor))
    assert counts(simulator, places) == pytest.approx({room: p * COUNT for room, p in belief.items()}, abs=2)


def test_what_is_believed_nowhere_is_anywhere(layout: FloorMap) -> None:
    simulator = Simulator(layout, worlds=COUNT)
    found, often = np.unique(drawn(simulator, known_in(layout, {"a": {}})), return_counts=True)
    assert found.tolist() == list(range(len(simulator.points.cells)))
    assert often == pytest.approx(np.full(len(found), COUNT / len(found)), abs=2)


def test_a_seed_is_a_set_of_worlds_and_things_are_drawn_apart(layout: FloorMap) -> None:
    belief = {"kitchen_0": 0.5, "study_0": 0.5}
    known = known_in(layout, {"a": belief, "b": belief})

    def places(**options: int) -> list[list[int]]:
        found: list[list[int]] = Simulator(layout, **options).worlds(["a", "b"], known).places.tolist()
        return found

    assert places(seed=3) == places(seed=3) != places(seed=4)
    assert places(seed=0) == places()
    simulator = Simulator(layout, worlds=COUNT)
    in_study = simulator.points.room[simulator.worlds(["a", "b"], known).places] == layout.room_index["study_0"]
    assert float(in_study.all(axis=1).mean()) == pytest.approx(0.25, abs=0.05)


def test_an_instance_stands_at_a_point_of_its_own_room(layout: FloorMap) -> None:
    simulator = Simulator(layout)
    behind_the_wall = Spot(4.3, 1.0, "kitchen_0")
    known = known_in(layout, {"a": {"kitchen_0": 1.0}}, where={"a": [behind_the_wall]})
    [point] = simulator.worlds(["a"], known).choices.tolist()
    assert layout.room_ids[simulator.points.room[point]] == "kitchen_0"
    nearest = simulator.points.nearest(layout, behind_the_wall.x, behind_the_wall.y)
    assert layout.room_ids[simulator.points.room[nearest]] == "hall_0"
