"""Sight points: distances are those of the map, ways lead there, walls stop sight, and the cache only saves time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.floor_scenes import flat

from gavel_env.house import sight_points as module
from gavel_env.house.floor_map import FloorMap, known_layout
from gavel_env.house.scenes import load_scene
from gavel_env.house.sight_points import HEADINGS, SightPoints, bits, sight_points


def marked(words: np.ndarray, count: int) -> np.ndarray:
    """Undo `bits`."""
    single = np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=-1, bitorder="little")[..., :count]
    return np.equal(single, 1)


@pytest.fixture(scope="module", params=["flat", "Rs_int"])
def layout(request: pytest.FixtureRequest) -> FloorMap:
    return known_layout(flat() if request.param == "flat" else load_scene(request.param))


@pytest.fixture(scope="module")
def points(layout: FloorMap) -> SightPoints:
    return sight_points(layout)


def test_bits_keep_every_point() -> None:
    rows = np.random.default_rng(0).random((3, 130)) < 0.5
    assert bits(rows).shape == (3, 3)
    assert (marked(bits(rows), 130) == rows).all()


def test_every_bit_of_floor_is_near_a_point_of_its_room(layout: FloorMap, points: SightPoints) -> None:
    cells = np.nonzero(layout.floor.ravel())[0].astype(np.int32)
    away = np.linalg.norm(layout.points(cells)[:, None] - layout.points(points.cells)[None], axis=2)
    away[layout.rooms.ravel()[cells][:, None] != points.room[None]] = np.inf
    assert away.min(axis=1).max() < 0.71


def test_distances_are_those_of_the_map(layout: FloorMap, points: SightPoints) -> None:
    stands = np.unique(points.stand)
    rng = np.random.default_rng(1)
    for a, b in rng.choice(stands, (60, 2)):
        exact = layout.distance(int(points.cells[a]), (int(points.cells[b]),))
        assert exact is not None
        assert exact - 1e-4 <= points.metres[a, b] <= 1.03 * exact + 1e-4
    assert (points.metres == points.metres.T).all()


def test_ways_lead_to_the_goal(layout: FloorMap, points: SightPoints) -> None:
    stands = np.unique(points.stand)
    for a, b in np.random.default_rng(2).choice(stands, (100, 2)):
        at, steps, driven = int(a), 0, 0.0
        while at != b:
            onward = int(points.onward[at, b])
            assert points.metres[onward, b] < points.metres[at, b]
            assert layout.reachable.flat[points.cells[onward]]
            driven += float(points.metres[at, onward])
            at, steps = onward, steps + 1
            assert steps < len(stands)
        assert driven <= 1.15 * float(points.metres[a, b]) + 0.3


def test_sight_is_mutual_bounded_and_stopped_by_walls(layout: FloorMap, points: SightPoints) -> None:
    count = len(points.cells)
    sees = marked(points.around, count)
    assert (sees == sees.T).all()
    place = layout.points(points.cells)
    assert np.linalg.norm(place[:, None] - place[None], axis=2)[sees].max() <= layout.robot.camera_range_m + 1e-6
    ahead = marked(points.ahead, count)
    assert not (ahead & ~sees[:, None, :]).any()
    assert (ahead.any(axis=1) == sees).all()
    assert 0.1 < ahead.mean() / sees.mean() < 0.35
    assert ahead.shape[1] == HEADINGS


def test_walls_of_the_flat_stop_sight_reach_and_travel() -> None:
    layout = known_layout(flat())
    points = sight_points(layout)
    room = {name: points.room == layout.room_index[name] for name in layout.room_ids}
    sees, reach = marked(points.around, len(points.cells)), marked(points.reach, len(points.cells))
    place = layout.points(points.cells)
    for a, b in np.random.default_rng(3).integers(len(points.cells), size=(500, 2)):
        if np.linalg.norm(place[a] - place[b]) <= layout.robot.camera_range_m:
            line = place[a] + np.linspace(0.0, 1.0, 400)[:, None] * (place[b] - place[a])
            met = {layout.cell_at(x, y) for x, y in line}
            assert None not in met
            assert sees[a, b] <= (not any(layout.opaque.flat[cell] for cell in met if cell is not None))
    assert sees[np.ix_(room["hall_0"], room["kitchen_0"])].any()
    assert not reach[np.ix_(room["hall_0"], room["kitchen_0"])].any()
    pantry = layout.room_index["pantry_0"]
    assert (points.entry[:, pantry] == -1).all()
    assert (points.stand[room["pantry_0"]] != np.nonzero(room["pantry_0"])[0]).all()
    revealing = marked(points.reveals, len(points.cells))
    assert all(points.room[i] == points.room[j] for i, j in zip(*np.nonzero(revealing), strict=True))


def test_the_entry_of_a_room_is_its_nearest_point(layout: FloorMap, points: SightPoints) -> None:
    enterable = points.stand == np.arange(len(points.cells))
    for room in range(len(layout.room_ids)):
        members = np.nonzero(enterable & (points.room == room))[0]
        if members.size:
            nearest = points.metres[:, members].min(axis=1)
            assert (points.metres[np.arange(len(points.cells)), points.entry[:, room]] == nearest).all()


def _same(a: SightPoints, b: SightPoints) -> bool:
    ours: tuple[Any, ...] = a
    theirs: tuple[Any, ...] = b
    return all(np.array_equal(x, y) and x.dtype == y.dtype for x, y in zip(ours, theirs, strict=True))


def test_the_cache_gives_back_what_was_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = known_layout(flat())
    monkeypatch.setenv("GAVEL_CACHE", str(tmp_path / "cache"))
    fresh = sight_points.__wrapped__(layout)
    [file] = (tmp_path / "cache" / "sight").iterdir()

    def never(_: FloorMap) -> SightPoints:
        raise AssertionError("computed again")

    with monkeypatch.context() as patch:
        patch.setattr(module, "_compute", never)
        assert _same(sight_points.__wrapped__(layout), fresh)
        with pytest.raises(AssertionError, match="computed again"):
            sight_points.__wrapped__(known_layout(load_scene("Rs_int")))
    file.write_bytes(file.read_bytes()[:1000])
    assert _same(sight_points.__wrapped__(layout), fresh)
    file.write_bytes(b"")
    assert _same(sight_points.__wrapped__(layout), fresh)


def test_without_a_folder_to_write_it_still_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = known_layout(flat())
    monkeypatch.setenv("GAVEL_CACHE", str(tmp_path / "cache"))
    fresh = sight_points.__wrapped__(layout)
    blocked = tmp_path / "a file"
    blocked.write_text("in the way")
    monkeypatch.setenv("GAVEL_CACHE", str(blocked))
    assert _same(sight_points.__wrapped__(layout), fresh)
    assert blocked.read_text() == "in the way"
    assert os.listdir(tmp_path / "cache" / "sight") == [f"{module._fingerprint(layout)}.npz"]
