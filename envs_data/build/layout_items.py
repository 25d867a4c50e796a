"""The movables of a scene's own contents: each gets one support in its room, on or in a piece, else the floor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Literal

from envs_data.build.layout_pieces import Piece, rules
from gavel_env.house.scenes import Furniture, Item
from gavel_env.world_model.ontology import default_ontology

Holder = tuple[Literal["on", "in"], str, float, Furniture]

__all__ = ["assign_items"]

INSIDE_LEVELS = 4.0
FULL = 0.5


def assign_items(pieces: Sequence[Piece], furniture: Sequence[Furniture], numbers: Counter[str]) -> tuple[Item, ...]:
    """Give every movable a support in its room.

    Things of one model stay together: a support is filled to half of its area (four levels inside) before the next is
    begun, and the supports of a room take turns. What finds no support lies on the floor.

    Args:
        pieces: the movables, any order.
        furniture: the placed pieces.
        numbers: next index of each category; counted up.
    """
    found: list[Item] = []
    for room in sorted({p.room for p in pieces}):
        holders = _holders(room, furniture)
        used = [0.0] * len(holders)
        mine = sorted((p for p in pieces if p.room == room), key=lambda p: (p.category, p.model))
        current: dict[tuple[str, str], int] = {}
        for piece in mine:
            index = current.get(piece.key, -1)
            if index < 0 or used[index] + piece.area_m2 > holders[index][2]:
                index = _next(holders, used, piece)
            name = f"{piece.category}_{numbers[piece.category]}"
            numbers[piece.category] += 1
            if index < 0:
                found.append(Item(name, piece.category, piece.model, room, "floor", room))
                continue
            current[piece.key] = index
            used[index] += piece.area_m2
            relation, holder, _, _ = holders[index]
            found.append(Item(name, piece.category, piece.model, room, relation, holder))
    return tuple(found)


def _holders(room: str, furniture: Sequence[Furniture]) -> list[Holder]:
    """Return (relation, id, capacity in square metres, piece) of the supports of a room."""
    ontology = default_ontology()
    covered = {f.on for f in furniture if f.on is not None and f.size_m[2] <= 0.15}
    found: list[Holder] = []
    for piece in furniture:
        if piece.room != room or piece.mount not in ("floor", "wall") or piece.category in rules().keeps_nothing:
            continue
        category = ontology[piece.category]
        area = piece.size_m[0] * piece.size_m[1]
        if category.interior and not category.openable and piece.size_m[2] > 0.5:
            found.append(("in", piece.id, INSIDE_LEVELS * FULL * area, piece))
        elif category.surface and piece.id not in covered and piece.size_m[2] + piece.z <= 1.4 and area >= 0.12:
            found.append(("on", piece.id, FULL * area, piece))
    return found


def _next(holders: Sequence[Holder], used: Sequence[float], piece: Piece) -> int:
    """Return the emptiest support that the piece fits on, of its own kind of support if there is one, or -1."""
    wanted = rules().stands_on.get(piece.category, ())
    best, best_key = -1, (2, 2.0, 0)
    for i, (_, _, capacity, host) in enumerate(holders):
        longest = max(piece.size_m[0], piece.size_m[1])
        if used[i] + piece.area_m2 > capacity or longest > max(host.size_m[0], host.size_m[1]):
            continue
        soft = host.category in ("bed", "sofa", "armchair")
        if soft and host.category not in wanted:
            continue
        key = (0 if host.category in wanted else 1, round(used[i] / capacity, 4), i)
        if key < best_key:
            best, best_key = i, key
    return best
