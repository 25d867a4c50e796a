"""Errands of multi-task instructions: one thing, or one switch."""

from __future__ import annotations

from collections.abc import Callable

from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.drafts import Draft, PlaceTest, Thing
from gavel_env.tasks.errands import (
    ANY_THEME,
    Build,
    Errand,
    behind_a_door,
    draw_appliance,
    draw_switch,
    draw_target,
    draw_thing,
    fetch,
    in_doorless,
    in_the_open,
    literal,
    on_a_surface,
    outside_of_furniture,
    put,
    run,
    take_out,
)
from gavel_env.tasks.placements import Place
from gavel_env.world_model.ontology import Category

__all__ = [
    "away",
    "conferred",
    "counter_heat",
    "fridge_heat",
    "out_of_container",
    "switch_on",
    "to_container",
    "to_support",
]


def _carry(shape: str, draft: Draft, thing: Thing | None, test: PlaceTest) -> Errand | None:
    target = None if thing is None else draw_target(draft, [thing], test)
    if thing is None or target is None:
        return None
    plan = fetch(draft, thing) + put(draft, target.reference.piece, target.relation)
    return Errand(shape, (thing,), (target,), (), None, (literal(thing, target),), tuple(plan))


def to_support(draft: Draft) -> Errand | None:
    """Carry a thing from a support to another."""
    return _carry("to_support", draft, draw_thing(draft, ANY_THEME, outside_of_furniture), on_a_surface)


def to_container(draft: Draft) -> Errand | None:
    """Carry a thing from a support into a container without a door."""
    return _carry("to_container", draft, draw_thing(draft, ANY_THEME, outside_of_furniture), in_doorless(draft))


def out_of_container(draft: Draft) -> Errand | None:
    """Take a thing out of a container without a door and set it down."""
    return _carry(
        "out_of_container",
        draft,
        draw_thing(draft, ANY_THEME, in_doorless(draft), say=1.0, say_room_only=0.0),
        on_a_surface,
    )


def away(draft: Draft) -> Errand | None:
    """Put a thing away behind a door."""
    return _carry("away", draft, draw_thing(draft, ANY_THEME, in_the_open(draft)), behind_a_door(draft))


def switch_on(draft: Draft) -> Errand | None:
    """Switch something on."""
    switch = draw_switch(draft)
    if switch is None:
        return None
    plan = (f"NAVIGATE_TO({switch.piece.id})", f"TOGGLE_ON({switch.piece.id})")
    return Errand("switch_on", (), (), (), switch, (f"toggled({switch})",), plan)


def conferred(shape: str, themes: tuple[Theme, ...], state: str, serves: Callable[[Category], bool]) -> Build:
    """Return the shape "run a thing through an appliance" (dishwasher, washer, dryer)."""

    def build(draft: Draft) -> Errand | None:
        thing = draw_thing(draft, themes, in_the_open(draft))
        appliance = None if thing is None else draw_appliance(draft, [thing], serves)
        if thing is None or appliance is None:
            return None
        piece = appliance.piece
        plan = fetch(draft, thing) + put(draft, piece, "in") + run(piece)
        return Errand(shape, (thing,), (), (appliance,), None, (f"{state}({thing.category})",), tuple(plan))

    return build


def _heat(shape: str, draft: Draft, thing: Thing | None) -> Errand | None:
    if thing is None or not draft.house.ontology[thing.category].cookable:
        return None
    appliance = draw_appliance(draft, [thing], lambda category: category.heat is not None)
    target = draw_target(draft, [thing], on_a_surface)
    if appliance is None or target is None:
        return None
    piece = appliance.piece
    heat = draft.house.ontology[piece.category].heat
    inside = draft.house.ontology[piece.category].interior and heat is not None and heat.requires_inside
    plan = [
        *fetch(draft, thing),
        *put(draft, piece, "in" if inside else "on"),
        *run(piece),
        *(take_out(draft, piece, thing) if inside else [f"GRASP({thing.id})"]),
        *put(draft, target.reference.piece, target.relation),
    ]
    goal = (f"cooked({thing.category})", literal(thing, target))
    return Errand(shape, (thing,), (target,), (appliance,), None, goal, tuple(plan))


def counter_heat(draft: Draft) -> Errand | None:
    """Heat what stands in the open, then serve it."""
    return _heat("counter_heat", draft, draw_thing(draft, ("hot_food",), on_a_surface, say=0.6))


def fridge_heat(draft: Draft) -> Errand | None:
    """Heat what is in the fridge, then serve it."""
    return _heat("fridge_heat", draft, draw_thing(draft, ("hot_food",), _cold(draft)))


def _cold(draft: Draft) -> PlaceTest:
    def test(place: Place) -> bool:
        piece = place.piece
        return piece is not None and draft.house.shuts(place) and draft.house.ontology[piece.category].cold is not None

    return test
