"""Edit rules for plans that end wrong: goal conditions unmet, doors left open, appliances left on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from gavel_agents.edits.rule import Case, Change, drop, insert, replace
from gavel_agents.edits.sketch import Sketch
from gavel_agents.edits.states import load_before_running, run_named_appliance, run_while_inside, shut_before_running
from gavel_agents.edits.violations import place_in_passing
from gavel_agents.edits.wants import SPATIAL, Errand, chosen_subject, destinations, wanted_flag
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.goals import Literal, Predicate, fitting
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["LITERAL_RULES", "SAFETY_RULES", "GoalRule", "SafetyRule", "in_order"]

GoalRule = Callable[[Case, Literal], Iterator[Change]]
SafetyRule = Callable[[Case, str], Iterator[Change]]

PLACES = {Relation.ON_TOP: Primitive.PLACE_ON_TOP, Relation.INSIDE: Primitive.PLACE_INSIDE}


def in_order(literals: list[Literal]) -> list[Literal]:
    """Sort unmet literals by when they are best seen to: states, then what goes on or in things yet to be moved."""
    moved = {lit.subject for lit in literals if lit.predicate in SPATIAL}

    def when(literal: Literal) -> int:
        if wanted_flag(literal) is not None:
            return 0
        if literal.predicate in SPATIAL:
            return 1 if literal.object in moved else 2
        return 3

    return sorted(literals, key=when)


# --- where things belong -------------------------------------------------------------------------------------------


def place_held(case: Case, literal: Literal) -> Iterator[Change]:
    """Object still in the hand: place it where the plan was last at its destination."""
    if chosen_subject(case, literal.subject, case.graph) == case.graph.holding is not None:
        yield from place_in_passing(case)


def change_relation(case: Case, literal: Literal) -> Iterator[Change]:
    """Put on top where inside was asked, or inside where on top was: change the placement."""
    obj, errand = _errand(case, literal)
    if obj is None or errand is None:
        return
    step = _last_placement(case, obj)
    if step is not None and case.plan[step].target == errand.place:
        yield replace(case.plan, step, (Action(PLACES[errand.relation], errand.place),))


def redirect(case: Case, literal: Literal) -> Iterator[Change]:
    """Put in a place that the goal does not want: put it where the goal wants it instead."""
    obj, errand = _errand(case, literal)
    if obj is None or errand is None:
        return
    step = _last_placement(case, obj)
    if step is None or any((obj in case.trace[step].flags[f]) != (obj in case.graph.flags[f]) for f in Flag):
        return
    sketch = Sketch(case.trace[step], case.profile)
    if sketch.put(errand.relation, errand.place) and sketch.shut():
        yield replace(case.plan, step, sketch.steps)


def deliver(case: Case, literal: Literal) -> Iterator[Change]:
    """Object not where the goal wants it: fetch it and bring it there."""
    obj, errand = _errand(case, literal)
    if obj is not None and errand is not None:
        yield from _append(case, errand)


def _errand(case: Case, literal: Literal) -> tuple[str | None, Errand | None]:
    obj = chosen_subject(case, literal.subject, case.graph)
    if obj is None or literal.negated or literal.object is None:
        return None, None
    places = fitting(case.graph, literal.object)
    for errand in destinations(case, case.graph, obj):
        if errand.place in places and errand.relation is SPATIAL[literal.predicate]:
            return obj, errand
    return None, None


def _last_placement(case: Case, obj: str) -> int | None:
    """Return the step that put `obj` down where it ends."""
    for step in range(len(case.plan) - 1, -1, -1):
        if case.trace[step].holding == obj and case.plan[step].primitive in PLACES.values():
            return step if case.graph.holding != obj else None
    return None


def _append(case: Case, errand: Errand) -> Iterator[Change]:
    sketch = Sketch(case.graph, case.profile)
    if not case.graph.world.nodes[errand.obj].fixed and sketch.bring(*errand):
        yield insert(case.plan, len(case.plan), sketch.steps)


def put_beside(case: Case, literal: Literal) -> Iterator[Change]:
    """Not next to, or not under: put it on the floor beside the other, or on or in what holds the other."""
    obj = chosen_subject(case, literal.subject, case.graph)
    if obj is None or literal.negated or literal.object is None:
        return
    for other in case.preferred(fitting(case.graph, literal.object)):
        pairs = ((obj, other),) if literal.predicate is Predicate.UNDER else ((obj, other), (other, obj))
        for mover, partner in pairs:
            support = case.graph.supports.get(partner)
            if support is not None and support.relation in PLACES and literal.predicate is Predicate.NEXT_TO:
                yield from _append(case, Errand(mover, *support))
            elif partner != mover:
                yield from _append(case, Errand(mover, Relation.FLOOR, partner))


def bring_into_room(case: Case, literal: Literal) -> Iterator[Change]:
    """Not in the room: bring it to a piece that stands there."""
    obj = chosen_subject(case, literal.subject, case.graph)
    if obj is None or literal.negated:
        return
    graph = case.graph
    for piece in case.preferred(o for o, node in graph.world.nodes.items() if node.fixed):
        room = graph.room_of(piece)
        if room is not None and graph.world.rooms[room].fits(str(literal.object)):
            relation = Relation.ON_TOP if graph.category(piece).surface else Relation.FLOOR
            yield from _append(case, Errand(obj, relation, piece))
            return


def take_away(case: Case, literal: Literal) -> Iterator[Change]:
    """Where the goal does not want it: take it away and set it down."""
    if not literal.negated or literal.object is None:
        return
    places = fitting(case.graph, literal.object)
    for obj in fitting(case.graph, literal.subject):
        support = case.graph.supports.get(obj)
        if support is None or support.relation is not SPATIAL[literal.predicate] or support.holder not in places:
            continue
        sketch = Sketch(case.graph, case.profile)
        if sketch.take(obj) and sketch.shut(only_near=True) and sketch.do(Primitive.RELEASE) and sketch.shut():
            yield insert(case.plan, len(case.plan), sketch.steps)


# --- doors and switches --------------------------------------------------------------------------------------------


def leave_it_so(case: Case, literal: Literal) -> Iterator[Change]:
    """Undone by the plan what the goal asks for: drop the step that undoes it."""
    undoing = {
        (Flag.OPEN, False): Primitive.CLOSE,
        (Flag.OPEN, True): Primitive.OPEN,
        (Flag.TOGGLED, False): Primitive.TOGGLE_OFF,
        (Flag.TOGGLED, True): Primitive.TOGGLE_ON,
    }
    flag = literal.predicate.flag
    if flag is None:
        return
    fits = fitting(case.graph, literal.subject)
    for step in range(len(case.plan) - 1, -1, -1):
        primitive, target, _ = case.plan[step]
        if target in fits and primitive is undoing.get((flag, literal.negated)):
            before, after = case.trace[step], case.trace[step + 1]
            if before.has(flag, target) != after.has(flag, target) and before.has(flag, target) != literal.negated:
                yield drop(case.plan, (step,))
            return


def operate_at_end(case: Case, literal: Literal) -> Iterator[Change]:
    """Not open, shut, on or off as the goal asks: do that."""
    flag = literal.predicate.flag
    fits = fitting(case.graph, literal.subject)
    wrong = [o for o in fits if case.graph.has(flag, o)] if literal.negated and flag is not None else fits
    for obj in wrong if literal.negated else case.preferred(wrong)[:1]:
        sketch = Sketch(case.graph, case.profile)
        if sketch.reach(obj) and _operate(sketch, literal, obj) and sketch.shut():
            yield insert(case.plan, len(case.plan), sketch.steps)


def _operate(sketch: Sketch, literal: Literal, obj: str) -> bool:
    if literal.predicate is Predicate.OPEN:
        return sketch.operate(Primitive.CLOSE if literal.negated else Primitive.OPEN, obj)
    if literal.negated:
        return sketch.operate(Primitive.TOGGLE_OFF, obj)
    category = sketch.graph.category(obj)
    if category.requires_closed and not sketch.graph.is_shut(obj) and not sketch.operate(Primitive.CLOSE, obj):
        return False
    return sketch.operate(Primitive.TOGGLE_ON, obj)


# --- restoration ---------------------------------------------------------------------------------------------------


def close_in_time(case: Case, container: str) -> Iterator[Change]:
    """Container left open: close it before the plan leaves it for the last time."""
    for step in range(len(case.trace) - 1, -1, -1):
        graph: SceneGraph = case.trace[step]
        if container in graph.near:
            sketch = Sketch(graph, case.profile)
            if container in graph.flags[Flag.OPEN] and sketch.operate(Primitive.CLOSE, container):
                yield insert(case.plan, step, sketch.steps)
            break


def switch_off(case: Case, appliance: str) -> Iterator[Change]:
    """Appliance left on: switch it off after its run."""
    for step in range(len(case.plan) - 1, -1, -1):
        if case.plan[step] == Action(Primitive.TOGGLE_ON, appliance):
            sketch = Sketch(case.trace[step + 1], case.profile)
            if sketch.operate(Primitive.TOGGLE_OFF, appliance):
                yield insert(case.plan, step + 1, sketch.steps)
            return


_STATE_RULES = (shut_before_running, run_while_inside, load_before_running, run_named_appliance)
_SPATIAL_RULES = (place_held, change_relation, redirect, deliver, take_away)
_OPERATE_RULES = (leave_it_so, operate_at_end)

LITERAL_RULES: Mapping[Predicate, tuple[GoalRule, ...]] = {
    Predicate.ON_TOP: _SPATIAL_RULES,
    Predicate.INSIDE: _SPATIAL_RULES,
    Predicate.UNDER: (put_beside,),
    Predicate.NEXT_TO: (put_beside,),
    Predicate.IN_ROOM: (bring_into_room,),
    Predicate.OPEN: _OPERATE_RULES,
    Predicate.TOGGLED: _OPERATE_RULES,
    Predicate.COOKED: _STATE_RULES,
    Predicate.WASHED: _STATE_RULES,
    Predicate.DRIED: _STATE_RULES,
    Predicate.HOT: _STATE_RULES,
    Predicate.FROZEN: _STATE_RULES,
    Predicate.DIRTY: _STATE_RULES,
}
"""Predicate of an unmet literal -> edit rules in order of preference."""

SAFETY_RULES: Mapping[Flag, tuple[SafetyRule, ...]] = {
    Flag.OPEN: (close_in_time,),
    Flag.TOGGLED: (switch_off,),
}
"""What was left (OPEN, TOGGLED) -> edit rules in order of preference."""
