"""A model that answers from a file: anyone's stored responses, scored without a model at hand.

The file is JSON Lines, `{"instruction_id": ID, "completions": [text, ...]}`, or with `"instruction": TEXT` instead of
the id; the n-th attempt gets the n-th completion, and the last one again when the attempts outnumber them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import msgspec

from gavel_agents.llm.interface import Completion, Prompt
from gavel_env.data import decode, read_bytes
from gavel_env.errors import DataError, UnknownInstruction
from gavel_env.instructions.lookup import InstructionLookup
from gavel_env.instructions.record import Instruction, shipped_instructions

__all__ = ["ScriptedModel"]


class _Line(msgspec.Struct, frozen=True):
    completions: tuple[str, ...]
    instruction_id: str = ""
    instruction: str = ""


class ScriptedModel:
    """Reads completions from a file."""

    def __init__(self, path: str) -> None:
        """Read and check the file.

        Raises:
            DataError: unreadable or malformed; names the file and the line.
        """
        self.name = f"scripted:{Path(path).name}"
        self.decoding: Mapping[str, str | float | int] = {}
        self._path = path
        self._completions: dict[str, tuple[str, ...]] = {}
        content = read_bytes(path, "scripted completions")
        for number, line in enumerate(content.splitlines(), start=1):
            if not line.strip():
                continue
            try:
                record = decode(line, _Line)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
                raise DataError(f"{path}:{number}: malformed completions: {error}") from error
            name = record.instruction_id or record.instruction
            if not name:
                raise DataError(f"{path}:{number}: needs instruction_id or instruction, the text")
            if not record.completions:
                raise DataError(f"{path}:{number}: {name!r} has no completions")
            self._completions[name] = record.completions
        if not self._completions:
            raise DataError(f"scripted completions {path} hold none")
        self._records = InstructionLookup()

    def know(self, instruction: Instruction) -> None:
        """Take in a record that may be asked about; the file may name it by its id."""
        self._records.add(instruction)

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the stored completions.

        Raises:
            UnknownInstruction: the file has none for an instruction.
        """
        return [Completion(self._answer(p)) for p in prompts]

    def _answer(self, prompt: Prompt) -> str:
        record = self._records.find(prompt.about) or _shipped_records().find(prompt.about)
        name = record.id if record is not None and record.id in self._completions else prompt.about.text
        stored = self._completions.get(name)
        if stored is None:
            raise UnknownInstruction(record.id if record else name, self._completions, self._path)
        return stored[min(prompt.attempt, len(stored) - 1)]


@cache
def _shipped_records() -> InstructionLookup:
    return InstructionLookup(shipped_instructions())
