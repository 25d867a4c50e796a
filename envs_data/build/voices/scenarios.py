"""Scenarios: house, placements, goals and certified reference plans, drawn before any sentence exists.

A scenario is an instruction record without texts. No two of a kind ask for the same in the same scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from envs_data.build.voices.shapes import MULTI_SHARES, SINGLE_SHARES, draw_errand, initial_states
from envs_data.build.voices.voices import VOICES, manners_for
from gavel_env.errors import InstructionError
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, Placement, TaskSpec
from gavel_env.tasks.certificate import certify
from gavel_env.tasks.drafts import Draft, Thing
from gavel_env.tasks.driving import drive
from gavel_env.tasks.errands import ANY_THEME, Errand
from gavel_env.tasks.placements import House, load_house, pick

__all__ = ["SCENES", "SEED", "draw", "faults"]

SEED = 730_117
SCENES = (
    "Beechwood_0_int",
    "house_single_floor",
    "Pomaria_1_int",
    "Ihlen_0_int",
    "Wainscott_0_int",
    "Merom_0_int",
    "Rs_int",
    "house_double_floor_lower",
    "Ihlen_1_int",
    "Benevolence_2_int",
    "Merom_1_int",
    "restaurant_hotel",
    "Benevolence_1_int",
    "house_double_floor_upper",
    "Wainscott_1_int",
    "office_vendor_machine",
    "Beechwood_1_int",
    "Pomaria_0_int",
    "Pomaria_2_int",
)
_TASKS = (2, 3, 2, 4, 3, 2, 3, 5)
_ATTEMPTS = 60

Kind = Literal["single", "multi"]
Asked = tuple[str, tuple[str, ...]]  # scene, goal


def faults(record: Instruction) -> list[str]:
    """Return why a record without wording does not certify: its plans in every order, then driven in its house.

    Unlike in the benchmarks a single literal may hold at the start ("wash it and put it back"); a whole goal may not.
    """
    found = [
        str(problem)
        for problem in certify(record, executor=False)
        if not (problem.check == "start" and problem.detail.endswith("holds at the start"))
    ]
    if found:
        return found
    return list(drive(instruction_graph(load_house(record.scene).scene, record), record).faults)


def draw(kind: Kind, count: int, seed: int = SEED, scenes: Sequence[str] = SCENES) -> Iterator[Instruction]:
    """Yield scenarios of a kind, scenes and voices dealt evenly.

    Raises:
        UnknownScene: a scene does not exist.
        InstructionError: no scenario could be certified in a scene.
    """
    voices = sorted(VOICES)
    seen: set[Asked] = set()
    for index in range(count):
        name = scenes[index % len(scenes)]
        voice = voices[(index + index // len(scenes)) % len(voices)]
        yield _one(kind, index, seed, load_house(name), voice, seen)


def _one(kind: Kind, index: int, seed: int, house: House, voice: str, seen: set[Asked]) -> Instruction:
    reason = "no errand fits"
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, int(kind == "multi"), index, attempt])
        draft = Draft(house, rng, say_room=0.6)
        errands = _errands(draft, 1 if kind == "single" else _TASKS[index % len(_TASKS)], kind)
        if len(errands) < (1 if kind == "single" else 2):
            continue
        record = _record(draft, errands, f"voices-{kind}-{index:03d}", kind)
        asked = (record.scene, record.goal().text())
        if asked in seen:
            reason = "only what was asked before fits"
            continue
        problems = faults(record)
        if not problems:
            seen.add(asked)
            manner = pick(rng, manners_for(record)) if rng.random() < 0.7 else None
            meta = {"voice": voice, "manner": manner, "shapes": [e.shape for e in errands], "seed": seed}
            return Instruction(
                record.id, record.scene, "", record.placements, record.tasks, kind, record.initial, meta=meta
            )
        reason = problems[0]
    raise InstructionError(f"no {kind} scenario {index} in {house.scene.scene}: {reason}")


def _errands(draft: Draft, count: int, kind: Kind) -> list[Errand]:
    shares = dict(SINGLE_SHARES if kind == "single" else MULTI_SHARES)
    errands: list[Errand] = []
    while len(errands) < count and shares:
        shape = pick(draft.rng, list(shares), shares.values())
        errand = draw_errand(draft, shape)
        if errand is None:
            del shares[shape]
        else:
            errands.append(errand)
    return errands


def _record(draft: Draft, errands: Sequence[Errand], identifier: str, kind: Kind) -> Instruction:
    things = [thing for errand in errands for thing in errand.things]
    for _ in range(int(draft.rng.integers(0, 4))):
        category = draft.category(ANY_THEME)
        start = None if category is None else draft.start(category, lambda place: not draft.house.shuts(place))
        if category is not None and start is not None:
            things.append(Thing(category, f"{category}_0", start))
            draft.things.append(things[-1])
    return Instruction(
        identifier,
        draft.house.scene.scene,
        "",
        tuple(Placement(t.category, t.start.relation, t.start.target, t.id) for t in things),
        tuple(TaskSpec("", errand.goal, errand.plan) for errand in errands),
        kind,
        tuple(state for errand in errands for state in initial_states(errand)),
    )
