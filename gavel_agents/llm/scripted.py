"""A model that answers from a file: anyone's stored responses, scored without a model at hand.

The file is JSON Lines, `{"instruction_id": ID, "completions": [text, ...]}`; the n-th attempt gets the n-th completion,
and the last one again when the attempts outnumber them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from gavel_agents.llm.interface import Completion, Prompt
from gavel_env.errors import DataError, UnknownInstruction

__all__ = ["ScriptedModel"]


class _Line(msgspec.Struct, frozen=True):
    instruction_id: str
    completions: tuple[str, ...]


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
        try:
            lines = Path(path).read_bytes().splitlines()
        except OSError as error:
            raise DataError(f"scripted completions {path} cannot be read: {error.strerror}") from error
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                record = msgspec.json.decode(line, type=_Line)
            except msgspec.DecodeError as error:
                raise DataError(f"{path}:{number}: malformed completions: {error}") from error
            if not record.completions:
                raise DataError(f"{path}:{number}: {record.instruction_id!r} has no completions")
            self._completions[record.instruction_id] = record.completions

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the stored completions.

        Raises:
            UnknownInstruction: the file has none for an instruction.
        """
        return [Completion(self._answer(p)) for p in prompts]

    def _answer(self, prompt: Prompt) -> str:
        stored = self._completions.get(prompt.instruction_id)
        if stored is None:
            raise UnknownInstruction(prompt.instruction_id, self._completions, self._path)
        return stored[min(prompt.attempt, len(stored) - 1)]
