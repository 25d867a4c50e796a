"""Instruction-target pairs for training and scoring understanding: splits `train` and `validation`.

A pair is a text and, for each of its tasks, the target that understanding must give (docs/howto/instructions.md). Pairs
are drawn in all scenes with the templates and object pairs of their split alone. Goals and relations are what the
errand means; nothing is executed, so a pair needs no placements and no plan.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from gavel_env.data import convert, read_bytes, read_lines
from gavel_env.errors import InstructionError
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.tasks.assembly import target_of
from gavel_env.tasks.drafts import Draft, Split
from gavel_env.tasks.generator import LONG_SHAPES, SHORT_SHAPES, draw_errands
from gavel_env.tasks.language import compose
from gavel_env.tasks.placements import House, pick
from gavel_env.tasks.wording_checks import sentence_faults

__all__ = ["Pair", "PairSet", "Target", "generate_pairs", "read_pairs"]

_LONG_SHARE = 0.4


class Target(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What understanding must give for one task.

    Attributes:
        text: the task as a sentence of its own.
        objects: designators in the order movables, furniture.
        relations: stated relations E_i as literals.
        goal: goal g_i as literals.
    """

    text: str
    objects: tuple[str, ...]
    relations: tuple[str, ...]
    goal: tuple[str, ...]


class Pair(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A text and the targets of its tasks."""

    id: str
    text: str
    tasks: tuple[Target, ...]


class PairSet(NamedTuple):
    """The pairs of a file and its content stamp."""

    pairs: tuple[Pair, ...]
    stamp: str


def generate_pairs(
    split: Split, count: int, scenes: Sequence[str], seed: int = 2026, load: Callable[[str], Scene] = load_scene
) -> Iterator[Pair]:
    """Yield pairs of a split, scenes in turn, no text twice.

    Args:
        split: whose templates and object pairs.
        count: how many.
        scenes: names of the scenes.
        seed: of all randomness.
        load: what gives a scene by its name.

    Raises:
        InstructionError: the scenes do not afford that many different texts.
    """
    houses = [House(load(name)) for name in scenes]
    texts: set[str] = set()
    number = 0
    for attempt in range(count * 20):
        if number == count:
            return
        rng = np.random.default_rng([seed, sum(map(ord, split)), attempt])
        long = bool(rng.random() < _LONG_SHARE)
        draft = Draft(houses[attempt % len(houses)], rng, split=split, say_room=float(rng.uniform(0.2, 0.7)))
        errands = draw_errands(draft, 1 if long else pick(rng, (1, 2, 3, 4, 5)), LONG_SHAPES if long else SHORT_SHAPES)
        if not errands:
            continue
        text, worded = compose(errands, rng, split)
        targets = tuple(convert(target_of(e, w), Target) for e, w in zip(errands, worded, strict=True))
        whole = [(t.objects, t.relations) for t in targets]
        if text in texts or any(sentence_faults(text, whole)):
            continue
        texts.add(text)
        yield Pair(f"{split}-{number:05d}", text, targets)
        number += 1
    if number < count:
        raise InstructionError(f"only {number} of {count} pairs of split {split!r} could be drawn")


def read_pairs(path: str | Path) -> PairSet:
    """Read a pair file (`.jsonl` or `.jsonl.gz`).

    Raises:
        InstructionError: unreadable file or malformed line, with its number.
    """
    content = read_bytes(path, "pair file", InstructionError)
    pairs = read_lines(path, Pair, "pair", InstructionError)
    return PairSet(tuple(pairs), hashlib.sha256(content).hexdigest()[:16])
