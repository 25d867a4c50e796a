"""Binding: from designators of a plan to instances of the house (shared by all methods).

A plan step on a designator is sent as an instance once one is bound, otherwise as the designator itself with its belief
as search prior. Going to an open piece whose expected contents are still unseen means going to them: the countertop
that has the pie, not the nearest one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from gavel_env.exchange import EnvAction, Observed
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import category_of

__all__ = ["Binder", "Surprise"]


class Surprise(NamedTuple):
    """Something is not in the piece where it was said to be.

    Attributes:
        holder: the node of that piece.
        elsewhere: whether it was seen elsewhere, and no other piece was seen that may be the one that was meant.
    """

    holder: str
    elsewhere: bool


class Binder:
    """Remembers which instance every designator stands for.

    Attributes:
        bound: designator node -> instance id; what is bound stays bound, unless it is rejected.
        rejected: instances that turned out not to be what a designator meant.
    """

    def __init__(self) -> None:
        self.bound: dict[str, str] = {}
        self.rejected: set[str] = set()

    def surprise(self, action: Action, believed: SceneGraph, observed: Observed) -> Surprise | None:
        """Return what is wrong where something is gone to or grasped that was said to be in a piece and is not.

        A piece that is still shut is not looked into yet; one that is named by its id is the only one that was meant.
        """
        node = action.target
        if action.primitive not in (Primitive.NAVIGATE_TO, Primitive.GRASP) or node is None:
            return None
        if node not in believed.world.nodes or node in self.bound:
            return None
        holder = next((holder for _, holder in believed.holders(node) if holder in self.bound), None)
        if holder is None or _names_an_instance(holder, believed):
            return None
        piece = self.bound[holder]
        going = action.primitive is Primitive.NAVIGATE_TO
        if going and not observed.graph.category(piece).openable:
            return None  # what stands open is found by searching for the thing itself
        if observed.graph.is_shut(piece) or observed.graph.closed_container(piece) is not None:
            return None
        found = self._choose(node, believed, observed, near_first=True)
        if found is None:
            return Surprise(holder, False)
        if observed.graph.contains(piece, found) or (not going and found in observed.graph.near):
            return None
        if any(other != piece for other in self.candidates(holder, believed, observed)):
            return Surprise(holder, False)
        return Surprise(holder, True)

    def reject(self, node: str) -> None:
        """Unbind a node whose instance was not the one that was meant."""
        self.rejected.add(self.bound.pop(node))

    def send(
        self, action: Action, believed: SceneGraph, observed: Observed, priors: Mapping[str, Mapping[str, float]]
    ) -> EnvAction:
        """Return the action as the environment understands it, binding what is observed.

        Args:
            action: a plan step on a node of the believed graph.
            believed: the believed graph before the step.
            observed: what has been observed.
            priors: node -> room id -> belief, for the search of what is not bound.
        """
        node = action.target
        if node is None or node not in believed.world.nodes:
            return EnvAction.of(action)
        if node not in self.bound:
            going = action.primitive is Primitive.NAVIGATE_TO
            sought = self._sought(node, believed) if going else node
            instance = self._choose(sought, believed, observed, near_first=not going)
            if instance is None:
                return self._search(sought, believed, observed, priors.get(node)) if going else EnvAction.of(action)
            self.bind(sought, instance, believed, observed)
        return EnvAction(action.primitive, self.bound.get(node, node), priors.get(node))

    def arrived(self, action: Action, believed: SceneGraph, observed: Observed) -> bool:
        """Bind what a search has found; return whether it was what the search was for."""
        node = action.target
        if action.primitive is not Primitive.NAVIGATE_TO or node is None or observed.reached is None:
            return True
        if node in believed.world.nodes and node not in self.bound:
            sought = self._sought(node, believed)
            if not self._fits(sought, observed.reached, believed, observed):
                return False
            self.bind(sought, observed.reached, believed, observed)
        return True

    def _search(
        self, node: str, believed: SceneGraph, observed: Observed, prior: Mapping[str, float] | None
    ) -> EnvAction:
        """Return the search for a node; one named by its id is searched by category, without those seen already."""
        if not _names_an_instance(node, believed):
            own = Designator.parse(node)
            said_room = believed.world.nodes[node].stated_room != own.room
            picky = is_concept(own.name) or said_room or _stated(node, believed)
            unfit = self._unfit(node, believed, observed) if picky else ()
            return EnvAction(Primitive.NAVIGATE_TO, node, prior, tuple(sorted(self.rejected.union(unfit))))
        category = believed.category(node).name
        seen = observed.graph.world.by_category.get(category, ())
        return EnvAction(Primitive.NAVIGATE_TO, category, prior, seen)

    def _unfit(self, node: str, believed: SceneGraph, observed: Observed) -> Iterator[str]:
        """Yield what was seen of a node's category or concept and is not what is meant."""
        for instance in observed.graph.world.instances(Designator.parse(node).name):
            if not self._fits(node, instance, believed, observed):
                yield instance

    def bind(self, node: str, instance: str, believed: SceneGraph, observed: Observed) -> None:
        """Bind a node, and with it the nodes that the believed graph says hold it."""
        self.bound[node] = instance
        real = list(observed.graph.holders(instance))
        for (relation, holder), (real_relation, real_holder) in zip(believed.holders(node), real, strict=False):
            fits = self._fits(holder, real_holder, believed, observed)
            if holder in self.bound or relation is not real_relation or not fits:
                break
            self.bound[holder] = real_holder

    def designator(self, node: str, believed: SceneGraph) -> str:
        """Return what the environment calls a node that is not bound: its designator, or the category of its id."""
        return believed.category(node).name if _names_an_instance(node, believed) else node

    def destination(self, node: str, believed: SceneGraph, observed: Observed) -> str | None:
        """Return the observed instance that going to `node` would go to, or None if it would be searched."""
        return self.bound.get(node) or self._choose(self._sought(node, believed), believed, observed, near_first=False)

    def destinations(self, node: str, believed: SceneGraph, observed: Observed) -> Sequence[str]:
        """Return every observed instance that going to `node` may come to; none if it would be searched."""
        if node in self.bound:
            return (self.bound[node],)
        return self._fitting(self._sought(node, believed), believed, observed)

    def _sought(self, node: str, believed: SceneGraph) -> str:
        """Return what going to `node` means going to: its first expected unbound contents, if it stands open."""
        category = believed.category(node)
        if category.graspable or category.has_door:
            return node
        return next((c for c in believed.contents.get(node, ()) if c not in self.bound), node)

    def _choose(self, node: str, believed: SceneGraph, observed: Observed, *, near_first: bool) -> str | None:
        """Return the observed instance for a node: what it is said to be in or on, then near, then the nearest."""
        found = self._fitting(node, believed, observed)
        if near_first:
            found = [i for i in found if i in observed.graph.near] or found
        return min(found, key=lambda i: (_distance_m(observed, i), i), default=None)

    def _fitting(self, node: str, believed: SceneGraph, observed: Observed) -> list[str]:
        """Return the observed instances for a node, of them those that are in or on what it is said to be in or on."""
        taken = () if believed.world.nodes[node].fixed else tuple(self.bound.values())
        found = [i for i in self.candidates(node, believed, observed) if i not in taken]
        support = believed.supports.get(node)
        if support is not None and support.relation <= Relation.INSIDE and support.holder in self.bound:
            return [i for i in found if observed.graph.contains(self.bound[support.holder], i)] or found
        return found

    def candidates(self, node: str, believed: SceneGraph, observed: Observed) -> Iterator[str]:
        """Yield the observed instances that fit a node's designator."""
        for category in believed.world.nodes[node].categories:
            for instance in observed.graph.world.by_category.get(category.name, ()):
                if self._fits(node, instance, believed, observed):
                    yield instance

    def _fits(self, node: str, instance: str, believed: SceneGraph, observed: Observed) -> bool:
        wanted = believed.world.nodes[node]
        if instance in self.rejected:
            return False
        if _names_an_instance(node, believed):
            return instance == node
        kind = observed.graph.category(instance).name
        if kind != wanted.category.name and not any(kind == other.name for other in wanted.others):
            return False
        if any(instance not in observed.graph.flags[flag] for flag in _stated(node, believed)):
            return False
        if wanted.stated_room is None:
            return True
        room = observed.graph.room_of(instance)
        return room is not None and observed.graph.world.rooms[room].fits(wanted.stated_room)


def _stated(node: str, believed: SceneGraph) -> tuple[Flag, ...]:
    """Return what a thing that is not found yet is said to be: "shut the cabinet" means one that is open.

    Of a piece that something is said to be in, nothing: it is opened to look, and the next one tried may be shut.
    """
    if node in believed.contents:
        return ()
    return tuple(flag for flag in (Flag.OPEN, Flag.TOGGLED) if believed.has(flag, node))


def _names_an_instance(node: str, believed: SceneGraph) -> bool:
    """Return whether a node is an instance id (`fridge_1`) rather than a designator over categories."""
    return node != believed.category(node).name and category_of(node) == believed.category(node).name


def _distance_m(observed: Observed, instance: str) -> float:
    """Return the driving distance from the robot to an observed instance, by the known layout."""
    if instance == observed.graph.holding or instance in observed.graph.near:
        return 0.0
    x, y = observed.positions[instance]
    goal = observed.layout.nearest_reachable(x, y, observed.graph.room_of(instance))
    metres = None if goal is None else observed.layout.distance(observed.cell, (goal,))
    return float("inf") if metres is None else metres
