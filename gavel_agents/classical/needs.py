"""What a goal may need in one world: what it speaks of, what holds that, and what can give the states asked for."""

from __future__ import annotations

from functools import cached_property

from gavel_agents.classical.wishes import literals_of
from gavel_agents.edits.wants import confers
from gavel_env.world_model.conditions import ON_FLOOR
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Designator, Goal, Predicate, fitting
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["MADE", "Needs"]

MADE = {
    p.value: flag
    for flag in (Flag.COOKED, Flag.WASHED, Flag.DRIED, Flag.HOT, Flag.FROZEN)
    for p in Predicate
    if p.flag is flag
}
"""Name of a predicate -> the state that only an appliance gives."""


class Needs:
    """What matters for one goal from one start.

    Attributes:
        start: the state that is planned from.
        goal: what is planned for.
        wanted: what the goal asks to be open, and on.
        hand: primitives that a full hand costs at a door or switch: none, or setting down and taking again.
    """

    def __init__(self, start: SceneGraph, goal: Goal, profile: Profile = Profile.PAPER) -> None:
        self.start = start
        self.goal = goal
        self.hand = 2 if profile is Profile.OMNIGIBSON else 0
        self._workers: dict[tuple[str, Flag], tuple[tuple[str, Relation], ...]] = {}
        self.wanted = {
            flag: frozenset(o for o in start.world.nodes if goal.wants(flag, o, start))
            for flag in (Flag.OPEN, Flag.TOGGLED)
        }

    @cached_property
    def relevant(self) -> tuple[str, ...]:
        """What a plan may need: what the goal speaks of, what holds it, and what can give the states asked for."""
        found: dict[str, None] = {}
        for predicate, names in literals_of(self.goal):
            things = [o for name in names for o in fitting(self.start, Designator.parse(name))]
            found.update(dict.fromkeys(things))
            flag = MADE.get(predicate)
            for thing in things:
                if flag is not None:
                    found.update((a, None) for a, _ in self.workers(thing, flag))
                if predicate == Predicate.DIRTY.value:
                    found.update((a, None) for a, _ in self._cleaners(thing))
                if predicate in (Predicate.HOT.value, Predicate.FROZEN.value):
                    found.update((a, None) for f in (Flag.HOT, Flag.FROZEN) for a, _ in self.workers(thing, f))
            if predicate in (Predicate.IN_ROOM.value, ON_FLOOR):
                found.update((o, None) for o in self._in_room(self.start, names[-1]))
        for thing in tuple(found):
            found.update((holder, None) for _, holder in self.start.holders(thing))
        return tuple(o for o in self.start.world.nodes if o in found)

    def workers(self, thing: str, flag: Flag) -> tuple[tuple[str, Relation], ...]:
        """Return what gives a thing a state when it is run, and how the thing must lie in or on it."""
        key = (thing, flag)
        if key not in self._workers:
            found = ((a, confers(self.start, a, thing, flag)) for a in self.start.world.nodes if a != thing)
            self._workers[key] = tuple((a, relation) for a, relation in found if relation is not None)
        return self._workers[key]

    def _cleaners(self, thing: str) -> tuple[tuple[str, Relation], ...]:
        """Return what takes dirt off a thing by being run with it inside."""
        rinsing = (
            (a, Relation.INSIDE)
            for a in self.start.world.nodes
            if a != thing and self.start.category(a).rinses and self.start.category(a).interior
        )
        return (*self.workers(thing, Flag.WASHED), *rinsing, *((w, Relation.ON_TOP) for w in self.wipers(thing)))

    def wipers(self, thing: str) -> tuple[str, ...]:
        """Return what wipes a thing clean when it is put down on it."""
        if not self.start.category(thing).surface:
            return ()
        nodes = self.start.world.nodes
        return tuple(o for o in nodes if o != thing and nodes[o].category.wipes and not nodes[o].fixed)

    def machines(self, thing: str) -> tuple[tuple[str, Relation], ...]:
        """Return the machines that take dirt off a thing."""
        return tuple((a, r) for a, r in self._cleaners(thing) if r is Relation.INSIDE)

    @staticmethod
    def _in_room(graph: SceneGraph, room: str) -> list[str]:
        """Return fixed pieces of a room, by which a thing can be brought there."""
        rooms = graph.world.rooms
        found = []
        for o, node in graph.world.nodes.items():
            where = graph.room_of(o) if node.fixed else None
            if where is not None and rooms[where].fits(room):
                found.append(o)
        return found

    def pieces_of(self, room: str) -> list[str]:
        """Return the fixed pieces known to stand in a room."""
        return self._in_room(self.start, room)
