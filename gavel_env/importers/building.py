"""What every importer needs: names that plans can write, categories that are known, and supports from boxes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from gavel_env.data import read_bytes
from gavel_env.errors import GraphError
from gavel_env.world_model.actions import normalise_name
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.graph_file import (
    FORMAT,
    ConnectionEntry,
    GraphFile,
    NodeEntry,
    RobotEntry,
    RoomEntry,
    graph_from,
)
from gavel_env.world_model.layout import Point
from gavel_env.world_model.ontology import Category, Ontology, default_ontology
from gavel_env.world_model.own_categories import OwnCategory

__all__ = ["Box", "Builder", "Imported", "decode", "word_of"]

T = TypeVar("T")

Source = str | bytes | Path | Mapping[str, Any] | list[Any]


class Imported(NamedTuple):
    """What an importer returns.

    Attributes:
        file: the graph as a file says it; `save` writes it.
        names: id in the graph -> id in the source.
    """

    file: GraphFile
    names: Mapping[str, str]

    def graph(self, ontology: Ontology | None = None) -> SceneGraph:
        """Return the graph."""
        return graph_from(self.file, ontology, "imported graph")

    def save(self, path: str | Path) -> None:
        """Write the graph as `gavel-graph/1`."""
        Path(path).write_bytes(msgspec.json.format(msgspec.json.encode(self.file), indent=2))


class Box(NamedTuple):
    """An axis-aligned box in metres, z upwards."""

    centre: Point
    size: Point

    @property
    def bottom(self) -> float:
        """Height of its lower face."""
        return self.centre[2] - self.size[2] / 2

    @property
    def top(self) -> float:
        """Height of its upper face."""
        return self.centre[2] + self.size[2] / 2

    @property
    def footprint(self) -> tuple[tuple[float, float], ...]:
        """Its outline on the floor."""
        (x, y, _), (w, d, _) = self.centre, self.size
        return ((x - w / 2, y - d / 2), (x + w / 2, y - d / 2), (x + w / 2, y + d / 2), (x - w / 2, y + d / 2))

    def covers(self, point: Point) -> bool:
        """Return whether a point is above, in or below the box."""
        return all(abs(point[i] - self.centre[i]) <= self.size[i] / 2 for i in (0, 1))


def decode(source: Source, form: type[T], what: str) -> T:
    """Read a source in its published form; fields that are not needed are passed over.

    Raises:
        GraphError: unreadable or malformed, with the path inside the file.
    """
    try:
        if isinstance(source, Mapping | list):
            return msgspec.convert(source, form)
        if isinstance(source, str) and source.lstrip()[:1] not in ("{", "["):
            source = Path(source)
        content = read_bytes(source, what, GraphError) if isinstance(source, Path) else source
        return msgspec.json.decode(content, type=form)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as problem:
        place = f" {source}" if isinstance(source, Path) else ""
        raise GraphError(f"{what}{place} is malformed: {problem}") from problem


def word_of(name: str) -> str:
    """Return a foreign name as this project writes names: `DiningTable` -> `dining_table`."""
    bare = re.sub(r"[^\w]+", "_", normalise_name(name)).strip("_'.")
    return bare if bare[:1].isalpha() else f"x_{bare}".rstrip("_")


_ON_M = 0.15
"""Gap, or overlap, between a thing's lower face and what it stands on; detected boxes are that rough."""


