"""The steps of a plan: one way to meet an activity's goal, carried out on a graph.

States are made first (dirt washed off, food heated or frozen), then things are brought to their places, holders before
what they hold; then switches and doors. What was opened on the way is shut as soon as nothing more is needed from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from envs_data.build.activity_wants import Spot, Wants
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import apply, first_violation
from gavel_env.world_model.graph import Flag, Relation, SceneGraph
from gavel_env.world_model.ontology import Category

__all__ = ["Doer", "Stuck"]

_LONGEST = 400


class Stuck(Exception):
    """This way cannot be gone on with; the message says why."""


class Doer:
    """Carries out one way, step by step, on a graph of its own."""

    def __init__(self, start: SceneGraph, way: Wants, scope: Sequence[str], reachable: Callable[[str], bool]) -> None:
        self.start = self.graph = start
        self.way = way
        self.reachable = reachable
        self.steps: list[Action] = []
        self.opened: dict[str, None] = {}
        self.todo: dict[str, Spot] = {}
        known = [o for o in scope if o in start.world.nodes]
        self.tools = [o for o in known if not start.world.nodes[o].fixed]
        self.pieces = list(dict.fromkeys([*known, *start.world.nodes]))
        self.of_scope = frozenset(known)

    def run(self) -> list[Action]:
        """Return the plan.

        Raises:
            Stuck: something that is needed cannot be done.
        """
        self.todo = {
            obj: spot for obj, spot in self.way.spots.items() if spot.how != "stay" and not self._is_at(obj, spot)
        }
        wanted = self.way.states.items()
        self._clean([o for (flag, o), value in wanted if flag is Flag.DIRTY and not value and self._has(flag, o)])
        hot = [o for (flag, o), value in wanted if value and flag in (Flag.COOKED, Flag.HOT) and not self._has(flag, o)]
        thawed = [o for (flag, o), value in wanted if flag is Flag.FROZEN and not value and self._has(flag, o)]
        self._treat(list(dict.fromkeys(hot + thawed)), self._heaters, switch=True)
        cold = [o for (flag, o), value in wanted if value and flag is Flag.FROZEN and not self._has(flag, o)]
        cooled = [o for (flag, o), value in wanted if flag is Flag.HOT and not value and self._has(flag, o)]
        self._treat(list(dict.fromkeys(cold + cooled)), self._coolers, switch=False)
        self.todo = {
            obj: spot for obj, spot in self.way.spots.items() if spot.how != "stay" and not self._is_at(obj, spot)
        }
        self._move_all()
        self._switches_and_doors()
        return self.steps

    # --- single steps --------------------------------------------------------------------------------------------

    def _has(self, flag: Flag, obj: str) -> bool:
        return self.graph.has(flag, obj)

    def _do(self, primitive: Primitive, target: str | None = None) -> None:
        action = Action(primitive, target)
        violation = first_violation(self.graph, action)
        if violation is not None:
            raise Stuck(f"{action} is refused: {violation}")
        if len(self.steps) >= _LONGEST:
            raise Stuck(f"longer than {_LONGEST} steps")
        self.graph = apply(self.graph, action)
        self.steps.append(action)

    def _go(self, obj: str) -> None:
        if obj not in self.graph.near:
            self._do(Primitive.NAVIGATE_TO, obj)

    def _open(self, obj: str) -> None:
        self._go(obj)
        self._do(Primitive.OPEN, obj)
        self.opened[obj] = None

    def _uncover(self, obj: str) -> None:
        """Open every shut container around an object, from the outermost."""
        around = [h for relation, h in self.graph.holders(obj) if relation is Relation.INSIDE and self.graph.is_shut(h)]
        for container in reversed(around):
            self._open(container)

    def _fetch(self, obj: str) -> None:
        if self.graph.holding == obj:
            return
        self._uncover(obj)
        self._go(obj)
        self._do(Primitive.GRASP, obj)
        self._shut_what_is_done()

    def _put(self, obj: str, spot: Spot) -> None:
        """Bring what is held to its spot."""
        self.todo.pop(obj, None)
        if spot.how == "floor":
            if self.graph.robot_room != spot.where or not self.steps:
                self._do(Primitive.NAVIGATE_TO, self._landmark(spot.where, obj))
            self._do(Primitive.RELEASE)
        elif spot.how == "beside":
            self._do(Primitive.NAVIGATE_TO, spot.where)
            self._do(Primitive.RELEASE)
        else:
            self._uncover(spot.where)
            self._go(spot.where)
            if spot.how == "in" and self.graph.is_shut(spot.where):
                self._open(spot.where)
            self._do(Primitive.PLACE_ON_TOP if spot.how == "on" else Primitive.PLACE_INSIDE, spot.where)
        self._shut_what_is_done()

    def _landmark(self, room: str, held: str) -> str:
        """Return something that stands in a room, to go to when only the room matters."""
        for obj in self.pieces:
            here = obj != held and self.graph.room_of(obj) == room and self.graph.closed_container(obj) is None
            if here and self._accessible(obj):
                return obj
        raise Stuck(f"nothing to go to in {room}")

    def _accessible(self, obj: str) -> bool:
        """Return whether the robot can get at an object."""
        nodes = self.graph.world.nodes
        while not nodes[obj].fixed:
            support = self.graph.supports.get(obj)
            if support is None or support.relation in (Relation.FLOOR, Relation.HELD):
                return support is not None
            obj = support.holder
        return self.reachable(obj)

    # --- doors ---------------------------------------------------------------------------------------------------

    def _shut_what_is_done(self) -> None:
        """Shut what the plan opened, is within reach, and is not needed again."""
        for obj in [o for o in reversed(list(self.opened)) if o in self.graph.near]:
            if not self._needed(obj) and not self.way.states.get((Flag.OPEN, obj), False):
                self._do(Primitive.CLOSE, obj)
                del self.opened[obj]

    def _needed(self, container: str) -> bool:
        for obj, spot in self.todo.items():
            if self.graph.contains(container, obj) and self.graph.holding != obj:
                return True
            if spot.how in ("on", "in") and (spot.where == container or self.graph.contains(container, spot.where)):
                return True
            if spot.how == "beside" and self.graph.contains(container, spot.where):
                return True
        return False

    # --- states --------------------------------------------------------------------------------------------------

    def _by_preference(self, obj: str, fits: Callable[[Category], bool]) -> list[str]:
        """Return the appliances that fit: the activity's own first, then those of the object's room, in graph order."""
        room = self.graph.room_of(obj)
        found = [p for p in self.pieces if self.graph.world.nodes[p].fixed and fits(self.graph.category(p))]
        found = [p for p in found if self._accessible(p)]
        spot = self.way.spots.get(obj)
        found.sort(
            key=lambda p: (spot is None or p != spot.where, p not in self.of_scope, self.graph.room_of(p) != room)
        )
        return found

    def _movable(self, obj: str) -> bool:
        """Return whether one hand can put it into an appliance."""
        node = self.graph.world.nodes[obj]
        return node.category.graspable and not node.fixed

    def _loose(self, obj: str) -> bool:
        node = self.graph.world.nodes[obj]
        return node.category.liftable and not node.fixed

    def _clean(self, objects: Iterable[str]) -> None:
        """Take the dirt off: in a sink, dishwasher or washer what can be carried, with a rag what cannot."""
        washed: dict[str, list[str]] = {}
        wiped = []
        for obj in objects:
            basins = self._by_preference(obj, lambda c: c.interior and c.toggleable and (c.rinses or c.washes))
            if self._movable(obj) and basins:
                washed.setdefault(basins[0], []).append(obj)
            else:
                wiped.append(obj)
        for basin, dirty in washed.items():
            self._run_appliance(basin, dirty, "in", switch=True)
        for obj in wiped:
            self._wipe(obj)

    def _wipe(self, obj: str) -> None:
        if not self._has(Flag.DIRTY, obj):
            return
        kind = self.graph.category(obj)
        if not kind.surface:
            raise Stuck(f"{obj} is dirty; it can be neither carried to water nor wiped (it has no surface)")
        tools = [t for t in self.tools if t != obj and self.graph.category(t).wipes and self._loose(t)]
        if not tools:
            raise Stuck(f"{obj} is dirty, and the activity has nothing to wipe it with")
        tool = min(tools, key=lambda t: (self.graph.supports[t].holder != obj, t not in self.todo))
        spot = self.todo.pop(tool, None)
        self._fetch(tool)
        self._put(tool, Spot("on", obj))
        if spot is not None:
            self.todo[tool] = spot

    def _heaters(self, obj: str) -> list[tuple[str, str]]:
        found = self._by_preference(obj, lambda c: c.heat is not None and c.toggleable)
        ways = []
        for piece in found:
            category = self.graph.category(piece)
            assert category.heat is not None
            if category.interior:
                ways.append((piece, "in"))
            elif category.surface and not category.heat.requires_inside:
                ways.append((piece, "on"))
        return ways

    def _coolers(self, obj: str) -> list[tuple[str, str]]:
        def freezes(category: Category) -> bool:
            cold = category.cold
            return category.interior and cold is not None and cold.freezes and not cold.requires_toggled_on

        return [(piece, "in") for piece in self._by_preference(obj, freezes)]

    def _treat(
        self, objects: Sequence[str], appliances: Callable[[str], list[tuple[str, str]]], *, switch: bool
    ) -> None:
        batches: dict[tuple[str, str], list[str]] = {}
        for obj in objects:
            found = appliances(obj)
            if not found:
                raise Stuck(f"nothing in the scene can {'heat' if switch else 'freeze'} {obj}")
            if not self._movable(obj):
                raise Stuck(f"{obj} cannot be lifted")
            batches.setdefault(found[0], []).append(obj)
        for (appliance, how), batch in batches.items():
            self._run_appliance(appliance, batch, how, switch=switch)

    def _run_appliance(self, appliance: str, batch: Sequence[str], how: str, *, switch: bool) -> None:
        """Load an appliance, run it, and leave what is in it there; it is shut if it has a door."""
        spot = Spot(how, appliance)
        waiting = {obj: spot for obj in batch if not self._is_at(obj, spot)}
        kept, self.todo = self.todo, dict(waiting)
        for obj in waiting:
            self._fetch(obj)
            self._put(obj, spot)
        self.todo = kept
        category = self.graph.category(appliance)
        self._go(appliance)
        if category.openable:
            if not switch and not waiting and self.graph.is_shut(appliance):
                self._open(appliance)
            if not self.graph.is_shut(appliance):
                self._do(Primitive.CLOSE, appliance)
                self.opened.pop(appliance, None)
        if switch:
            self._do(Primitive.TOGGLE_ON, appliance)
            self._do(Primitive.TOGGLE_OFF, appliance)

    # --- places --------------------------------------------------------------------------------------------------

    def _is_at(self, obj: str, spot: Spot) -> bool:
        if spot.how == "beside":
            return self.graph.beside(obj, spot.where) and self.graph.supports[obj].relation is Relation.FLOOR
        support = self.graph.supports.get(obj)
        how = {Relation.ON_TOP: "on", Relation.INSIDE: "in", Relation.FLOOR: "floor", Relation.HELD: "held"}
        return support is not None and (how[support.relation], support.holder) == spot

    def _move_all(self) -> None:
        """Bring everything to its place; holders first, then what lies where the last thing was or goes."""
        last: tuple[str | None, str] = (None, "")
        while self.todo:
            ready = [o for o, spot in self.todo.items() if spot.where not in self.todo]
            if not ready:
                raise Stuck(f"things wait for each other: {', '.join(self.todo)}")
            source = {o: self.graph.supports[o].holder for o in ready}
            obj = min(ready, key=lambda o: (source[o] != last[0], self.todo[o].where != last[1]))
            spot = self.todo[obj]
            last = (source[obj], spot.where)
            self._fetch(obj)
            self._put(obj, spot)

    def _switches_and_doors(self) -> None:
        wanted = self.way.states
        for obj in list(self.opened):
            if not wanted.get((Flag.OPEN, obj), False):
                self._uncover(obj)
                self._go(obj)
                self._do(Primitive.CLOSE, obj)
                del self.opened[obj]
        for flag, on, off in (
            (Flag.OPEN, Primitive.OPEN, Primitive.CLOSE),
            (Flag.TOGGLED, Primitive.TOGGLE_ON, Primitive.TOGGLE_OFF),
        ):
            for (wanted_flag, obj), value in wanted.items():
                if wanted_flag is flag and self._has(flag, obj) != value:
                    self._uncover(obj)
                    self._go(obj)
                    self._do(on if value else off, obj)
