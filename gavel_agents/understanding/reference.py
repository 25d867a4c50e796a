"""The reference understanding: what the benchmark's authors meant, for studies of planning alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gavel_agents.understanding.interface import Decomposition, Rooms, TaskUnderstanding
from gavel_env.instructions.lookup import About, InstructionLookup
from gavel_env.instructions.record import Instruction
from gavel_env.instructions.reference_names import goal_designators, spoken
from gavel_env.world_model.goals import Designator, Literal, parse_literal

__all__ = ["ReferenceUnderstanding"]


class ReferenceUnderstanding:
    """Answers from the instruction records: their goals, and objects and stated relations from `meta["targets"]`.

    A record without targets is read by `reference_names`: besides the goal's objects, a task speaks of those of its
    reference plan; it states where things start if its own text names that place, and that what shall be changed is so.
    """

    name = "reference"

    def __init__(self, instructions: Iterable[Instruction]) -> None:
        self._records = InstructionLookup(instructions)

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the record's tasks; abstains on a sentence that is in no record of a house with these rooms."""
        instruction = self._records.find(About.of(text, rooms or ()))
        if instruction is None:
            return Decomposition((), f"unknown_instruction: {text[:80]!r}")
        return Decomposition(tuple(_task(instruction, index) for index in range(len(instruction.tasks))))


def _task(instruction: Instruction, index: int) -> TaskUnderstanding:
    spec = instruction.tasks[index]
    targets = instruction.meta.get("targets", ())
    if index >= len(targets):
        said = spoken(instruction, index)
        names = map(Designator.parse, said.names.values())
        return TaskUnderstanding(spec.text, tuple(dict.fromkeys(names)), said.relations, said.goal)
    goal = spec.parsed_goal()
    stated = tuple(parse_literal(text) for text in targets[index].get("relations", ()))
    named = map(Designator.parse, targets[index].get("objects", ()))
    objects = tuple(dict.fromkeys((*named, *designators(stated), *goal_designators(goal))))
    return TaskUnderstanding(spec.text, objects, stated, goal)


def designators(literals: Iterable[Literal]) -> tuple[Designator, ...]:
    """Return every designator of some literals once, in order; the rooms of `in_room` are not objects."""
    found: dict[Designator, None] = {}
    for literal in literals:
        found[literal.subject] = None
        if literal.object is not None and literal.predicate.value != "in_room":
            found[literal.object] = None
    return tuple(found)
