"""Fresh certified instructions with difficulty knobs, deterministic by seed.

Instruction `i` of a seed depends on the seed, `i` and the knobs alone, not on what was generated before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import msgspec
import numpy as np

from gavel_env.errors import InstructionError
from gavel_env.instructions.record import Instruction
from gavel_env.tasks.assembly import assemble, initial_graph, rooms_visited
from gavel_env.tasks.certificate import certify
from gavel_env.tasks.drafts import Draft, Split
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.placements import House, load_house, pick
from gavel_env.tasks.shapes import SHAPES, draw_errand

__all__ = ["LONG_SHAPES", "SHORT_SHAPES", "Knobs", "draw_errands", "generate"]

# Shares of the shapes, as in the benchmarks (of 140 errands, of 100 single tasks).
SHORT_SHAPES = {
    "to_support": 43,
    "to_container": 43,
    "out_of_container": 14,
    "away": 10,
    "switch_on": 8,
    "wash_dish": 5,
    "wash_clothes": 2,
    "counter_heat": 6,
    "fridge_heat": 6,
    "dry_clothes": 3,
}
LONG_SHAPES = {
    "put_two_away": 20,
    "take_two_out": 14,
    "bring_three": 14,
    "swap": 10,
    "carry_two_and_switch": 9,
    "tray": 9,
    "load_dishwasher": 7,
    "counter_heat": 6,
    "fridge_heat": 6,
    "wash_then_dry": 3,
    "carry_two": 2,
}
_ATTEMPTS = 200


class Knobs(msgspec.Struct, frozen=True, kw_only=True):
    """What to generate.

    Attributes:
        kind: one long task, or several independent errands.
        count: number of instructions.
        seed: of all randomness.
        houses: scene names; instruction `i` plays in house `i` modulo their number.
        tasks: least and most errands of a multi-task instruction.
        rooms: least and most rooms in which the reference plan stops.
        horizon: least and most primitives of the reference plan.
        surprise: probability that a thing starts anywhere in the open, against the evidence.
        say_room: probability that a piece of furniture is named with its room, where both are clear.
        distractors: movables that nothing is asked of.
        split: whose sentence templates and object pairs to use.
        any_pairs: use object pairs of every split.
    """

    kind: Literal["single", "multi"] = "multi"
    count: int = 50
    seed: int = 0
    houses: tuple[str, ...] = ("Rs_int",)
    tasks: tuple[int, int] = (2, 5)
    rooms: tuple[int, int] = (1, 99)
    horizon: tuple[int, int] = (1, 99)
    surprise: float = 0.1
    say_room: float = 0.46
    distractors: int = 2
    split: Split = "benchmark"
    any_pairs: bool = False


def draw_errands(draft: Draft, count: int, shares: dict[str, int]) -> list[Errand]:
    """Draw errands into a draft, shapes by their shares; fewer if the house affords no more."""
    shapes = dict(shares)
    errands: list[Errand] = []
    while len(errands) < count and shapes:
        shape = pick(draft.rng, list(shapes), shapes.values())
        errand = draw_errand(draft, shape, attempts=25)
        if errand is None:
            del shapes[shape]
        else:
            errands.append(errand)
    return errands


def generate(knobs: Knobs, *, executor: bool = True) -> Iterator[Instruction]:
    """Yield certified instructions.

    Args:
        knobs: what to generate.
        executor: certify in the executor too, not only symbolically.

    Raises:
        UnknownScene: a house does not exist.
        InstructionError: no instruction fits the knobs in a house; names the house, the knobs and what was found.
    """
    houses = [load_house(name) for name in knobs.houses]
    seen: set[str] = set()
    for index in range(knobs.count):
        house = houses[index % len(houses)]
        record = _one(knobs, house, index, seen, executor)
        seen.add(record.text)
        yield record


def _one(knobs: Knobs, house: House, index: int, seen: set[str], executor: bool) -> Instruction:
    single = knobs.kind == "single"
    name = f"{knobs.kind}-{house.scene.scene}-s{knobs.seed}-{index:04d}"
    reasons: dict[str, int] = {}
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([knobs.seed, index, attempt, int(single)])
        draft = Draft(
            house,
            rng,
            split=None if knobs.any_pairs else knobs.split,
            say_room=knobs.say_room,
            surprise=knobs.surprise,
        )
        low, high = (1, 1) if single else knobs.tasks
        errands = draw_errands(draft, pick(rng, range(low, high + 1)), LONG_SHAPES if single else SHORT_SHAPES)
        reason = _misfit(knobs, draft, errands, name, low)
        if isinstance(reason, Instruction):
            problems = certify(reason, executor=executor)
            if not problems and reason.text not in seen:
                return reason
            reason = str(problems[0]) if problems else "same text as another"
        reasons[reason] = reasons.get(reason, 0) + 1
    common = max(reasons, key=lambda r: (reasons[r], r))
    raise InstructionError(
        f"no {knobs.kind} instruction fits in {house.scene.scene!r} after {_ATTEMPTS} attempts; most often: {common}"
    )


def _misfit(knobs: Knobs, draft: Draft, errands: Sequence[Errand], name: str, low: int) -> Instruction | str:
    """Return the assembled instruction, or why its errands do not fit the knobs."""
    if len(errands) < low:
        return f"the house affords only {len(errands)} errands"
    steps = sum(len(e.plan) for e in errands)
    if not knobs.horizon[0] <= steps <= knobs.horizon[1]:
        return f"horizon outside {knobs.horizon[0]}-{knobs.horizon[1]} primitives"
    notes: dict[str, Any] = {"seed": knobs.seed, "distractors": knobs.distractors}
    record = assemble(
        draft,
        errands,
        draft.rng,
        identifier=name,
        split=knobs.split,
        distractors=knobs.distractors,
        notes=notes,
    )
    rooms = len(rooms_visited(initial_graph(draft, record), record))
    if not knobs.rooms[0] <= rooms <= knobs.rooms[1]:
        return f"rooms outside {knobs.rooms[0]}-{knobs.rooms[1]}"
    return record


assert all(shape in SHAPES for shape in (*SHORT_SHAPES, *LONG_SHAPES))
