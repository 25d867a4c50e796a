"""`python -m eval.studies.scaling`: how cost grows with objects, floor, tasks, episodes, workers and connections.

Every curve is drawn with the exponent k of the fit cost = c * size^k. Within the process, cost is CPU time and the best
of several runs, so that what else the machine does counts little. Needs the extra `[plots]` for the picture.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from eval.studies.bench_agents import slow_endpoint
from eval.studies.bench_world import instructions, make, reset
from eval.studies.plots import figure, fitted_exponent, plain_logarithmic
from gavel_env.exchange import EnvAction
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["CURVES", "Curve", "evaluate_many", "main", "memory_mb", "play"]

Points = Iterator[tuple[float, float]]

# From 22 to 6,980 objects, and from 13 m² to 1,570 m².
_BY_OBJECTS = (
    "gates_bedroom",
    "Pomaria_0_int",
    "Rs_int",
    "Beechwood_0_int",
    "restaurant_cafeteria",
    "house_double_floor_lower",
    "office_bike",
    "school_gym",
    "house_single_floor",
    "restaurant_asian",
    "grocery_store_convenience",
    "hall_conference_large",
    "grocery_store_cafe",
)
_GAVEL = ("--agents", "gavel-full", "--planner", "reference:multi", "--kind", "multi")
_BY_FLOOR = ("Rs_int", "Merom_0_int", "Ihlen_1_int", "Beechwood_0_int", "office_large", "house_single_floor")


class Curve(NamedTuple):
    """One panel.

    Attributes:
        size: what grows.
        cost: what it costs.
        points: yields (size, cost).
    """

    size: str
    cost: str
    points: Callable[[], Points]


def _cpu(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _objects(scene: Scene) -> int:
    return len(scene.furniture) + len(scene.items)


def _record(scene: Scene) -> dict[str, Any]:
    """Return an errand that any scene affords: a ball from the floor of its first room onto its first surface."""
    from gavel_env.world_model.ontology import default_ontology

    place = next(p for p in scene.furniture if default_ontology()[p.category].surface)
    task = {"text": "Move the ball.", "goal": [f"on_top(tennis_ball, {place.id})"], "reference_plan": []}
    ball = {"category": "tennis_ball", "relation": "floor", "target": scene.rooms[0].id}
    return {"id": scene.scene, "scene": scene.scene, "text": "Move the ball.", "placements": [ball], "tasks": [task]}


def _in_scenes(cost: Callable[[Any], float], scenes: Sequence[str] = _BY_OBJECTS) -> Points:
    import gymnasium as gym

    import gavel_env  # noqa: F401  (registers the environments)

    for name in scenes:
        scene = load_scene(name)
        env = gym.make(
            "Gavel-SingleTask-v0",
            instructions=[_record(scene)],
            on_violation="noop",
            max_nodes=20_000,
            max_episode_steps=10**9,
            disable_env_checker=True,
        )
        env.reset(seed=0)
        yield float(_objects(scene)), cost(env)


def _reset_ms(env: Any) -> float:
    return 1e3 * min(_cpu(lambda: env.reset(seed=0)) for _ in range(9))


def _step_us(env: Any) -> float:
    """Take up and drop something with everything observed: the graph changes, nothing is driven."""
    env.unwrapped.reveal()
    env.step(EnvAction(Primitive.NAVIGATE_TO, "tennis_ball"))
    graph = env.unwrapped.observed.graph
    ball = next(iter(sorted(graph.near & set(graph.world.instances("tennis_ball")))))
    both = (EnvAction(Primitive.GRASP, ball), EnvAction(Primitive.RELEASE))
    return 1e6 * min(_cpu(lambda: [env.step(action) for action in both]) / 2 for _ in range(50))


def _search_s() -> Points:
    from gavel_env.house.floor_map import floor_map
    from gavel_env.instructions.initial_graph import scene_graph
    from gavel_env.sim.executor import Executor
    from gavel_env.world_model.ontology import default_ontology

    for name in _BY_FLOOR:
        scene = load_scene(name)
        graph = scene_graph(scene)
        missing = next(category for category in default_ontology() if category not in graph.world.by_category)
        Executor(scene, graph).step(Action(Primitive.NAVIGATE_TO, missing))
        executor = Executor(scene, graph)
        spent = _cpu(lambda: executor.step(Action(Primitive.NAVIGATE_TO, missing)))  # noqa: B023
        yield float(floor_map(scene).floor.sum()) / 100.0, spent


def _planning_ms() -> Points:
    """Understand, verify and order, the certified plans in a model's place; medians over 15 instructions of each N."""
    import gavel_agents

    env, _ = make("symbolic")
    for count in (2, 3, 4, 5):
        chosen = [i for i in instructions("multi").values() if len(i.tasks) == count][:15]
        spent = []
        for instruction in chosen:
            observation = reset(env, instruction)
            agent = gavel_agents.make("gavel-full", understanding="reference", planner="reference:multi")
            agent.reset(observation, {})
            spent.append(min(_cpu(lambda: agent.reset(observation, {})) for _ in range(3)))  # noqa: B023
        yield float(count), 1e3 * statistics.median(spent)


def memory_mb(play: str = "play") -> Points:
    """Play 10,000 episodes in a process of their own, and look at the most memory it has taken so far.

    Args:
        play: function of this module that plays them, `play` or `evaluate_many`.
    """
    code = f"from eval.studies.scaling import {play} as play; play()"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    for line in done.stdout.splitlines():
        episode, megabytes = line.split()
        yield float(episode), float(megabytes)


