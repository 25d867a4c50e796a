"""Edits for actions of one's own: what they need is brought about by regression over declared effects.

A need that fails is brought about by what makes it true: a built-in stretch (go there, take it, open it, put it
there), an appliance, a hint of the action, or another that declares it as an effect, whose needs are brought
about first, at most `DEEPEST` deep.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from gavel_agents.edits.rule import Case, Change, insert
from gavel_agents.edits.sketch import Sketch
from gavel_agents.edits.wants import GIVEN_BY_APPLIANCES, confers
from gavel_env.errors import MalformedAction
from gavel_env.world_model.actions import Action, Primitive, parse_action, primitive_of
from gavel_env.world_model.dynamics import ViolationKind
from gavel_env.world_model.goals import Literal, fitting
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.own_actions import Need, OwnAction, own_action, own_actions, violation_of

__all__ = ["act_for", "bring_about_needs"]

DEEPEST = 3
_MOST_BINDINGS = 200
_STATIC = ("graspable", "surface", "interior", "door", "switch")
_UNKNOWN = (ViolationKind.UNKNOWN_OBJECT, ViolationKind.ROOM_TARGET)


def bring_about_needs(case: Case) -> Iterator[Change]:
    """Need of an action of one's own that fails: bring about all that it needs, before it."""
    violation = case.verdict.violation
    if violation is None or violation.kind in _UNKNOWN:
        return
    sketch = Sketch(case.graph, case.profile)
    if _prepare(case, sketch, case.action, DEEPEST) and sketch.steps:
        yield insert(case.plan, case.step, sketch.steps)


def act_for(case: Case, literal: Literal) -> Iterator[Change]:
    """State that an action of one's own gives or takes: carry that out at the end."""
    if literal.predicate.flag is None or not own_actions():
        return
    for obj in case.preferred(fitting(case.graph, literal.subject)):
        if case.graph.has(literal.predicate.flag, obj) != literal.negated:
            continue
        sketch = Sketch(case.graph, case.profile)
        need = Need(literal.predicate.value, (obj,), literal.negated)
        if _by_own_action(case, sketch, need, DEEPEST) and sketch.shut():
            yield insert(case.plan, len(case.plan), sketch.steps)


def _prepare(case: Case, sketch: Sketch, action: Action, depth: int) -> bool:
    """Make every need of a step hold in the sketch; what one spoils is brought about again."""
    own = own_action(action.primitive)
    if own is None:
        return False
    values = dict(zip(own.parameters, action.arguments, strict=True))
    needs = [need.of(values) for need in own.preconditions]
    for _ in range(2 * len(needs) + 1):
        missing = [(need, written) for need, written in zip(needs, own.preconditions, strict=True)
                   if violation_of(sketch.graph, need) is not None]  # fmt: skip
        if not missing:
            return True
        need, written = missing[0]
        hint = own.hints.get(written.text)
        if hint is not None:
            if not _follow(sketch, hint, values):
                return False
        elif not _achieve(case, sketch, need, depth):
            return False
    return False


def _follow(sketch: Sketch, hint: tuple[str, ...], values: dict[str, str]) -> bool:
    """Carry out the steps of a hint, going to what they name."""
    for text in hint:
        try:
            step = parse_action(text)
        except MalformedAction:
            return False
        arguments = tuple(values.get(a, a) for a in step.arguments)
        if step.primitive is Primitive.GRASP:
            if arguments[0] not in sketch.graph.world.nodes or not sketch.take(arguments[0]):
                return False
            continue
        going = step.primitive in (Primitive.NAVIGATE_TO, Primitive.RELEASE)
        if arguments and not going and arguments[0] in sketch.graph.world.nodes and not sketch.reach(arguments[0]):
            return False
        if not sketch.do(step.primitive, *arguments):
            return False
    return True


def _achieve(case: Case, sketch: Sketch, need: Need, depth: int) -> bool:
    if need.function is not None or need.name in _STATIC:
        return False
    x = need.parameters[0]
    if need.name in ("near", "accessible"):
        return sketch.reach(x)
    if need.name == "holding":
        return sketch.take(x)
    if need.name == "hand_free":
        return sketch.set_down()
    if need.name in ("opened", "open") and not need.negated:
        return sketch.reach(x) and sketch.open(x)
    if need.name in ("on_top", "inside"):
        relation = Relation.ON_TOP if need.name == "on_top" else Relation.INSIDE
        return sketch.take(x) and sketch.put(relation, need.parameters[1])
    if need.name == "open":
        return sketch.reach(x) and sketch.operate(Primitive.CLOSE, x)
    if need.name == "toggled":
        return sketch.reach(x) and sketch.operate(Primitive.TOGGLE_OFF if need.negated else Primitive.TOGGLE_ON, x)
    return _by_own_action(case, sketch, need, depth) or _by_appliance(case, sketch, need)


def _by_appliance(case: Case, sketch: Sketch, need: Need) -> bool:
    flag, obj = Flag[need.name.upper()], need.parameters[0]
    if flag is Flag.DIRTY and need.negated:
        flag = Flag.WASHED
    elif flag not in GIVEN_BY_APPLIANCES or need.negated:
        return False
    for appliance in case.preferred(sketch.graph.world.nodes):
        relation = None if appliance == obj else confers(sketch.graph, appliance, obj, flag)
        if relation is None:
            continue
        trial = sketch.fork()
        if trial.bring(obj, relation, appliance) and trial.run(appliance, case.goal):
            sketch.adopt(trial)
            return True
    return False


def _by_own_action(case: Case, sketch: Sketch, need: Need, depth: int) -> bool:
    """Carry out an action of one's own that declares what is needed as an effect."""
    if depth == 0:
        return False
    for own in own_actions():
        primitive = primitive_of(own.name)
        for made in own.makes:
            if primitive is None or (made.name, made.negated) != (need.name, need.negated):
                continue
            for arguments in _bindings(case, sketch.graph, own, made.parameters[0], need.parameters[0]):
                trial = sketch.fork()
                action = Action(primitive, arguments[0] if arguments else None, arguments[1:])
                if _prepare(case, trial, action, depth - 1) and trial.do(primitive, *arguments):
                    sketch.adopt(trial)
                    return True
    return False


def _bindings(case: Case, graph: SceneGraph, own: OwnAction, parameter: str, obj: str) -> Iterator[tuple[str, ...]]:
    """Yield arguments for an action, one parameter being given: things that afford it, first those that need least."""
    statics = [need for need in own.preconditions if need.name in _STATIC]
    others = [p for p in own.parameters if p != parameter]

    def able(p: str, thing: str) -> bool:
        if any(violation_of(graph, need.of({p: thing})) is not None for need in statics if need.parameters == (p,)):
            return False
        holds = any(need.name == "holding" and need.parameters == (p,) for need in own.preconditions)
        node = graph.world.nodes[thing]
        return not holds or (node.category.liftable and not node.fixed)

    if not able(parameter, obj):
        return
    choices = [[o for o in case.preferred(graph.world.nodes) if o != obj and able(p, o)] for p in others]

    def missing(chosen: tuple[str, ...]) -> int:
        values = {parameter: obj, **dict(zip(others, chosen, strict=True))}
        return sum(
            need.function is None and violation_of(graph, need.of(values)) is not None for need in own.preconditions
        )

    options = itertools.islice(
        (chosen for chosen in itertools.product(*choices) if len(set(chosen)) == len(chosen)), _MOST_BINDINGS
    )
    for chosen in sorted(options, key=missing):
        values = {parameter: obj, **dict(zip(others, chosen, strict=True))}
        yield tuple(values[p] for p in own.parameters)
