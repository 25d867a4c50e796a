"""Edit rules for states that only an appliance gives: cooked, washed, dried, hot, frozen, not dirty."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gavel_agents.edits.rule import Case, Change, insert
from gavel_agents.edits.sketch import Sketch
from gavel_agents.edits.wants import appliances, chosen_subject, confers, wanted_flag
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.goals import Literal
from gavel_env.world_model.graph import Flag, Relation, SceneGraph, Support

__all__ = ["load_before_running", "run_named_appliance", "run_while_inside", "shut_before_running"]


def shut_before_running(case: Case, literal: Literal) -> Iterator[Change]:
    """Appliance run over the object with its door open: close it before the switch."""
    obj, flag = _state(case, literal)
    if obj is None:
        return
    for step, action in enumerate(case.plan):
        if action.primitive is not Primitive.TOGGLE_ON or action.target is None:
            continue
        graph = case.trace[step]
        support = graph.supports.get(obj)
        loaded = support is not None and support.holder == action.target
        if not loaded or obj in case.trace[step + 1].flags[flag] or action.target not in graph.flags[Flag.OPEN]:
            continue
        sketch = Sketch(graph, case.profile)
        if sketch.operate(Primitive.CLOSE, action.target):
            yield insert(case.plan, step, sketch.steps)


def run_while_inside(case: Case, literal: Literal) -> Iterator[Change]:
    """State never conferred: run the appliance while the object is in it."""
    obj, flag = _state(case, literal)
    if obj is None:
        return
    last = len(case.trace) - 1
    while last >= 0:
        support = case.trace[last].supports.get(obj)
        first = last
        while first > 0 and case.trace[first - 1].supports.get(obj) == support:
            first -= 1
        if support is not None and _would_give(case.trace[last], support, obj, flag):
            at = _best_moment(case.trace, support.holder, first, last)
            sketch = Sketch(case.trace[at], case.profile)
            if sketch.run(support.holder, case.goal):
                yield insert(case.plan, at, sketch.steps)
        last = first - 1


def _would_give(graph: SceneGraph, support: Support, obj: str, flag: Flag) -> bool:
    return support.relation <= Relation.INSIDE and confers(graph, support.holder, obj, flag) is support.relation


def _best_moment(trace: Sequence[SceneGraph], appliance: str, first: int, last: int) -> int:
    """Return the latest state in first..last near the appliance, with its door shut if there is one such."""
    near = [k for k in range(last, first - 1, -1) if appliance in trace[k].near]
    return next((k for k in near if trace[k].is_shut(appliance)), near[0] if near else last)


def load_before_running(case: Case, literal: Literal) -> Iterator[Change]:
    """Appliance run without the object that needs it: put the object in first."""
    obj, flag = _state(case, literal)
    if obj is None:
        return
    for step, action in enumerate(case.plan):
        if action.primitive is not Primitive.TOGGLE_ON or action.target is None:
            continue
        relation = confers(case.trace[step], action.target, obj, flag)
        if relation is None:
            continue
        held = case.trace[step].holding
        at = step if held == obj else case.approach_start(step)
        if held == obj:
            while at > 0 and case.trace[at].is_shut(action.target) and action.target in case.trace[at - 1].near:
                at -= 1
            if case.trace[at].holding != obj or case.trace[at].is_shut(action.target):
                at = step
        if case.trace[at].holding not in (None, obj):
            continue
        sketch = Sketch(case.trace[at], case.profile)
        if sketch.bring(obj, relation, action.target) and (at < step or sketch.reach(action.target)):
            yield insert(case.plan, at, sketch.steps)


def run_named_appliance(case: Case, literal: Literal) -> Iterator[Change]:
    """State never conferred: bring the object to an appliance that the plan names, and run it."""
    obj, flag = _state(case, literal)
    if obj is None:
        return
    for errand in appliances(case, case.graph, obj, flag):
        sketch = Sketch(case.graph, case.profile)
        if sketch.bring(obj, errand.relation, errand.place) and sketch.run(errand.place, case.goal):
            yield insert(case.plan, len(case.plan), sketch.steps)


def _state(case: Case, literal: Literal) -> tuple[str | None, Flag]:
    flag = wanted_flag(literal)
    return (None, Flag.OPEN) if flag is None else (chosen_subject(case, literal.subject, case.graph), flag)
