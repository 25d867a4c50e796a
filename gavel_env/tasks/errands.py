"""The shapes of errands: goal and reference plan from the graph, by construction.

An errand is what one task of an instruction asks for. Each shape is one function from a draft to an errand, registered
in `SHAPES`; goal literals speak of designators, reference plans of instance ids. Step counts are those of a plan that
fetches with one hand and shuts every door that it opened.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

from gavel_env.tasks.drafts import Draft, Reference, Thing
from gavel_env.tasks.placements import Piece, Place, pick
from gavel_env.tasks.vocabulary import Theme

__all__ = ["SHAPES", "Errand", "Shape", "Target", "draw_errand"]

ANY: tuple[Theme, ...] = ("dish", "laundry", "hot_food", "food", "drink", "pantry", "office", "toy", "bath", "household")


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


# --- pieces of reference plans --------------------------------------------------------------------------------------


def _fetch(draft: Draft, thing: Thing) -> list[str]:
    place = thing.start
    if place.piece is not None and draft.house.shuts(place):
        box = place.piece.id
        return [f"NAVIGATE_TO({box})", f"OPEN({box})", f"GRASP({thing.id})", f"CLOSE({box})"]
    return [f"NAVIGATE_TO({thing.id})", f"GRASP({thing.id})"]


def _put(draft: Draft, piece: Piece, relation: str) -> list[str]:
    steps = [f"NAVIGATE_TO({piece.id})"]
    if relation == "on":
        return [*steps, f"PLACE_ON_TOP({piece.id})"]
    if draft.house.ontology[piece.category].has_door:
        return [*steps, f"OPEN({piece.id})", f"PLACE_INSIDE({piece.id})", f"CLOSE({piece.id})"]
    return [*steps, f"PLACE_INSIDE({piece.id})"]


def _run(piece: Piece) -> list[str]:
    return [f"TOGGLE_ON({piece.id})", f"TOGGLE_OFF({piece.id})"]


def _take_out(draft: Draft, piece: Piece, thing: Thing) -> list[str]:
    if draft.house.ontology[piece.category].has_door:
        return [f"OPEN({piece.id})", f"GRASP({thing.id})", f"CLOSE({piece.id})"]
    return [f"GRASP({thing.id})"]


def _literal(thing: Thing, target: Target) -> str:
    return f"{'on_top' if target.relation == 'on' else 'inside'}({thing.category}, {target.reference})"


# --- draws ----------------------------------------------------------------------------------------------------------


def _thing(
    draft: Draft,
    themes: Sequence[Theme],
    test: Callable[[Place], bool],
    beside: Sequence[str] = (),
    *,
    say: float = 0.35,
    say_room_only: float = 0.12,
) -> Thing | None:
    category = draft.category(themes, beside)
    if category is None:
        return None
    start = draft.start(category, test)
    return None if start is None else draft.thing(category, start, say=say, say_room_only=say_room_only)


def _target(draft: Draft, things: Sequence[Thing], test: Callable[[Place], bool]) -> Target | None:
    """Draw a destination that no thing starts at, of a category that no thing starts on or in."""
    starts = {t.start.piece.category for t in things if t.start.piece is not None}
    place = draft.destination([t.category for t in things], lambda p: p.piece.category not in starts and test(p))  # type: ignore[union-attr]
    if place is None or place.piece is None:
        return None
    reference = draft.refer(place.piece)
    return None if reference is None else Target(reference, "in" if place.relation == "in" else "on")


def _appliance(draft: Draft, things: Sequence[Thing], test: Callable[[Piece], bool]) -> Reference | None:
    categories = [t.category for t in things]
    pieces = [
        p for p in draft.house.pieces_for("run") if test(p) and all(draft.pairs_fit((c, p.category)) for c in categories)
    ]
    return draft.refer(pick(draft.rng, pieces), source=True) if pieces else None


def _open(draft: Draft) -> Callable[[Place], bool]:
    return lambda place: not draft.house.shuts(place)


def _shut(draft: Draft) -> Callable[[Place], bool]:
    return draft.house.shuts


def _on(place: Place) -> bool:
    return place.relation == "on"


def _doorless(draft: Draft) -> Callable[[Place], bool]:
    return lambda place: place.relation == "in" and not draft.house.shuts(place)


# --- errands of multi-task instructions -----------------------------------------------------------------------------


def _carry(shape: str, draft: Draft, thing: Thing | None, test: Callable[[Place], bool]) -> Errand | None:
    target = None if thing is None else _target(draft, [thing], test)
    if thing is None or target is None:
        return None
    plan = _fetch(draft, thing) + _put(draft, target.reference.piece, target.relation)
    return Errand(shape, (thing,), (target,), (), None, (_literal(thing, target),), tuple(plan))


def _to_support(draft: Draft) -> Errand | None:
    start = lambda p: p.relation != "in"  # noqa: E731
    return _carry("to_support", draft, _thing(draft, ANY, start), _on)


def _to_container(draft: Draft) -> Errand | None:
    start = lambda p: p.relation != "in"  # noqa: E731
    return _carry("to_container", draft, _thing(draft, ANY, start), _doorless(draft))


def _out_of_container(draft: Draft) -> Errand | None:
    return _carry("out_of_container", draft, _thing(draft, ANY, _doorless(draft), say=1.0, say_room_only=0.0), _on)


def _away(draft: Draft) -> Errand | None:
    return _carry("away", draft, _thing(draft, ANY, _open(draft)), _shut(draft))


def _switch_on(draft: Draft) -> Errand | None:
    switch = _switch(draft)
    if switch is None:
        return None
    plan = (f"NAVIGATE_TO({switch.piece.id})", f"TOGGLE_ON({switch.piece.id})")
    return Errand("switch_on", (), (), (), switch, (f"toggled({switch})",), plan)


def _switch(draft: Draft) -> Reference | None:
    pieces = [p for p in draft.house.pieces_for("switch") if p.category not in draft.references]
    lamps = [p for p in pieces if p.category != "electric_switch"] or pieces
    return draft.refer(pick(draft.rng, lamps)) if lamps else None


def _conferred(shape: str, themes: tuple[Theme, ...], state: str, serves: Callable[[Draft, Piece], bool]) -> Build:
    """Return the shape "run a thing through an appliance" (dishwasher, washer, dryer)."""

    def build(draft: Draft) -> Errand | None:
        thing = _thing(draft, themes, _open(draft))
        appliance = None if thing is None else _appliance(draft, [thing], lambda p: serves(draft, p))
        if thing is None or appliance is None:
            return None
        piece = appliance.piece
        plan = _fetch(draft, thing) + _put(draft, piece, "in") + _run(piece)
        return Errand(shape, (thing,), (), (appliance,), None, (f"{state}({thing.category})",), tuple(plan))

    return build


def _washes_dishes(draft: Draft, piece: Piece) -> bool:
    return draft.house.ontology[piece.category].washes and piece.category == "dishwasher"


def _washes_clothes(draft: Draft, piece: Piece) -> bool:
    return draft.house.ontology[piece.category].washes and piece.category != "dishwasher"


def _dries(draft: Draft, piece: Piece) -> bool:
    return draft.house.ontology[piece.category].dries


def _heats(draft: Draft) -> Callable[[Piece], bool]:
    return lambda piece: draft.house.ontology[piece.category].heat is not None


def _heat(shape: str, draft: Draft, thing: Thing | None) -> Errand | None:
    if thing is None or not draft.house.ontology[thing.category].cookable:
        return None
    appliance = _appliance(draft, [thing], _heats(draft))
    target = _target(draft, [thing], _on)
    if appliance is None or target is None:
        return None
    piece = appliance.piece
    heat = draft.house.ontology[piece.category].heat
    inside = draft.house.ontology[piece.category].interior and heat is not None and heat.requires_inside
    plan = [
        *_fetch(draft, thing),
        *_put(draft, piece, "in" if inside else "on"),
        *_run(piece),
        *(_take_out(draft, piece, thing) if inside else [f"GRASP({thing.id})"]),
        *_put(draft, target.reference.piece, target.relation),
    ]
    goal = (f"cooked({thing.category})", _literal(thing, target))
    return Errand(shape, (thing,), (target,), (appliance,), None, goal, tuple(plan))


def _counter_heat(draft: Draft) -> Errand | None:
    return _heat("counter_heat", draft, _thing(draft, ("hot_food",), lambda p: p.relation == "on", say=0.6))


def _fridge_heat(draft: Draft) -> Errand | None:
    return _heat("fridge_heat", draft, _thing(draft, ("hot_food",), _cold(draft)))


def _cold(draft: Draft) -> Callable[[Place], bool]:
    def test(place: Place) -> bool:
        piece = place.piece
        return piece is not None and draft.house.shuts(place) and draft.house.ontology[piece.category].cold is not None

    return test


# --- single long tasks ----------------------------------------------------------------------------------------------


def _several(
    shape: str,
    draft: Draft,
    things: Sequence[Thing | None],
    tests: Sequence[Callable[[Place], bool]],
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
        target = _target(draft, found if len(tests) == 1 else group, test)
        if target is None or any(
            t.reference.piece.category == target.reference.piece.category for t in targets
        ):
            return None
        targets.append(target)
    ends = [targets[0] if len(tests) == 1 else target for target in (targets * len(found))[: len(found)]]
    plan: list[str] = []
    for thing, target in zip(found, ends, strict=True):
        plan += _fetch(draft, thing) + _put(draft, target.reference.piece, target.relation)
    goal = [_literal(thing, target) for thing, target in zip(found, ends, strict=True)]
    lamp = _switch(draft) if switch else None
    if switch:
        if lamp is None or any(lamp.piece.category == t.reference.piece.category for t in targets):
            return None
        plan += [f"NAVIGATE_TO({lamp.piece.id})", f"TOGGLE_ON({lamp.piece.id})"]
        goal.append(f"toggled({lamp})")
    return Errand(shape, tuple(found), tuple(targets), (), lamp, tuple(goal), tuple(plan))


def _things(draft: Draft, count: int, first: Callable[[Place], bool], others: Callable[[Place], bool]) -> list[Thing]:
    """Draw things that go well together: of one theme, each pair in the draft's split."""
    theme = pick(draft.rng, ANY)
    themes: tuple[Theme, ...] = (theme,)
    if draft.rng.random() < 0.4:
        themes = ANY
    found: list[Thing] = []
    for index in range(count):
        beside = [t.category for t in found]
        thing = _thing(draft, themes, first if index == 0 else others, beside, say_room_only=0.05)
        if thing is None or any(t.category == thing.category for t in found):
            return []
        found.append(thing)
    return found


