"""Where an environment's instructions come from: shipped files, files of one's own, or records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from gavel_env.data import is_path
from gavel_env.errors import InstructionError
from gavel_env.instructions.record import Instruction, InstructionSet, parse_instruction, read_instructions, shipped

__all__ = ["InstructionSource", "gather"]

InstructionSource: TypeAlias = str | Path | InstructionSet | Iterable[Instruction | Mapping[str, Any]]


def gather(source: InstructionSource, scenes: str | Iterable[str] | None = None) -> Mapping[str, Instruction]:
    """Return the instructions of a source by id.

    Args:
        source: name of a shipped file, path of a file (`*.jsonl`), a set, or records.
        scenes: keep only those in this scene, or in these.

    Raises:
        InstructionError: the file is unreadable, a record is malformed, or nothing is left.
        UnknownInstruction: no shipped file has this name.
    """
    records: Mapping[str, Instruction]
    if isinstance(source, InstructionSet):
        records = source
    elif isinstance(source, str | Path):
        path = Path(source) if is_path(source) else shipped(str(source))
        records = _read(str(path), path.stat().st_mtime_ns if path.exists() else 0)
    else:
        parsed = [parse_instruction(record, f"instructions[{i}]") for i, record in enumerate(source)]
        records = {record.id: record for record in parsed}
        if len(records) < len(parsed):
            raise InstructionError("two of the instructions given share an id")
    wanted = None if scenes is None else sorted({scenes} if isinstance(scenes, str) else set(scenes))
    kept = {name: records[name] for name in records if wanted is None or records[name].scene in wanted}
    if not kept:
        there = ", ".join(sorted({record.scene for record in records.values()})) or "none"
        raise InstructionError(f"no instruction is left for scenes={wanted}; scenes of the instructions: {there}")
    return kept


@lru_cache(maxsize=16)
def _read(path: str, _modified_ns: int) -> InstructionSet:
    return read_instructions(path)
