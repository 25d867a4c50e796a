"""The transition model f(G, a) of Eq. (2): preconditions, effects and the safety predicate.

The same model moves the hidden world and predicts for the agents. Every precondition is one small function that stands
once, in the table `RULES`; the order of a row is the order in which violations are reported. `NavigateTo` can also be
refused by the executor (`unreachable`, `not_found`), which alone knows geometry and what a search finds.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec

from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.goals import GoalText, as_goal
from gavel_env.world_model.graph import Flag, Relation, SceneGraph, Support
from gavel_env.world_model.open_enums import add_member

__all__ = [
    "OWN_RULES",
    "PRECONDITION",
    "RULES",
    "OwnRule",
    "Profile",
    "Violation",
    "ViolationKind",
    "apply",
    "conferred",
    "first_violation",
    "rollout",
    "unsafe",
    "violations",
]


class ViolationKind(enum.Enum):
    """Why a transition is invalid (the value is the text form in records and verdicts)."""

    UNKNOWN_OBJECT = "unknown_object"
    ROOM_TARGET = "room_target"
    HIDDEN = "hidden"
    UNREACHABLE = "unreachable"
    NOT_FOUND = "not_found"
    NOT_NEAR = "not_near"
    NOT_GRASPABLE = "not_graspable"
    HAND_FULL = "hand_full"
    HAND_EMPTY = "hand_empty"
    CLOSED = "closed"
    NO_SURFACE = "no_surface"
    NO_INTERIOR = "no_interior"
    SELF_PLACEMENT = "self_placement"
    CYCLE = "cycle"
    NO_DOOR = "no_door"
    NO_SWITCH = "no_switch"
    DOOR_OPEN = "door_open"


PRECONDITION = add_member(ViolationKind, "PRECONDITION", "precondition")
"""A need of an action of one's own, said by the violation's `blocker`; the nine have none such, so that what is made of
the kinds (observation spaces, tables) does not list it."""


class Profile(enum.Enum):
    """Rules profile.

    `PAPER`: doors and switches may be operated with something in hand, as the paper's reference plans do.
    `OMNIGIBSON`: they need an empty hand, as OmniGibson's symbolic primitives have it.
    """

    PAPER = "paper"
    OMNIGIBSON = "omnigibson"


class Violation(NamedTuple):
    """One violated precondition.

    Attributes:
        kind: which one.
        subject: the action's target (or what is held, for the gripper's conditions).
        blocker: what stands in the way: the shut container, the held object, or None.
        step: index in the plan, or None outside a plan.
    """

    kind: ViolationKind
    subject: str
    blocker: str | None = None
    step: int | None = None

    def __str__(self) -> str:
        because = f" (because of {self.blocker})" if self.blocker else ""
        return f"{self.kind.value}({self.subject}){because}"


Check = Callable[[SceneGraph, str], Violation | None]
Effect = Callable[[SceneGraph, str], SceneGraph]


class Rule(NamedTuple):
    """One row of the table: pre_a, further preconditions of the `OMNIGIBSON` profile, eff_a."""

    preconditions: tuple[Check, ...]
    effect: Effect
    omnigibson: tuple[Check, ...] = ()


class OwnRule(NamedTuple):
    """One row of an action of one's own, over all its arguments."""

    violations: Callable[[SceneGraph, Sequence[str]], Iterator[Violation]]
    effect: Callable[[SceneGraph, Sequence[str]], SceneGraph]


OWN_RULES: dict[Primitive, OwnRule] = {}
"""Actions of one's own (`own_actions.register_action`)."""


# --- preconditions -------------------------------------------------------------------------------------------------


def known(graph: SceneGraph, x: str) -> Violation | None:
    """The target is an object that the graph knows."""
    if x in graph.world.nodes:
        return None
    kind = ViolationKind.ROOM_TARGET if x in graph.world.rooms else ViolationKind.UNKNOWN_OBJECT
    return Violation(kind, x)


def _not_hidden(graph: SceneGraph, x: str) -> Violation | None:
    """The target is not inside something shut."""
    blocker = graph.closed_container(x)
    return None if blocker is None else Violation(ViolationKind.HIDDEN, x, blocker)


def accessible(graph: SceneGraph, x: str) -> Violation | None:
    """Nothing that the target is inside is shut."""
    blocker = graph.closed_container(x)
    return None if blocker is None else Violation(ViolationKind.CLOSED, x, blocker)


