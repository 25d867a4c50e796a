"""Reference plans in a model's place (`reference:single`, `reference:FILE.jsonl`): no language model at all.

For studies of what comes after the plan: beliefs, search and ordering. Tables call it by this name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gavel_agents.llm.interface import Completion, Prompt
from gavel_env.data import is_path
from gavel_env.errors import UnknownInstruction
from gavel_env.instructions.lookup import InstructionLookup
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.instructions.reference_names import spoken
from gavel_env.world_model.actions import Action
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.ontology import category_of

__all__ = ["ReferencePlans", "written"]


class ReferencePlans:
    """Answers every prompt with the certified plans of its instruction, written over designators."""

    def __init__(self, source: str | Iterable[Instruction]) -> None:
        """Take instruction records, or read an instruction file: a shipped name or a path.

        Raises:
            UnknownInstruction: no shipped file has this name.
            InstructionError: the file cannot be read.
        """
        self.name = "reference plans (no model)"
        self.decoding: Mapping[str, str | float | int] = {}
        if isinstance(source, str):
            file = Path(source) if is_path(source) else shipped(source)
            source = read_instructions(file).values()
        self._records = InstructionLookup(source)

    def know(self, instruction: Instruction) -> None:
        """Take in a record that may be asked about."""
        self._records.add(instruction)

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the reference plans.

        Raises:
            UnknownInstruction: there is no record of an instruction.
        """
        return [Completion(self._answer(prompt)) for prompt in prompts]

    def _answer(self, prompt: Prompt) -> str:
        instruction = self._records.find(prompt.about)
        if instruction is None:
            raise UnknownInstruction(prompt.about.text, (), "the reference plans")
        return written(instruction, _plans(instruction))


def _plans(instruction: Instruction) -> list[tuple[Action, ...]]:
    return [task.parsed_plan() for task in instruction.tasks]


def written(instruction: Instruction, plans: Sequence[Sequence[Action]]) -> str:
    """Return plans of an instruction's tasks, over instance ids, as a model would write them."""
    targets = instruction.meta.get("targets", ())
    lines: list[str] = []
    for index, plan in enumerate(plans):
        lines.append(f"Task {index + 1}:")
        said = targets[index].get("objects", ()) if index < len(targets) else ()
        names = {Designator.parse(text).name: text for text in said}
        if index >= len(targets) and index < len(instruction.tasks):
            names = dict(spoken(instruction, index).names)
        for action in plan:
            target = action.target or ""
            category = category_of(target)
            lines.append(f"{action.primitive.name} {names.get(target) or names.get(category, category)}".strip())
    return "\n".join(lines)
