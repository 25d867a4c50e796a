"""The agent's view as a text."""

from __future__ import annotations

from gavel_env.exchange import Observed
from gavel_env.world_model.graph import Flag

__all__ = ["describe"]


def describe(observed: Observed) -> str:
    """Return what is observed as a text of a few dozen lines: the rooms, what stands in them, what is on and in it."""
    graph = observed.graph
    lines = [
        observed.instruction,
        f"in {graph.robot_room or 'no room'}, holding {graph.holding or 'nothing'}, "
        f"{observed.metres:.1f} m driven, last action: {observed.outcome or 'none yet'}",
    ]
    by_room: dict[str | None, list[str]] = {}
    for obj in graph.world.nodes:
        support = graph.supports.get(obj)
        if support is None or support.holder not in graph.world.nodes:
            by_room.setdefault(graph.room_of(obj), []).append(obj)
    for room in graph.world.rooms:
        here = by_room.get(room, [])
        note = ", searched" if room in observed.searched else ""
        lines.append(f"{room}{note}{':' if here else ''}")
        for obj in here:
            lines.extend(_lines(observed, obj, 1))
    return "\n".join(lines)


def _lines(observed: Observed, obj: str, depth: int) -> list[str]:
    graph = observed.graph
    notes = [flag.name.lower() for flag in Flag if graph.has(flag, obj)]
    notes += ["near"] * (obj in graph.near) + ["held"] * (obj == graph.holding)
    support = graph.supports.get(obj)
    relation = f"{support.relation.name.lower().replace('_', ' ')}: " if support is not None and depth > 1 else ""
    lines = [f"{'  ' * depth}{relation}{obj}{' (' + ', '.join(notes) + ')' if notes else ''}"]
    for item in graph.contents.get(obj, ()):
        lines.extend(_lines(observed, item, depth + 1))
    return lines
