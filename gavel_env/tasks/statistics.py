"""What a set of instructions is like: lengths, literals, rooms, wording. Functions of the records alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.assembly import rooms_visited
from gavel_env.world_model.goals import Literal

__all__ = ["CONFERRED", "Statistics", "furniture_references", "needs_appliance", "statistics"]

CONFERRED = frozenset({"cooked", "washed", "dried", "hot", "frozen"})
"""Predicates that only operating an appliance can make true."""


class Statistics(msgspec.Struct, frozen=True):
    """Figures of a set of instructions.

    Attributes:
        instructions: number of records.
        scenes: records by scene.
        tasks: records by number of tasks.
        steps_mean: mean primitives of the reference plan.
        steps_range: shortest and longest reference plan.
        literals: goal literals by predicate.
        literals_per_task: tasks by number of literals.
        rooms_mean: mean number of rooms in which the reference plan stops.
        appliance: records that need a state which only an appliance gives.
        room_unsaid: share of furniture references without a room, or None without targets.
        room_said: share of texts in which some reference says a room, or None without targets.
        shapes: errands by shape.
        templates: number of different clause templates.
    """

    instructions: int
    scenes: Mapping[str, int]
    tasks: Mapping[int, int]
    steps_mean: float
    steps_range: tuple[int, int]
    literals: Mapping[str, int]
    literals_per_task: Mapping[int, int]
    rooms_mean: float
    appliance: int
    room_unsaid: float | None
    room_said: float | None
    shapes: Mapping[str, int]
    templates: int


def needs_appliance(instruction: Instruction) -> bool:
    """Return whether the goal asks for a state that only an appliance gives."""
    return any(lit.predicate.value in CONFERRED and not lit.negated for lit in instruction.goal().literals)


def furniture_references(targets: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the furniture designators that the texts of these targets name."""
    furniture = default_vocabulary().furniture
    return [name for target in targets for name in target["objects"] if name.partition("@")[0] in furniture]


def statistics(instructions: Iterable[Instruction]) -> Statistics:
    """Return the figures of a set of instructions.

    Raises:
        GavelError: a record does not fit its scene, or its reference plan does not run.
    """
    records = list(instructions)
    steps = [len(r.reference_plan()) for r in records]
    rooms = [len(rooms_visited(instruction_graph(load_scene(r.scene), r), r)) for r in records]
    literals: list[Literal] = [lit for r in records for t in r.tasks for lit in t.parsed_goal().literals]
    said = [furniture_references(r.meta.get("targets", ())) for r in records]
    references = [name for names in said for name in names]
    count = max(1, len(records))
    return Statistics(
        instructions=len(records),
        scenes=_sorted(Counter(r.scene for r in records)),
        tasks=_sorted(Counter(len(r.tasks) for r in records)),
        steps_mean=sum(steps) / count,
        steps_range=(min(steps, default=0), max(steps, default=0)),
        literals=_sorted(Counter(lit.predicate.value for lit in literals)),
        literals_per_task=_sorted(Counter(len(t.goal) for r in records for t in r.tasks)),
        rooms_mean=sum(rooms) / count,
        appliance=sum(needs_appliance(r) for r in records),
        room_unsaid=sum("@" not in name for name in references) / len(references) if references else None,
        room_said=sum(any("@" in n for n in names) for names in said) / count if references else None,
        shapes=_sorted(Counter(shape for r in records for shape in r.meta.get("shapes", ()))),
        templates=len({template for r in records for template in r.meta.get("templates", ())}),
    )


def _sorted(counts: Counter[Any]) -> dict[Any, int]:
    return dict(sorted(counts.items()))