def near(graph: SceneGraph, x: str) -> Violation | None:
    """The target is within reach or held."""
    return None if x in graph.near or x == graph.holding else Violation(ViolationKind.NOT_NEAR, x)


def graspable(graph: SceneGraph, x: str) -> Violation | None:
    """The target can be lifted, and is not part of the house."""
    node = graph.world.nodes[x]
    return None if node.category.liftable and not node.fixed else Violation(ViolationKind.NOT_GRASPABLE, x)


def hand_free(graph: SceneGraph, x: str) -> Violation | None:
    """The hand is empty."""
    return None if graph.holding is None else Violation(ViolationKind.HAND_FULL, x, graph.holding)


def _hand_holds(graph: SceneGraph, x: str) -> Violation | None:
    """The hand holds something."""
    return Violation(ViolationKind.HAND_EMPTY, x) if graph.holding is None else None


def surface(graph: SceneGraph, y: str) -> Violation | None:
    """Things can stand on the target."""
    return None if graph.category(y).surface else Violation(ViolationKind.NO_SURFACE, y)


def interior(graph: SceneGraph, y: str) -> Violation | None:
    """Things fit inside the target."""
    return None if graph.category(y).interior else Violation(ViolationKind.NO_INTERIOR, y)


def opened(graph: SceneGraph, y: str) -> Violation | None:
    """The target is open, or has no door."""
    return Violation(ViolationKind.CLOSED, y, y) if graph.is_shut(y) else None


def _not_itself(graph: SceneGraph, y: str) -> Violation | None:
    """The target is not what the hand holds."""
    return Violation(ViolationKind.SELF_PLACEMENT, y, y) if graph.holding == y else None


def _no_cycle(graph: SceneGraph, y: str) -> Violation | None:
    """The target is not on or in what the hand holds."""
    held = graph.holding
    if held is not None and held != y and graph.contains(held, y):
        return Violation(ViolationKind.CYCLE, y, held)
    return None


def door(graph: SceneGraph, y: str) -> Violation | None:
    """The target has a door."""
    return None if graph.category(y).openable else Violation(ViolationKind.NO_DOOR, y)


def switch(graph: SceneGraph, y: str) -> Violation | None:
    """The target has a switch."""
    return None if graph.category(y).toggleable else Violation(ViolationKind.NO_SWITCH, y)


def _door_shut(graph: SceneGraph, y: str) -> Violation | None:
    """The target is shut, if it runs only with its door shut."""
    category = graph.category(y)
    if category.requires_closed and category.openable and not graph.is_shut(y):
        return Violation(ViolationKind.DOOR_OPEN, y, y)
    return None


# --- effects -------------------------------------------------------------------------------------------------------


def _navigate_to(graph: SceneGraph, x: str) -> SceneGraph:
    """The target, what it holds, what holds it, and what the hand carries are near; the robot is in its room."""
    held = graph.holding
    if x == held:
        return graph
    near = {x, *graph.descendants(x), *(holder for _, holder in graph.holders(x))}
    if held is not None:
        near.add(held)
        near.update(graph.descendants(held))
    return msgspec.structs.replace(graph, near=frozenset(near), robot_room=graph.room_of(x))


def _grasp(graph: SceneGraph, x: str) -> SceneGraph:
    """The hand holds the target, with everything on or in it."""
    next_to = graph.next_to
    if next_to:
        next_to = frozenset(pair for pair in next_to if x not in pair)
    moved = graph.place(x, Support(Relation.HELD, "robot"))
    return msgspec.structs.replace(moved, holding=x, next_to=next_to)


def _release(graph: SceneGraph, _: str) -> SceneGraph:
    """The held object is on the floor of the robot's room, next to the near things that stand there."""
    held = graph.holding
    assert held is not None
    room = graph.robot_room
    down = graph.place(held, None if room is None else Support(Relation.FLOOR, room))
    pairs = {(held, o) if held < o else (o, held) for o in graph.near if o != held and _stands_on_floor(graph, o)}
    return msgspec.structs.replace(down, holding=None, next_to=graph.next_to | pairs)


def _stands_on_floor(graph: SceneGraph, obj: str) -> bool:
    support = graph.supports.get(obj)
    floor = support is None or support.relation == Relation.FLOOR
    return floor and graph.category(obj).mount == "floor"