def _put_two_away(draft: Draft) -> Errand | None:
    first = _shut(draft) if draft.rng.random() < 0.3 else _open(draft)
    things = _things(draft, 2, first, _open(draft))
    same = draft.rng.random() < 0.5
    tests = [_shut(draft)] if same else [_shut(draft), _shut(draft)]
    return _several("put_two_away", draft, things, tests) if things else None


def _take_two_out(draft: Draft) -> Errand | None:
    boxes = [p for p in draft.house.pieces_for("in") if draft.house.ontology[p.category].has_door]
    if not boxes:
        return None
    box = pick(draft.rng, boxes)
    within = lambda p: p.relation == "in" and p.piece == box  # noqa: E731
    things = _things(draft, 2, within, within)
    tests: list[Callable[[Place], bool]] = [_on] if draft.rng.random() < 0.6 else [_on, _on]
    return _several("take_two_out", draft, things, tests) if things else None


def _bring_three(draft: Draft) -> Errand | None:
    first = _shut(draft) if draft.rng.random() < 0.4 else _open(draft)
    things = _things(draft, 3, first, _open(draft))
    test = _on if draft.rng.random() < 0.55 else _doorless(draft)
    return _several("bring_three", draft, things, [test]) if things else None


def _carry_two(draft: Draft) -> Errand | None:
    return _two(draft, "carry_two", switch=False)


