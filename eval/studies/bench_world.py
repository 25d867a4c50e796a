"""Lines of the bench: first steps, resets, steps, searches, vector environments."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from functools import cache, partial
from typing import Any

from eval.studies.measuring import Measurement, Samples, timed
from gavel_env.exchange import EnvAction, Observation
from gavel_env.instructions.record import Instruction, InstructionSet, read_instructions, shipped
from gavel_env.world_model.actions import Primitive

__all__ = ["STILL", "STILL_GRAPH", "WORLD", "instructions", "make", "one_per_scene", "plans", "reset", "still_steps"]


@cache
def instructions(kind: str) -> InstructionSet:
    """Return a shipped instruction file, read once."""
    return read_instructions(shipped(kind))


def one_per_scene(kind: str) -> list[Instruction]:
    """Return one instruction for every house of a file."""
    return list({instruction.scene: instruction for instruction in instructions(kind).values()}.values())


def make(observation: str) -> tuple[Any, Any]:
    """Return an environment as `gym.make` gives it, and the same without wrappers."""
    import gymnasium as gym

    import gavel_env  # noqa: F401  (registers the environments)

    env = gym.make("Gavel-SingleTask-v0", disable_env_checker=True, observation=observation, max_episode_steps=10**9)
    return env, env.unwrapped


def reset(env: Any, instruction: Instruction) -> Observation:
    """Begin an instruction; return the observation."""
    observation: Observation = env.reset(seed=0, options={"instruction": instruction})[0]
    return observation


def _resets(observation: str) -> Samples:
    env, _ = make(observation)
    for instruction in one_per_scene("single"):
        reset(env, instruction)
    for instruction in instructions("single").values():
        yield timed(partial(reset, env, instruction))


def _cold(code: str, *, compiled: bool = True) -> Samples:
    """Time a piece of code in fresh processes; if not `compiled`, each also compiles its kernels anew."""
    program = f"import time\n{code.format(begin='begun = time.perf_counter()')}\nprint(time.perf_counter() - begun)"
    for _ in range(5 if compiled else 3):
        with tempfile.TemporaryDirectory() as folder:
            environment = dict(os.environ) if compiled else {**os.environ, "NUMBA_CACHE_DIR": folder}
            done = subprocess.run(
                [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
            )
        yield float(done.stdout)


def _rasters() -> Samples:
    from gavel_env.house.rasters import rasterise
    from gavel_env.house.scenes import load_scene, scene_names

    scenes = [load_scene(name) for name in scene_names()]
    rasterise(scenes[0], 0.1)
    for scene in scenes:
        yield timed(partial(rasterise, scene, 0.1))


def _whole_house(scene: str) -> Samples:
    """Search a whole house for what is nowhere; of a sample, nothing but the map is known before."""
    from gavel_env.house.floor_map import floor_map
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import scene_graph
    from gavel_env.sim.executor import Executor
    from gavel_env.world_model.actions import Action
    from gavel_env.world_model.ontology import default_ontology

    house = load_scene(scene)
    graph = scene_graph(house)
    missing = next(category for category in default_ontology() if category not in graph.world.by_category)
    floor_map(house)
    for _ in range(3):
        executor = Executor(house, graph)
        yield timed(partial(executor.step, Action(Primitive.NAVIGATE_TO, missing)))


def _learner_steps(level: str) -> Samples:
    """Step `Gavel-RL-v0` by masked random actions; a sample is the mean of 200 steps, resets included."""
    import gymnasium as gym
    import numpy as np

    import gavel_env  # noqa: F401  (registers the environments)

    env: Any = gym.make("Gavel-RL-v0", level=level, disable_env_checker=True)
    rng = np.random.default_rng(0)
    _, info = env.reset(seed=0)

    def play() -> None:
        nonlocal info
        for _ in range(200):
            *_, terminated, truncated, info = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
            if terminated or truncated:
                _, info = env.reset()

    for _ in range(5):
        play()
    for _ in range(20):
        yield timed(play) / 200


def _vector_steps(mode: str, count: int) -> Samples:
    """Step a vector of `Gavel-RL-v0`; a sample is the time of one environment's step, mean of 100."""
    import gymnasium as gym
    import numpy as np

    import gavel_env  # noqa: F401  (registers the environments)

    envs = gym.make_vec("Gavel-RL-v0", num_envs=count, vectorization_mode=mode, level="easy")
    rng = np.random.default_rng(0)
    _, info = envs.reset(seed=0)

    def play() -> None:
        nonlocal info
        for _ in range(100):
            *_, info = envs.step(np.array([rng.choice(np.flatnonzero(mask)) for mask in info["action_mask"]]))

    play()
    for _ in range(5):
        yield timed(play) / 100 / count
    envs.close()