def _place_on_top(graph: SceneGraph, y: str) -> SceneGraph:
    """The held object is on the target, whose dirt a cloth takes off."""
    held = graph.holding
    assert held is not None
    placed = msgspec.structs.replace(graph.place(held, Support(Relation.ON_TOP, y)), holding=None)
    if y in placed.flags[Flag.DIRTY] and graph.category(held).wipes:
        placed = placed.with_flag(Flag.DIRTY, frozenset((y,)), value=False)
    return placed


def _place_inside(graph: SceneGraph, y: str) -> SceneGraph:
    """The held object is inside the target."""
    held = graph.holding
    assert held is not None
    placed = msgspec.structs.replace(graph.place(held, Support(Relation.INSIDE, y)), holding=None)
    return placed if graph.category(y).openable else _chill(placed, y)


def _open(graph: SceneGraph, y: str) -> SceneGraph:
    """The target is open; if it runs only with its door shut, it goes off."""
    graph = graph.with_flag(Flag.OPEN, frozenset((y,)))
    if graph.category(y).requires_closed and y in graph.flags[Flag.TOGGLED]:
        graph = graph.with_flag(Flag.TOGGLED, frozenset((y,)), value=False)
    return graph


def _close(graph: SceneGraph, y: str) -> SceneGraph:
    """The target is shut; what it holds freezes, if it is a freezer."""
    return _chill(graph.with_flag(Flag.OPEN, frozenset((y,)), value=False), y)


def _chill(graph: SceneGraph, y: str) -> SceneGraph:
    """Freeze what is in a cold source that needs no switch: once its door is shut, or at once if it has none.

    What freezes is hot no more; what a heat source makes hot is frozen no more (`_toggle_on`).
    """
    cold = graph.category(y).cold
    if cold is None or not cold.freezes or cold.requires_toggled_on:
        return graph
    chilled = frozenset(o for o in _within(graph, y, inside_only=True) if graph.category(o).freezable)
    return graph.with_flag(Flag.FROZEN, chilled).with_flag(Flag.HOT, chilled, value=False)


def _toggle_on(graph: SceneGraph, y: str) -> SceneGraph:
    """The target is on; what it holds becomes cooked and hot, washed, dried or clean, as the ontology says."""
    graph = graph.with_flag(Flag.TOGGLED, frozenset((y,)))
    for flag, objects in conferred(graph, y).items():
        graph = graph.with_flag(flag, objects)
        if flag in _UNDOES:
            graph = graph.with_flag(_UNDOES[flag], objects, value=False)
    if graph.category(y).rinses:
        graph = graph.with_flag(Flag.DIRTY, frozenset(_within(graph, y, inside_only=True)), value=False)
    return graph


_UNDOES = {Flag.WASHED: Flag.DIRTY, Flag.HOT: Flag.FROZEN}


def _toggle_off(graph: SceneGraph, y: str) -> SceneGraph:
    """The target is off."""
    return graph.with_flag(Flag.TOGGLED, frozenset((y,)), value=False)


def conferred(graph: SceneGraph, appliance: str) -> dict[Flag, frozenset[str]]:
    """Return the states that switching `appliance` on gives, and to which of its contents.

    Contents are what is in it (for heat sources that do not require inside: also on it), and one level down what those
    hold, unless shut away. Which category does what comes from the ontology.
    """
    category = graph.category(appliance)
    states: dict[Flag, frozenset[str]] = {}
    heat = category.heat
    if heat is not None and not (heat.requires_closed and category.openable and not graph.is_shut(appliance)):
        heated = _within(graph, appliance, inside_only=heat.requires_inside)
        states[Flag.COOKED] = frozenset(o for o in heated if graph.category(o).cookable)
        states[Flag.HOT] = frozenset(o for o in heated if graph.category(o).heatable)
    if category.washes:
        states[Flag.WASHED] = frozenset(_within(graph, appliance, inside_only=True))
    if category.dries:
        states[Flag.DRIED] = frozenset(_within(graph, appliance, inside_only=True))
    return {flag: objects for flag, objects in states.items() if objects}


def _within(graph: SceneGraph, holder: str, *, inside_only: bool) -> list[str]:
    direct = [
        o
        for o in graph.contents.get(holder, ())
        if not graph.world.nodes[o].fixed and (not inside_only or graph.supports[o].relation == Relation.INSIDE)
    ]
    below = [o for d in direct for o in graph.contents.get(d, ()) if graph.closed_container(o) in (None, holder)]
    return direct + below


