"""The reference understanding: what the benchmark's authors meant, for studies of planning alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gavel_agents.understanding.base import Decomposition, TaskUnderstanding
from gavel_env.goals import Designator, Literal, parse_literal
from gavel_env.instructions import Instruction, TaskSpec

__all__ = ["ReferenceUnderstanding"]


class ReferenceUnderstanding:
    """Answers from the instruction records themselves (goals, and objects and relations of `meta["targets"]`)."""

    name = "reference"

    def __init__(self, instructions: Iterable[Instruction]) -> None:
        self._by_text = {i.text: i for i in instructions}

    def understand(self, text: str) -> Decomposition:
        """Return the record's tasks; abstains on a sentence that is in no record."""
        instruction = self._by_text.get(text)
        if instruction is None:
            return Decomposition((), f"unknown_instruction: {text[:80]!r}")
        stated = instruction.meta.get("targets", ())
        tasks = [
            _task(spec, stated[index] if index < len(stated) else {}) for index, spec in enumerate(instruction.tasks)
        ]
        return Decomposition(tuple(tasks))


def _task(spec: TaskSpec, target: Mapping[str, Sequence[str]]) -> TaskUnderstanding:
    goal = spec.parsed_goal()
    stated = tuple(parse_literal(text) for text in target.get("relations", ()))
    said = map(Designator.parse, target.get("objects", ()))
    objects = tuple(dict.fromkeys((*said, *designators((*stated, *goal.literals)))))
    return TaskUnderstanding(spec.text, objects, stated, goal)


def designators(literals: Iterable[Literal]) -> tuple[Designator, ...]:
    """Return every designator of some literals once, in order; the rooms of `in_room` are no objects."""
    found: dict[Designator, None] = {}
    for literal in literals:
        found[literal.subject] = None
        if literal.object is not None and literal.predicate.value != "in_room":
            found[literal.object] = None
    return tuple(found)