def still_steps(observation: str) -> Samples:
    """Open and shut a door; a sample is the mean of twenty steps."""
    env, world = make(observation)
    for instruction in one_per_scene("single"):
        reset(env, instruction)
        doors = [n.id for n in world.reveal().graph.world.nodes.values() if n.fixed and n.category.openable]
        if doors and env.step(EnvAction(Primitive.NAVIGATE_TO, doors[0]))[4]["outcome"] == "ok":
            opening, closing = EnvAction(Primitive.OPEN, doors[0]), EnvAction(Primitive.CLOSE, doors[0])
            for _ in range(30):
                yield timed(lambda: (env.step(opening), env.step(closing)), 10) / 2  # noqa: B023


def _known_drives() -> Samples:
    env, world = make("symbolic")
    for instruction in one_per_scene("single"):
        reset(env, instruction)
        pieces = [node.id for node in world.reveal().graph.world.nodes.values() if node.fixed]
        for piece in (*pieces[::3], *pieces[1::3]):
            action = EnvAction(Primitive.NAVIGATE_TO, piece)
            begun = time.perf_counter()
            _, _, ended, _, info = env.step(action)
            spent = time.perf_counter() - begun
            if info["outcome"] == "ok" and info["step_metres"] > 0:
                yield spent
            if ended:
                reset(env, instruction)
                world.reveal()


def _room_searches() -> Samples:
    """Look for what is nowhere, so that every room is searched; a sample is a house's mean over its rooms."""
    from gavel_env.world_model.ontology import default_ontology

    env, world = make("symbolic")
    for instruction in one_per_scene("single"):
        before = reset(env, instruction).observed.searched
        present = world.privileged_state().graph.world.by_category
        missing = next(category for category in default_ontology() if category not in present)
        begun = time.perf_counter()
        after = env.step(EnvAction(Primitive.NAVIGATE_TO, missing))[0].observed.searched
        if len(after) > len(before):
            yield (time.perf_counter() - begun) / len(after - before)


def plans() -> list[tuple[Instruction, list[EnvAction]]]:
    """Return the shipped single tasks with reference plans of 17 steps (the longest there are, if none has 17)."""
    found = [(i, [EnvAction.of(a) for a in i.reference_plan()]) for i in instructions("single").values()]
    steps = 17 if any(len(plan) == 17 for _, plan in found) else max(len(plan) for _, plan in found)
    return [(i, plan) for i, plan in found if len(plan) == steps]


def _reference_plans() -> Samples:
    env, world = make("symbolic")
    for _ in range(3):
        for instruction, plan in plans():
            reset(env, instruction)
            world.reveal()
            yield timed(lambda: [env.step(action) for action in plan])  # noqa: B023


_IMPORT = "{begin}\nimport gavel_env"
_FIRST_RESET = "import gymnasium as gym, gavel_env\nenv = gym.make('Gavel-SingleTask-v0')\n{begin}\nenv.reset(seed=0)"
STILL = "step without driving, symbolic observation"
STILL_GRAPH = "step without driving, Graph observation"

WORLD: tuple[Measurement, ...] = (
    Measurement("import gavel_env (fresh process)", "s", 0.4, partial(_cold, _IMPORT)),
    Measurement("first reset of a fresh installation", "s", 4.0, partial(_cold, _FIRST_RESET, compiled=False)),
    Measurement("first reset of a process", "s", 0.3, partial(_cold, _FIRST_RESET)),
    Measurement("raster of a scene (51 scenes)", "ms", None, _rasters),
    Measurement("reset", "ms", 20.0, partial(_resets, "graph")),
    Measurement(STILL, "/s", 10_000.0, partial(still_steps, "symbolic")),
    Measurement(STILL_GRAPH, "/s", 3_000.0, partial(still_steps, "graph")),
    Measurement("NavigateTo a known object", "ms", 0.2, _known_drives),
    Measurement("full search of a room", "ms", 10.0, _room_searches),
    Measurement("search of house_single_floor, whole", "s", 2.0, partial(_whole_house, "house_single_floor")),
    Measurement("search of hall_arch_wood, whole", "s", 2.0, partial(_whole_house, "hall_arch_wood")),
    Measurement("17-step plan, everything known", "ms", 2.0, _reference_plans),
    Measurement("Gavel-RL-v0 easy, random masked", "/s", 3_000.0, partial(_learner_steps, "easy")),
    Measurement("Gavel-RL-v0 medium, random masked", "/s", None, partial(_learner_steps, "medium")),
    *(
        Measurement(f"Gavel-RL-v0 easy, {mode} vector of {count}", "/s", None, partial(_vector_steps, mode, count))
        for mode in ("sync", "async")
        for count in (1, 2, 4, 8)
    ),
)
