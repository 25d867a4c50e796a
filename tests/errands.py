"""Errands with reference plans over real scene graphs, and defects of the kinds that language models make."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
from worlds import restrict

from gavel_env.actions import Action, Primitive
from gavel_env.goals import Goal, fitting, parse_goal
from gavel_env.graph import Node, Relation, SceneGraph, Support
from gavel_env.grounding import instruction_graph, scene_graph
from gavel_env.instructions import read_instructions, shipped
from gavel_env.ontology import Category, default_ontology
from gavel_env.scenes import load_scene, scene_names

Plan = tuple[Action, ...]
Rng = np.random.Generator

NAV, GRASP, RELEASE = Primitive.NAVIGATE_TO, Primitive.GRASP, Primitive.RELEASE
ON, IN = Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE
OPEN, CLOSE = Primitive.OPEN, Primitive.CLOSE
START, STOP = Primitive.TOGGLE_ON, Primitive.TOGGLE_OFF


class Errand(NamedTuple):
    """A task: the graph in which it is set, its goal and a plan that does it."""

    shape: str
    graph: SceneGraph
    goal: Goal
    reference: Plan


class House:
    """A scene's graph sorted by what its pieces afford, and the movables put into it."""

    def __init__(self, graph: SceneGraph, rng: Rng) -> None:
        self.graph = graph
        self.rng = rng
        self.goal: list[str] = []
        self.steps: list[Action] = []

    def pieces(self, fits: Callable[[Category], bool]) -> list[str]:
        return [o for o, node in self.graph.world.nodes.items() if node.fixed and fits(node.category)]

    def pick(self, names: list[str], but: tuple[str, ...] = ()) -> str:
        names = [n for n in names if n not in but]
        if not names:
            raise LookupError
        return names[int(self.rng.integers(len(names)))]

    def surface(self, *but: str) -> str:
        return self.pick(
            self.pieces(lambda c: c.surface and not c.openable and not c.toggleable and c.mount == "floor"), but
        )

    def shelf(self, *but: str) -> str:
        return self.pick(self.pieces(lambda c: c.interior and not c.openable), but)

    def box(self, *but: str) -> str:
        return self.pick(self.pieces(lambda c: c.has_door and not c.safety_critical), but)

    def add(self, pool: tuple[str, ...], holder: str, relation: Relation) -> str:
        used = {node.category.name for node in self.graph.world.nodes.values()}
        name = self.pick([n for n in pool if n not in used])
        obj = f"{name}_0"
        self.graph = self.graph.with_nodes({obj: Node(obj, default_ontology()[name], False)})
        self.graph = self.graph.place(obj, Support(relation, holder))
        return obj

    def do(self, *steps: tuple[Primitive, str]) -> None:
        self.steps += [Action(primitive, target) for primitive, target in steps]

    def want(self, predicate: str, *objects: str) -> None:
        self.goal.append(f"{predicate}({', '.join(self.designate(o) for o in objects)})")

    def designate(self, obj: str) -> str:
        """Return an instance id, or a category with its room if that is what identifies it."""
        node, room = self.graph.world.nodes[obj], self.graph.room_of(obj)
        if not node.fixed:
            return node.category.name
        if room is None or self.rng.random() < 0.3:
            return obj
        return f"{node.category.name}@{self.graph.world.rooms[room].type}"

    def take(self, obj: str, source: str) -> None:
        if self.graph.category(source).openable and self.graph.supports[obj].relation is Relation.INSIDE:
            self.do((NAV, source), (OPEN, source), (GRASP, obj), (CLOSE, source))
        else:
            self.do((NAV, obj), (GRASP, obj))

    def put_in(self, place: str) -> None:
        if self.graph.category(place).openable:
            self.do((NAV, place), (OPEN, place), (IN, place), (CLOSE, place))
        else:
            self.do((NAV, place), (IN, place))

    def put_on(self, place: str) -> None:
        self.do((NAV, place), (ON, place))


