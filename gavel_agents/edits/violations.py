"""Edit rules for violated preconditions: the table from violation kind to what follows from the action model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gavel_agents.edits.names import read_name
from gavel_agents.edits.regression import bring_about_needs
from gavel_agents.edits.rule import Case, Change, Rule, drop, insert, replace
from gavel_agents.edits.sketch import Sketch, outermost_shut
from gavel_agents.edits.wants import SPATIAL, Errand, chosen_subject, destinations, errands, works_of
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import ViolationKind, violations
from gavel_env.world_model.goals import Predicate
from gavel_env.world_model.graph import Relation

__all__ = ["OWN_RULES", "VIOLATION_RULES", "place_in_passing"]

PLACES = (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE)
DOORS = (Primitive.OPEN, Primitive.CLOSE)
SWITCHES = (Primitive.TOGGLE_ON, Primitive.TOGGLE_OFF)
HOPELESS = (ViolationKind.NOT_GRASPABLE, ViolationKind.NO_DOOR, ViolationKind.NO_SWITCH)


# --- proximity and accessibility -----------------------------------------------------------------------------------


def approach(case: Case) -> Iterator[Change]:
    """Not near: navigate to the target first, opening what it is shut in."""
    if any(v.kind in HOPELESS for v in violations(case.graph, case.action, case.profile)):
        return
    sketch = Sketch(case.graph, case.profile)
    if sketch.reach(case.target):
        yield insert(case.plan, case.step, sketch.steps)


def open_the_box(case: Case) -> Iterator[Change]:
    """Navigation to something hidden: go to the container and open it instead."""
    container = outermost_shut(case.graph, case.target)
    if container is None:
        return
    following = case.plan[case.step + 1 : case.step + 2]
    if following == (Action(Primitive.OPEN, container),) and container not in case.graph.near:
        yield replace(case.plan, case.step, (Action(Primitive.NAVIGATE_TO, container),))
    sketch = Sketch(case.graph, case.profile)
    if sketch.reach(case.target):
        yield replace(case.plan, case.step, sketch.steps)


def open_first(case: Case) -> Iterator[Change]:
    """Closed: open the container that is in the way."""
    sketch = Sketch(case.graph, case.profile)
    if not sketch.reach(case.target):
        return
    if case.action.primitive is Primitive.PLACE_INSIDE and not sketch.open(case.target):
        return
    yield insert(case.plan, case.step, sketch.steps)


def shut_door(case: Case) -> Iterator[Change]:
    """Door open at switch-on: close it."""
    sketch = Sketch(case.graph, case.profile)
    if sketch.operate(Primitive.CLOSE, case.target):
        yield insert(case.plan, case.step, sketch.steps)


# --- the hand ------------------------------------------------------------------------------------------------------


def place_in_passing(case: Case) -> Iterator[Change]:
    """Hand full: put the held object where the goal wants it, at the last moment when the plan was there."""
    held = case.graph.holding
    if held is None:
        return
    picked = case.held_since()
    again = case.step < len(case.plan) and case.target == held
    works = list(works_of(case, case.graph, held))
    if case.step < len(case.plan) and case.action.primitive in DOORS + SWITCHES:
        just_taken = picked > 0 and case.trace[picked - 1].contains(case.target, held)
        if case.action.primitive in (Primitive.CLOSE, Primitive.TOGGLE_ON) and not just_taken:
            for errand in errands(case, case.graph, held):
                if errand.place == case.target:
                    yield from _in_passing(case, errand, picked, case.step)
        return
    for errand in works:
        # The object must be in before the appliance is run.
        runs = [t for t in range(picked, case.step) if case.plan[t] == Action(Primitive.TOGGLE_ON, errand.place)]
        yield from _in_passing(case, errand, picked, runs[-1] if runs else case.step)
    if not again and not works:
        for errand in destinations(case, case.graph, held):
            yield from _in_passing(case, errand, picked, case.step)


def _in_passing(case: Case, errand: Errand, first: int, last: int) -> Iterator[Change]:
    """Offer to place at the latest state in first..last near the place; where it stands open, if there is one."""
    near = [k for k in range(last, first - 1, -1) if errand.place in case.trace[k].near]
    if errand.relation is Relation.INSIDE:
        near.sort(key=lambda k: case.trace[k].is_shut(errand.place))
    for k in near[:1]:
        sketch = Sketch(case.trace[k], case.profile)
        if sketch.put(errand.relation, errand.place) and sketch.shut():
            yield insert(case.plan, k, sketch.steps)


def already_held(case: Case) -> Iterator[Change]:
    """Hand full with the very object to be grasped: the grasp is superfluous."""
    if case.target == case.graph.holding:
        yield drop(case.plan, (case.step,))


def finish_errand(case: Case) -> Iterator[Change]:
    """Hand full: first finish what the goal wants done with the held object."""
    held = case.graph.holding
    if held is None or case.action.primitive is not Primitive.GRASP:
        return
    at = _before_approach(case)
    for errand in errands(case, case.trace[at], held):
        sketch = Sketch(case.trace[at], case.profile)
        if not sketch.put(errand.relation, errand.place):
            continue
        given = sketch.graph
        if any(errand == work for work in works_of(case, given, held)) and not sketch.run(errand.place, case.goal):
            continue
        if sketch.shut() and (at < case.step or sketch.reach(case.target)):
            yield insert(case.plan, at, sketch.steps)


def leave_it(case: Case) -> Iterator[Change]:
    """Hand full with something of which the goal wants nothing more: do not grasp that."""
    held = case.graph.holding
    grasp = case.held_since() - 1
    if held is None or grasp < 0 or case.plan[grasp] != Action(Primitive.GRASP, held):
        return
    if not errands(case, case.trace[grasp], held) and not _named_by_goal(case, held):
        yield drop(case.plan, (grasp,))


def park(case: Case) -> Iterator[Change]:
    """Hand full: set the held object down on a near surface, or on the floor."""
    if case.action.primitive is not Primitive.GRASP:
        return
    at = _before_approach(case)
    sketch = Sketch(case.trace[at], case.profile)
    if sketch.set_down():
        yield insert(case.plan, at, sketch.steps)


def set_down_to_operate(case: Case) -> Iterator[Change]:
    """Hand full at a door or switch that needs it empty: set down, operate, take again."""
    if case.action.primitive in DOORS + SWITCHES:
        sketch = Sketch(case.graph, case.profile)
        if sketch.operate(case.action.primitive, case.target):
            yield replace(case.plan, case.step, sketch.steps)


def grasp_in_passing(case: Case) -> Iterator[Change]:
    """Hand empty at a placement: grasp what belongs there, at the last moment when the plan was near it."""
    if case.action.primitive not in PLACES:
        return
    free = case.held_since()
    for obj in (*_wanted_there(case), *_last_approached(case, free)):
        # Not before the appliance in which it is has run.
        holders = {holder for _, holder in case.graph.holders(obj)}
        runs = [t for t in range(free, case.step) if case.plan[t] in [Action(Primitive.TOGGLE_ON, h) for h in holders]]
        first = runs[-1] + 1 if runs else free
        near = [k for k in range(case.step, first - 1, -1) if obj in case.trace[k].near]
        near.sort(key=lambda k: case.trace[k].closed_container(obj) is not None)
        for k in near[:1]:
            sketch = Sketch(case.trace[k], case.profile)
            if sketch.take(obj) and sketch.shut(only_near=True, but=case.target):
                yield insert(case.plan, k, sketch.steps)


def fetch(case: Case) -> Iterator[Change]:
    """Hand empty at a placement: fetch what the goal wants there."""
    if case.action.primitive not in PLACES:
        return
    at = max(_before_approach(case), case.held_since())
    for obj in _wanted_there(case):
        sketch = Sketch(case.trace[at], case.profile)
        if not (sketch.take(obj) and sketch.shut(only_near=True, but=case.target)):
            continue
        if at < case.step or sketch.reach(case.target):
            yield insert(case.plan, at, sketch.steps)


def _before_approach(case: Case) -> int:
    """Return where the approach to the failing step begins, if the hand was as it is now."""
    at = case.approach_start(case.step)
    return at if case.trace[at].holding == case.graph.holding else case.step


def _wanted_there(case: Case) -> list[str]:
    """Return the objects that the goal, or a state it asks for, wants at the target; last approached ones first."""
    found: dict[str, None] = {}
    for literal in case.goal.literals:
        obj = chosen_subject(case, literal.subject, case.graph)
        if obj is None or (literal.negated and literal.predicate in SPATIAL):
            continue
        if any(errand.place == case.target for errand in errands(case, case.graph, obj)):
            found[obj] = None
    approached = {a.target: i for i, a in enumerate(case.plan[: case.step]) if a.primitive is Primitive.NAVIGATE_TO}
    return sorted(found, key=lambda o: -approached.get(o, -1))


def _last_approached(case: Case, since: int) -> Iterator[str]:
    """Yield what the plan last navigated to with the hand free, if it can be lifted."""
    for index in range(case.step - 1, since - 1, -1):
        primitive, target, _ = case.plan[index]
        if primitive is Primitive.NAVIGATE_TO and target is not None and target != case.target:
            node = case.graph.world.nodes[target]
            if node.category.graspable and not node.fixed:
                yield target
                return


def _named_by_goal(case: Case, obj: str) -> bool:
    return any(chosen_subject(case, lit.subject, case.graph) == obj for lit in case.goal.literals)


# --- affordances ---------------------------------------------------------------------------------------------------


def other_relation(case: Case) -> Iterator[Change]:
    """No surface or no interior: place the other way if the target affords that."""
    if case.action.primitive in PLACES:
        other = PLACES[1 - PLACES.index(case.action.primitive)]
        category = case.graph.category(case.target)
        if category.interior if other is Primitive.PLACE_INSIDE else category.surface:
            yield replace(case.plan, case.step, (Action(other, case.target),))


def deliver_instead(case: Case) -> Iterator[Change]:
    """A placement that cannot be: put the held object where the goal wants it."""
    held = case.graph.holding
    if held is None or case.action.primitive not in PLACES:
        return
    for errand in errands(case, case.graph, held):
        sketch = Sketch(case.graph, case.profile)
        if sketch.put(errand.relation, errand.place) and sketch.shut():
            yield replace(case.plan, case.step, sketch.steps)


def place_elsewhere(case: Case) -> Iterator[Change]:
    """Unknown place for the held object: put it where the goal wants it; what was meant need not be known."""
    held = case.graph.holding
    last = case.step
    while last < len(case.plan) and case.plan[last].primitive in (Primitive.NAVIGATE_TO, *DOORS):
        last += 1
    steps = case.plan[case.step : last + 1]
    if held is None or steps[-1].primitive not in PLACES or any(action.target != case.target for action in steps):
        return
    for errand in errands(case, case.graph, held):
        sketch = Sketch(case.graph, case.profile)
        if sketch.put(errand.relation, errand.place) and sketch.shut():
            yield replace(case.plan, case.step, sketch.steps, last + 1)


def release_in_room(case: Case) -> Iterator[Change]:
    """Placement on a room in which the goal wants the held object: set it on the floor there."""
    held = case.graph.holding
    room = case.graph.world.rooms[case.target]
    if held is None or case.action.primitive not in PLACES or case.graph.robot_room != room.id:
        return
    for literal in case.goal.literals:
        asked = literal.predicate is Predicate.IN_ROOM and room.fits(str(literal.object))
        if asked and chosen_subject(case, literal.subject, case.graph) == held:
            yield replace(case.plan, case.step, (Action(Primitive.RELEASE),))


def drop_doors(case: Case) -> Iterator[Change]:
    """No door: drop every opening and closing of the target."""
    yield drop(case.plan, _steps_on(case, DOORS))


def drop_switches(case: Case) -> Iterator[Change]:
    """No switch: drop every switching of the target."""
    yield drop(case.plan, _steps_on(case, SWITCHES))


def _steps_on(case: Case, primitives: tuple[Primitive, ...]) -> list[int]:
    later = range(case.step, len(case.plan))
    return [i for i in later if case.plan[i].target == case.target and case.plan[i].primitive in primitives]


def drop_step(case: Case) -> Iterator[Change]:
    """Nothing in the action model makes the step possible, or nothing needs it: drop it."""
    yield drop(case.plan, (case.step,))


VIOLATION_RULES: Mapping[ViolationKind, tuple[Rule, ...]] = {
    ViolationKind.NOT_NEAR: (approach, drop_step),
    ViolationKind.HIDDEN: (open_the_box, drop_step),
    ViolationKind.CLOSED: (open_first, drop_step),
    ViolationKind.DOOR_OPEN: (shut_door, drop_step),
    ViolationKind.HAND_FULL: (
        place_in_passing,
        already_held,
        finish_errand,
        leave_it,
        park,
        set_down_to_operate,
        drop_step,
    ),
    ViolationKind.HAND_EMPTY: (grasp_in_passing, fetch, drop_step),
    ViolationKind.NO_SURFACE: (other_relation, deliver_instead, drop_step),
    ViolationKind.NO_INTERIOR: (other_relation, deliver_instead, drop_step),
    ViolationKind.SELF_PLACEMENT: (deliver_instead, drop_step),
    ViolationKind.CYCLE: (deliver_instead, drop_step),
    ViolationKind.ROOM_TARGET: (release_in_room, deliver_instead, drop_step),
    ViolationKind.NOT_GRASPABLE: (drop_step,),
    ViolationKind.NO_DOOR: (drop_doors,),
    ViolationKind.NO_SWITCH: (drop_switches,),
    # If people's words do not tell which object was meant, and where it is after all, is for the model to say.
    ViolationKind.UNKNOWN_OBJECT: (read_name, place_elsewhere),
    ViolationKind.NOT_FOUND: (),
    ViolationKind.UNREACHABLE: (),
}
"""Violation kind -> edit rules in order of preference. A kind whose rules do not apply is left to the model."""

OWN_RULES: tuple[Rule, ...] = (bring_about_needs, drop_step)
"""Edit rules for any violation of an action of one's own."""