class Builder:
    """Collects rooms and things of a foreign graph.

    Attributes:
        names: id in the graph -> id in the source.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self.ontology = default_ontology()
        self.names: dict[str, str] = {}
        self.boxes: dict[str, Box] = {}
        self.room_entries: dict[str, RoomEntry] = {}
        self.connections: dict[tuple[str, str], float | None] = {}
        self.robot = RobotEntry()
        self.next_to: set[tuple[str, str]] = set()
        self._nodes: dict[str, dict[str, Any]] = {}
        self._own: dict[str, OwnCategory] = {}
        self._ids: dict[str, str] = {}

    def name(self, key: str, word: str) -> str:
        """Return a fresh id for a thing or room of the source: its word with an index.

        Raises:
            GraphError: the source has the key twice.
        """
        if key in self._ids:
            raise GraphError(f"{self.what}: duplicate id {key!r}")
        stem = word_of(word)
        index = 0
        while f"{stem}_{index}" in self.names:
            index += 1
        self._ids[key] = f"{stem}_{index}"
        self.names[f"{stem}_{index}"] = key
        return f"{stem}_{index}"

    def known(self, key: str, place: str) -> str:
        """Return the id that a key of the source has here.

        Raises:
            GraphError: the source speaks of what it does not have.
        """
        if key not in self._ids:
            raise GraphError(f"{self.what}: {place}: unknown id {key!r}")
        return self._ids[key]

    def has(self, key: str) -> bool:
        """Return whether a key of the source was taken over."""
        return key in self._ids

    def room(self, key: str, kind: str, **where: Any) -> str:
        """Add a room."""
        name = self.name(key, kind)
        self.room_entries[name] = RoomEntry(name, word_of(kind), **where)
        return name

    def connect(self, a: str, b: str, metres: float | None = None) -> None:
        """Add a way between two rooms."""
        if a != b:
            self.connections[(a, b) if a < b else (b, a)] = metres

    def thing(self, key: str, kind: str, facts: Mapping[str, bool], **fields: Any) -> str:
        """Add a thing.

        Args:
            key: id in the source.
            kind: what the source calls it.
            facts: affordances that the source states; others are those of the known category of that name.
            fields: of `NodeEntry`.
        """
        name = self.name(key, kind)
        self._nodes[name] = {"category": self._category(kind, facts), **fields}
        return name

    def put(self, name: str, **where: Any) -> None:
        """Say where a thing is: `on_top`, `inside`, `room` or `held`; the first word on it counts."""
        entry = self._nodes[name]
        if not entry.keys() & {"on_top", "inside", "room", "held"}:
            entry.update(where)

    def placed(self, name: str) -> bool:
        """Return whether it is known where a thing is."""
        return bool(self._nodes[name].keys() & {"on_top", "inside", "room", "held"})

    def category(self, name: str) -> Category:
        """Return what a thing affords."""
        of = self._nodes[name]["category"]
        return (self.ontology.extend({of: self._own[of]}) if of in self._own else self.ontology)[of]

    def position(self, name: str) -> Point | None:
        """Return where a thing is, if that is known."""
        box = self.boxes.get(name)
        at: Point | None = self._nodes[name].get("position")
        return at if at is not None else None if box is None else box.centre

    def things(self) -> tuple[str, ...]:
        """Return the ids of the things so far."""
        return tuple(self._nodes)

    def _category(self, kind: str, facts: Mapping[str, bool]) -> str:
        word = word_of(kind)
        named = word if word in self.ontology else self.ontology.concepts.meaning(word).thing
        base = None
        if named is not None and self.ontology.knows(named):
            members = self.ontology.kinds(named)
            base = max(members, key=lambda c: sum(getattr(c, fact) == value for fact, value in facts.items()))
            if all(getattr(base, fact) == value for fact, value in facts.items()):
                return base.name
        name = word if not is_concept(word) else f"x_{word}"
        before = self._own.get(name)
        said: dict[str, Any] = {f: v or (before is not None and bool(getattr(before, f))) for f, v in facts.items()}
        self._own[name] = OwnCategory(like=base.name if base is not None else None, source=self.what, **said)
        return name

    # --- supports from boxes ---------------------------------------------------------------------------------------

    def settle(self, default_room: str | None) -> None:
        """Say of every thing that has a box, and whose place the source does not say, what holds it up.

        It stands on the highest box whose upper face is at its lower face and which is beneath its centre; else it is
        inside the smallest box with an interior that holds its centre; else on the floor of `default_room`.
        """
        for name in self._nodes:
            if self.placed(name):
                continue
            holder = self._beneath(name)
            if holder is not None:
                self.put(name, **{holder[0]: holder[1]})
            elif default_room is not None:
                self.put(name, room=default_room)

    def _beneath(self, name: str) -> tuple[str, str] | None:
        box = self.boxes.get(name)
        if box is None:
            return None
        ontology = self.ontology.extend(self._own) if self._own else self.ontology
        others = [
            o for o in self.boxes if o != name and self.boxes[o].covers(box.centre) and not self._rests_on(o, name)
        ]
        on = [
            o
            for o in others
            if ontology[self._nodes[o]["category"]].surface
            and abs(self.boxes[o].top - box.bottom) <= _ON_M
            and self.boxes[o].bottom < box.bottom
        ]
        if on:
            return "on_top", max(on, key=lambda o: (self.boxes[o].top, o))
        around = [
            o
            for o in others
            if ontology[self._nodes[o]["category"]].interior
            and self.boxes[o].bottom <= box.centre[2] <= self.boxes[o].top
            and math.prod(self.boxes[o].size) > math.prod(box.size)
        ]
        return ("inside", min(around, key=lambda o: (math.prod(self.boxes[o].size), o))) if around else None

    def _rests_on(self, obj: str, holder: str) -> bool:
        for _ in range(len(self._nodes)):
            entry = self._nodes[obj]
            above = entry.get("on_top") or entry.get("inside")
            if above is None:
                return False
            if above == holder:
                return True
            obj = above
        return True

    def finish(self) -> Imported:
        """Return the whole graph."""
        nodes = []
        for name, fields in self._nodes.items():
            box = self.boxes.get(name)
            where = {} if box is None else {"position": box.centre, "footprint": box.footprint}
            nodes.append(NodeEntry(id=name, **{**where, **fields}))
        file = GraphFile(
            format=FORMAT,
            nodes=tuple(nodes),
            rooms=tuple(self.room_entries.values()),
            connections=tuple(
                pair if metres is None else ConnectionEntry(pair, metres)
                for pair, metres in sorted(self.connections.items(), key=lambda item: item[0])
            ),
            robot=self.robot,
            next_to=tuple(sorted(self.next_to)),
            categories=self._own,
        )
        done = Imported(file, self.names)
        done.graph()  # What does not hang together is said here, not when the file is read back.
        return done
