"""Instructions: their files, where environments take them from, and the hidden graph that they start with."""

from gavel_env.instructions.record import (
    Instruction,
    InstructionSet,
    Placement,
    Rejected,
    TaskSpec,
    read_instructions,
    shipped,
    shipped_instructions,
)

__all__ = [
    "Instruction",
    "InstructionSet",
    "Placement",
    "Rejected",
    "TaskSpec",
    "read_instructions",
    "shipped",
    "shipped_instructions",
]
