"""Furnishing a room: the order in which its floor pieces are put down, tried in several ways."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from envs_data.build.layout_pieces import Piece, rules
from envs_data.build.layout_place import (
    place_aisle,
    place_bed,
    place_before,
    place_chair,
    place_corner,
    place_counter,
    place_free,
    place_lounge,
    place_run,
    place_sofa,
    place_table,
    place_table_at_wall,
    place_wall,
)
from envs_data.build.layout_poses import RoomLayout
from envs_data.build.layout_space import RoomSpace
from envs_data.build.layout_tops import slab_over_bases

__all__ = ["furnish"]

ATTEMPTS = 16
COUNTER_M = 0.9


def place_slab(layout: RoomLayout, piece: Piece) -> bool:
    """A countertop: over base units where it can, else on its own at the wall."""
    if slab_over_bases(layout, piece):
        return True
    if not place_counter(layout, piece):
        return False
    lift = max(0.0, COUNTER_M - piece.size_m[2])
    layout.placed[-1] = layout.placed[-1]._replace(z=round(lift, 3))
    return True


Placer = Callable[[RoomLayout, Piece], bool]

PLACERS: dict[str, Placer] = {
    "aisle": place_aisle,
    "bath": place_wall,
    "bed": place_bed,
    "chair": place_chair,
    "coffee_table": place_before,
    "corner": place_corner,
    "desk": place_wall,
    "free": place_free,
    "lounge": place_lounge,
    "nightstand": place_wall,
    "run": place_run,
    "sink": place_run,
    "slab": place_slab,
    "sofa": place_sofa,
    "table": place_table,
    "top": place_corner,
    "wall_piece": place_wall,
}


def furnish(space: Callable[[bool], RoomSpace], pieces: Sequence[Piece], tight: bool) -> RoomLayout:
    """Put the floor pieces of a room down, in the order that leaves the fewest out.

    Args:
        space: makes the empty room afresh for each attempt, comfortable (False) or tight (True).
        pieces: what stands on the floor.
        tight: whether tight aisles may be tried where comfortable ones leave pieces out.
    """
    orders = rules().orders
    best: RoomLayout | None = None
    first: list[tuple[str, str]] = []
    for narrow in (False, True) if tight else (False,):
        if best is not None and not best.left:
            return best
        for attempt in range(ATTEMPTS):
            order = orders[attempt // 2 % len(orders)]
            early = first if attempt >= 2 * len(orders) else []
            layout = _attempt(space(narrow), pieces, order, attempt % 2 == 1, early)
            if best is None or _loss(layout) < _loss(best):
                best = layout
            if (not best.left and not best.astray) or len(pieces) > 100:
                return best
            first = sorted({p.key for p in layout.left}) + [k for k in first if k not in {p.key for p in layout.left}]
    assert best is not None
    last = [_attempt(space(tight), pieces, order, False, []) for order in rules().last_orders if best.left]
    best = min([best, *last], key=_loss)
    _add_left(best)
    return best


def _add_left(layout: RoomLayout) -> None:
    """Put down what is left of a full room, beside a bathtub or table that can still be reached from another side.

    What stands is not moved.
    """
    layout.reach_any_side()
    left, layout.left = layout.left, []
    layout.left += [piece for piece in left if not PLACERS[piece.role](layout, piece)]


def _loss(layout: RoomLayout) -> tuple[int, float]:
    """Return how bad a layout is: a piece left out counts as four away from their wall; then the area left out."""
    return 4 * len(layout.left) + layout.astray, round(sum(p.area_m2 for p in layout.left), 4)


def _attempt(
    space: RoomSpace,
    pieces: Sequence[Piece],
    order: Sequence[str],
    tables_at_wall: bool,
    first: Sequence[tuple[str, str]],
) -> RoomLayout:
    layout = RoomLayout(space)
    rank = {role: i for i, role in enumerate(order)}
    early = {key: i - len(first) for i, key in enumerate(first)}
    ordered = sorted(
        pieces, key=lambda p: (early.get(p.key, 0), rank[p.role], -round(p.area_m2, 3), p.category, p.model)
    )
    failed: set[tuple[str, str]] = set()
    for piece in ordered:
        placer = place_table_at_wall if piece.role == "table" and tables_at_wall else PLACERS[piece.role]
        if piece.key in failed or not placer(layout, piece):
            failed.add(piece.key)
            layout.left.append(piece)
    return layout
