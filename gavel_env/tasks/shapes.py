"""The table of errand shapes, and how one is drawn into a draft."""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter

from gavel_env.tasks import long_errands as long
from gavel_env.tasks import short_errands as short
from gavel_env.tasks.drafts import Draft
from gavel_env.tasks.errands import Errand, Shape

__all__ = ["SHAPES", "draw_errand"]

SHAPES: Mapping[str, Shape] = {
    "to_support": Shape(short.to_support, False),
    "to_container": Shape(short.to_container, False),
    "out_of_container": Shape(short.out_of_container, False),
    "away": Shape(short.away, False),
    "switch_on": Shape(short.switch_on, False),
    "wash_dish": Shape(short.conferred("wash_dish", ("dish", "tray"), "washed", attrgetter("washes")), True),
    "wash_clothes": Shape(short.conferred("wash_clothes", ("laundry",), "washed", attrgetter("washes")), True),
    "dry_clothes": Shape(short.conferred("dry_clothes", ("laundry",), "dried", attrgetter("dries")), True),
    "counter_heat": Shape(short.counter_heat, True),
    "fridge_heat": Shape(short.fridge_heat, True),
    "put_two_away": Shape(long.put_two_away, False),
    "take_two_out": Shape(long.take_two_out, False),
    "bring_three": Shape(long.bring_three, False),
    "carry_two": Shape(long.carry_two, False),
    "carry_two_and_switch": Shape(long.carry_two_and_switch, False),
    "swap": Shape(long.swap, False),
    "tray": Shape(long.tray, False),
    "load_dishwasher": Shape(long.load_dishwasher, True),
    "wash_then_dry": Shape(long.wash_then_dry, True),
}


def draw_errand(draft: Draft, shape: str, attempts: int = 60) -> Errand | None:
    """Draw an errand of a shape that shares nothing with those of the draft, and note what it uses; None if none fits.

    The references of one errand and of the whole draft agree: one furniture category, one room, one way to name it.
    """
    kept_things, kept = list(draft.things), dict(draft.references)
    for _ in range(attempts):
        errand = SHAPES[shape].build(draft)
        if errand is not None and draft.note(*errand.references()):
            draft.things.extend(errand.things)
            return errand
        draft.things[:], draft.references = list(kept_things), dict(kept)
    return None