# --- the table -----------------------------------------------------------------------------------------------------

RULES: Mapping[Primitive, Rule] = {
    Primitive.NAVIGATE_TO: Rule((known, _not_hidden), _navigate_to),
    Primitive.GRASP: Rule((known, near, graspable, hand_free, accessible), _grasp),
    Primitive.RELEASE: Rule((_hand_holds,), _release),
    Primitive.PLACE_ON_TOP: Rule(
        (known, _hand_holds, _not_itself, near, surface, accessible, _no_cycle), _place_on_top
    ),
    Primitive.PLACE_INSIDE: Rule(
        (known, _hand_holds, _not_itself, near, interior, opened, accessible, _no_cycle), _place_inside
    ),
    Primitive.OPEN: Rule((known, near, door, accessible), _open, (hand_free,)),
    Primitive.CLOSE: Rule((known, near, door, accessible), _close, (hand_free,)),
    Primitive.TOGGLE_ON: Rule((known, near, switch, accessible, _door_shut), _toggle_on, (hand_free,)),
    Primitive.TOGGLE_OFF: Rule((known, near, switch, accessible), _toggle_off, (hand_free,)),
}


def first_violation(graph: SceneGraph, action: Action, profile: Profile = Profile.PAPER) -> Violation | None:
    """Return the first violated precondition of `action` in `graph`, or None if it is applicable."""
    try:
        rule = RULES[action.primitive]
    except KeyError:
        return next(OWN_RULES[action.primitive].violations(graph, action.arguments), None)
    target = action.target or ""
    for check in rule.preconditions:
        violation = check(graph, target)
        if violation is not None:
            return violation
    if profile is Profile.OMNIGIBSON:
        for check in rule.omnigibson:
            violation = check(graph, target)
            if violation is not None:
                return violation
    return None


def violations(graph: SceneGraph, action: Action, profile: Profile = Profile.PAPER) -> tuple[Violation, ...]:
    """Return every violated precondition of `action` in `graph`, in the table's order; empty = applicable.

    An unknown target ends the list: nothing else can be said of it.
    """
    rule = RULES.get(action.primitive)
    if rule is None:
        return tuple(OWN_RULES[action.primitive].violations(graph, action.arguments))
    target = action.target or ""
    found: list[Violation] = []
    for check in rule.preconditions + (rule.omnigibson if profile is Profile.OMNIGIBSON else ()):
        violation = check(graph, target)
        if violation is not None:
            found.append(violation)
            if check is known:
                break
    return tuple(found)


def apply(graph: SceneGraph, action: Action) -> SceneGraph:
    """Return eff_a(G). The caller has seen that the preconditions hold (`first_violation` is None)."""
    try:
        rule = RULES[action.primitive]
    except KeyError:
        return OWN_RULES[action.primitive].effect(graph, action.arguments)
    return rule.effect(graph, action.target or "")


def unsafe(start: SceneGraph, end: SceneGraph, goal: GoalText) -> tuple[tuple[Flag, str], ...]:
    """Return what breaks safe(a_0..a_H-1): (OPEN, x) for doors left open, (TOGGLED, x) for appliances left on.

    Only what the plan itself opened or switched on counts, only safety-critical appliances must be off, and what the
    goal asks to be open or on may stay so. Empty = safe.
    """
    goal = as_goal(goal)
    left: list[tuple[Flag, str]] = []
    for flag in (Flag.OPEN, Flag.TOGGLED):
        for obj in sorted(end.flags[flag] - start.flags[flag]):
            if flag is Flag.TOGGLED and not end.category(obj).safety_critical:
                continue
            if not goal.wants(flag, obj, end):
                left.append((flag, obj))
    return tuple(left)


def rollout(
    graph: SceneGraph, plan: Sequence[Action], profile: Profile = Profile.PAPER
) -> tuple[SceneGraph, Violation | None]:
    """Apply a plan until its end or its first violation; return the last graph and that violation with its step."""
    for step, action in enumerate(plan):
        violation = first_violation(graph, action, profile)
        if violation is not None:
            return graph, violation._replace(step=step)
        graph = apply(graph, action)
    return graph, None
