"""How likely each category of a concept is what is meant, in a house whose rooms are known.

Somebody says "the cabinet". With R the rooms that it may be in (all, or those stated),

    w_c  ~  1 / (1 + rank_c) * (1 - prod_{r in R} (1 - a_c(tau_r))),

rank_c: place of c among the concept's members, 0 for the one that people think of first; a_c(tau): share of the rooms
of type tau that hold a c, in the scenes that the location priors learn from (no benchmark house):

    a_c(tau) = (rooms of type tau with c + g_c) / (rooms of type tau + 1),   g_c = (rooms with c + 1/2) / (rooms + 1).

The belief of a node named by a concept is the mixture sum_c w_c b_c. Not in the paper, whose designators name one
category each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.data import load_contents, training_scenes

__all__ = ["category_weights"]


class _Shares(NamedTuple):
    """Rooms by type, and by type and category; `everywhere` counts the rooms that hold a category."""

    rooms: Counter[str]
    with_category: Counter[tuple[str, str]]
    everywhere: Counter[str]


@cache
def _shares() -> _Shares:
    contents = load_contents()
    found = _Shares(Counter(), Counter(), Counter())
    for scene in training_scenes(contents):
        for room in contents.scenes[scene]:
            found.rooms[room.type] += 1
            found.with_category.update((room.type, category) for category in room.contents)
            found.everywhere.update(room.contents.keys())
    return found


def _share(category: str, room_type: str) -> float:
    """Return a_c(tau)."""
    shares = _shares()
    general = (shares.everywhere[category] + 0.5) / (shares.rooms.total() + 1.0)
    return (shares.with_category[room_type, category] + general) / (shares.rooms[room_type] + 1.0)


def category_weights(categories: Sequence[str], room_types: Sequence[str]) -> NDArray[np.float64]:
    """Return w_c, (categories,), sum 1.

    Args:
        categories: what may be meant, the one that people think of first in front.
        room_types: types of the rooms that it may be in, one entry a room.
    """
    if len(categories) == 1:
        return np.ones(1)
    weights = np.array(
        [
            (1.0 - np.prod([1.0 - _share(category, kind) for kind in room_types])) / (1.0 + rank)
            for rank, category in enumerate(categories)
        ]
    )
    total = float(weights.sum())
    return weights / total if total > 0.0 else np.full(len(categories), 1.0 / len(categories))