def _carry_two_and_switch(draft: Draft) -> Errand | None:
    return _two(draft, "carry_two_and_switch", switch=True)


def _two(draft: Draft, shape: str, *, switch: bool) -> Errand | None:
    first = _shut(draft) if switch and draft.rng.random() < 0.25 else _open(draft)
    things = _things(draft, 2, first, _open(draft))
    kinds = [pick(draft.rng, [_on, _doorless(draft)]) for _ in range(1 if draft.rng.random() < 0.4 else 2)]
    return _several(shape, draft, things, kinds, switch=switch) if things else None


def _swap(draft: Draft) -> Errand | None:
    """Swap what stands in two places, by way of a third (the parking surface)."""
    house = draft.house
    say = {"say": 1.0, "say_room_only": 0.0}
    first = pick(draft.rng, [_on, _on, _doorless(draft), _shut(draft)])
    second = pick(draft.rng, [_on, _on, _doorless(draft)])
    theme = pick(draft.rng, ANY)
    a = _thing(draft, (theme,), first, **say)
    if a is None or a.source is None:
        return None
    b = _thing(draft, (theme,) if draft.rng.random() < 0.5 else ANY, second, [a.category, a.source.piece.category], **say)
    if b is None or b.source is None or b.category == a.category:
        return None
    if a.source.piece.category == b.source.piece.category or not draft.pairs_fit((a.category, b.source.piece.category)):
        return None
    parking = [p for p in house.pieces_for("on") if p.id not in (a.source.piece.id, b.source.piece.id)]
    parking = [p for p in parking if p.room == a.start.room] or parking
    if not parking:
        return None
    spot = pick(draft.rng, parking)
    at_a, at_b = Target(a.source, _relation(a.start)), Target(b.source, _relation(b.start))
    plan = [
        *_fetch(draft, a),
        *_put(draft, spot, "on"),
        *_fetch(draft, b),
        *_put(draft, at_a.reference.piece, at_a.relation),
        f"NAVIGATE_TO({a.id})",
        f"GRASP({a.id})",
        *_put(draft, at_b.reference.piece, at_b.relation),
    ]
    goal = (_literal(a, at_b), _literal(b, at_a))
    return Errand("swap", (a, b), (at_b, at_a), (), None, goal, tuple(plan))