@cache
def pools() -> dict[str, tuple[str, ...]]:
    """Movable categories by use."""
    small = [c for c in default_ontology().values() if c.graspable]
    plain = [c for c in small if not c.openable]
    return {
        "any": tuple(c.name for c in small)[::7],
        "food": tuple(c.name for c in plain if c.cookable)[::5],
        "tray": tuple(
            c.name for c in plain if c.name in ("tray", "plate", "platter", "chopping_board", "cookie_sheet")
        ),
        "cloth": tuple(c.name for c in plain if c.name in ("shirt", "sock", "towel", "sweater", "dress", "hand_towel")),
        "dish": tuple(
            c.name for c in plain if c.name in ("bowl", "mug", "plate", "teacup", "wineglass", "fork", "pan")
        ),
    }


def put_two_away(h: House) -> None:
    for _ in range(2):
        source, place = h.surface(), h.box()
        obj = h.add(pools()["any"], source, Relation.ON_TOP)
        h.take(obj, source)
        h.put_in(place)
        h.want("inside", obj, place)


def take_two_out(h: House) -> None:
    for _ in range(2):
        source, place = h.box(), h.surface()
        obj = h.add(pools()["any"], source, Relation.INSIDE)
        h.take(obj, source)
        h.put_on(place)
        h.want("on_top", obj, place)


def bring_three(h: House) -> None:
    inside = h.rng.random() < 0.5
    place = h.shelf() if inside else h.surface()
    for _ in range(3):
        source = h.surface(place)
        obj = h.add(pools()["any"], source, Relation.ON_TOP)
        h.take(obj, source)
        if inside:
            h.put_in(place)
        else:
            h.put_on(place)
        h.want("inside" if inside else "on_top", obj, place)


def swap_two(h: House) -> None:
    first, second = h.surface(), ""
    second = h.surface(first)
    parking = h.surface(first, second)
    a = h.add(pools()["any"], first, Relation.ON_TOP)
    b = h.add(pools()["any"], second, Relation.ON_TOP)
    for obj, place in ((a, parking), (b, first), (a, second)):
        h.do((NAV, obj), (GRASP, obj), (NAV, place), (ON, place))
    h.want("on_top", a, second)
    h.want("on_top", b, first)


def carry_two_and_switch(h: House) -> None:
    lamp = h.pick(h.pieces(lambda c: c.toggleable and not c.safety_critical and not c.openable))
    for _ in range(2):
        source = h.surface()
        place = h.surface(source)
        obj = h.add(pools()["any"], source, Relation.ON_TOP)
        h.take(obj, source)
        h.put_on(place)
        h.want("on_top", obj, place)
    h.do((NAV, lamp), (START, lamp))
    h.want("toggled", lamp)


def tray_into_cabinet(h: House) -> None:
    place = h.box()
    tray = h.add(pools()["tray"], h.surface(), Relation.ON_TOP)
    source = h.surface()
    obj = h.add(pools()["food"], source, Relation.ON_TOP)
    h.take(obj, source)
    h.put_on(tray)
    h.do((GRASP, tray))
    h.put_in(place)
    h.want("on_top", obj, tray)
    h.want("inside", tray, place)


def run_dishwasher(h: House) -> None:
    machine = h.pick(h.pieces(lambda c: c.washes and c.openable))
    for first in (True, False):
        source = h.surface()
        obj = h.add(pools()["dish"], source, Relation.ON_TOP)
        h.take(obj, source)
        h.do((NAV, machine), *(((OPEN, machine),) if first else ()), (IN, machine))
        h.want("inside", obj, machine)
        h.want("washed", obj)
    h.do((CLOSE, machine), (START, machine), (STOP, machine))


