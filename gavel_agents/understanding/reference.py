"""The reference understanding: what the benchmark's authors meant, for studies of planning alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gavel_agents.understanding.base import Decomposition, TaskUnderstanding
from gavel_env.goals import Designator, Literal, parse_literal
from gavel_env.instructions import Instruction, TaskSpec
from gavel_env.ontology import category_of

__all__ = ["ReferenceUnderstanding"]


class ReferenceUnderstanding:
    """Answers from the instruction records: their goals, and objects and stated relations from `meta["targets"]`.

    A record without targets is read so: besides the goal's objects, a task speaks of the categories of its reference
    plan; and it states where a movable of the goal starts if its own text names that place.
    """

    name = "reference"

    def __init__(self, instructions: Iterable[Instruction]) -> None:
        self._by_id: dict[str, Instruction] = {}
        self._by_text: dict[str, Instruction] = {}
        for instruction in instructions:
            self._by_id[instruction.id] = instruction
            self._by_text.setdefault(instruction.text, instruction)

    def understand(self, text: str, instruction_id: str = "") -> Decomposition:
        """Return the record's tasks; abstains on a sentence that is in no record."""
        instruction = self._by_id.get(instruction_id)
        if instruction is None or instruction.text != text:
            instruction = self._by_text.get(text)
        if instruction is None:
            return Decomposition((), f"unknown_instruction: {text[:80]!r}")
        targets = instruction.meta.get("targets", ())
        tasks = [
            _task(spec, targets[index] if index < len(targets) else _derived(instruction, spec))
            for index, spec in enumerate(instruction.tasks)
        ]
        return Decomposition(tuple(tasks))


def _task(spec: TaskSpec, target: Mapping[str, Sequence[str]]) -> TaskUnderstanding:
    goal = spec.parsed_goal()
    stated = tuple(parse_literal(text) for text in target.get("relations", ()))
    said = map(Designator.parse, target.get("objects", ()))
    objects = tuple(dict.fromkeys((*said, *designators((*stated, *goal.literals)))))
    return TaskUnderstanding(spec.text, objects, stated, goal)


_RELATIONS = {"on": "on_top", "in": "inside"}


def _derived(instruction: Instruction, spec: TaskSpec) -> dict[str, list[str]]:
    """Return objects and stated relations of a task whose record has no targets."""
    said = {d.name: str(d) for d in designators(spec.parsed_goal().literals)}
    wanted = {category_of(name): name for name in said} | {name: name for name in said}
    for action in spec.parsed_plan():
        if action.target is not None:
            name = Designator.parse(action.target).name
            category = name if name in said else category_of(name)
            said.setdefault(category, category)
    relations = []
    for placement in instruction.placements:
        place = category_of(Designator.parse(placement.target).name)
        named = place.replace("_", " ") in instruction.text.lower().replace("_", " ")
        subject = wanted.get(placement.id or "") or wanted.get(placement.category)
        if placement.relation in _RELATIONS and subject is not None and named:
            relations.append(f"{_RELATIONS[placement.relation]}({subject}, {said.setdefault(place, place)})")
    return {"objects": list(said.values()), "relations": relations}


def designators(literals: Iterable[Literal]) -> tuple[Designator, ...]:
    """Return every designator of some literals once, in order; the rooms of `in_room` are no objects."""
    found: dict[Designator, None] = {}
    for literal in literals:
        found[literal.subject] = None
        if literal.object is not None and literal.predicate.value != "in_room":
            found[literal.object] = None
    return tuple(found)
