"""Errands with reference plans over real scene graphs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
from support.worlds import restrict

from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.instructions.initial_graph import instruction_graph, scene_graph
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.goals import Goal, fitting, parse_goal
from gavel_env.world_model.graph import Node, Relation, SceneGraph, Support
from gavel_env.world_model.ontology import Category, default_ontology

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
