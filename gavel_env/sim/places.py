"""Where objects are on the floor plan, and from where they are within reach.

Furniture stands where the scene says; a movable is where its nearest fixed holder is, on its own spot of the floor, or
in the hand. `near` is measured as the distance from the robot's centre to that footprint or spot.
"""

from __future__ import annotations

import math

import numpy as np

from gavel_env.house.floor_map import FloorMap, Indices
from gavel_env.world_model.graph import Relation, SceneGraph

__all__ = ["Places"]


class Places:
    """The places of one house in one episode.

    Args:
        floor: the map.
        graph: G*_0.
        rng: chooses the spots of the movables that start on the floor: reachable cells of their rooms.

    Attributes:
        spots: flat cell of every movable that lies on the floor.
    """

    def __init__(self, floor: FloorMap, graph: SceneGraph, rng: np.random.Generator) -> None:
        self.floor = floor
        self.spots: dict[str, int] = {}
        on_floor = [(o, s.holder) for o, s in graph.supports.items() if s.relation is Relation.FLOOR]
        for obj, room in sorted(pair for pair in on_floor if not graph.world.nodes[pair[0]].fixed):
            cells = floor.room_cells[room]
            if cells.size == 0:
                inside = floor.floor & (floor.rooms == floor.room_index[room])
                cells = np.nonzero(inside.ravel())[0].astype(np.int32)
            self.spots[obj] = int(rng.choice(cells))

    def anchor(self, graph: SceneGraph, obj: str) -> str | int | None:
        """Return what fixes an object's place: its nearest fixed holder or itself, a floor cell, or None = the hand."""
        nodes = graph.world.nodes
        while not nodes[obj].fixed:
            relation, holder = graph.supports[obj]
            if relation is Relation.HELD:
                return None
            if relation is Relation.FLOOR:
                return self.spots[obj]
            obj = holder
        return obj

    def position(self, graph: SceneGraph, obj: str, cell: int) -> tuple[float, float]:
        """Return x, y in metres of an object's anchor; those of the robot's `cell` for what is in the hand."""
        anchor = self.anchor(graph, obj)
        if isinstance(anchor, str):
            piece = self.floor.pieces[anchor]
            return piece.x, piece.y
        return self.floor.point(cell if anchor is None else anchor)

    def stances(self, graph: SceneGraph, obj: str, cell: int) -> Indices:
        """Return the cells to work on an object from, (n,) flat; the robot's own `cell` for what is in the hand."""
        anchor = self.anchor(graph, obj)
        if anchor is None:
            return np.array([cell], np.int32)
        return self.floor.stances_at(anchor) if isinstance(anchor, int) else self.floor.stances(anchor)

    def distance_m(self, graph: SceneGraph, obj: str, cell: int) -> float:
        """Return the metres from the centre of the robot's `cell` to an object; 0 for what is in the hand."""
        anchor = self.anchor(graph, obj)
        if anchor is None:
            return 0.0
        cell_m = self.floor.robot.cell_m
        row, column = self.floor.cell(cell)
        if isinstance(anchor, int):
            spot = self.floor.cell(anchor)
            return math.hypot(row - spot.row, column - spot.column) * cell_m
        x, y, cosine, sine, half_depth, half_width = (float(v) for v in self.floor.rectangle(anchor))
        dx, dy = column + 0.5 - x, row + 0.5 - y
        along = max(0.0, abs(dx * cosine + dy * sine) - half_depth)
        across = max(0.0, abs(dy * cosine - dx * sine) - half_width)
        return math.hypot(along, across) * cell_m
