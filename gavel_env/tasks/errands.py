"""What an errand is, and what its shapes are made of: draws, steps of reference plans, goal literals.

An errand is what one task of an instruction asks for, with goal and reference plan by construction. Goal literals speak
of designators, reference plans of instance ids; a reference plan has one hand and shuts every door that it opened.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.drafts import Draft, PlaceTest, Reference, Thing
from gavel_env.tasks.placements import Piece, Place, pick
from gavel_env.world_model.ontology import Category

__all__ = [
    "ANY_THEME",
    "Build",
    "Errand",
    "Shape",
    "Target",
    "behind_a_door",
    "draw_appliance",
    "draw_switch",
    "draw_target",
    "draw_thing",
    "fetch",
    "in_doorless",
    "in_the_open",
    "literal",
    "on_a_surface",
    "outside_of_furniture",
    "put",
    "run",
    "take_out",
]

ANY_THEME: tuple[Theme, ...] = (
    "dish",
    "laundry",
    "hot_food",
    "food",
    "drink",
    "pantry",
    "office",
    "toy",
    "bath",
    "household",
)


class Target(NamedTuple):
    """Where a thing is to end: on or in a piece."""

    reference: Reference
    relation: Literal["on", "in"]


class Errand(NamedTuple):
    """One errand, before it is put into words.

    Attributes:
        shape: name in `SHAPES`.
        things: movables in order of mention.
        targets: where each thing goes (one for all, or one each; empty if only a state is asked).
        appliances: pieces that are run, in order.
        switch: a piece that is to be on at the end, or None.
        goal: literals in text form.
        plan: reference plan as text actions.
    """

    shape: str
    things: tuple[Thing, ...]
    targets: tuple[Target, ...]
    appliances: tuple[Reference, ...]
    switch: Reference | None
    goal: tuple[str, ...]
    plan: tuple[str, ...]

    def references(self) -> tuple[Reference, ...]:
        """Return every reference to furniture in the errand's sentence."""
        sources = [t.source for t in self.things if t.source is not None]
        switch = () if self.switch is None else (self.switch,)
        return (*sources, *(t.reference for t in self.targets), *self.appliances, *switch)


Build = Callable[[Draft], Errand | None]


class Shape(NamedTuple):
    """A row of the table: how to draw the shape, and whether it needs a state that only an appliance gives."""

    build: Build
    confers: bool


# --- steps of reference plans, goal literals -----------------------------------------------------------------------


def fetch(draft: Draft, thing: Thing) -> list[str]:
    """Return the steps that take a thing in hand where it starts."""
    place = thing.start
    if place.piece is not None and draft.house.shuts(place):
        box = place.piece.id
        return [f"NAVIGATE_TO({box})", f"OPEN({box})", f"GRASP({thing.id})", f"CLOSE({box})"]
    return [f"NAVIGATE_TO({thing.id})", f"GRASP({thing.id})"]


def put(draft: Draft, piece: Piece, relation: str) -> list[str]:
    """Return the steps that put what is held on or in a piece."""
    steps = [f"NAVIGATE_TO({piece.id})"]
    if relation == "on":
        return [*steps, f"PLACE_ON_TOP({piece.id})"]
    if draft.house.ontology[piece.category].has_door:
        return [*steps, f"OPEN({piece.id})", f"PLACE_INSIDE({piece.id})", f"CLOSE({piece.id})"]
    return [*steps, f"PLACE_INSIDE({piece.id})"]


def run(piece: Piece) -> list[str]:
    """Return the steps that run an appliance."""
    return [f"TOGGLE_ON({piece.id})", f"TOGGLE_OFF({piece.id})"]


def take_out(draft: Draft, piece: Piece, thing: Thing) -> list[str]:
    """Return the steps that take a thing out of a piece at which the robot stands."""
    if draft.house.ontology[piece.category].has_door:
        return [f"OPEN({piece.id})", f"GRASP({thing.id})", f"CLOSE({piece.id})"]
    return [f"GRASP({thing.id})"]


def literal(thing: Thing, target: Target) -> str:
    """Return the goal literal of a thing at its target."""
    return f"{'on_top' if target.relation == 'on' else 'inside'}({thing.category}, {target.reference})"


# --- kinds of places ------------------------------------------------------------------------------------------------


def in_the_open(draft: Draft) -> PlaceTest:
    """Return the test for places that are not behind a door."""
    return lambda place: not draft.house.shuts(place)


def behind_a_door(draft: Draft) -> PlaceTest:
    """Return the test for places inside a container with a door."""
    return draft.house.shuts


def in_doorless(draft: Draft) -> PlaceTest:
    """Return the test for places inside a container without a door."""
    return lambda place: place.relation == "in" and not draft.house.shuts(place)


def on_a_surface(place: Place) -> bool:
    """Return whether a place is on top of a piece."""
    return place.relation == "on"


def outside_of_furniture(place: Place) -> bool:
    """Return whether a place is on a piece or on the floor."""
    return place.relation != "in"


# --- draws ----------------------------------------------------------------------------------------------------------


def draw_thing(
    draft: Draft,
    themes: Sequence[Theme],
    test: PlaceTest,
    beside: Sequence[str] = (),
    *,
    say: float = 0.35,
    say_room_only: float = 0.12,
) -> Thing | None:
    """Draw a movable of the themes that starts where the test allows, or None if this draw does not work out.

    Args:
        draft: what the instruction has used so far.
        themes: of the movable.
        test: of its start.
        beside: categories that its category must pair with in the draft's split.
        say: probability that its support is said.
        say_room_only: probability that only its room is said.
    """
    category = draft.category(themes, beside)
    start = None if category is None else draft.start(category, test)
    if category is None or start is None:
        return None
    return draft.thing(category, start, say=say, say_room_only=say_room_only)


def draw_target(draft: Draft, things: Sequence[Thing], test: PlaceTest) -> Target | None:
    """Draw a destination of a category at which none of the things starts; of what fits, the piece nearest to them."""
    starts = {t.start.piece.category for t in things if t.start.piece is not None}
    place = draft.destination([t.category for t in things], test, starts)
    if place is None or place.piece is None:
        return None
    reference = draft.refer(place.piece)
    if reference is None:
        return None
    return Target(draft.nearest(reference, things), "in" if place.relation == "in" else "on")


def draw_appliance(draft: Draft, things: Sequence[Thing], test: Callable[[Category], bool]) -> Reference | None:
    """Draw an appliance for the things' themes and with the wanted effect; of what fits, the piece nearest to them."""
    themes = {draft.house.vocabulary.movables[t.category].theme for t in things}
    pieces = [
        piece
        for piece in draft.house.pieces_for("run")
        if test(draft.house.ontology[piece.category])
        and themes <= set(draft.house.vocabulary.furniture[piece.category].suits)
        and all(draft.pairs_fit((t.category, piece.category)) for t in things)
    ]
    reference = draft.refer(pick(draft.rng, pieces)) if pieces else None
    return None if reference is None else draft.nearest(reference, things)


def draw_switch(draft: Draft) -> Reference | None:
    """Draw a piece to be switched on, of a category that the draft does not speak of yet."""
    pieces = [p for p in draft.house.pieces_for("switch") if p.category not in draft.references]
    kinds = sorted({p.category for p in pieces})
    if not kinds:
        return None
    kind = pick(draft.rng, kinds)
    return draft.refer(pick(draft.rng, [p for p in pieces if p.category == kind]))
