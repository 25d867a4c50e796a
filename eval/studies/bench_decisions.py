"""Lines of the bench: deciding by J and by simulated worlds, as the tasks grow in number.

Tasks are made up: each fetches a thing of unknown place to another one, with random beliefs over the rooms, so that
every number of tasks can be had in every house and nothing is known at the start.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from eval.studies.measuring import Measurement, Samples, timed
from gavel_env.exchange import EnvAction
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["DECISIONS"]


def _situations(tasks: int, *, simulated: bool) -> Iterator[Any]:
    """Yield three situations in each of the ten benchmark houses."""
    from gavel_agents.ordering.cost import TravelModel
    from gavel_agents.ordering.knowledge import Knowledge
    from gavel_agents.ordering.simulator import Simulator
    from gavel_agents.ordering.situation import Situation
    from gavel_env.house.floor_map import known_layout
    from gavel_env.house.scenes import BENCHMARK_HOUSES, load_scene

    for house in BENCHMARK_HOUSES:
        layout = known_layout(load_scene(house))
        travel = TravelModel(layout)
        simulator = Simulator(layout) if simulated else None
        for seed in range(3):
            rng = np.random.default_rng(seed)
            nodes = [f"{kind}_{i}" for i in range(tasks) for kind in ("thing", "place")]
            beliefs = {node: rng.dirichlet(np.ones(len(travel.rooms))) for node in nodes}
            seen = np.zeros(layout.shape, np.bool_)
            known = Knowledge(
                layout.start, seen, frozenset(), {}, beliefs, {n: n for n in nodes}, travel.rooms, holding=None
            )
            plans = [_fetch(f"thing_{i}", f"place_{i}") for i in range(tasks)]
            yield Situation(plans, travel, travel.at(layout.start), beliefs, {}, simulator, known)


def _fetch(thing: str, place: str) -> list[Action]:
    steps = (Primitive.NAVIGATE_TO, Primitive.GRASP, Primitive.NAVIGATE_TO, Primitive.PLACE_ON_TOP)
    return [Action(step, target) for step, target in zip(steps, (thing, thing, place, place), strict=True)]


def _orders(tasks: int) -> Samples:
    """Find the best order by J."""
    for situation in _situations(tasks, simulated=False):
        work = partial(_first, situation)
        work()
        yield timed(work)


def _first(situation: Any) -> Any:
    return next(situation.candidates())


def _decisions(tasks: int) -> Samples:
    """Decide as gavel-plus does: the order, and the room in which the first search begins."""
    from gavel_agents.ordering.decision import returning_search

    def decide(situation: Any) -> None:
        order = _first(situation).order
        plans = [situation.plans[i] for i in order]
        search = EnvAction(Primitive.NAVIGATE_TO, plans[0][0].target, {})
        returning_search(situation.simulator, situation.known, search, plans, ())

    for situation in _situations(tasks, simulated=True):
        decide(situation)
        yield timed(partial(decide, situation))


def _rollouts() -> Samples:
    """Carry out one order of five tasks in 64 worlds."""
    from gavel_agents.ordering.simulator import legs_of

    for situation in _situations(5, simulated=True):
        things = list(situation.known.belief)
        worlds = situation.simulator.worlds(things, situation.known)
        legs = legs_of(situation.plans, {thing: i for i, thing in enumerate(things)}, None)
        order = np.arange(5, dtype=np.int16)[None]
        work = partial(situation.simulator.metres, worlds, legs, order)
        work()
        yield timed(work, 5)


def _sight_points() -> Samples:
    """Read the sight points of the ten benchmark houses from the cache."""
    from gavel_env.house.floor_map import known_layout
    from gavel_env.house.scenes import BENCHMARK_HOUSES, load_scene
    from gavel_env.house.sight_points import sight_points

    layouts = [known_layout(load_scene(house)) for house in BENCHMARK_HOUSES]
    for layout in layouts:
        sight_points(layout)
    for _ in range(5):
        sight_points.cache_clear()
        yield timed(lambda: [sight_points(layout) for layout in layouts])


DECISIONS: tuple[Measurement, ...] = (
    Measurement("sight points of ten houses, from the cache", "s", 0.3, _sight_points),
    Measurement("simulate an order of 5 tasks in 64 worlds", "ms", None, _rollouts),
    *(Measurement(f"best order of {n} tasks by J, nothing known", "ms", None, partial(_orders, n)) for n in (2, 5, 8)),
    *(Measurement(f"one decision of gavel-plus, {n} tasks", "ms", 25.0, partial(_decisions, n)) for n in (2, 5, 8)),
)
