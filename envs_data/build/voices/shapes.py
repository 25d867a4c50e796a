"""Errands that people ask for and the benchmarks lack: off, open, shut, two of a kind, one out, there and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.drafts import Draft, Thing
from gavel_env.tasks.errands import (
    ANY_THEME,
    Build,
    Errand,
    Target,
    behind_a_door,
    draw_appliance,
    draw_switch,
    draw_target,
    draw_thing,
    fetch,
    in_the_open,
    literal,
    on_a_surface,
    put,
    run,
    take_out,
)
from gavel_env.tasks.placements import Place, pick
from gavel_env.tasks.shapes import SHAPES

__all__ = ["BUILDS", "MULTI_SHARES", "SINGLE_SHARES", "draw_errand", "initial_states"]


def switch_off(draft: Draft) -> Errand | None:
    """Switch off what is on at the start."""
    switch = draw_switch(draft)
    if switch is None:
        return None
    plan = (f"NAVIGATE_TO({switch.piece.id})", f"TOGGLE_OFF({switch.piece.id})")
    return Errand("switch_off", (), (), (), switch, (f"not toggled({switch})",), plan)


def _door(shape: str, step: str, goal: str) -> Build:
    def build(draft: Draft) -> Errand | None:
        ontology = draft.house.ontology
        pieces = [p for p in draft.house.pieces_for("in") if ontology[p.category].has_door]
        pieces = [p for p in pieces if p.category not in draft.references]
        kinds = sorted({p.category for p in pieces})
        if not kinds:
            return None
        kind = pick(draft.rng, kinds)
        door = draft.refer(pick(draft.rng, [p for p in pieces if p.category == kind]))
        if door is None:
            return None
        plan = (f"NAVIGATE_TO({door.piece.id})", f"{step}({door.piece.id})")
        return Errand(shape, (), (), (), door, (goal.format(door),), plan)

    return build


def pair(draft: Draft) -> Errand | None:
    """Bring two things of one kind to one place; the goal names them by their ids."""
    first = draw_thing(draft, ANY_THEME, in_the_open(draft))
    if first is None:
        return None
    together = draft.rng.random() < 0.4

    def beside(place: Place) -> bool:
        return not draft.house.shuts(place) and (place == first.start) == together

    start = draft.start(first.category, beside)
    test = on_a_surface if draft.rng.random() < 0.5 else behind_a_door(draft)
    target = None if start is None else draw_target(draft, [first], test)
    if start is None or target is None or (start.piece and start.piece.category == target.reference.piece.category):
        return None
    things = (first, Thing(first.category, f"{first.category}_1", start))
    predicate = "on_top" if target.relation == "on" else "inside"
    goal = tuple(f"{predicate}({thing.id}, {target.reference})" for thing in things)
    plan = [s for thing in things for s in (*fetch(draft, thing), *put(draft, target.reference.piece, target.relation))]
    return Errand("pair", things, (target,), (), None, goal, tuple(plan))


def take_one_out(draft: Draft) -> Errand | None:
    """Take a thing out from behind a door and set it down."""
    thing = draw_thing(draft, ANY_THEME, behind_a_door(draft))
    target = None if thing is None else draw_target(draft, [thing], on_a_surface)
    if thing is None or target is None:
        return None
    plan = fetch(draft, thing) + put(draft, target.reference.piece, target.relation)
    return Errand("take_one_out", (thing,), (target,), (), None, (literal(thing, target),), tuple(plan))


def there_and_back(draft: Draft) -> Errand | None:
    """Wash, dry or heat a thing and bring it back to where it was."""
    themes: dict[str, tuple[Theme, ...]] = {
        "washed": ("dish", "laundry"),
        "dried": ("laundry",),
        "cooked": ("hot_food",),
    }
    state = pick(draft.rng, list(themes))
    thing = draw_thing(draft, [pick(draft.rng, themes[state])], on_a_surface, say=1.0)
    if thing is None or thing.source is None:
        return None
    ontology = draft.house.ontology
    machine = draw_appliance(
        draft,
        [thing],
        lambda c: c.washes if state == "washed" else c.dries if state == "dried" else c.heat is not None,
    )
    if machine is None or (state == "cooked" and not ontology[thing.category].cookable):
        return None
    piece, heat = machine.piece, ontology[machine.piece.category].heat
    inside = state != "cooked" or (ontology[piece.category].interior and heat is not None and heat.requires_inside)
    plan = [
        *fetch(draft, thing),
        *put(draft, piece, "in" if inside else "on"),
        *run(piece),
        *(take_out(draft, piece, thing) if inside else [f"GRASP({thing.id})"]),
        *put(draft, thing.source.piece, "on"),
    ]
    home = Target(thing.source, "on")
    goal = (f"{state}({thing.category})", literal(thing, home))
    return Errand("there_and_back", (thing,), (home,), (machine,), None, goal, tuple(plan))


BUILDS: Mapping[str, Callable[[Draft], Errand | None]] = {
    **{name: shape.build for name, shape in SHAPES.items()},
    "switch_off": switch_off,
    "open_door": _door("open_door", "OPEN", "open({})"),
    "close_door": _door("close_door", "CLOSE", "not open({})"),
    "pair": pair,
    "take_one_out": take_one_out,
    "there_and_back": there_and_back,
}

# Shares of the shapes; what a house does not afford goes to the others.
SINGLE_SHARES = {
    "put_two_away": 12,
    "take_two_out": 10,
    "bring_three": 10,
    "carry_two": 8,
    "carry_two_and_switch": 7,
    "swap": 9,
    "tray": 4,
    "load_dishwasher": 8,
    "wash_then_dry": 10,
    "counter_heat": 8,
    "fridge_heat": 8,
    "there_and_back": 9,
    "pair": 9,
    "take_one_out": 9,
    "away": 8,
    "to_support": 6,
    "to_container": 5,
    "wash_dish": 5,
    "wash_clothes": 5,
    "dry_clothes": 3,
    "switch_on": 4,
    "switch_off": 5,
    "open_door": 4,
    "close_door": 4,
}
MULTI_SHARES = {
    "to_support": 20,
    "to_container": 18,
    "out_of_container": 8,
    "away": 13,
    "take_one_out": 11,
    "switch_on": 9,
    "switch_off": 8,
    "open_door": 4,
    "close_door": 6,
    "pair": 6,
    "wash_dish": 6,
    "wash_clothes": 6,
    "dry_clothes": 4,
    "counter_heat": 6,
    "fridge_heat": 6,
    "there_and_back": 5,
}


def draw_errand(draft: Draft, shape: str, attempts: int = 40) -> Errand | None:
    """Draw an errand of a shape that shares nothing with those of the draft, and note it; None if none fits."""
    kept_things, kept = list(draft.things), dict(draft.references)
    for _ in range(attempts):
        errand = BUILDS[shape](draft)
        if errand is not None and draft.note(*errand.references()):
            draft.things.extend(errand.things)
            return errand
        draft.things[:], draft.references = list(kept_things), dict(kept)
    return None


def initial_states(errand: Errand) -> tuple[str, ...]:
    """Return what must hold at the start for the errand to have something to do."""
    if errand.switch is None:
        return ()
    states = {"switch_off": "toggled", "close_door": "open"}
    return (f"{states[errand.shape]}({errand.switch.piece.id})",) if errand.shape in states else ()
