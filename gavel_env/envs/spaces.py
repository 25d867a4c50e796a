"""Observations as Gymnasium spaces: the observed scene graph as a `spaces.Graph`, and the rest.

Node 0 is the robot, then come the rooms in the scene's order, then the observed objects in the order of first sight: a
node keeps its index for the whole episode, and the action space's `target` points at it. What has not been observed has
no node.
"""

from __future__ import annotations

import enum
from typing import Any

import numpy as np
from gymnasium import spaces

from gavel_env.envs.unicode_text import UnicodeText
from gavel_env.errors import TooManyNodes
from gavel_env.world_model.dynamics import ViolationKind
from gavel_env.world_model.graph import Flag

__all__ = [
    "AFFORDANCES",
    "MAX_CATEGORIES",
    "MAX_INSTRUCTION",
    "MAX_ROOMS",
    "NODE_COLUMNS",
    "ROOM_TYPES",
    "NO_ROOM",
    "OUTCOMES",
    "EdgeType",
    "NodeKind",
    "TooManyNodes",
    "node_space",
    "observation_space",
]

MAX_ROOMS = 64
NO_ROOM = MAX_ROOMS
MAX_CATEGORIES = 10_000
_FAR_M = 1e6
MAX_INSTRUCTION = 4096
_ROOM_TYPES = """
    bar bathroom bedroom biology_lab break_room chemistry_lab childs_room classroom closet computer_lab
    conference_hall copy_room corridor dining_room empty_room entryway exercise_room garage garden grocery_store gym
    hammam infirmary kitchen living_room lobby locker_room meeting_room pantry_room phone_room playroom
    private_office sauna shared_office spa staircase storage_room television_room utility_room
"""
ROOM_TYPES = tuple(_ROOM_TYPES.split())
"""The 39 room types of BEHAVIOR-1K's scenes (bddl 3.6.0)."""

OUTCOMES = ("", "ok", *(kind.value for kind in ViolationKind))


class NodeKind(enum.IntEnum):
    """Values of the column `kind`."""

    ROBOT = 0
    ROOM = 1
    OBJECT = 2


class EdgeType(enum.IntEnum):
    """Values of the edges: relation(source, target)."""

    ON_TOP = 0
    OBJECT_INSIDE = 1
    HOLDING = 2
    ROOM_INSIDE = 3
    ROOM_CONNECT = 4
    NEXT_TO = 5
    UNDER = 6
    NEAR = 7


AFFORDANCES = (
    "openable",
    "toggleable",
    "requires_closed",
    "surface",
    "interior",
    "liftable",
    "cookable",
    "washes",
    "dries",
    "rinses",
    "wipes",
    "safety_critical",
    "clearance",
)
_FLAGS = tuple(flag.name.lower() for flag in Flag)
NODE_COLUMNS = (
    "kind",
    "type",
    "x_m",
    "y_m",
    "width_m",
    "height_m",
    "room",
    "searched",
    "fixed",
    "near",
    "held",
    *_FLAGS,
    *AFFORDANCES,
    "heats",
    "cools",
)
"""Columns of a node, all float32.

kind: `NodeKind`. type: rooms: index in `ROOM_TYPES` (-1: another type); objects: index of the category in the ontology.
x_m, y_m: centre of a room, of the piece that holds an object up, or of the robot. width_m, height_m: extent of a room's
bounding box; 0 for others. room: node index of the room, -1 if unknown. searched: a room that was searched. The others
are 0 or 1.
"""
_COLUMN = {name: i for i, name in enumerate(NODE_COLUMNS)}


def node_space(max_nodes: int, count: int | None = None) -> spaces.Box:
    """Return the space of a node, or of an array of `count` nodes."""
    low = np.zeros(len(NODE_COLUMNS), np.float32)
    high = np.ones(len(NODE_COLUMNS), np.float32)
    for column, least, most in (
        ("kind", 0, len(NodeKind) - 1),
        ("type", -1, MAX_CATEGORIES - 1),
        ("x_m", -_FAR_M, _FAR_M),
        ("y_m", -_FAR_M, _FAR_M),
        ("width_m", 0, _FAR_M),
        ("height_m", 0, _FAR_M),
        ("room", -1, max_nodes - 1),
    ):
        low[_COLUMN[column]], high[_COLUMN[column]] = least, most
    if count is not None:
        low, high = np.tile(low, (count, 1)), np.tile(high, (count, 1))
    return spaces.Box(low, high, dtype=np.float32)


def observation_space(max_nodes: int, *, with_graph: bool) -> spaces.Dict:
    """Return the observation space; `with_graph` adds the `graph` entry."""
    parts: dict[str, spaces.Space[Any]] = {
        "holding": spaces.Discrete(max_nodes),
        "instruction": UnicodeText(MAX_INSTRUCTION),
        "metres": spaces.Box(0.0, _FAR_M, (1,), np.float32),
        "outcome": spaces.Discrete(len(OUTCOMES)),
        "pose": spaces.Box(-_FAR_M, _FAR_M, (4,), np.float32),
        "room": spaces.Discrete(MAX_ROOMS + 1),
        "searched": spaces.MultiBinary(MAX_ROOMS),
    }
    if with_graph:
        parts["graph"] = spaces.Graph(
            node_space=node_space(max_nodes),
            edge_space=spaces.Discrete(len(EdgeType)),
        )
    return spaces.Dict(parts)
