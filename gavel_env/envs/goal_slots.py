"""What the K slots of a learner stand for: what the goal speaks of, then what else was observed.

A slot keeps what it stands for, so that a policy can rely on it. The first slots are the goal's designators in the
order written; each is bound to the instance that the robot came to, or else to the nearest that was seen when the first
was. Then there is a machine for every state that the goal asks for (something that cooks, washes, ...), and the others
hold observed instances: more machines of that kind, containers that may hide something, then whatever else was seen.
A container that was looked into and shut again makes room for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache
from typing import NamedTuple

from gavel_env.exchange import Observed
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import Profile, first_violation
from gavel_env.world_model.goals import Designator, Goal, Predicate, fitting
from gavel_env.world_model.graph import Flag, Room, SceneGraph
from gavel_env.world_model.ontology import Category, default_ontology

__all__ = ["GoalSlots", "Slot", "can_be_searched_for", "goal_designators", "named_slots"]


class Slot(NamedTuple):
    """What a slot stands for.

    Attributes:
        designator: what it is searched for as: the goal's name for it, or a category of machine; None in other slots.
        instance: observed id, or None while nothing is known that fits.
        gives: the state that a machine is to confer; None in other slots.
    """

    designator: Designator | None = None
    instance: str | None = None
    gives: Flag | None = None

    def fitting(self, graph: SceneGraph) -> tuple[str, ...]:
        """Return the observed instances that fit a slot with a designator."""
        if self.gives is not None:
            confers = _CONFERS[self.gives]
            return tuple(node.id for node in graph.world.nodes.values() if confers(node.category))
        assert self.designator is not None
        return fitting(graph, self.designator)


_CONFERS: Mapping[Flag, Callable[[Category], bool]] = {
    Flag.COOKED: lambda category: category.heat is not None,
    Flag.HOT: lambda category: category.heat is not None,
    Flag.FROZEN: lambda category: category.cold is not None and category.cold.freezes,
    Flag.WASHED: lambda category: category.washes,
    Flag.DRIED: lambda category: category.dries,
    Flag.DIRTY: lambda category: category.washes or category.rinses or category.wipes,  # of its negation
}


def goal_designators(goal: Goal) -> tuple[Designator, ...]:
    """Return the things that a goal's literals speak of, each once, in the order written; rooms are not things."""
    found: dict[Designator, None] = {}
    for literal in goal.literals:
        found.setdefault(literal.subject)
        if literal.object is not None and literal.predicate is not Predicate.IN_ROOM:
            found.setdefault(literal.object)
    return tuple(found)


def _wanted_states(goal: Goal) -> tuple[Flag, ...]:
    """Return the states that something must confer, each once, in the order written."""
    flags = (lit.predicate.flag for lit in goal.literals if lit.negated == (lit.predicate is Predicate.DIRTY))
    return tuple(dict.fromkeys(flag for flag in flags if flag is not None and flag in _CONFERS))


@cache
def _machine(flag: Flag) -> Designator | None:
    """Return what a machine that confers a state is searched for as: a named one, if there is any with a door."""
    ontology = default_ontology()
    named = sorted(name for name in default_vocabulary().furniture if _CONFERS[flag](ontology[name]))
    named.sort(key=lambda name: (not ontology[name].toggleable, not ontology[name].has_door))
    return Designator(named[0]) if named else None


def named_slots(goal: Goal) -> tuple[Slot, ...]:
    """Return the slots that a goal asks for: its things, then the machines."""
    things = [Slot(designator) for designator in goal_designators(goal)]
    return (*things, *(Slot(_machine(flag), None, flag) for flag in _wanted_states(goal)))


def can_be_searched_for(designator: Designator, rooms: Collection[Room], searched: Collection[str]) -> bool:
    """Tell whether a room where a designator may be found has not been searched; what is named by its id is never."""
    if not default_ontology().knows(designator.name):
        return False
    fits = (room for room in rooms if designator.room is None or room.fits(designator.room))
    return any(room.id not in searched for room in fits)


