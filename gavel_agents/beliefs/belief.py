"""The belief B_t over the rooms of what has not been found (Eq. belief), and its update Upsilon.

B_t = Upsilon(B_{t-1}, a, z) is computed from the prior and everything observed so far, which is the same thing here: an
observed object localises, a searched room without the object leaves the support, and nothing is ever forgotten.

Two readings that the paper leaves open. What stands *in* something with a door is not refuted by searching the room: it
follows its container. What stands on or in something open is found together with it ("the pie on the countertop" is on
*that* countertop), so the pair shares one belief, which only the sight of the pie settles.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn import LocationPrior, RoomInfo, load_prior
from gavel_env.house.floor_map import FloorMap
from gavel_env.world_model.graph import Node, Relation, Room, SceneGraph, World

__all__ = ["Belief", "Evidence", "Prior", "load_prior"]

Floats = NDArray[np.float64]
Prior = LocationPrior


class Evidence(Protocol):
    """What the belief reads of an observation (`gavel_env.exchange.Observed` has it)."""

    @property
    def graph(self) -> SceneGraph:
        """Everything observed so far."""
        ...

    @property
    def searched(self) -> frozenset[str]:
        """Rooms that have been searched completely."""
        ...


class _Expected(NamedTuple):
    """Before any observation: what is stated (prior within the stated rooms), and the prior alone. (rooms,) each."""

    stated: Floats
    anywhere: Floats


class _Expectations:
    """The prior over one house, remembered by category and stated room."""

    def __init__(self, rooms: Sequence[RoomInfo], prior: LocationPrior) -> None:
        self._rooms = tuple(rooms)
        self._prior = prior
        self._memory: dict[tuple[str, str | None], _Expected] = {}
        self.one_hot = {r.id: _frozen(np.eye(len(self._rooms))[i]) for i, r in enumerate(self._rooms)}
        self.uniform = _frozen(np.full(len(self._rooms), 1.0 / len(self._rooms)))

    def of(self, node: Node) -> _Expected:
        """Return what is expected of a node of the believed graph.

        Of one that may be of several categories, their expectations are mixed by its weights (`mixture`).
        """
        if not node.others:
            return self._of(node.category.name, node.stated_room)
        each = [self._of(category.name, node.stated_room) for category in node.categories]
        weights = np.array(node.weights)
        return _Expected(
            _frozen(weights @ np.array([e.stated for e in each])),
            _frozen(weights @ np.array([e.anywhere for e in each])),
        )

    def _of(self, category: str, stated_room: str | None) -> _Expected:
        """Return what is expected of a category, with a room stated, or none."""
        key = (category, stated_room)
        if key not in self._memory:
            anywhere = _frozen(np.asarray(self._prior(category, self._rooms), dtype=np.float64))
            fits = np.array([stated_room is None or Room(r.id, r.type).fits(stated_room) for r in self._rooms])
            stated = _normalised(anywhere * fits)
            if stated is None:
                # The prior gives the stated rooms nothing, or no reachable room is of the stated type.
                stated = _normalised(fits.astype(np.float64))
            self._memory[key] = _Expected(anywhere if stated is None else stated, anywhere)
        return self._memory[key]


@dataclass(frozen=True, eq=False)
class Belief(Mapping[str, Floats]):
    """B_t: node of the believed graph -> b_o^t, (rooms,) probabilities, read-only, sum 1.

    Attributes:
        rooms: ids of the reachable rooms, the order of every vector.
        refuted: nodes that are in none of the rooms where they were said or expected to be; they fall back to the prior
            over the rooms not yet searched, and when all are, to all rooms alike.
    """

    rooms: tuple[str, ...]
    refuted: frozenset[str]
    _vectors: Mapping[str, Floats] = field(repr=False)
    _root_of: Mapping[str, str] = field(repr=False)
    _expectations: _Expectations = field(repr=False)

    @classmethod
    def initial(cls, graph: SceneGraph, layout: FloorMap, rooms: Sequence[str], prior: LocationPrior) -> Belief:
        """Return B_0 for every node of the believed graph.

        Args:
            graph: G_0, with the stated relations.
            layout: the known layout, for the types and sizes of rooms.
            rooms: ids of the reachable rooms.
            prior: where objects of a category usually are.

        Raises:
            ValueError: no reachable room.
        """
        known = {room.id: RoomInfo(room.id, room.type, room.area_m2) for room in layout.scene.rooms}
        return cls.over(graph, [known[room] for room in rooms], prior)

    @classmethod
    def over(cls, graph: SceneGraph, rooms: Sequence[RoomInfo], prior: LocationPrior) -> Belief:
        """Return B_0 over the given rooms.

        Raises:
            ValueError: no rooms.
        """
        if not rooms:
            raise ValueError("a belief needs at least one reachable room")
        empty = cls(tuple(r.id for r in rooms), frozenset(), {}, {}, _Expectations(rooms, prior))
        return empty.update(graph, _Nothing(), {})

    def update(
        self,
        graph: SceneGraph,
        observed: Evidence,
        bound: Mapping[str, str],
        rejected: Collection[str] = (),
    ) -> Belief:
        """Return B_{t+1} = Upsilon(B_t, a_t, z_{t+1}).

        Args:
            graph: the believed graph after a_t; its nodes are the uncertain objects.
            observed: all that has been observed, z_{t+1} included.
            bound: node -> observed instance that it is known to be.
            rejected: observed instances that turned out not to be what was meant; seeing them says nothing.
        """
        return _Update(self._expectations, graph, observed, bound, frozenset(rejected)).apply(self)

    def root(self, node: str) -> str:
        """Return the node that says where a node is, itself or what holds it: nodes of one root are in one place."""
        return self._root_of[node]

    def __getitem__(self, node: str) -> Floats:
        return self._vectors[node]

    def __iter__(self) -> Iterator[str]:
        return iter(self._vectors)

    def __len__(self) -> int:
        return len(self._vectors)

    def most_likely(self, node: str) -> str:
        """Return r_hat = argmax b_o(r); the earlier room wins ties."""
        return self.rooms[int(np.argmax(self._vectors[node]))]

    def collapsed(self) -> Belief:
        """Return the belief that commits every object to its most likely room (`gavel-map`)."""
        one_hot = self._expectations.one_hot
        return replace(self, _vectors={node: one_hot[self.most_likely(node)] for node in self._vectors})

    def likely(self) -> dict[str, list[str]]:
        """Return node -> its possible rooms by decreasing belief."""
        out = {}
        for node, vector in self._vectors.items():
            order = np.argsort(-vector, kind="stable")
            out[node] = [self.rooms[i] for i in order if vector[i] > 0.0]
        return out

    def priors(self) -> dict[str, dict[str, float]]:
        """Return node -> room id -> belief, possible rooms only: the `search_prior` of actions."""
        return {
            node: {room: p for room, p in zip(self.rooms, vector.tolist(), strict=True) if p > 0.0}
            for node, vector in self._vectors.items()
        }


class _Nothing:
    """Nothing observed yet."""

    graph = SceneGraph(World.of({}, frozenset(), {}), {}, {})
    searched: frozenset[str] = frozenset()


class _Update:
    """One application of Upsilon."""

    def __init__(
        self,
        expectations: _Expectations,
        graph: SceneGraph,
        observed: Evidence,
        bound: Mapping[str, str],
        rejected: frozenset[str],
    ) -> None:
        self._expected = expectations
        self._graph = graph
        self._seen = observed.graph
        self._bound = bound
        self._taken = frozenset(bound.values())
        self._rejected = rejected
        one_hot = expectations.one_hot
        self._unsearched = np.array([room not in observed.searched for room in one_hot], dtype=np.float64)
        self._refuted: set[str] = set()
        self._roots: dict[str, Floats] = {}

    def apply(self, belief: Belief) -> Belief:
        """Return the belief after the update."""
        vectors: dict[str, Floats] = {}
        root_of: dict[str, str] = {}
        for node in self._graph.world.nodes:
            root_of[node] = outermost = self._outermost(node)
            if outermost not in self._roots:
                self._roots[outermost] = self._root(outermost)
            vectors[node] = self._roots[outermost]
            if outermost in self._refuted:
                self._refuted.add(node)
        return replace(belief, _vectors=vectors, _root_of=root_of, refuted=frozenset(self._refuted))

    def _outermost(self, node: str) -> str:
        """Return the bound or outermost node that says where `node` is: itself, or what holds it."""
        while node not in self._bound:
            support = self._graph.supports.get(node)
            if support is None or support.relation in (Relation.FLOOR, Relation.HELD):
                return node
            node = support.holder
        return node

    def _root(self, node: str) -> Floats:
        """Return the belief of a node that nothing unbound holds."""
        one_hot = self._expected.one_hot
        if node in self._bound:
            room = self._seen.room_of(self._bound[node])
            if room in one_hot:
                return one_hot[room]
        support = self._graph.supports.get(node)
        believed = self._graph.room_of(node)
        if support is not None and support.relation is Relation.HELD and believed in one_hot:
            return one_hot[believed]
        entry = self._graph.world.nodes[node]
        stated, anywhere = self._expected.of(entry)
        if believed in one_hot:
            stated = one_hot[believed]
        there = self._rooms_where_seen(node)
        if there is not None:
            found = _normalised(stated * there)
            return _frozen(there / there.sum()) if found is None else found
        left = _normalised(stated * self._unsearched)
        if left is not None:
            return left
        self._refuted.add(node)
        left = _normalised(anywhere * self._unsearched)
        return self._expected.uniform if left is None else left

    def _rooms_where_seen(self, node: str) -> Floats | None:
        """Return 1 for each room where the node (or what shows which one it is) was seen, (rooms,), or None."""
        rooms = {self._seen.room_of(i) for witness in self._witnesses(node) for i in self._candidates(witness)}
        there = np.array([room in rooms for room in self._expected.one_hot], dtype=np.float64)
        return there if there.any() else None

    def _witnesses(self, node: str) -> Sequence[str]:
        """Return what must be seen to know where the node is: its unfound contents if it stands open, else itself."""
        category = self._graph.category(node)
        if category.graspable or category.has_door:
            return (node,)
        unfound = [c for c in self._graph.contents.get(node, ()) if c not in self._bound]
        return unfound or (node,)

    def _candidates(self, node: str) -> Iterator[str]:
        """Yield the observed instances that the node may be."""
        entry = self._graph.world.nodes[node]
        for instance in (i for c in entry.categories for i in self._seen.world.by_category.get(c.name, ())):
            if instance in self._rejected or (not entry.fixed and instance in self._taken):
                continue
            room = self._seen.room_of(instance)
            if room is None:
                continue
            if entry.stated_room is None or self._seen.world.rooms[room].fits(entry.stated_room):
                yield instance


def _frozen(vector: Floats) -> Floats:
    vector.flags.writeable = False
    return vector


def _normalised(weights: Floats) -> Floats | None:
    """Return the weights with sum 1, read-only, or None if all are zero."""
    total = float(weights.sum())
    return _frozen(weights / total) if total > 0.0 else None
