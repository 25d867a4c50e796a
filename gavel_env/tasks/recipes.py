"""The recipes of the two benchmarks: how many of what, drawn so that the whole set comes out as described.

Every record is the best of a few candidates: the one after which the running figures of the set (primitives, rooms,
predicates, rooms said) are nearest to the figures wanted. The choice looks at the set's description alone, never at how
any agent fares. Figures wanted: docs/reference/benchmarks.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import msgspec
import numpy as np

from gavel_env.errors import InstructionError
from gavel_env.house.floor_map import floor_map
from gavel_env.house.scenes import BENCHMARK_HOUSES, Scene, load_scene, scene_names
from gavel_env.instructions.record import Instruction
from gavel_env.tasks.assembly import assemble, initial_graph, rooms_visited
from gavel_env.tasks.certificate import certify
from gavel_env.tasks.drafts import Draft
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.generator import LONG_SHAPES, SHORT_SHAPES, draw_errands
from gavel_env.tasks.placements import House
from gavel_env.tasks.shapes import SHAPES, draw_errand
from gavel_env.tasks.statistics import furniture_references

__all__ = ["DIFFER", "HOUSES", "house_names", "multi_benchmark", "scene_as_drawn", "single_benchmark"]

HOUSES = BENCHMARK_HOUSES

_ADDED_SINCE = {
    "Merom_0_garden": ("toilet_0",),
    "Pomaria_0_garden": ("furniture_sink_0",),
    "Pomaria_0_int": ("furniture_sink_0",),
}
"""Furniture that layouts have gained since the shipped sets were drawn."""


def scene_as_drawn(name: str) -> Scene:
    """Return a scene with the furniture that it had when the shipped sets were drawn.

    The sets are drawn in these, so that they, and what was recorded on them, stay the same; everything else, the
    certificates included, is of the scenes as they are.
    """
    scene = load_scene(name)
    added = _ADDED_SINCE.get(name, ())
    return msgspec.structs.replace(scene, furniture=tuple(f for f in scene.furniture if f.id not in added))


def _house(name: str) -> House:
    scene = scene_as_drawn(name)
    return House(scene, floor=floor_map(scene), name=name)


def house_names(wanted: Sequence[str]) -> tuple[str, ...]:
    """Return scene names, with `benchmark`, `held-out` and `all` replaced by the scenes they stand for.

    Held out are the scenes that are neither a benchmark house nor its garden twin.
    """
    twins = {name.removesuffix("_int") for name in HOUSES}
    sets = {
        "benchmark": HOUSES,
        "held-out": tuple(n for n in scene_names() if n.removesuffix("_int").removesuffix("_garden") not in twins),
        "all": scene_names(),
    }
    return tuple(dict.fromkeys(name for word in wanted for name in sets.get(word, (word,))))


_ATTEMPTS = 400
_CONFERRING = {shape: share for shape, share in SHORT_SHAPES.items() if SHAPES[shape].confers}
_PLAIN = {shape: share for shape, share in SHORT_SHAPES.items() if not SHAPES[shape].confers}


class _Tally:
    """Running sums of the figures of a set, and the distance of their means to those wanted."""

    def __init__(self, wanted: Mapping[str, tuple[float, float]]) -> None:
        self.wanted = wanted
        self.sums = dict.fromkeys(wanted, (0.0, 0.0))

    def distance(self, figures: Mapping[str, tuple[float, float]]) -> float:
        """Return how far the means (sum / weight) would be from those wanted with one more record."""
        total = 0.0
        for name, (mean, scale) in self.wanted.items():
            value = self.sums[name][0] + figures[name][0]
            weight = self.sums[name][1] + figures[name][1]
            total += abs(value - mean * weight) / scale
        return total

    def add(self, figures: Mapping[str, tuple[float, float]]) -> None:
        """Take a record into the sums."""
        for name in self.wanted:
            self.sums[name] = (self.sums[name][0] + figures[name][0], self.sums[name][1] + figures[name][1])


def _figures(draft: Draft, record: Instruction) -> dict[str, tuple[float, float]]:
    """Return figure -> (value, weight) of a record: what its tally adds up."""
    references = furniture_references(record.meta["targets"])
    literals = [lit for task in record.tasks for lit in task.goal]
    inside = sum(lit.startswith("inside") for lit in literals)
    return {
        "steps": (float(len(record.reference_plan())), 1.0),
        "rooms": (float(len(rooms_visited(initial_graph(draft, record), record))), 1.0),
        "unsaid": (float(sum("@" not in name for name in references)), float(len(references))),
        "said": (float(any("@" in name for name in references)), 1.0),
        "inside": (float(inside), float(inside + sum(lit.startswith("on_top") for lit in literals))),
    }


def _best(
    house: House,
    tally: _Tally,
    draw: Callable[[Draft], Sequence[Errand] | None],
    seed: Sequence[int],
    identifier: str,
    texts: set[str],
    candidates: int,
    differ: Callable[[Instruction], bool] | None = None,
) -> Instruction:
    """Return the certified candidate that brings the tally nearest to what is wanted."""
    found: list[tuple[float, int, Instruction, dict[str, tuple[float, float]]]] = []
    reason = "no errand of the shape fits"
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([*seed, attempt])
        draft = Draft(house, rng, split="benchmark")
        errands = draw(draft)
        if errands is None:
            continue
        record = assemble(draft, errands, rng, identifier=identifier, distractors=int(rng.integers(0, 4)))
        problems = certify(record)
        if problems or record.text in texts:
            reason = str(problems[0]) if problems else "the text stands twice"
            continue
        figures = _figures(draft, record)
        if differ is not None:
            differs = differ(record)
            record = msgspec.structs.replace(record, meta={**record.meta, "orders_differ": differs})
            figures["differ"] = (float(differs), 1.0)
        found.append((tally.distance(figures), len(found), record, figures))
        if len(found) == candidates:
            break
    if not found:
        raise InstructionError(f"{identifier}: nothing could be certified in {_ATTEMPTS} attempts: {reason}")
    _, _, record, figures = min(found, key=lambda item: item[:2])
    tally.add(figures)
    texts.add(record.text)
    return record


# --- 100 single tasks -----------------------------------------------------------------------------------------------

# Shapes that only some houses afford are dealt first, one to a house.
_DEALT_FIRST = ("wash_then_dry", "load_dishwasher", "fridge_heat", "counter_heat")


def _affords(house: House, shape: str) -> bool:
    draft = Draft(house, np.random.default_rng(0), split="benchmark")
    return draw_errand(draft, shape, attempts=150) is not None


def _deal_shapes(houses: Sequence[House], shares: Mapping[str, int]) -> list[list[str]]:
    """Deal the shapes to the houses, ten each, as evenly as the houses afford."""
    hands: list[list[str]] = [[] for _ in houses]
    size = sum(shares.values()) // len(houses)
    for shape in (*_DEALT_FIRST, *(s for s in shares if s not in _DEALT_FIRST)):
        able = [i for i, house in enumerate(houses) if _affords(house, shape)]
        for _ in range(shares[shape]):
            open_hands = [i for i in able if len(hands[i]) < size]
            if not open_hands:
                raise InstructionError(f"no house is left for shape {shape!r}")
            least = min(open_hands, key=lambda i: (hands[i].count(shape), len(hands[i]), i))
            hands[least].append(shape)
    return hands


def single_benchmark(seed: int = 2026, names: Sequence[str] = HOUSES) -> Iterator[Instruction]:
    """Yield the single-task benchmark: 100 long tasks, ten per house.

    Raises:
        InstructionError: a house affords too little.
    """
    houses = [_house(name) for name in names]
    fixed = {"steps": (12.25, 0.4), "said": (0.52, 0.5), "inside": (102 / 199, 0.3)}
    tally, texts = _Tally(fixed), set[str]()
    hands = _deal_shapes(houses, LONG_SHAPES)
    order = [(house, k, hand[k]) for k in range(10) for house, hand in zip(houses, hands, strict=True)]
    # Shapes with nothing to choose come first, so that the others can make up for them.
    free = ("put_two_away", "bring_three", "swap", "carry_two_and_switch", "carry_two")
    order.sort(key=lambda item: item[2] in free)
    records: dict[tuple[str, int], Instruction] = {}
    for house, k, shape in order:
        name = house.scene.scene

        def draw(draft: Draft, shape: str = shape) -> list[Errand] | None:
            draft.say_room = 0.22
            errand = draw_errand(draft, shape, attempts=20)
            return None if errand is None or not 8 <= len(errand.plan) <= 17 else [errand]

        key = [seed, 1, names.index(name), k]
        records[name, k] = _best(house, tally, draw, key, f"single-{name}-{k:02d}", texts, 10)
    for name in names:
        for k in range(10):
            yield records[name, k]


# --- 500 multi-task instructions ------------------------------------------------------------------------------------

_TASKS = (5, 4, 3, 5, 4, 2, 5, 4, 3, 5, 4, 5, 3, 4, 5, 2)
_NEED_APPLIANCE = 199
DIFFER = 0.70
"""Share of multi-task instructions on which the ordering methods are to choose different orders."""


def multi_benchmark(
    seed: int = 2026,
    names: Sequence[str] = HOUSES,
    each: int = 50,
    differ: Callable[[Instruction], bool] | None = None,
) -> Iterator[Instruction]:
    """Yield the multi-task benchmark: 50 instructions per house of two to five independent errands.

    Args:
        seed: of all randomness.
        names: the houses.
        each: instructions per house.
        differ: tells of an instruction whether the ordering methods order it differently (`eval.studies.orders`); if
            given, `DIFFER` of the set do, and each record notes it in `meta`. It must not look at who does better.

    Raises:
        InstructionError: a house affords too little.
    """
    houses = [_house(name) for name in names]
    wanted = {"steps": (18.8, 8.0), "rooms": (4.66, 0.4), "unsaid": (0.54, 1.0)}
    if differ is not None:
        wanted["differ"] = (DIFFER, 0.25)
    tally, texts = _Tally(wanted), set[str]()
    quotas = _appliance_quotas(houses, each)
    records: dict[tuple[str, int], Instruction] = {}
    for k in range(each):
        for index, house in enumerate(houses):
            name = house.scene.scene
            # Spread the quota evenly over the house's instructions.
            conferring = (k + 1) * quotas[index] // each > k * quotas[index] // each

            def draw(
                draft: Draft, k: int = k, index: int = index, conferring: bool = conferring
            ) -> list[Errand] | None:
                return _draw_multi(draft, _task_count(k, index), conferring)

            key = [seed, 2, index, k]
            records[name, k] = _best(house, tally, draw, key, f"multi-{name}-{k:02d}", texts, 5, differ)
    for name in names:
        for k in range(each):
            yield records[name, k]


def _task_count(k: int, house: int) -> int:
    """Return N of instruction k of a house: 2 to 5, 3.87 on average."""
    return _TASKS[(k + 3 * house) % len(_TASKS)]


def _appliance_quotas(houses: Sequence[House], each: int) -> list[int]:
    """Return how many instructions of each house need an appliance: even among the houses that afford it."""
    able = [any(_affords(house, shape) for shape in _CONFERRING) for house in houses]
    total = _NEED_APPLIANCE * each * len(houses) // 500
    quotas = [0] * len(houses)
    while sum(quotas) < total and any(able):
        quotas[min((i for i, ok in enumerate(able) if ok), key=lambda i: (quotas[i], i))] += 1
    return quotas


def _draw_multi(draft: Draft, count: int, conferring: bool) -> list[Errand] | None:
    draft.say_room = 0.38
    errands: list[Errand] = []
    if conferring:
        twice = count > 2 and draft.rng.random() < 0.1
        errands += draw_errands(draft, 2 if twice else 1, _CONFERRING)
        if not errands:
            return None
    errands += draw_errands(draft, count - len(errands), _PLAIN)
    if len(errands) != count:
        return None
    order = draft.rng.permutation(count)
    return [errands[i] for i in order]
