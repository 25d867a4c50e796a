"""A learner's observation: slots, goal literals and the robot as one vector of fixed length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from gavel_env.envs.goal_slots import GoalSlots, goal_designators
from gavel_env.envs.spaces import AFFORDANCES
from gavel_env.exchange import Observed
from gavel_env.world_model.goals import Goal, Literal, Predicate
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import Category

__all__ = ["LITERAL_COLUMNS", "ROBOT_COLUMNS", "SLOT_COLUMNS", "SlotFeatures", "split_features"]

Floats = NDArray[np.float32]

_AFFORDANCES = tuple(name for name in AFFORDANCES if name != "clearance")
_FLAGS = tuple(flag.name.lower() for flag in Flag)
SLOT_COLUMNS = (
    "goal",
    "known",
    "near",
    "held",
    "shut_away",
    "looked_into",
    "to_restore",
    "distance",
    "same_room",
    "on_top",
    "inside",
    "on_floor",
    "holder",
    *_FLAGS,
    "fixed",
    *_AFFORDANCES,
    "heats",
    "cools",
)
"""Columns of a slot, all within 0 and 1.

goal: the goal speaks of it, or needs such a machine. known: an instance was seen. shut_away: inside something shut.
looked_into: a container that was seen open. to_restore: opened or switched on since it was first seen, though the goal
does not ask for it. distance: in a straight line, 1 at 10 m and beyond. holder: (slot + 1) / K of what it is on or in,
0 if no slot stands for that.
"""
_COLUMN = {name: i for i, name in enumerate(SLOT_COLUMNS)}
_FIRST_FLAG = _COLUMN[_FLAGS[0]]
_FIXED = _COLUMN["fixed"]
_SUPPORTS = {
    Relation.ON_TOP: _COLUMN["on_top"],
    Relation.INSIDE: _COLUMN["inside"],
    Relation.FLOOR: _COLUMN["on_floor"],
}
_FAR_M = 10.0

LITERAL_COLUMNS = ("used", "unmet", "negated", "robot_in_room", *(predicate.value for predicate in Predicate))
"""First columns of a goal literal; then follow subject and object, each as one of K slots."""

ROBOT_COLUMNS = ("holding", "rooms_searched", "time", "metres", "refused", "unmet", "to_restore")
"""Columns of the robot: time is the share of the steps that are over, metres are per 100, unmet and to_restore are
counts divided by the number of goal literals, at most 1."""


class SlotFeatures:
    """Writes observations of one episode.

    Args:
        goal: what is asked for.
        slots: K.
        literals: most literals.
    """

    def __init__(self, goal: Goal, table: GoalSlots, literals: int) -> None:
        self._goal = goal
        self._table = table
        size = len(table.slots)
        self._static: dict[str, Floats] = {}
        self._fixed_part = np.zeros((literals, len(LITERAL_COLUMNS) + 2 * size), np.float32)
        named = {designator: index for index, designator in enumerate(goal_designators(goal))}
        for row, literal in zip(self._fixed_part, goal.literals, strict=False):
            row[0], row[2] = 1.0, literal.negated
            row[LITERAL_COLUMNS.index(literal.predicate.value)] = 1.0
            row[len(LITERAL_COLUMNS) + named[literal.subject]] = 1.0
            if literal.object in named:
                row[len(LITERAL_COLUMNS) + size + named[literal.object]] = 1.0

    def write(self, observed: Observed, unmet: Sequence[object], to_restore: frozenset[str], time: float) -> Floats:
        """Return the observation, (length,) float32.

        Args:
            observed: the agent's view.
            unmet: what is unmet in it.
            to_restore: what was opened or switched on and must not stay so.
            time: share of the steps that are over.
        """
        graph = observed.graph
        slots = np.zeros((len(self._table.slots), len(SLOT_COLUMNS)), np.float32)
        x, y = observed.layout.point(observed.cell)
        place = {slot.instance: index for index, slot in enumerate(self._table.slots) if slot.instance is not None}
        for row, (designator, instance, _) in zip(slots, self._table.slots, strict=True):
            if instance is None:
                row[0] = designator is not None
                continue
            row[:] = self._static_row(graph, instance)
            at_x, at_y = observed.positions[instance]
            support = graph.supports.get(instance)
            values = [
                designator is not None,
                1.0,
                instance in graph.near,
                instance == graph.holding,
                graph.closed_container(instance) is not None,
                instance in self._table.opened,
                instance in to_restore,
                min(1.0, ((at_x - x) ** 2 + (at_y - y) ** 2) ** 0.5 / _FAR_M),
                graph.room_of(instance) == graph.robot_room,
            ]
            row[: len(values)] = values
            if support is not None and support.relation in _SUPPORTS:
                row[_SUPPORTS[support.relation]] = 1.0
                row[_COLUMN["holder"]] = (place.get(support.holder, -1) + 1) / len(slots)
        for column, flagged in enumerate(graph.flags, start=_FIRST_FLAG):
            for instance in flagged:
                if instance in place:
                    slots[place[instance], column] = 1.0
        literals = self._fixed_part.copy()
        missing = set(unmet)
        for row, literal in zip(literals, self._goal.literals, strict=False):
            row[1] = literal in missing
            if literal.predicate is Predicate.IN_ROOM:
                row[3] = _robot_is_in(graph, literal)
        count = max(1, len(self._goal.literals))
        robot = np.array(
            (
                graph.holding is not None,
                len(observed.searched) / max(1, len(graph.world.rooms)),
                time,
                min(1.0, observed.metres / 100.0),
                observed.outcome not in ("", "ok"),
                min(1.0, len(unmet) / count),
                min(1.0, len(to_restore) / count),
            ),
            np.float32,
        )
        return np.concatenate([slots.ravel(), literals.ravel(), robot])

    def _static_row(self, graph: SceneGraph, instance: str) -> Floats:
        if instance not in self._static:
            row = np.zeros(len(SLOT_COLUMNS), np.float32)
            row[_FIXED] = graph.world.nodes[instance].fixed
            row[_FIXED + 1 :] = _affordances(graph.category(instance))
            self._static[instance] = row
        return self._static[instance]


def _affordances(category: Category) -> list[bool]:
    values = [bool(getattr(category, name)) for name in _AFFORDANCES]
    return [*values, category.heat is not None, category.cold is not None]


def _robot_is_in(graph: SceneGraph, literal: Literal) -> bool:
    room = graph.robot_room
    return room is not None and graph.world.rooms[room].fits(str(literal.object))


def feature_space(slots: int, literals: int) -> spaces.Box:
    """Return the space of the observations."""
    length = slots * len(SLOT_COLUMNS) + literals * (len(LITERAL_COLUMNS) + 2 * slots) + len(ROBOT_COLUMNS)
    return spaces.Box(0.0, 1.0, (length,), np.float32)


def split_features(observation: Floats, slots: int, literals: int) -> Mapping[str, Floats]:
    """Return the parts of observations, (..., length), as views.

    Returns:
        `slots` (..., K, columns), `literals` (..., L, columns + 2 K) and `robot` (..., columns).
    """
    lead, width = observation.shape[:-1], len(LITERAL_COLUMNS) + 2 * slots
    first = slots * len(SLOT_COLUMNS)
    second = first + literals * width
    return {
        "slots": observation[..., :first].reshape(*lead, slots, len(SLOT_COLUMNS)),
        "literals": observation[..., first:second].reshape(*lead, literals, width),
        "robot": observation[..., second:],
    }
