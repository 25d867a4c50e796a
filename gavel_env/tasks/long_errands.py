"""Single long tasks: several things, several legs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.drafts import Draft, PlaceTest, Thing
from gavel_env.tasks.errands import (
    ANY_THEME,
    Errand,
    Target,
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
    put,
    run,
    take_out,
)
from gavel_env.tasks.placements import Place, pick

__all__ = [
    "bring_three",
    "carry_two",
    "carry_two_and_switch",
    "load_dishwasher",
    "put_two_away",
    "swap",
    "take_two_out",
    "tray",
    "wash_then_dry",
]


def _several(
    shape: str,
    draft: Draft,
    things: Sequence[Thing | None],
    tests: Sequence[PlaceTest],
    *,
    switch: bool = False,
) -> Errand | None:
    """Carry several things: to one place (one test), or each to its own (one test each)."""
    found = [t for t in things if t is not None]
    if len(found) < len(things):
        return None
    groups = [found] if len(tests) == 1 else [[t] for t in found]
    targets: list[Target] = []
    for group, test in zip(groups, tests, strict=True):
        target = draw_target(draft, found if len(tests) == 1 else group, test)
        if target is None or any(t.reference.piece.category == target.reference.piece.category for t in targets):
            return None
        targets.append(target)
    ends = [targets[0] if len(tests) == 1 else target for target in (targets * len(found))[: len(found)]]
    plan: list[str] = []
    for thing, target in zip(found, ends, strict=True):
        plan += fetch(draft, thing) + put(draft, target.reference.piece, target.relation)
    goal = [literal(thing, target) for thing, target in zip(found, ends, strict=True)]
    lamp = draw_switch(draft) if switch else None
    if switch:
        if lamp is None or any(lamp.piece.category == t.reference.piece.category for t in targets):
            return None
        plan += [f"NAVIGATE_TO({lamp.piece.id})", f"TOGGLE_ON({lamp.piece.id})"]
        goal.append(f"toggled({lamp})")
    return Errand(shape, tuple(found), tuple(targets), (), lamp, tuple(goal), tuple(plan))


def _things(draft: Draft, count: int, first: PlaceTest, others: PlaceTest) -> list[Thing]:
    """Draw things that go well together: of one theme, each pair in the draft's split."""
    theme = pick(draft.rng, ANY_THEME)
    themes: tuple[Theme, ...] = (theme,)
    if draft.rng.random() < 0.4:
        themes = ANY_THEME
    found: list[Thing] = []
    for index in range(count):
        beside = [t.category for t in found]
        thing = draw_thing(draft, themes, first if index == 0 else others, beside, say_room_only=0.05)
        if thing is None or any(t.category == thing.category for t in found):
            return []
        found.append(thing)
    return found


def put_two_away(draft: Draft) -> Errand | None:
    """Put two things away behind doors, shutting them each time."""
    first = behind_a_door(draft) if draft.rng.random() < 0.45 else in_the_open(draft)
    things = _things(draft, 2, first, in_the_open(draft))
    same = draft.rng.random() < 0.5
    tests = [behind_a_door(draft)] if same else [behind_a_door(draft), behind_a_door(draft)]
    return _several("put_two_away", draft, things, tests) if things else None


def take_two_out(draft: Draft) -> Errand | None:
    """Take two things out of one container with a door and set them down."""
    boxes = [p for p in draft.house.pieces_for("in") if draft.house.ontology[p.category].has_door]
    if not boxes:
        return None
    box = pick(draft.rng, boxes)

    def within(place: Place) -> bool:
        return place.relation == "in" and place.piece == box

    things = _things(draft, 2, within, within)
    tests: list[PlaceTest] = [on_a_surface] if draft.rng.random() < 0.6 else [on_a_surface, on_a_surface]
    return _several("take_two_out", draft, things, tests) if things else None


def bring_three(draft: Draft) -> Errand | None:
    """Bring three things to one place."""
    first = behind_a_door(draft) if draft.rng.random() < 0.4 else in_the_open(draft)
    things = _things(draft, 3, first, in_the_open(draft))
    test = on_a_surface if draft.rng.random() < 0.55 else in_doorless(draft)
    return _several("bring_three", draft, things, [test]) if things else None


def carry_two(draft: Draft) -> Errand | None:
    """Carry two things."""
    return _two(draft, "carry_two", switch=False)


def carry_two_and_switch(draft: Draft) -> Errand | None:
    """Carry two things, then switch something on."""
    return _two(draft, "carry_two_and_switch", switch=True)


def _two(draft: Draft, shape: str, *, switch: bool) -> Errand | None:
    first = behind_a_door(draft) if switch and draft.rng.random() < 0.25 else in_the_open(draft)
    things = _things(draft, 2, first, in_the_open(draft))
    kinds = [pick(draft.rng, [on_a_surface, in_doorless(draft)]) for _ in range(1 if draft.rng.random() < 0.4 else 2)]
    return _several(shape, draft, things, kinds, switch=switch) if things else None


