"""States, actions and refusals in words, and the commands that a state admits: what people and language models play by.

Every command is read back by `parse_action`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gavel_env.errors import nearest_names
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import PRECONDITION, Profile, Violation, ViolationKind, first_violation
from gavel_env.world_model.graph import Flag, Relation, SceneGraph

__all__ = ["REASONS", "command", "commands", "look", "nearest_commands", "outcome_text", "reason"]

REASONS: Mapping[ViolationKind, str] = {
    ViolationKind.UNKNOWN_OBJECT: "there is no {x}",
    ViolationKind.ROOM_TARGET: "{x} is a room; name an object",
    ViolationKind.HIDDEN: "{x} is inside {blocker}, which is closed",
    ViolationKind.UNREACHABLE: "no way leads to {x}",
    ViolationKind.NOT_FOUND: "{x} was not found anywhere",
    ViolationKind.NOT_NEAR: "the robot is not near {x}",
    ViolationKind.NOT_GRASPABLE: "{x} cannot be carried",
    ViolationKind.HAND_FULL: "the hand already holds {blocker}",
    ViolationKind.HAND_EMPTY: "the hand is empty",
    ViolationKind.CLOSED: "{blocker} is closed",
    ViolationKind.NO_SURFACE: "nothing can be put on top of {x}",
    ViolationKind.NO_INTERIOR: "nothing can be put inside {x}",
    ViolationKind.SELF_PLACEMENT: "{x} cannot be put on or in itself",
    ViolationKind.CYCLE: "{x} is on or in {blocker}, which the hand holds",
    ViolationKind.NO_DOOR: "{x} has no door",
    ViolationKind.NO_SWITCH: "{x} has no switch",
    ViolationKind.DOOR_OPEN: "the door of {x} is open",
}
"""Which precondition is missing, in words."""

_VERBS: Mapping[Primitive, str] = {
    Primitive.NAVIGATE_TO: "go to",
    Primitive.GRASP: "take",
    Primitive.RELEASE: "drop",
    Primitive.PLACE_ON_TOP: "put on",
    Primitive.PLACE_INSIDE: "put in",
    Primitive.OPEN: "open",
    Primitive.CLOSE: "close",
    Primitive.TOGGLE_ON: "turn on",
    Primitive.TOGGLE_OFF: "turn off",
}
_SHOWN = (Flag.TOGGLED, Flag.COOKED, Flag.WASHED, Flag.DRIED, Flag.HOT, Flag.FROZEN, Flag.DIRTY)


def reason(violation: Violation) -> str:
    """Return why an action is invalid, in words."""
    if violation.kind is PRECONDITION:
        return f"it needs {violation.blocker}"
    return REASONS[violation.kind].format(x=violation.subject, blocker=violation.blocker)


# --- commands --------------------------------------------------------------------------------------------------------


def command(action: Action) -> str:
    """Return an action as one says it: `go to fridge_0`."""
    verb = _VERBS.get(action.primitive) or action.primitive.name.lower().replace("_", " ")
    return f"{verb} {', '.join(action.arguments)}" if action.target else verb


def commands(graph: SceneGraph, profile: Profile = Profile.PAPER, find: Iterable[str] = ()) -> list[str]:
    """Return every command that the world model accepts in a graph: what is in reach first, then where to go.

    Args:
        graph: what is known.
        profile: rules profile.
        find: categories or designators that may be searched for.
    """
    here = sorted(graph.near if graph.holding is None else graph.near | {graph.holding})
    actions = [Action(Primitive.RELEASE)]
    actions += [Action(p, obj) for obj in here for p in Primitive if p.takes_target and p is not Primitive.NAVIGATE_TO]
    actions += [Action(Primitive.NAVIGATE_TO, obj) for obj in graph.world.nodes if obj not in here]
    accepted = [command(action) for action in actions if first_violation(graph, action, profile) is None]
    return accepted + [f"find {name}" for name in find]


def nearest_commands(text: str, known: Sequence[str]) -> tuple[str, ...]:
    """Return up to three of the known commands that look like a text, best first."""
    return nearest_names(text.strip().lower(), known)


# --- states ----------------------------------------------------------------------------------------------------------


def look(graph: SceneGraph) -> str:
    """Return what is known of the robot's room, what is in the hand, and which rooms are next to it."""
    room = graph.robot_room
    seen = [obj for obj in graph.world.nodes if graph.room_of(obj) == room and _stands_alone(graph, obj)]
    neighbours = sorted({b if a == room else a for a, b in graph.world.connections if room in (a, b)})
    lines = [f"You are in {room or 'no room'}."]
    lines.append(f"You see {_list([_with_contents(graph, obj) for obj in seen])}." if seen else "You see nothing yet.")
    near = sorted(obj for obj in graph.near if obj != graph.holding)
    if near:
        lines.append(f"Within reach: {_list(near)}.")
    lines.append(f"You hold {'nothing' if graph.holding is None else _with_state(graph, graph.holding)}.")
    if neighbours:
        lines.append(f"Next to this room: {_list(neighbours)}.")
    return " ".join(lines)


