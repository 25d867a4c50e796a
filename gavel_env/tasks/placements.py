"""Where movables start and where they are taken: drawn after what BEHAVIOR's activities do, not after convenience.

The counts (`envs_data/placement_evidence.json`) say how often an activity puts a thing of a kind on or in a kind of
furniture in a type of room. They come from the activities' initial states and goals, never from the scenes' own
contents, which the relational semantic network is trained on: a likely room is likely, and surprises happen.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gavel_env.errors import SceneError
from gavel_env.house.floor_map import FloorMap, floor_map
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.instructions.vocabulary import Vocabulary, default_vocabulary
from gavel_env.tasks.evidence import load_evidence
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.ontology import Ontology, default_ontology

__all__ = ["House", "Piece", "Place", "load_house", "pick"]

T = TypeVar("T")

# Shares of a category's own evidence, of its theme's, and of every surface alike.
OWN, THEME, ANYWHERE = 0.74, 0.23, 0.03
# A count for furniture in one type of room counts this much for the same furniture elsewhere.
OTHER_ROOM = 0.15
# What people do not leave on the floor.
EATEN = ("dish", "tray", "hot_food", "food", "drink", "pantry")

Key = tuple[str, str, str]  # relation, holder category ("" = floor), room type ("" = any)
Counts = dict[str, dict[Key, float]]


class Piece(NamedTuple):
    """A piece of furniture that the vocabulary names."""

    id: str
    category: str
    room: str
    room_type: str


class Place(NamedTuple):
    """A support: on or in a piece, or on the floor of a room (`piece` is then None)."""

    relation: Literal["on", "in", "floor"]
    room: str
    room_type: str
    piece: Piece | None = None

    @property
    def target(self) -> str:
        """The id that a placement names."""
        return self.room if self.piece is None else self.piece.id


def pick(rng: np.random.Generator, options: Sequence[T], weights: Iterable[float] | None = None) -> T:
    """Return one option, drawn by weight with one call of `rng.random()`."""
    shares = np.cumsum([1.0] * len(options) if weights is None else list(weights))
    index = int(np.searchsorted(shares, rng.random() * shares[-1], side="right"))
    return options[min(index, len(options) - 1)]


@lru_cache(maxsize=1)
def _counts() -> tuple[Counts, Counts, Counts, Counts]:
    """Return the evidence for starts by category and by theme, and for destinations by category and by theme."""
    vocabulary, evidence = default_vocabulary(), load_evidence()
    tables: tuple[Counts, Counts, Counts, Counts] = ({}, {}, {}, {})
    for row in evidence.placed:
        if row.relation == "under":
            continue
        things = [c for c in evidence.kinds.get(row.thing, ()) if c in vocabulary.movables]
        holders = [c for c in evidence.kinds.get(row.holder, ()) if c in vocabulary.furniture]
        keys = [("floor", "", row.room)] if row.relation == "floor" else [(row.relation, h, row.room) for h in holders]
        for thing in things:
            theme = vocabulary.movables[thing].theme
            for key in keys:
                share = 1.0 / (len(things) * len(keys))
                for table, name, count in (
                    (tables[0], thing, row.at_start),
                    (tables[1], theme, row.at_start),
                    (tables[2], thing, row.at_start + row.in_goal),
                    (tables[3], theme, row.at_start + row.in_goal),
                ):
                    if count:
                        counts = table.setdefault(name, {})
                        counts[key] = counts.get(key, 0.0) + count * share
    return tables


class House:
    """A scene as the task generator sees it: nameable pieces by use, and weighted places for every movable.

    Attributes:
        scene: its file.
        graph: its graph as it stands.
        pieces: nameable furniture, in the scene's order.
        supports: every place on, in or beside them, and the floors of the rooms.
        floor: map to drive on; None = distances are not asked for.
    """

    def __init__(
        self,
        scene: Scene,
        ontology: Ontology | None = None,
        vocabulary: Vocabulary | None = None,
        floor: FloorMap | None = None,
        name: str = "",
    ) -> None:
        """Build the view.

        Args:
            scene: the scene.
            ontology: affordances; default the shipped ones.
            vocabulary: nouns; default the shipped ones.
            floor: map to drive on; pieces that the robot cannot reach are then left out.
            name: under which instructions find the scene, such as a path; default: that which it has itself.

        Raises:
            SceneError: the scene has no furniture that the vocabulary names.
        """
        self.scene = scene
        self.name = name or scene.scene
        self.ontology = ontology or default_ontology()
        self.vocabulary = vocabulary or default_vocabulary()
        self.graph: SceneGraph = scene_graph(scene, self.ontology)
        types = {room.id: room.type for room in scene.rooms}
        self.pieces = tuple(
            Piece(f.id, f.category, f.room, types[f.room])
            for f in scene.furniture
            if f.category in self.vocabulary.furniture and (floor is None or floor.stances(f.id).size)
        )
        self.floor = floor
        if not self.pieces:
            raise SceneError(f"scene {scene.scene!r} has no furniture that the vocabulary names")
        self.rooms = tuple((room.id, room.type) for room in scene.rooms)
        own = {self.graph.category(obj).name for obj in self.graph.world.nodes}
        self.movables = tuple(c for c in sorted(self.vocabulary.movables) if c not in own)
        self._room_types = dict(self.rooms)
        self._rooms_with: dict[str, tuple[str, ...]] = {}
        self._travel: dict[str, dict[str, float]] = {}
        self.supports = self._list_supports()
        self._cache: dict[tuple[str, bool], tuple[tuple[Place, ...], tuple[float, ...]]] = {}

    def _list_supports(self) -> tuple[Place, ...]:
        places: list[Place] = []
        for piece in self.pieces:
            words, category = self.vocabulary.furniture[piece.category], self.ontology[piece.category]
            if "on" in words.uses and category.surface:
                places.append(Place("on", piece.room, piece.room_type, piece))
            if "in" in words.uses and category.interior:
                places.append(Place("in", piece.room, piece.room_type, piece))
        enterable = [r for r, _ in self.rooms if self.floor is None or self.floor.room_points[r] is not None]
        floors = [Place("floor", room, kind) for room, kind in self.rooms if room in enterable]
        return (*places, *floors)

    def shuts(self, place: Place) -> bool:
        """Return whether a thing there is behind a door."""
        return place.relation == "in" and place.piece is not None and self.ontology[place.piece.category].has_door

    def travel_m(self, start: Place, piece: Piece) -> float:
        """Return the metres from a place to the nearest stance of a piece; 0 for all if the house has no map."""
        if self.floor is None:
            return 0.0
        if start.target not in self._travel:
            self._travel[start.target] = self._travel_from(self.floor, start)
        return self._travel[start.target][piece.id]

    def _travel_from(self, floor: FloorMap, start: Place) -> dict[str, float]:
        piece = start.piece
        source = floor.room_points[start.room] if piece is None else int(floor.stances(piece.id)[0])
        if source is None:
            return {p.id: 0.0 for p in self.pieces}
        field = floor.distance_field(source).ravel()
        return {p.id: float(field[floor.stances(p.id)].min()) for p in self.pieces}

    def rooms_with(self, category: str, room_type: str | None = None) -> tuple[str, ...]:
        """Return the room of each piece of a category (in rooms of a type), one entry per piece, of the whole scene."""
        if category not in self._rooms_with:
            found = map(self.graph.room_of, self.graph.world.by_category.get(category, ()))
            self._rooms_with[category] = tuple(room for room in found if room is not None)
        rooms = self._rooms_with[category]
        return rooms if room_type is None else tuple(r for r in rooms if self._room_types[r] == room_type)

    def pieces_for(self, use: str) -> list[Piece]:
        """Return the pieces that serve a use."""
        return [p for p in self.pieces if use in self.vocabulary.furniture[p.category].uses]

    def places(self, category: str, *, as_goal: bool = False) -> tuple[tuple[Place, ...], tuple[float, ...]]:
        """Return every support of the house and its weight for a movable category.

        Args:
            category: of the movable.
            as_goal: weigh places as destinations (initial states and goals; never the floor) instead of as starts.
        """
        key = (category, as_goal)
        if key not in self._cache:
            self._cache[key] = self._weigh(category, as_goal)
        return self._cache[key]

    def _weigh(self, category: str, as_goal: bool) -> tuple[tuple[Place, ...], tuple[float, ...]]:
        by_category, by_theme = _counts()[2:] if as_goal else _counts()[:2]
        places = tuple(p for p in self.supports if not (as_goal and p.relation == "floor"))
        own = self._fit(places, by_category.get(category, {}))
        theme = self._fit(places, by_theme.get(self.vocabulary.movables[category].theme, {}))
        weights = (OWN * own + THEME * theme) * np.array([self.suits(p, category) for p in places], dtype=float)
        if as_goal:
            return places, tuple(float(w) for w in weights)
        open_places = np.array([p.relation == "on" for p in places], dtype=float)
        weights = weights + ANYWHERE * open_places / max(1.0, float(open_places.sum()))
        return places, tuple(float(w) for w in weights)

    def suits(self, place: Place, category: str) -> bool:
        """Return whether a movable is plausibly put at a place."""
        theme = self.vocabulary.movables[category].theme
        if place.piece is None:
            return theme not in EATEN
        suits = self.vocabulary.furniture[place.piece.category].suits
        return not suits or theme in suits

    @staticmethod
    def _fit(places: tuple[Place, ...], counts: Mapping[Key, float]) -> NDArray[np.float64]:
        """Spread counts over the fitting places, each count evenly, flattened by a square root; scale to 1."""
        weights = np.zeros(len(places))
        groups: dict[Key, list[int]] = {}
        for index, place in enumerate(places):
            holder = "" if place.piece is None else place.piece.category
            groups.setdefault((place.relation, holder, place.room_type), []).append(index)
            groups.setdefault((place.relation, holder, ""), []).append(index)
        for key, count in counts.items():
            if key in groups:
                weights[groups[key]] += np.sqrt(count) / len(groups[key])
            anywhere = (key[0], key[1], "")
            if key[2] and anywhere in groups:
                weights[groups[anywhere]] += OTHER_ROOM * np.sqrt(count) / len(groups[anywhere])
        total = float(weights.sum())
        return weights / total if total > 0 else weights


@lru_cache(maxsize=64)
def load_house(scene: str) -> House:
    """Return the generator's view of a shipped scene or a scene file.

    Raises:
        UnknownScene, SceneError: as `scenes.load_scene`.
    """
    found = load_scene(scene)
    return House(found, floor=floor_map(found), name=scene)