def _relation(place: Place) -> Literal["on", "in"]:
    return "in" if place.relation == "in" else "on"


def _tray(draft: Draft) -> Errand | None:
    """Set a thing on a tray, put the tray away."""
    tray = _thing(draft, ("tray",), _open(draft))
    if tray is None or not draft.house.ontology[tray.category].surface:
        return None
    thing = _thing(draft, ("dish", "food", "drink", "pantry", "hot_food"), _open(draft), [tray.category])
    target = None if thing is None else _target(draft, [tray], _shut(draft))
    if thing is None or target is None or not draft.pairs_fit((thing.category, target.reference.piece.category)):
        return None
    plan = [
        *_fetch(draft, thing),
        f"NAVIGATE_TO({tray.id})",
        f"PLACE_ON_TOP({tray.id})",
        f"GRASP({tray.id})",
        *_put(draft, target.reference.piece, "in"),
    ]
    goal = (f"on_top({thing.category}, {tray.category})", _literal(tray, target))
    return Errand("tray", (thing, tray), (target,), (), None, goal, tuple(plan))


def _load_dishwasher(draft: Draft) -> Errand | None:
    """Load two things, then run the dishwasher."""
    a = _thing(draft, ("dish",), _open(draft))
    b = None if a is None else _thing(draft, ("dish",), _open(draft), [a.category])
    if a is None or b is None or a.category == b.category:
        return None
    machine = _appliance(draft, [a, b], lambda p: _washes_dishes(draft, p))
    if machine is None:
        return None
    box = machine.piece.id
    plan = [
        *_fetch(draft, a),
        f"NAVIGATE_TO({box})",
        f"OPEN({box})",
        f"PLACE_INSIDE({box})",
        *_fetch(draft, b),
        f"NAVIGATE_TO({box})",
        f"PLACE_INSIDE({box})",
        f"CLOSE({box})",
        *_run(machine.piece),
    ]
    goal = tuple(f"inside({t.category}, {machine})" for t in (a, b)) + tuple(f"washed({t.category})" for t in (a, b))
    return Errand("load_dishwasher", (a, b), (), (machine,), None, goal, tuple(plan))


def _wash_then_dry(draft: Draft) -> Errand | None:
    thing = _thing(draft, ("laundry",), _open(draft))
    if thing is None:
        return None
    washer = _appliance(draft, [thing], lambda p: _washes_clothes(draft, p))
    dryer = _appliance(draft, [thing], lambda p: _dries(draft, p))
    if washer is None or dryer is None:
        return None
    plan = [
        *_fetch(draft, thing),
        *_put(draft, washer.piece, "in"),
        *_run(washer.piece),
        *_take_out(draft, washer.piece, thing),
        *_put(draft, dryer.piece, "in"),
        *_run(dryer.piece),
    ]
    name = thing.category
    goal = (f"washed({name})", f"dried({name})", f"inside({name}, {dryer})")
    return Errand("wash_then_dry", (thing,), (), (washer, dryer), None, goal, tuple(plan))


SHAPES: Mapping[str, Shape] = {
    "to_support": Shape(_to_support, False),
    "to_container": Shape(_to_container, False),
    "out_of_container": Shape(_out_of_container, False),
    "away": Shape(_away, False),
    "switch_on": Shape(_switch_on, False),
    "wash_dish": Shape(_conferred("wash_dish", ("dish", "tray"), "washed", _washes_dishes), True),
    "wash_clothes": Shape(_conferred("wash_clothes", ("laundry",), "washed", _washes_clothes), True),
    "dry_clothes": Shape(_conferred("dry_clothes", ("laundry",), "dried", _dries), True),
    "counter_heat": Shape(_counter_heat, True),
    "fridge_heat": Shape(_fridge_heat, True),
    "put_two_away": Shape(_put_two_away, False),
    "take_two_out": Shape(_take_two_out, False),
    "bring_three": Shape(_bring_three, False),
    "carry_two": Shape(_carry_two, False),
    "carry_two_and_switch": Shape(_carry_two_and_switch, False),
    "swap": Shape(_swap, False),
    "tray": Shape(_tray, False),
    "load_dishwasher": Shape(_load_dishwasher, True),
    "wash_then_dry": Shape(_wash_then_dry, True),
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