def outcome_text(action: Action, before: SceneGraph, after: SceneGraph, outcome: str, metres: float = 0.0) -> str:
    """Return what an action did, in words: what changed and what came into view, or why it was refused.

    Args:
        action: as it was sent; a target that has since been found is named by `after`.
        before: what was known.
        after: what is known now.
        outcome: "ok" or the kind of the violation.
        metres: driven in this step.
    """
    x = action.target or ""
    drove = f" ({metres:.1f} m)" if metres else ""
    fresh = [obj for obj in after.world.nodes if obj not in before.world.nodes]
    shown = f" New in sight: {_list([_with_state(after, obj) for obj in fresh])}." if fresh else ""
    if outcome != "ok":
        violation = first_violation(before, action)
        if violation is None or violation.kind.value != outcome:
            violation = Violation(ViolationKind(outcome), x)
        return f"Nothing happens: {reason(violation)}{drove}.{shown}"
    held = before.holding
    did = {
        Primitive.NAVIGATE_TO: f"You are at {_with_contents(after, x) if x in after.world.nodes else x}{drove}.",
        Primitive.GRASP: f"You take {x}.",
        Primitive.RELEASE: f"You drop {held} on the floor of {after.robot_room}.",
        Primitive.PLACE_ON_TOP: f"You put {held} on {x}.",
        Primitive.PLACE_INSIDE: f"You put {held} in {x}.",
        Primitive.OPEN: f"You open {_with_contents(after, x) if x in after.world.nodes else x}.",
        Primitive.CLOSE: f"You close {x}.",
        Primitive.TOGGLE_ON: f"You turn on {x}.",
        Primitive.TOGGLE_OFF: f"You turn off {x}.",
    }
    changed = [
        f"{obj} is {flag.name.lower()} now."
        for flag in _SHOWN[1:]
        for obj in sorted(after.flags[flag] - before.flags[flag])
        if obj in before.world.nodes
    ]
    return " ".join([did.get(action.primitive, f"You {command(action)}."), *changed]) + shown


def _stands_alone(graph: SceneGraph, obj: str) -> bool:
    support = graph.supports.get(obj)
    return support is None or support.relation is Relation.FLOOR


def _with_state(graph: SceneGraph, obj: str) -> str:
    states = [flag.name.lower().replace("toggled", "on") for flag in _SHOWN if graph.has(flag, obj)]
    if graph.category(obj).openable:
        states.insert(0, "closed" if graph.is_shut(obj) else "open")
    return f"{obj} ({', '.join(states)})" if states else obj


def _with_contents(graph: SceneGraph, obj: str) -> str:
    parts = []
    for relation, word in ((Relation.ON_TOP, "on"), (Relation.INSIDE, "in")):
        held = [item for item in graph.contents.get(obj, ()) if graph.supports[item].relation is relation]
        if held:
            parts.append(f"{_list([_with_contents(graph, item) for item in held])} {word} it")
    return f"{_with_state(graph, obj)} with {' and '.join(parts)}" if parts else _with_state(graph, obj)


def _list(items: Sequence[str]) -> str:
    return ", ".join(items)
