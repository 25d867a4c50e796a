"""Build `envs_data/instructions/rl.jsonl`: the instructions of the levels of `Gavel-RL-v0`.

    python -m envs_data.build.rl_levels

Deterministic. No level plays in a house of the benchmarks, and all object pairs are of the training split; the houses
and pairs of a level's train and test instructions are the same, their instructions differ.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from gavel_env.instructions.record import Instruction
from gavel_env.tasks.generator import Knobs, generate

__all__ = ["KNOBS", "build", "main"]

TARGET = Path(__file__).resolve().parent.parent / "instructions" / "rl.jsonl"
TRAIN, TEST = 100, 50

KNOBS: Mapping[str, Knobs] = {
    "easy": Knobs(
        houses=("gates_bedroom", "hotel_suite_small", "Benevolence_0_int", "Benevolence_2_int", "Pomaria_2_int"),
        tasks=(1, 1),
        rooms=(1, 1),
        horizon=(3, 4),
        distractors=2,
        seed=14,
        split="train",
    ),
    "medium": Knobs(
        houses=("Benevolence_2_int", "Ihlen_0_int", "Pomaria_2_int", "Merom_0_int", "hotel_suite_large"),
        tasks=(1, 1),
        horizon=(4, 17),
        distractors=3,
        seed=15,
        split="train",
    ),
    "hard": Knobs(
        houses=("Ihlen_0_int", "Merom_0_int", "house_double_floor_lower", "house_double_floor_upper"),
        tasks=(2, 3),
        distractors=4,
        seed=16,
        split="train",
    ),
}


def build() -> Iterator[Instruction]:
    """Yield the instructions of all levels."""
    for level, knobs in KNOBS.items():
        for index, record in enumerate(generate(msgspec.structs.replace(knobs, count=TRAIN + TEST))):
            split, number = ("train", index) if index < TRAIN else ("test", index - TRAIN)
            yield msgspec.structs.replace(record, id=f"{level}-{split}-{number:03d}")


def main() -> int:
    """Write the file."""
    TARGET.write_bytes(b"".join(msgspec.json.encode(record) + b"\n" for record in build()))
    print(f"{TARGET.name}: {TARGET.stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