def heat(h: House, *, from_box: bool) -> None:
    oven = h.pick(h.pieces(lambda c: c.heat is not None and c.interior and c.openable and c.toggleable))
    source, table = h.box() if from_box else h.surface(), h.surface()
    obj = h.add(pools()["food"], source, Relation.INSIDE if from_box else Relation.ON_TOP)
    h.take(obj, source)
    h.put_in(oven)
    h.do((START, oven), (STOP, oven), (OPEN, oven), (GRASP, obj), (CLOSE, oven))
    h.put_on(table)
    h.want("cooked", obj)
    h.want("on_top", obj, table)


def counter_oven_table(h: House) -> None:
    heat(h, from_box=False)


def fridge_heat_table(h: House) -> None:
    heat(h, from_box=True)


def wash_then_dry(h: House) -> None:
    washer = h.pick(h.pieces(lambda c: c.washes and c.openable and c.name != "dishwasher"))
    dryer = h.pick(h.pieces(lambda c: c.dries and c.openable), (washer,))
    source = h.surface()
    obj = h.add(pools()["cloth"], source, Relation.ON_TOP)
    h.take(obj, source)
    h.put_in(washer)
    h.do((START, washer), (STOP, washer), (OPEN, washer), (GRASP, obj), (CLOSE, washer))
    h.put_in(dryer)
    h.do((START, dryer), (STOP, dryer))
    h.want("washed", obj)
    h.want("dried", obj)
    h.want("inside", obj, dryer)


SHAPES: dict[str, Callable[[House], None]] = {
    f.__name__: f
    for f in (
        put_two_away,
        take_two_out,
        bring_three,
        swap_two,
        carry_two_and_switch,
        tray_into_cabinet,
        run_dishwasher,
        counter_oven_table,
        fridge_heat_table,
        wash_then_dry,
    )
}


@cache
def furnished(scene: str) -> SceneGraph:
    return scene_graph(load_scene(scene))


def draw_errand(rng: Rng, scenes: tuple[str, ...] | None = None) -> Errand:
    """Draw an errand at random; shapes that the drawn house has no pieces for are drawn again."""
    scenes = scenes or scene_names()
    while True:
        scene = scenes[int(rng.integers(len(scenes)))]
        shape = list(SHAPES)[int(rng.integers(len(SHAPES)))]
        house = House(furnished(scene), rng)
        try:
            SHAPES[shape](house)
        except LookupError:
            continue
        return Errand(shape, house.graph, parse_goal(house.goal), tuple(house.steps))


def shipped_errands() -> list[Errand]:
    """Return every task of the shipped single and multi-task instructions as an errand of its own."""
    errands = []
    for kind in ("single", "multi"):
        for record in read_instructions(shipped(kind)).values():
            graph = instruction_graph(load_scene(record.scene), record)
            errands += [Errand(record.kind, graph, t.parsed_goal(), t.parsed_plan()) for t in record.tasks]
    return errands


def believed(rng: Rng, errand: Errand) -> Errand:
    """Return the errand over a believed graph: only what it speaks of is known, of some things not where it is."""
    goal, graph = errand.goal, errand.graph
    named = {a.target for a in errand.reference if a.target is not None}
    for literal in goal.literals:
        for designator in (literal.subject, literal.object):
            if designator is not None and not named & set(fitting(graph, designator)):
                named.update(fitting(graph, designator)[:1])
    small = restrict(graph, sorted(named))
    nodes = {}
    for obj, node in small.world.nodes.items():
        room = graph.room_of(obj)
        nodes[obj] = node._replace(stated_room=None if room is None else graph.world.rooms[room].type)
    small = small.with_nodes(nodes)
    for obj, support in sorted(small.supports.items()):
        if support.relation is not Relation.INSIDE and rng.random() < 0.6:
            small = small.place(obj, None)
    return errand._replace(graph=msgspec.structs.replace(small, robot_room=None))


# --- defects -------------------------------------------------------------------------------------------------------


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
    at = _any(rng, [i for i in _where(plan, ON) if i and plan[i - 1] == (NAV, plan[i].target)])
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
