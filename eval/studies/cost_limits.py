"""What can be asked of a cost model here at all, measured on a sample of instructions.

The metres of an instruction depend on where its things turn out to be, which no cost model knows. So beside the R² of a
model stand: that of a Monte Carlo of the real executor under the same belief, which a model can reach and not surpass
in the long run; how well the model ranks orders of the same instruction, which is what it is for; and how well the
pairwise sum J stands for rollouts through whole orders.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import msgspec
import numpy as np

import gavel_agents
from eval.records.sampling import sample
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.pipeline import PlanningAgent
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.errors import InstructionError
from gavel_env.exchange import Observed
from gavel_env.instructions.record import Instruction, Placement
from gavel_env.tasks.placements import House, Place, load_house

__all__ = ["Limits", "limits", "reordered"]

Beliefs = Mapping[str, Mapping[str, float]]


class Limits(NamedTuple):
    """Limits of a cost model on a sample; None where it cannot be said.

    Attributes:
        instructions: in the sample.
        worlds: that the executor was run in, per instruction.
        orders: that were driven, per instruction with three tasks or more.
        model_r_squared: of the model and the metres driven, on the sample.
        ceiling_r_squared: of the executor's mean over worlds drawn from B_0 and the metres driven.
        ceiling_bias: that mean per metre driven, less 1.
        rank_correlation: Spearman's, of model and metres over the orders of an instruction, mean over instructions.
        rank_error: its standard error.
        sequential_r_squared: of J and of its rollouts through whole orders; None if the cost is not J.
    """

    instructions: int
    worlds: int
    orders: int
    model_r_squared: float | None
    ceiling_r_squared: float | None
    ceiling_bias: float | None
    rank_correlation: float | None
    rank_error: float | None
    sequential_r_squared: float | None


def limits(
    instructions: Mapping[str, Instruction],
    *,
    agent: str = "gavel-static",
    prior: str = "choice",
    cost: str | None = None,
    coverage_width_m: float | None = None,
    count: int = 60,
    worlds: int = 16,
    orders: int = 8,
    seed: int = 0,
    measured: Callable[[], object] = lambda: None,
) -> Limits:
    """Measure the limits.

    Args:
        instructions: the sample is drawn from these by the hash of their ids.
        agent: a method that orders once.
        prior: location prior.
        cost: what the method goes by; default its own.
        coverage_width_m: w_cov of J.
        count: instructions in the sample.
        worlds: drawn from B_0 per instruction.
        orders: random ones, per instruction.
        seed: of worlds and orders.
        measured: called after every instruction.
    """
    env = gym.make("Gavel-MultiTask-v0", terminate_on_success=False, observation="symbolic")
    chosen: list[tuple[float, float, float, float]] = []
    ranks: list[float] = []
    pairwise = False
    for index, name in enumerate(sample(instructions, count)):
        instruction, rng = instructions[name], np.random.default_rng([seed, index])
        understanding, model = ReferenceUnderstanding([instruction]), ReferencePlans([instruction])
        planner = gavel_agents.make(
            agent, understanding=understanding, planner=model, prior=prior, cost=cost, coverage_width_m=coverage_width_m
        )
        assert isinstance(planner, PlanningAgent)
        observation, info = env.reset(seed=0, options={"instruction": instruction})
        planner.reset(observation, info)
        situation = planner.situation(observation.observed)
        pairwise = situation.simulator is None
        order = next(situation.candidates()).order
        [expected] = situation.expected_m([order])
        driven = _drive(env, reordered(instruction, order), prior)
        replaced = _worlds(instruction, planner.beliefs, observation.observed, rng, worlds)
        simulated = [m for world in replaced if (m := _drive(env, reordered(world, order), prior)) is not None]
        if driven is not None and simulated:
            chosen.append((expected, driven, float(np.mean(simulated)), situation.sequential_m(order)))
        if len(instruction.tasks) >= 3:
            tried = _random_orders(len(instruction.tasks), orders, rng)
            metres = [_drive(env, reordered(instruction, order), prior) for order in tried]
            ranks += _rank_correlation(situation.expected_m(tried), metres)
        measured()
    env.close()
    table = np.array(chosen).reshape(-1, 4)
    expected_m, driven_m, mean_m, sequential_m = table.T
    return Limits(
        len(table),
        worlds,
        orders,
        _r_squared(expected_m, driven_m),
        _r_squared(mean_m, driven_m),
        float(mean_m.mean() / driven_m.mean() - 1.0) if len(table) else None,
        float(np.mean(ranks)) if ranks else None,
        float(np.std(ranks, ddof=1) / math.sqrt(len(ranks))) if len(ranks) > 1 else None,
        _r_squared(expected_m, sequential_m) if pairwise else None,
    )


def reordered(instruction: Instruction, order: Sequence[int]) -> Instruction:
    """Return an instruction with its tasks in another order, so that methods that keep the order drive that one."""
    meta = dict(instruction.meta)
    if "targets" in meta:
        meta["targets"] = [meta["targets"][i] for i in order]
    tasks = tuple(instruction.tasks[i] for i in order)
    return msgspec.structs.replace(instruction, tasks=tasks, meta=meta)


def _drive(env: gym.Env[Any, Any], instruction: Instruction, prior: str) -> float | None:
    """Return the metres of carrying out the tasks in the order written, or None if it fails."""
    driver = gavel_agents.make(
        "gavel-basic",
        understanding=ReferenceUnderstanding([instruction]),
        planner=ReferencePlans([instruction]),
        prior=prior,
    )
    try:
        observation, info = env.reset(seed=0, options={"instruction": instruction})
    except InstructionError:  # a goal that holds at the start
        return None
    driver.reset(observation, info)
    while (action := driver.act(observation, info)) is not None:
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return None
    return float(info["metres"])


def _worlds(
    instruction: Instruction, beliefs: Beliefs, observed: Observed, rng: np.random.Generator, count: int
) -> Iterator[Instruction]:
    """Yield the instruction with the movables that nobody has seen where the belief puts them."""
    house = load_house(instruction.scene)
    seen = observed.graph.world
    unseen = [p for p in instruction.placements if p.category in beliefs and p.category not in seen.by_category]
    for _ in range(count):
        moved = {p.category: _place(house, p, beliefs[p.category], set(seen.nodes), rng) for p in unseen}
        placements = tuple(moved.get(p.category, p) for p in instruction.placements)
        yield msgspec.structs.replace(instruction, placements=placements)


def _place(
    house: House, placement: Placement, belief: Mapping[str, float], seen: set[str], rng: np.random.Generator
) -> Placement:
    """Draw a room by belief, and in it one of the places that would have hidden the thing so far, else its floor."""
    stated = [p for p in house.supports if p.piece is not None and p.target == placement.target]
    if stated and house.shuts(stated[0]):  # in something shut: nothing is believed but what the instruction says
        return placement
    rooms = list(belief)
    room = rooms[int(rng.choice(len(rooms), p=np.array(list(belief.values())) / sum(belief.values())))]

    def hides(place: Place) -> bool:
        return place.room == room and place.piece is not None and place.target not in seen and not house.shuts(place)

    open_places = [place for place in house.supports if hides(place)]
    if not open_places:
        return msgspec.structs.replace(placement, relation="floor", target=room)
    place = open_places[int(rng.integers(len(open_places)))]
    return msgspec.structs.replace(placement, relation=place.relation, target=place.target)


def _random_orders(tasks: int, count: int, rng: np.random.Generator) -> list[tuple[int, ...]]:
    drawn = dict.fromkeys(tuple(int(i) for i in rng.permutation(tasks)) for _ in range(4 * count))
    return list(drawn)[:count]


def _rank_correlation(expected: Sequence[float], driven: Sequence[float | None]) -> list[float]:
    """Return Spearman's rank correlation; nothing if one side does not vary."""
    pairs = [(e, d) for e, d in zip(expected, driven, strict=True) if d is not None]
    if len(pairs) < 3:
        return []
    first, second = (_ranks(np.round(side, 6)) for side in np.array(pairs).T)
    if first.std() == 0.0 or second.std() == 0.0:
        return []
    return [float(np.corrcoef(first, second)[0, 1])]


def _ranks(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return mid-ranks."""
    _, inverse, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - (count - 1) / 2.0)[inverse])


def _r_squared(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> float | None:
    if len(a) < 3 or a.std() == 0.0 or b.std() == 0.0:
        return None
    return float(np.corrcoef(a, b)[0, 1] ** 2)