_LOOKED_AT = (100, 300, 1_000, 3_000, 10_000)


def _look(episode: int) -> None:
    if episode in _LOOKED_AT:
        unit = 2**20 if sys.platform == "darwin" else 2**10
        print(episode, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit, flush=True)


def play(most: int = 10_000) -> None:
    """Play episodes of masked random actions, ten steps each; print the most memory so far, in MB, at some of them."""
    import gymnasium as gym
    import numpy as np

    import gavel_env  # noqa: F401  (registers the environments)

    env: Any = gym.make("Gavel-RL-v0", level="easy", disable_env_checker=True)
    rng = np.random.default_rng(0)
    _, info = env.reset(seed=0)
    for episode in range(1, most + 1):
        for _ in range(10):
            *_, terminated, truncated, info = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
            if terminated or truncated:
                break
        _, info = env.reset()
        _look(episode)


def evaluate_many(most: int = 10_000) -> None:
    """Evaluate the methods of experiment 2 with a simulated planner; print the most memory so far, in MB, as `play`."""
    from itertools import count

    from eval.run.runner import run
    from eval.studies.experiments import EXPERIMENTS, planned

    seeds = range(5)
    each = len(EXPERIMENTS["exp2"].agents) * len(seeds)
    plan = planned(EXPERIMENTS["exp2"], planners=["simulated:qwen3-8b"], seeds=tuple(seeds), limit=max(1, most // each))
    number = count(1)
    with tempfile.TemporaryDirectory() as folder:
        run(plan, folder, report=lambda _: _look(next(number)))


def _evaluation(*arguments: str) -> tuple[float, float]:
    """Return the wall-clock and the CPU seconds of an evaluation."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "eval", "eval", *arguments, "--quiet", "--out", folder]
        wall, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
        return time.perf_counter() - wall, cpu


def _episodes_s() -> Points:
    for count in (25, 50, 100, 200, 400):
        yield float(count), _evaluation(*_GAVEL, "--limit", str(count))[1]


def _workers_s() -> Points:
    for workers in (1, 2, 4):
        yield float(workers), _evaluation(*_GAVEL, "--limit", "400", "--workers", str(workers))[0]


def _connections_s() -> Points:
    with slow_endpoint() as spec:
        for connections in (1, 2, 4, 8, 16, 32):
            chosen = ("--agents", "llm-only", "--planner", spec, "--kind", "single", "--limit", "32")
            yield float(connections), _evaluation(*chosen, "--connections", str(connections))[0]


CURVES: tuple[Curve, ...] = (
    Curve("objects in the scene", "reset, CPU ms", lambda: _in_scenes(_reset_ms)),
    Curve("objects observed", "step without driving, CPU µs", lambda: _in_scenes(_step_us)),
    Curve("floor, m²", "search of the whole house, CPU s", _search_s),
    Curve("tasks of an instruction", "planning of gavel-full, CPU ms", _planning_ms),
    Curve("episodes evaluated", "CPU s", _episodes_s),
    Curve("worker processes, 400 episodes", "wall clock, s", _workers_s),
    Curve("connections, 32 calls of 1 s", "wall clock, s", _connections_s),
    Curve("episodes in one process", "most memory, MB", memory_mb),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the curves, print their points and exponents, and draw them.

    Args:
        argv: arguments after the program's name; None = those of the process.
    """
    parser = argparse.ArgumentParser(prog="python -m eval.studies.scaling", description="How cost grows.")
    parser.add_argument("--only", metavar="TEXT", help="only curves whose axes have this text")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw them")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the points")
    arguments = parser.parse_args(argv)
    chosen = [c for c in CURVES if arguments.only is None or arguments.only.lower() in f"{c.size} {c.cost}".lower()]
    found: dict[Curve, list[tuple[float, float]]] = {}
    for curve in chosen:
        found[curve] = sorted(curve.points())
        exponent, _ = fitted_exponent(*zip(*found[curve], strict=True))
        points = ", ".join(f"{size:,.0f}: {cost:,.3g}" for size, cost in found[curve])
        print(f"{curve.cost} against {curve.size}: k = {exponent:.2f} ({points})", flush=True)
    if arguments.json is not None:
        table = [{"size": c.size, "cost": c.cost, "points": points} for c, points in found.items()]
        arguments.json.write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n", "utf-8")
    if arguments.png is not None:
        _draw(found, arguments.png)
    return 0


def _draw(found: Mapping[Curve, Sequence[tuple[float, float]]], path: Path) -> None:
    columns = min(2, len(found))
    drawing, axes = figure(columns, -(-len(found) // columns))
    flat = axes.flat if len(found) > 1 else [axes]
    for ax, (curve, points) in zip(flat, found.items(), strict=False):
        sizes, costs = zip(*points, strict=True)
        exponent, factor = fitted_exponent(sizes, costs)
        ax.loglog(sizes, costs, "o", color="tab:brown")
        ax.loglog(
            sizes, [factor * size**exponent for size in sizes], color="0.6", label=f"k = {round(exponent, 2) + 0.0:.2f}"
        )
        ax.set(xlabel=curve.size, ylabel=curve.cost)
        ax.set_ylim(min(costs) / 2, max(costs) * 2)
        plain_logarithmic(ax, sizes)
        ax.legend(loc="upper left")
    drawing.savefig(path)


if __name__ == "__main__":
    sys.exit(main())