def swap(draft: Draft) -> Errand | None:
    """Swap what stands in two places, by way of a third (the parking surface)."""
    house = draft.house
    first = pick(draft.rng, [on_a_surface, on_a_surface, in_doorless(draft), behind_a_door(draft)])
    second = pick(draft.rng, [on_a_surface, on_a_surface, in_doorless(draft)])
    theme = pick(draft.rng, ANY_THEME)
    a = draw_thing(draft, (theme,), first, say=1.0)
    if a is None or a.source is None:
        return None
    themes: tuple[Theme, ...] = (theme,) if draft.rng.random() < 0.5 else ANY_THEME
    b = draw_thing(draft, themes, second, [a.category, a.source.piece.category], say=1.0)
    if b is None or b.source is None or b.category == a.category:
        return None
    if a.source.piece.category == b.source.piece.category or not draft.pairs_fit((a.category, b.source.piece.category)):
        return None
    if not (draft.house.suits(a.start, b.category) and draft.house.suits(b.start, a.category)):
        return None
    parking = [p for p in house.pieces_for("on") if p.id not in (a.source.piece.id, b.source.piece.id)]
    parking = [p for p in parking if p.room == a.start.room] or parking
    if not parking:
        return None
    spot = pick(draft.rng, parking)
    at_a, at_b = Target(a.source, _relation(a.start)), Target(b.source, _relation(b.start))
    plan = [
        *fetch(draft, a),
        *put(draft, spot, "on"),
        *fetch(draft, b),
        *put(draft, at_a.reference.piece, at_a.relation),
        f"NAVIGATE_TO({a.id})",
        f"GRASP({a.id})",
        *put(draft, at_b.reference.piece, at_b.relation),
    ]
    goal = (literal(a, at_b), literal(b, at_a))
    return Errand("swap", (a, b), (at_b, at_a), (), None, goal, tuple(plan))


def _relation(place: Place) -> Literal["on", "in"]:
    return "in" if place.relation == "in" else "on"


def tray(draft: Draft) -> Errand | None:
    """Set a thing on a tray, put the tray away."""
    tray = draw_thing(draft, ("tray",), in_the_open(draft))
    if tray is None or not draft.house.ontology[tray.category].surface:
        return None
    thing = draw_thing(draft, ("dish", "food", "drink", "pantry", "hot_food"), in_the_open(draft), [tray.category])
    target = None if thing is None else draw_target(draft, [tray], behind_a_door(draft))
    if thing is None or target is None or not draft.pairs_fit((thing.category, target.reference.piece.category)):
        return None
    plan = [
        *fetch(draft, thing),
        f"NAVIGATE_TO({tray.id})",
        f"PLACE_ON_TOP({tray.id})",
        f"GRASP({tray.id})",
        *put(draft, target.reference.piece, "in"),
    ]
    goal = (f"on_top({thing.category}, {tray.category})", literal(tray, target))
    return Errand("tray", (thing, tray), (target,), (), None, goal, tuple(plan))


def load_dishwasher(draft: Draft) -> Errand | None:
    """Load two things, then run the dishwasher."""
    a = draw_thing(draft, ("dish",), in_the_open(draft))
    b = None if a is None else draw_thing(draft, ("dish",), in_the_open(draft), [a.category])
    if a is None or b is None or a.category == b.category:
        return None
    machine = draw_appliance(draft, [a, b], lambda category: category.washes)
    if machine is None:
        return None
    box = machine.piece.id
    plan = [
        *fetch(draft, a),
        f"NAVIGATE_TO({box})",
        f"OPEN({box})",
        f"PLACE_INSIDE({box})",
        *fetch(draft, b),
        f"NAVIGATE_TO({box})",
        f"PLACE_INSIDE({box})",
        f"CLOSE({box})",
        *run(machine.piece),
    ]
    goal = tuple(f"inside({t.category}, {machine})" for t in (a, b)) + tuple(f"washed({t.category})" for t in (a, b))
    return Errand("load_dishwasher", (a, b), (), (machine,), None, goal, tuple(plan))


def wash_then_dry(draft: Draft) -> Errand | None:
    """Wash a thing, dry it, and leave it in the dryer."""
    thing = draw_thing(draft, ("laundry",), in_the_open(draft))
    if thing is None:
        return None
    washer = draw_appliance(draft, [thing], lambda category: category.washes)
    dryer = draw_appliance(draft, [thing], lambda category: category.dries)
    if washer is None or dryer is None:
        return None
    plan = [
        *fetch(draft, thing),
        *put(draft, washer.piece, "in"),
        *run(washer.piece),
        *take_out(draft, washer.piece, thing),
        *put(draft, dryer.piece, "in"),
        *run(dryer.piece),
    ]
    name = thing.category
    goal = (f"washed({name})", f"dried({name})", f"inside({name}, {dryer})")
    return Errand("wash_then_dry", (thing,), (), (washer, dryer), None, goal, tuple(plan))