class GoalSlots:
    """The slots of one episode.

    Args:
        goal: what is asked for; its `named_slots` must not be more than `size`.
        size: K.
        rooms: of the house, for designators with a room.

    Attributes:
        slots: K of them.
        opened: containers that the robot has seen open.
        unreachable: instances to which no route was found; they are not offered again.
    """

    def __init__(self, goal: Goal, size: int, rooms: Collection[Room]) -> None:
        named = named_slots(goal)
        self.slots: list[Slot] = [*named, *[Slot()] * (size - len(named))]
        self.opened: set[str] = set()
        self.unreachable: set[str] = set()
        self._named = len(named)
        self._rooms = rooms
        self._wanted = _wanted_states(goal)
        self._waiting: tuple[list[str], list[str], list[str]] = ([], [], [])  # appliances, containers, the rest
        self._filed = 0

    def __iter__(self) -> Iterator[Slot]:
        return iter(self.slots)

    def update(self, observed: Observed) -> None:
        """Bind what has come into view, and give the free slots to what waits for one."""
        graph = observed.graph
        self.opened.update(obj for obj in graph.flags[Flag.OPEN] if graph.category(obj).has_door)
        if len(graph.world.nodes) > self._filed or self.unreachable:
            self._bind(observed)
            fresh = list(graph.world.nodes)[self._filed :]
            self._filed = len(graph.world.nodes)
            for obj in fresh:
                self._waiting[self._use(graph.category(obj))].append(obj)
        self._fill(graph)

    def _bind(self, observed: Observed) -> None:
        """Bind the goal's designators for which something is known now."""
        graph = observed.graph
        taken = {slot.instance for slot in self.slots[: self._named]}
        here = observed.layout.point(observed.cell)
        for index, slot in enumerate(self.slots[: self._named]):
            if slot.instance is not None and slot.instance not in self.unreachable:
                continue
            found = [o for o in slot.fitting(graph) if o not in self.unreachable]
            if not found:
                self.slots[index] = slot._replace(instance=None)
                continue
            nearest = min(found, key=lambda o: (o in taken, o != observed.reached, _away(observed.positions[o], here)))
            self.slots[index] = slot._replace(instance=nearest)
            taken.add(nearest)
            for other in range(self._named, len(self.slots)):
                if self.slots[other].instance == nearest:
                    self.slots[other] = Slot()

    def _use(self, category: Category) -> int:
        if any(_CONFERS[flag](category) for flag in self._wanted):
            return 0
        return 1 if category.has_door else 2

    def _fill(self, graph: SceneGraph) -> None:
        pressing, containers, rest = self._waiting
        bound = {slot.instance for slot in self.slots}
        for index in range(self._named, len(self.slots)):
            instance = self.slots[index].instance
            if instance is not None and not ((pressing or containers) and self._gives_way(graph, instance)):
                continue
            queue = pressing or containers or ([] if instance is not None else rest)
            while queue and queue[0] in bound:
                queue.pop(0)
            if queue:
                self.slots[index] = Slot(None, queue.pop(0))

    def _gives_way(self, graph: SceneGraph, instance: str) -> bool:
        """Tell whether an instance is of less use than a container that waits for a slot."""
        if instance in graph.near or instance == graph.holding:
            return False
        use = self._use(graph.category(instance))
        if use != 1:
            return use == 2
        goal = {slot.instance for slot in self.slots[: self._named]}
        return instance in self.opened and graph.is_shut(instance) and goal.isdisjoint(graph.descendants(instance))

    # --- what can be done with them --------------------------------------------------------------------------------

    def allowed(self, observed: Observed, profile: Profile) -> Iterator[tuple[Primitive, int]]:
        """Yield the (primitive, slot) pairs that the world model accepts in the observed graph.

        To go to what is not known yet is accepted while a room that fits has not been searched. `RELEASE` has no
        target; it is slot 0's.
        """
        graph = observed.graph
        if graph.holding is not None:
            yield Primitive.RELEASE, 0
        for index, (designator, instance, _) in enumerate(self.slots):
            if instance is None:
                if designator is not None and self._can_be_searched_for(designator, observed):
                    yield Primitive.NAVIGATE_TO, index
                continue
            near = instance in graph.near or instance == graph.holding
            for primitive in _TARGETED if near else _GOING:
                if primitive is Primitive.NAVIGATE_TO and instance in self.unreachable:
                    continue
                if first_violation(graph, Action(primitive, instance), profile) is None:
                    yield primitive, index

    def _can_be_searched_for(self, designator: Designator, observed: Observed) -> bool:
        return can_be_searched_for(designator, self._rooms, observed.searched)


_TARGETED = tuple(p for p in Primitive if p.takes_target)
_GOING = (Primitive.NAVIGATE_TO,)


def _away(a: tuple[float, float], b: tuple[float, float]) -> float:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2
