"""How language models break plans: one small edit per published kind of first defect.

Kinds and counts are those of 57 bad first plans of a real 8-billion-parameter model on 100 single tasks
(docs/reference/agents.md). An edit returns the broken plan, or None where it does not fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import SceneGraph

__all__ = ["DEFECTS", "Defect"]

Plan = tuple[Action, ...]
Edit = Callable[[Plan, SceneGraph, np.random.Generator], Plan | None]

_PLACES = (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE)
_LOOPING_STEPS = 66


class Defect(NamedTuple):
    """A kind of defect.

    Attributes:
        name: what goes wrong.
        seen: how many of the 57 bad plans it broke first.
        edit: how it breaks a plan.
    """

    name: str
    seen: int
    edit: Edit


def _pick(rng: np.random.Generator, positions: Sequence[int]) -> int | None:
    return int(positions[int(rng.integers(len(positions)))]) if positions else None


def _steps(plan: Plan, *primitives: Primitive) -> list[int]:
    return [i for i, action in enumerate(plan) if action.primitive in primitives]


def _without(plan: Plan, rng: np.random.Generator, positions: Sequence[int]) -> Plan | None:
    """Leave one of some steps out."""
    at = _pick(rng, positions)
    return None if at is None else (*plan[:at], *plan[at + 1 :])


def _inserted(plan: Plan, at: int, action: Action) -> Plan:
    return (*plan[:at], action, *plan[at:])


def _replaced(plan: Plan, at: int, action: Action) -> Plan:
    return (*plan[:at], action, *plan[at + 1 :])


def _empty_hand(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    return _without(plan, rng, _steps(plan, Primitive.GRASP))


def _full_hand(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    """Forget to put the first thing down before the next is taken."""
    grasps = _steps(plan, Primitive.GRASP)
    return _without(plan, rng, [i for i in _steps(plan, *_PLACES) if grasps and i < grasps[-1]])


def _into_shut(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    return _without(plan, rng, _steps(plan, Primitive.OPEN))


def _goal_unmet(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    """Stop before the last thing is fetched, or before something is switched on."""
    ends = [i for i in _steps(plan, Primitive.GRASP)[1:] if plan[i - 1].primitive is Primitive.NAVIGATE_TO]
    if ends:
        return plan[: ends[-1] - 1]
    return _without(plan, rng, _steps(plan, Primitive.TOGGLE_ON))


def _to_room(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    at = _pick(rng, _steps(plan, Primitive.NAVIGATE_TO))
    room = None if at is None else graph.room_of(plan[at].target or "")
    return None if at is None or room is None else _replaced(plan, at, Action(Primitive.NAVIGATE_TO, room))


def _on_top_for_inside(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    at = _pick(rng, _steps(plan, Primitive.PLACE_INSIDE))
    return None if at is None else _replaced(plan, at, plan[at]._replace(primitive=Primitive.PLACE_ON_TOP))


def _no_navigate(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    return _without(plan, rng, _steps(plan, Primitive.NAVIGATE_TO))


def _left_on(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    return _without(plan, rng, _steps(plan, Primitive.TOGGLE_OFF)[-1:])


def _left_open(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    return _without(plan, rng, _steps(plan, Primitive.CLOSE)[-1:])


def _just_shut(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    """Shut a container between opening it and reaching in."""
    at = _pick(rng, _steps(plan, Primitive.OPEN))
    return None if at is None else _inserted(plan, at + 1, Action(Primitive.CLOSE, plan[at].target))


def _doorless(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    places = [i for i in _steps(plan, *_PLACES) if not graph.category(plan[i].target or "").openable]
    at = _pick(rng, places)
    return None if at is None else _inserted(plan, at, Action(Primitive.OPEN, plan[at].target))


def _looping(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    """Say the last steps over and over, to the token limit."""
    tail = plan[-4:]
    repeated = plan
    while len(repeated) < _LOOPING_STEPS:
        repeated += tail
    return repeated[:_LOOPING_STEPS]


def _grasp_furniture(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    at = _pick(rng, [i for i in _steps(plan, *_PLACES) if not graph.category(plan[i].target or "").graspable])
    return None if at is None else _inserted(plan, at, Action(Primitive.GRASP, plan[at].target))


def _into_box(plan: Plan, graph: SceneGraph, rng: np.random.Generator) -> Plan | None:
    """Go to a thing inside a container that is still shut."""
    grasps = {i: plan[i].target for i in _steps(plan, Primitive.GRASP)}
    opened = [i for i in _steps(plan, Primitive.OPEN) if i + 1 in grasps]
    at = _pick(rng, opened)
    return None if at is None else _inserted(plan, at, Action(Primitive.NAVIGATE_TO, grasps[at + 1]))


DEFECTS: tuple[Defect, ...] = (
    Defect("place with an empty hand", 10, _empty_hand),
    Defect("grasp with a full hand", 9, _full_hand),
    Defect("into something shut", 8, _into_shut),
    Defect("goal unmet", 6, _goal_unmet),
    Defect("navigate to a room", 4, _to_room),
    Defect("on top where inside was meant", 4, _on_top_for_inside),
    Defect("missing navigate", 3, _no_navigate),
    Defect("left on", 3, _left_on),
    Defect("left open", 2, _left_open),
    Defect("grasp inside what was just shut", 2, _just_shut),
    Defect("open what has no door", 2, _doorless),
    Defect("looping", 2, _looping),
    Defect("grasp furniture", 1, _grasp_furniture),
    Defect("navigate into a shut box", 1, _into_box),
)
