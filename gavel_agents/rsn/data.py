"""Where things stand in the 51 scenes: the placements that the location priors learn from and are scored on.

A *query* is (scene, room, category): a room that holds the category, and a belief over all rooms of its scene is asked
to name it. Building parts, and categories of fewer than three scenes, ask no queries (Sec. "Belief Initialization" of
the paper trains on 197 categories; this rule gives 201).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from gavel_env.data import read_json, shipped_data
from gavel_env.house.scenes import BENCHMARK_HOUSES

__all__ = [
    "BENCHMARK_HOUSES",
    "Contents",
    "Query",
    "RoomInfo",
    "category_folds",
    "house_of",
    "known_categories",
    "load_contents",
    "placements",
    "queries",
    "room_types",
    "scene_folds",
    "training_scenes",
]

FORMAT = "gavel-room-contents/1"
MINIMUM_SCENES = 3
MOST_PER_ROOM = 50
"""A shop's 1,411 apples in one room count as this many placements."""


class RoomInfo(NamedTuple):
    """What a prior knows of a room: id, type, and floor area (m²; None = unknown)."""

    id: str
    type: str
    area_m2: float | None = None


class RoomRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A room of a scene and what it holds: category -> number of instances."""

    id: str
    type: str
    area_m2: float | None
    contents: dict[str, int]

    @property
    def info(self) -> RoomInfo:
        """The room as a prior sees it: without its contents."""
        return RoomInfo(self.id, self.type, self.area_m2)


class Contents(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole table: parts of the building by category, and scene -> rooms."""

    format: str
    provenance: str
    structure: tuple[str, ...]
    scenes: dict[str, tuple[RoomRecord, ...]]

    def rooms(self, scene: str) -> tuple[RoomInfo, ...]:
        """Return a scene's rooms as a prior sees them."""
        return tuple(room.info for room in self.scenes[scene])


class Query(NamedTuple):
    """Which room of `scene` holds `category`? Row `room` of its rooms does (`instances` of it)."""

    scene: str
    category: str
    room: int
    instances: int


def load_contents(path: Path | None = None) -> Contents:
    """Read and validate a table of room contents (default: the shipped one, read once).

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    return _read(path or shipped_data("room_contents.json"))


@cache
def _read(path: Path) -> Contents:
    return read_json(path, Contents, "room contents", version=FORMAT)


def house_of(scene: str) -> str:
    """Return the house of a scene: `X_garden` and `X_int` are one house (65-84 % of their models are shared)."""
    return scene.removesuffix("_garden").removesuffix("_int")


def training_scenes(contents: Contents) -> tuple[str, ...]:
    """Return the scenes that the shipped priors may learn from: no benchmark house, nor a garden twin of one."""
    held_out = {house_of(scene) for scene in BENCHMARK_HOUSES}
    return tuple(scene for scene in sorted(contents.scenes) if house_of(scene) not in held_out)


def known_categories(contents: Contents) -> tuple[str, ...]:
    """Return the categories that ask queries, sorted."""
    scenes_of: dict[str, set[str]] = {}
    for scene, rooms in contents.scenes.items():
        for room in rooms:
            for category in room.contents:
                scenes_of.setdefault(category, set()).add(scene)
    structure = frozenset(contents.structure)
    return tuple(sorted(c for c, at in scenes_of.items() if len(at) >= MINIMUM_SCENES and c not in structure))


def room_types(contents: Contents, scenes: Iterable[str]) -> tuple[str, ...]:
    """Return the room types of some scenes, sorted."""
    return tuple(sorted({room.type for scene in scenes for room in contents.scenes[scene]}))


def queries(contents: Contents, scenes: Iterable[str], categories: Iterable[str]) -> list[Query]:
    """Return every query of the scenes, in order of scene, category and room."""
    categories = tuple(categories)
    return [
        Query(scene, category, i, min(count, MOST_PER_ROOM))
        for scene in sorted(scenes)
        for category in categories
        for i, room in enumerate(contents.scenes[scene])
        if (count := room.contents.get(category, 0))
    ]


def placements(
    contents: Contents, scenes: Iterable[str], categories: Sequence[str], types: Sequence[str]
) -> np.ndarray:
    """Return the number of instances of each category in rooms of each type, (categories, types) float64."""
    row = {c: i for i, c in enumerate(categories)}
    column = {t: i for i, t in enumerate(types)}
    counts = np.zeros((len(row), len(column)))
    for query in queries(contents, scenes, categories):
        counts[row[query.category], column[contents.scenes[query.scene][query.room].type]] += query.instances
    return counts


def scene_folds(contents: Contents, count: int, seed: int) -> tuple[tuple[str, ...], ...]:
    """Split the scenes into folds of whole houses."""
    houses = sorted({house_of(scene) for scene in contents.scenes})
    order = np.random.default_rng(seed).permutation(len(houses))
    fold_of = {houses[house]: rank % count for rank, house in enumerate(order)}
    return tuple(tuple(s for s in sorted(contents.scenes) if fold_of[house_of(s)] == f) for f in range(count))


def category_folds(categories: Sequence[str], count: int, seed: int) -> tuple[tuple[str, ...], ...]:
    """Split the categories into folds, for the score on categories never seen."""
    order = np.random.default_rng([seed, 1]).permutation(len(categories))
    fold_of = {categories[category]: rank % count for rank, category in enumerate(order)}
    return tuple(tuple(c for c in categories if fold_of[c] == f) for f in range(count))
