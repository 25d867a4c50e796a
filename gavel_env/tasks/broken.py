"""Broken variants of reference plans, each with the ending that it must have.

A defect is a small named edit of the plan (drop, swap, retarget, insert); `broken_variants` applies every defect
that fits and keeps those that no longer end well, as many kinds of defect as there are. The endings are what the
transition model says; shipped variants (`envs_data/instructions/broken/`) pin them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from gavel_env.data import read_lines
from gavel_env.errors import InstructionError
from gavel_env.tasks.judging import judge
from gavel_env.world_model.actions import Action, Primitive, parse_action
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import SceneGraph

__all__ = ["LEAST", "Broken", "broken_path", "broken_variants", "defects", "read_broken"]

LEAST = 6
"""Every task has at least this many broken variants."""


class Broken(msgspec.Struct, frozen=True, array_like=True):
    """A broken variant: the steps `start:stop` of the reference plan replaced, and how that must end.

    Attributes:
        defect: name of the defect.
        start: first replaced step.
        stop: step after the last replaced one.
        steps: what stands there instead, as text actions.
        ending: `Ending.kind` that the plan must give.
        at: step of the violation, or None.
    """

    defect: str
    start: int
    stop: int
    steps: tuple[str, ...]
    ending: str = ""
    at: int | None = None

    def plan(self, reference: Sequence[Action]) -> tuple[Action, ...]:
        """Return the broken plan."""
        return (*reference[: self.start], *map(parse_action, self.steps), *reference[self.stop :])


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    id: str
    tasks: tuple[tuple[Broken, ...], ...]


def broken_path(instructions: Path) -> Path:
    """Return where the broken variants of an instruction file lie: `broken/` beside it, same name."""
    return instructions.parent / "broken" / instructions.name


def read_broken(path: Path) -> dict[str, tuple[tuple[Broken, ...], ...]]:
    """Return the broken variants of a file: per instruction id, per task.

    Raises:
        InstructionError: unreadable file or malformed line, with its number.
    """
    return {record.id: record.tasks for record in read_lines(path, _Line, "broken variants", InstructionError)}


_DROPS = {
    Primitive.NAVIGATE_TO: "drop_navigate",
    Primitive.GRASP: "drop_grasp",
    Primitive.PLACE_ON_TOP: "drop_place",
    Primitive.PLACE_INSIDE: "drop_place",
    Primitive.OPEN: "drop_open",
    Primitive.CLOSE: "drop_close",
    Primitive.TOGGLE_ON: "drop_switch_on",
    Primitive.TOGGLE_OFF: "leave_on",
}
_PLACES = (Primitive.PLACE_ON_TOP, Primitive.PLACE_INSIDE)


def defects(graph: SceneGraph, plan: Sequence[Action]) -> Iterator[Broken]:
    """Yield every edit that a defect can make to a plan, without its ending, in a fixed order."""
    fixtures = [node.id for node in graph.world.nodes.values() if node.fixed]
    for i, (primitive, target, _) in enumerate(plan):
        if primitive in _DROPS:
            yield Broken(_DROPS[primitive], i, i + 1, ())
        if i + 1 < len(plan):
            yield Broken("swap_steps", i, i + 2, (str(plan[i + 1]), str(plan[i])))
        if primitive in _PLACES:
            other = _PLACES[1 - _PLACES.index(primitive)]
            yield Broken("wrong_relation", i, i + 1, (str(Action(other, target)),))
            yield Broken("release_instead", i, i + 1, ("RELEASE()",))
            yield Broken("grasp_twice", i, i, (f"GRASP({target})",))
        if primitive is Primitive.NAVIGATE_TO and target is not None:
            room = graph.room_of(target)
            if room is not None:
                yield Broken("navigate_to_room", i, i + 1, (f"NAVIGATE_TO({room})",))
            yield Broken("invented_object", i, i + 1, (f"NAVIGATE_TO(invented_{target})",))
            stray = next((f for f in fixtures if f != target and graph.room_of(f) != room), None)
            if stray is not None:
                yield Broken("wrong_target", i, i + 1, (f"NAVIGATE_TO({stray})",))
        if primitive is Primitive.GRASP and target is not None:
            holder = next((h for _, h in graph.holders(target)), None)
            if holder is not None:
                yield Broken("grasp_fixture", i, i + 1, (f"GRASP({holder})",))
        if primitive is Primitive.TOGGLE_ON:
            yield Broken("open_instead", i, i + 1, (f"OPEN({target})",))
            yield Broken("release_first", i, i, ("RELEASE()",))
    yield Broken("stop_early", len(plan) - 1, len(plan), ())


def broken_variants(graph: SceneGraph, plan: Sequence[Action], goal: Goal, most: int = 8) -> tuple[Broken, ...]:
    """Return broken variants of a reference plan with their endings, up to `most`.

    Endings that none has yet come first, then defects that none has yet, then the others, each in plan order.
    """
    found: dict[tuple[str, str], Broken] = {}
    further: list[Broken] = []
    for edit in defects(graph, plan):
        ending = judge(graph, edit.plan(plan), goal)
        if ending.kind != "valid":
            broken = msgspec.structs.replace(edit, ending=ending.kind, at=ending.step)
            if found.setdefault((edit.defect, ending.kind), broken) is not broken:
                further.append(broken)
    by_ending = {broken.ending: broken for broken in reversed(found.values())}
    by_defect = {broken.defect: broken for broken in reversed(found.values())}
    wanted = [*reversed(by_ending.values()), *reversed(by_defect.values()), *found.values(), *further]
    chosen = list(dict.fromkeys(wanted))[:most]
    return tuple(sorted(chosen, key=lambda b: (b.start, b.stop, b.defect)))
