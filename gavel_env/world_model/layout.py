"""Where things and rooms of a graph lie, as far as someone has measured it. A graph can do without."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeAlias

import msgspec

__all__ = ["NO_LAYOUT", "Layout", "Point", "Polygon"]

Point: TypeAlias = tuple[float, float, float]
"""x, y, z in metres, z upwards."""

Polygon: TypeAlias = tuple[tuple[float, float], ...]
"""Corners (x, y) in metres, in order; at least three."""

_NOTHING: Mapping[str, Point] = MappingProxyType({})


class Layout(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is known of where things and rooms lie when the graph is made.

    Attributes:
        positions: id of a node, a room or `robot` -> its centre.
        footprints: node or room id -> the outline of what it covers of the floor.
        distances_m: connection (a, b) as the world has it -> metres of the way between the two rooms.
    """

    positions: Mapping[str, Point] = _NOTHING
    footprints: Mapping[str, Polygon] = MappingProxyType({})
    distances_m: Mapping[tuple[str, str], float] = MappingProxyType({})

    def __bool__(self) -> bool:
        return bool(self.positions or self.footprints or self.distances_m)


NO_LAYOUT = Layout()
