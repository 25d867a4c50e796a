"""Build `envs_data/instructions`: both benchmarks, their broken variants, and the pairs for understanding.

    python -m envs_data.build.instructions [single|multi|validation|train ...]

Deterministic: the same scenes, vocabulary, templates and evidence give the same bytes (docs/reference/benchmarks.md).
"""

from __future__ import annotations

import argparse
import gzip
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction
from gavel_env.tasks.broken import Broken, broken_variants
from gavel_env.tasks.drafts import Split
from gavel_env.tasks.pairs import generate_pairs
from gavel_env.tasks.recipes import multi_benchmark, scene_as_drawn, single_benchmark

__all__ = ["build", "main"]

FOLDER = Path(__file__).resolve().parent.parent / "instructions"
TRAIN, VALIDATION = 8_400, 500


def _lines(records: Iterable[Any]) -> bytes:
    return b"".join(msgspec.json.encode(record) + b"\n" for record in records)


def _broken(record: Instruction) -> dict[str, Any]:
    graph = instruction_graph(load_scene(record.scene), record)
    tasks: list[tuple[Broken, ...]] = [
        broken_variants(graph, task.parsed_plan(), task.parsed_goal()) for task in record.tasks
    ]
    return {"id": record.id, "tasks": tasks}


def _benchmark(name: str, records: Iterable[Instruction]) -> dict[str, bytes]:
    kept = list(records)
    return {f"{name}.jsonl": _lines(kept), f"broken/{name}.jsonl": _lines(map(_broken, kept))}


def _packed(content: bytes) -> bytes:
    return gzip.compress(content, compresslevel=9, mtime=0)


def _pairs(split: Split, count: int) -> bytes:
    return _lines(generate_pairs(split, count, scene_names(), load=scene_as_drawn))


def _multi() -> dict[str, bytes]:
    from eval.studies.orders import Orders  # the only build that runs agents; nothing that ships depends on it

    return _benchmark("multi", multi_benchmark(differ=Orders().differ))


_BUILDERS: Mapping[str, Callable[[], dict[str, bytes]]] = {
    "single": lambda: _benchmark("single", single_benchmark()),
    "multi": _multi,
    "validation": lambda: {"pairs/validation.jsonl": _pairs("validation", VALIDATION)},
    "train": lambda: {"pairs/train.jsonl.gz": _packed(_pairs("train", TRAIN))},
}


def build(name: str) -> dict[str, bytes]:
    """Return the files of one part: path below `envs_data/instructions` -> content."""
    return _BUILDERS[name]()


def main(argv: list[str] | None = None) -> int:
    """Write the files of the parts named, or of all."""
    parser = argparse.ArgumentParser(description="Build the shipped instruction files.")
    parser.add_argument("parts", nargs="*", choices=[[], *_BUILDERS], metavar="PART", help=", ".join(_BUILDERS))
    for name in parser.parse_args(argv).parts or list(_BUILDERS):
        began = time.perf_counter()
        for path, content in build(name).items():
            target = FOLDER / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            print(f"{target.relative_to(FOLDER.parent)}: {len(content):,} bytes, {time.perf_counter() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
