"""A state and a goal as a PDDL planning task over the lifted household domain (`household.pddl`), for ADL planners.

`pddl` exports one state in plain STRIPS, to check single steps; this is what a planner searches to the end. The domain
is a text of its own and shares no precondition or effect with `dynamics`; the tests hold the two to each other.

The goal is the task's own conditions, and that what the plan opens and switches on is shut and off at its end. Literals
of one subject that several things fit are met by one of them; quantifiers are written out over their members.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import NamedTuple

from gavel_env.world_model.actions import Action, Primitive, own_step
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import GoalText, as_goal
from gavel_env.world_model.graph import Relation, SceneGraph, all_flags
from gavel_env.world_model.own_actions import own_action
from gavel_env.world_model.own_actions_pddl import with_own_actions
from gavel_env.world_model.planning_goal import Expression, GoalWriter, state_name

__all__ = ["Expression", "PlanningTask", "household_domain", "pddl_names", "planning_task", "state_of"]


class PlanningTask(NamedTuple):
    """A planning task over the household domain.

    Attributes:
        things: PDDL name -> id of the graph.
        rooms: PDDL name -> room id.
        init: facts that hold in the state.
        goal: condition to be reached; `exists` has one variable, of things.
    """

    things: Mapping[str, str]
    rooms: Mapping[str, str]
    init: tuple[Expression, ...]
    goal: Expression

    @property
    def domain(self) -> str:
        """The domain, as PDDL, with actions of one's own.

        Raises:
            NotExpressible: one of those needs or does what PDDL cannot say.
        """
        return with_own_actions(household_domain())

    @property
    def problem(self) -> str:
        """The problem, as PDDL."""
        objects = f"{' '.join(self.things)} - thing {' '.join(self.rooms)} - room"
        init = "\n  ".join(map(_written, self.init))
        return (
            f"(define (problem errand)\n(:domain household)\n(:objects {objects})\n"
            f"(:init\n  {init})\n(:goal {_written(self.goal)}))\n"
        )

    def action(self, name: str, arguments: Sequence[str]) -> Action:
        """Return the primitive that a step of a plan stands for; the last argument is the target of the nine."""
        primitive = Primitive[name.replace("-", "_").upper()]
        if own_action(primitive) is not None:
            return own_step(primitive, [self.things[a] for a in arguments])
        target = self.things[arguments[-1]] if primitive.takes_target else None
        return Action(primitive, target)


def _written(expression: Expression) -> str:
    """Return an expression in PDDL."""
    head, *rest = expression
    if head == "exists":
        return f"(exists ({rest[0]} - thing) {' '.join(_written(r) for r in rest[1:] if not isinstance(r, str))})"
    return f"({' '.join((str(head), *(r if isinstance(r, str) else _written(r) for r in rest)))})"


@cache
def household_domain() -> str:
    """Return the PDDL text of the household domain."""
    return (resources.files("gavel_env.world_model") / "household.pddl").read_text("utf-8")


def planning_task(
    graph: SceneGraph, goal: GoalText, profile: Profile = Profile.PAPER, objects: Collection[str] | None = None
) -> PlanningTask:
    """Return the task of reaching a goal from a state.

    Args:
        graph: the state.
        goal: g.
        profile: rules profile.
        objects: ids to write, with all that holds them; default: all. Others are left out, as if they were not there.

    Raises:
        NotExpressible: a condition of the goal cannot be written.
    """
    goal = as_goal(goal)
    kept = [o for o in graph.world.nodes if objects is None or o in objects]
    names = pddl_names([*kept, *graph.world.rooms])
    written = {identifier: name for name, identifier in names.items()}
    init = tuple(
        (fact[0], *(written[a] for a in fact[1:])) for fact in (*_statics(graph, kept, profile), *state_of(graph, kept))
    )
    things = {written[o]: o for o in kept}
    rooms = {written[r]: r for r in graph.world.rooms}
    return PlanningTask(things, rooms, init, GoalWriter(graph, set(kept), written).expression(goal))


def pddl_names(identifiers: Sequence[str]) -> dict[str, str]:
    """Return a PDDL name for every id: the id itself, without what PDDL cannot write."""
    names: dict[str, str] = {}
    for identifier in identifiers:
        name = re.sub(r"[^a-z0-9_-]", "-", identifier.lower())
        name = name if name[:1].isalpha() else f"x-{name}"
        while name in names:
            name += "-"
        names[name] = identifier
    return names


Fact = tuple[str, ...]


# --- the state -----------------------------------------------------------------------------------------------------


def _statics(graph: SceneGraph, objects: Sequence[str], profile: Profile) -> Iterator[Fact]:
    """Yield what things are, and what the rules profile allows."""
    if profile is Profile.PAPER:
        yield ("full-hand-may-operate",)
    for o in objects:
        node = graph.world.nodes[o]
        category = node.category
        heat, cold = category.heat, category.cold
        holds = {
            "fixed": node.fixed,
            "loose": category.liftable and not node.fixed,
            "surface": category.surface,
            "interior": category.interior,
            "floor-mounted": category.mount == "floor",
            "door": category.openable,
            "switch": category.toggleable,
            "needs-shut": category.requires_closed and category.openable,
            "clearance": category.clearance,
            "heats": heat is not None,
            "heats-on-top": heat is not None and not heat.requires_inside,
            "heats-when-shut": heat is not None and heat.requires_closed and category.openable,
            "freezes": cold is not None and cold.freezes and not cold.requires_toggled_on,
            "washes": category.washes,
            "dries": category.dries,
            "rinses": category.rinses,
            "wipes": category.wipes,
            "cookable": category.cookable,
            "heatable": category.heatable,
            "freezable": category.freezable,
        }
        yield from ((name, o) for name, value in holds.items() if value)


def state_of(graph: SceneGraph, objects: Sequence[str]) -> Iterator[Fact]:
    """Yield the facts of a state that can change, about some objects."""
    yield ("hand-empty",) if graph.holding is None else ("holding", graph.holding)
    if graph.robot_room is not None:
        yield ("robot-in", graph.robot_room)
    carried = set() if graph.holding is None else {graph.holding, *graph.descendants(graph.holding)}
    known = set(objects)
    for o in objects:
        support = graph.supports.get(o)
        if support is None or support.relation is Relation.FLOOR:
            yield ("lies", o)
        if support is not None and support.relation is Relation.FLOOR:
            yield ("on-floor", o, support.holder)
        if support is not None and support.relation <= Relation.INSIDE and support.holder in known:
            yield ("on-top" if support.relation is Relation.ON_TOP else "inside", o, support.holder)
        yield from (("aboard", o, o), ("rides", o, o))
        if not graph.world.nodes[o].fixed:
            yield from (("rides", o, holder) for holder in _carriers(graph, o) if holder in known)
        yield from (("aboard", o, holder) for _, holder in graph.holders(o) if holder in known)
        room = graph.room_of(o)
        if o in carried:
            yield ("carried", o)
        elif room is not None:
            yield ("in-room", o, room)
        if o in graph.near:
            yield ("near", o)
        if graph.is_shut(o):
            yield ("shut", o)
        yield from ((state_name(flag.name.lower()), o) for flag in all_flags() if graph.has(flag, o))
    for a, b in sorted(graph.next_to):
        if a in known and b in known:
            yield ("next-to", a, b)
            yield ("next-to", b, a)


def _carriers(graph: SceneGraph, obj: str) -> Iterator[str]:
    """Yield what holds a movable up, as far as the first fixed piece."""
    for _, holder in graph.holders(obj):
        yield holder
        if graph.world.nodes[holder].fixed:
            return
