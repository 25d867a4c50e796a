"""Defects of the kinds that language models put into plans."""

from __future__ import annotations

from collections.abc import Callable

from support.errands import CLOSE, GRASP, IN, NAV, ON, OPEN, RELEASE, START, STOP, Errand, Plan, Rng

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.graph import Relation, SceneGraph

Defect = Callable[[Rng, SceneGraph, Plan], Plan | None]


def _where(plan: Plan, *primitives: Primitive) -> list[int]:
    return [i for i, a in enumerate(plan) if a.primitive in primitives]


def _any(rng: Rng, indices: list[int]) -> int | None:
    return indices[int(rng.integers(len(indices)))] if indices else None


def _dropping(*primitives: Primitive) -> Defect:
    def defect(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
        at = _any(rng, _where(plan, *primitives))
        return None if at is None else (*plan[:at], *plan[at + 1 :])

    return defect


def _swap_adjacent(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, list(range(len(plan) - 1)))
    return None if at is None else (*plan[:at], plan[at + 1], plan[at], *plan[at + 2 :])


def _wrong_relation(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, _where(plan, ON, IN))
    if at is None:
        return None
    other = IN if plan[at].primitive is ON else ON
    return (*plan[:at], Action(other, plan[at].target), *plan[at + 1 :])


def _room_target(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, _where(plan, NAV))
    if at is None:
        return None
    rooms = sorted(graph.world.rooms)
    return (*plan[:at], Action(NAV, rooms[int(rng.integers(len(rooms)))]), *plan[at + 1 :])


def _open_doorless(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    doorless = [i for i in _where(plan, NAV) if plan[i].target in graph.world.nodes]
    doorless = [i for i in doorless if not graph.category(plan[i].target or "").openable]
    at = _any(rng, doorless)
    return None if at is None else (*plan[: at + 1], Action(OPEN, plan[at].target), *plan[at + 1 :])


def _put_back(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, _where(plan, GRASP))
    if at is None or plan[at].target not in graph.supports:
        return None
    relation, holder = graph.supports[plan[at].target or ""]
    back = Action(IN if relation is Relation.INSIDE else ON, holder)
    return (*plan[: at + 1], back, plan[at], *plan[at + 1 :])


def _duplicate_block(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    if len(plan) < 3:
        return None
    first = int(rng.integers(len(plan) - 2))
    last = first + int(rng.integers(2, 7))
    return (*plan[:last], *plan[first:last], *plan[last:])


def _loop_to_the_end(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    if len(plan) < 6:
        return None
    first = int(rng.integers(len(plan) - 4))
    return (*plan, *(plan[first : first + 4] * int(rng.integers(4, 10))))


def _both_grasps_first(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    grasps = _where(plan, GRASP)
    if len(grasps) < 2:
        return None
    n = int(rng.integers(len(grasps) - 1))
    here, there = grasps[n], grasps[n + 1]
    start = there - 1 if plan[there - 1].primitive is NAV else there
    return (*plan[: here + 1], *plan[start : there + 1], *plan[here + 1 : start], *plan[there + 1 :])


def _place_in_shut(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, [i for i in _where(plan, IN) if i and plan[i - 1].primitive is OPEN])
    return None if at is None else (*plan[: at - 1], plan[at], plan[at - 1], *plan[at + 1 :])


def _shut_before_grasp(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    pairs = [i for i in _where(plan, GRASP) if i + 1 < len(plan) and plan[i + 1].primitive is CLOSE]
    at = _any(rng, pairs)
    return None if at is None else (*plan[:at], plan[at + 1], plan[at], *plan[at + 2 :])


def _truncated(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    return None if len(plan) < 3 else plan[: len(plan) - int(rng.integers(1, len(plan) // 2 + 1))]


def _forgotten_carry(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    grasps = _where(plan, GRASP)
    if len(grasps) < 2:
        return None
    after = next((i + 1 for i in range(grasps[-1], len(plan)) if plan[i].primitive in (ON, IN)), len(plan))
    return (*plan[: grasps[-1]], *plan[after:])


def _release_after_place(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    out: list[Action] = []
    for action in plan:
        out.append(action)
        if action.primitive in (ON, IN):
            out.append(Action(RELEASE))
    return tuple(out) if len(out) > len(plan) else None


def _grasp_fixture(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    fixed = [i for i in _where(plan, NAV) if plan[i].target in graph.world.nodes]
    at = _any(rng, [i for i in fixed if graph.world.nodes[plan[i].target or ""].fixed])
    return None if at is None else (*plan[: at + 1], Action(GRASP, plan[at].target), *plan[at + 1 :])


def _navigate_into_box(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, [i for i in _where(plan, GRASP) if i > 1 and plan[i - 1].primitive is OPEN])
    return None if at is None else (*plan[: at - 2], Action(NAV, plan[at].target), *plan[at - 1 :])


def _wrong_place(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, [i for i in _where(plan, ON) if i and plan[i - 1] == Action(NAV, plan[i].target)])
    if at is None:
        return None
    others = [o for o, n in graph.world.nodes.items() if n.fixed and n.category.surface]
    other = others[int(rng.integers(len(others)))]
    return (*plan[: at - 1], Action(NAV, other), Action(ON, other), *plan[at + 1 :])


def _placed_on_itself(rng: Rng, graph: SceneGraph, plan: Plan) -> Plan | None:
    at = _any(rng, _where(plan, ON, IN))
    if at is None:
        return None
    held = next((plan[i].target for i in range(at, -1, -1) if plan[i].primitive is GRASP), None)
    return None if held is None else (*plan[:at], Action(plan[at].primitive, held), *plan[at + 1 :])


DEFECTS: dict[str, Defect] = {
    "navigation missing": _dropping(NAV),
    "opening missing": _dropping(OPEN),
    "closing missing": _dropping(CLOSE),
    "grasp missing": _dropping(GRASP),
    "placement missing": _dropping(ON, IN),
    "switch-on missing": _dropping(START),
    "switch-off missing": _dropping(STOP),
    "neighbours swapped": _swap_adjacent,
    "wrong relation": _wrong_relation,
    "room as target": _room_target,
    "doorless opened": _open_doorless,
    "taken and put back": _put_back,
    "block twice": _duplicate_block,
    "loops to the end": _loop_to_the_end,
    "both grasps first": _both_grasps_first,
    "placed into shut": _place_in_shut,
    "shut before grasp": _shut_before_grasp,
    "tail missing": _truncated,
    "filled and forgotten": _forgotten_carry,
    "release after place": _release_after_place,
    "fixture grasped": _grasp_fixture,
    "navigation into box": _navigate_into_box,
    "wrong place": _wrong_place,
    "placed on itself": _placed_on_itself,
}


def corrupt(rng: Rng, errand: Errand, count: int) -> tuple[Plan, tuple[str, ...]]:
    """Put up to `count` random defects (what a short plan has room for) into an errand's reference plan.

    Returns:
        The corrupted plan, and the names of its defects.
    """
    plan = errand.reference
    names: list[str] = []
    kinds = list(DEFECTS)
    for _ in range(20 * count):
        if len(names) == count:
            break
        name = kinds[int(rng.integers(len(kinds)))]
        changed = DEFECTS[name](rng, errand.graph, plan)
        if changed is None:
            continue
        plan = changed
        names.append(name)
    return plan, tuple(names)


def recoverable(errand: Errand, plan: Plan) -> bool:
    """Return whether what is missing stands in graph and goal.

    Which appliance gives a state stands in neither: the plan itself must still name one that the reference uses.
    """
    used = {a.target for a in errand.reference if a.primitive is START}
    confers = {lit.predicate.value for lit in errand.goal.literals} & {"cooked", "washed", "dried"}
    if not confers:
        return True
    return used <= {a.target for a in plan}
