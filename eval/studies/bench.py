"""`python -m eval.studies.bench`: how fast everything is, as medians beside the targets.

MiniGrid is stepped in the same run.

Scenes and compiled kernels are warm unless a line says cold. Every function below yields seconds per sample.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from itertools import islice
from typing import Any, NamedTuple

from gavel_env.errors import NotInstalled
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import Instruction, InstructionSet, read_instructions, shipped
from gavel_env.world_model.actions import Action, Primitive

__all__ = ["MEASUREMENTS", "Measured", "Measurement", "NotInstalled", "main", "measure"]

Samples = Iterator[float]


class Measurement(NamedTuple):
    """One line of the bench.

    Attributes:
        name: what one sample is.
        unit: of the printed number: "s", "ms", "µs" (time of a sample) or "/s" (samples per second).
        target: to be at most (times) or at least (rates); None if there is none.
        samples: yields seconds per sample.
    """

    name: str
    unit: str
    target: float | None
    samples: Callable[[], Samples]


class Measured(NamedTuple):
    """What a measurement gave; `value` is the median in its unit, None if it cannot be made here (`note` says why)."""

    name: str
    unit: str
    target: float | None
    value: float | None
    samples: int
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a value or target."""
        if self.value is None or self.target is None:
            return None
        return self.value >= self.target if self.unit == "/s" else self.value <= self.target


_SCALE: dict[str, Callable[[float], float]] = {
    "s": lambda seconds: seconds,
    "ms": lambda seconds: seconds * 1e3,
    "µs": lambda seconds: seconds * 1e6,
    "/s": lambda seconds: 1 / seconds,
}


def measure(measurement: Measurement) -> Measured:
    """Make one measurement."""
    name, unit, target, samples = measurement
    try:
        found = list(samples())
    except NotInstalled as error:
        return Measured(name, unit, target, None, 0, str(error))
    return Measured(name, unit, target, _SCALE[unit](statistics.median(found)), len(found))


def _timed(work: Callable[[], object], count: int = 1) -> float:
    """Return the seconds of one of `count` runs in a row."""
    begun = time.perf_counter()
    for _ in range(count):
        work()
    return (time.perf_counter() - begun) / count


# --- environments --------------------------------------------------------------------------------------------------


@cache
def _instructions(kind: str) -> InstructionSet:
    return read_instructions(shipped(kind))


def _one_per_scene(kind: str) -> list[Instruction]:
    return list({instruction.scene: instruction for instruction in _instructions(kind).values()}.values())


def _make(observation: str) -> tuple[Any, Any]:
    """Return an environment as `gym.make` gives it, and the same without wrappers."""
    import gymnasium as gym

    import gavel_env  # noqa: F401  (registers the environments)

    env = gym.make("Gavel-SingleTask-v0", disable_env_checker=True, observation=observation, max_episode_steps=10**9)
    return env, env.unwrapped


def _reset(env: Any, instruction: Instruction) -> dict[str, Any]:
    info: dict[str, Any] = env.reset(seed=0, options={"instruction": instruction})[1]
    return info


def _resets(observation: str) -> Samples:
    env, _ = _make(observation)
    for instruction in _one_per_scene("single"):
        _reset(env, instruction)
    for instruction in _instructions("single").values():
        yield _timed(partial(_reset, env, instruction))


def _cold(code: str) -> Samples:
    """Time a piece of code in fresh processes."""
    program = f"import time\n{code.format(begin='begun = time.perf_counter()')}\nprint(time.perf_counter() - begun)"
    for _ in range(5):
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        yield float(done.stdout)


def _still_steps(observation: str) -> Samples:
    env, world = _make(observation)
    for instruction in _one_per_scene("single"):
        _reset(env, instruction)
        doors = [n.id for n in world.reveal().graph.world.nodes.values() if n.fixed and n.category.openable]
        if doors and env.step(EnvAction(Primitive.NAVIGATE_TO, doors[0]))[4]["outcome"] == "ok":
            opening, closing = EnvAction(Primitive.OPEN, doors[0]), EnvAction(Primitive.CLOSE, doors[0])
            for _ in range(30):
                yield _timed(lambda: (env.step(opening), env.step(closing)), 10) / 2  # noqa: B023


def _known_drives() -> Samples:
    env, world = _make("symbolic")
    for instruction in _one_per_scene("single"):
        _reset(env, instruction)
        pieces = [node.id for node in world.reveal().graph.world.nodes.values() if node.fixed]
        for piece in (*pieces[::3], *pieces[1::3]):
            action = EnvAction(Primitive.NAVIGATE_TO, piece)
            begun = time.perf_counter()
            _, _, ended, _, info = env.step(action)
            spent = time.perf_counter() - begun
            if info["outcome"] == "ok" and info["step_metres"] > 0:
                yield spent
            if ended:
                _reset(env, instruction)
                world.reveal()


def _room_searches() -> Samples:
    """Look for what is nowhere, so that every room is searched; a sample is a house's mean over its rooms."""
    from gavel_env.world_model.ontology import default_ontology

    env, world = _make("symbolic")
    for instruction in _one_per_scene("single"):
        before = _reset(env, instruction)["observed"].searched
        present = world.privileged_state().graph.world.by_category
        missing = next(category for category in default_ontology() if category not in present)
        begun = time.perf_counter()
        after = env.step(EnvAction(Primitive.NAVIGATE_TO, missing))[4]["observed"].searched
        if len(after) > len(before):
            yield (time.perf_counter() - begun) / len(after - before)


def _plans() -> list[tuple[Instruction, list[EnvAction]]]:
    """Return the shipped single tasks with reference plans of 17 steps (the longest there are, if none has 17)."""
    plans = [(i, [EnvAction.of(a) for a in i.reference_plan()]) for i in _instructions("single").values()]
    steps = 17 if any(len(plan) == 17 for _, plan in plans) else max(len(plan) for _, plan in plans)
    return [(i, plan) for i, plan in plans if len(plan) == steps]


def _reference_plans() -> Samples:
    env, world = _make("symbolic")
    for _ in range(3):
        for instruction, plan in _plans():
            _reset(env, instruction)
            world.reveal()
            yield _timed(lambda: [env.step(action) for action in plan])  # noqa: B023


def _minigrid() -> Samples:
    import gymnasium as gym

    try:
        import minigrid  # noqa: F401  (registers its environments)
    except ImportError:
        raise NotInstalled("minigrid is not installed; the extra [dev] has it") from None
    env: Any = gym.make("MiniGrid-DoorKey-8x8-v0", disable_env_checker=True)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(300):
        actions = [env.action_space.sample() for _ in range(20)]
        begun = time.perf_counter()
        ended = False
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            ended = ended or terminated or truncated
            if terminated or truncated:
                break
        else:
            yield (time.perf_counter() - begun) / len(actions)
        if ended:
            env.reset()


# --- agents --------------------------------------------------------------------------------------------------------


def _problems() -> Iterator[tuple[Any, tuple[Action, ...], Any]]:
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import instruction_graph

    for instruction, _ in _plans():
        yield (
            instruction_graph(load_scene(instruction.scene), instruction),
            instruction.reference_plan(),
            instruction.goal(),
        )


def _validations() -> Samples:
    from gavel_env.world_model.verdict import validate

    for graph, plan, goal in _problems():
        for _ in range(20):
            yield _timed(partial(validate, graph, plan, goal), 5)


def _repairs() -> Samples:
    """Repair reference plans without their first OPEN, last NAVIGATE_TO and last CLOSE (or last step)."""
    from gavel_agents.edits.repair import repair

    for graph, plan, goal in _problems():
        broken = list(plan)
        for primitive, last in ((Primitive.OPEN, False), (Primitive.NAVIGATE_TO, True), (Primitive.CLOSE, True)):
            places = [i for i, action in enumerate(broken) if action.primitive is primitive]
            if places:
                del broken[places[-1 if last else 0]]
        for _ in range(10):
            yield _timed(partial(repair, graph, tuple(broken), goal))


def _planners(belief: str) -> Iterator[tuple[Any, dict[str, Any], Any]]:
    """Yield agents that plan by graph edits and order once, each with an instruction of five tasks just begun."""
    from gavel_agents.beliefs.belief import load_prior
    from gavel_agents.methods import MethodConfig
    from gavel_agents.pipeline import PlanningAgent
    from gavel_agents.understanding import ReferenceUnderstanding

    chosen = [i for i in _instructions("multi").values() if len(i.tasks) == 5]
    if not chosen:
        raise NotInstalled("no shipped instruction has five tasks")
    env, _ = _make("symbolic")
    for instruction in islice(chosen, 20):
        info = _reset(env, instruction)
        understanding = ReferenceUnderstanding([instruction])
        config = MethodConfig(source="edits", attempts=0, order="once", belief=belief)  # type: ignore[arg-type]
        agent = PlanningAgent("bench", config, understanding=understanding, model=None, prior=load_prior("choice"))
        yield agent, info, understanding


def _orderings() -> Samples:
    for agent, info, _ in _planners("full"):
        for _ in range(3):
            agent.reset({}, info)
            yield agent.trace.seconds["order"]


def _belief_updates() -> Samples:
    from gavel_agents.beliefs.belief import Belief, load_prior
    from gavel_agents.beliefs.believed_graph import believed_graph
    from gavel_agents.ordering.cost import TravelModel
    from gavel_env.world_model.ontology import default_ontology

    for _, info, understanding in _planners("full"):
        observed = info["observed"]
        world = observed.graph.world
        tasks = understanding.understand(observed.instruction).tasks
        graph = believed_graph(world.rooms, world.connections, tasks, default_ontology(), observed.graph.robot_room)
        rooms = TravelModel(observed.layout).rooms
        belief = Belief.initial(graph, observed.layout, rooms, load_prior("choice"))
        for _ in range(10):
            yield _timed(partial(belief.update, graph, observed, {}))


_IMPORT = "{begin}\nimport gavel_env"
_FIRST_RESET = "import gymnasium as gym, gavel_env\nenv = gym.make('Gavel-SingleTask-v0')\n{begin}\nenv.reset(seed=0)"
_MINIGRID = "step of MiniGrid DoorKey-8x8"
_STILL = "step that does not navigate, symbolic observation"
_STILL_GRAPH = "step that does not navigate, Graph observation"

MEASUREMENTS: tuple[Measurement, ...] = (
    Measurement("import gavel_env (fresh process)", "s", 0.4, partial(_cold, _IMPORT)),
    Measurement("first reset of a process (cold)", "s", None, partial(_cold, _FIRST_RESET)),
    Measurement("reset", "ms", 20.0, partial(_resets, "graph")),
    Measurement(_STILL, "/s", 10_000.0, partial(_still_steps, "symbolic")),
    Measurement(_STILL_GRAPH, "/s", 3_000.0, partial(_still_steps, "graph")),
    Measurement("NavigateTo a known object", "ms", 1.0, _known_drives),
    Measurement("full search of a room", "ms", 10.0, _room_searches),
    Measurement("17-step reference plan, everything known", "ms", 30.0, _reference_plans),
    Measurement("validate a 17-step plan", "µs", 150.0, _validations),
    Measurement("repair a plan with 3 defects", "ms", 3.0, _repairs),
    Measurement("order 5 tasks, full belief", "ms", 3.0, _orderings),
    Measurement("belief update, 5 tasks", "ms", 0.2, _belief_updates),
    Measurement(_MINIGRID, "/s", None, _minigrid),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the bench.

    Args:
        argv: arguments after the program's name; None = those of the process.

    Returns:
        0, or with `--strict` 1 if a target was missed.
    """
    parser = argparse.ArgumentParser(
        prog="python -m eval.studies.bench", description="Measure speed: medians beside targets."
    )
    parser.add_argument("--only", metavar="TEXT", help="only measurements whose name has this text")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--strict", action="store_true", help="exit with 1 if a target is missed")
    arguments = parser.parse_args(argv)
    found = [measure(m) for m in MEASUREMENTS if arguments.only is None or arguments.only.lower() in m.name.lower()]
    if arguments.json:
        print(json.dumps([m._asdict() | {"met": m.met} for m in found], indent=1, ensure_ascii=False))
    else:
        _show(found)
    return 1 if arguments.strict and any(m.met is False for m in found) else 0


def _show(found: Sequence[Measured]) -> None:
    from rich.console import Console
    from rich.table import Table

    busy = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    table = Table(
        title=f"Medians on {os.cpu_count()} × {platform.machine()}, Python {platform.python_version()}{busy}",
        title_justify="left",
    )
    for column in ("measured", "median", "target", "", "samples"):
        table.add_column(column, justify="left" if column == "measured" else "right")
    for m in found:
        bound = "" if m.target is None else f"{'≥' if m.unit == '/s' else '≤'} {m.target:,g} {m.unit}"
        value = "—" if m.value is None else f"{m.value:,.{_digits(m.value)}f} {m.unit}"
        verdict = {True: "met", False: "MISSED", None: m.note}[m.met]
        table.add_row(m.name, value, bound, verdict, str(m.samples or ""))
    console = Console()
    if not console.is_terminal:
        console.width = 120
    console.print(table)
    rates = {m.name: m.value for m in found if m.value is not None}
    if _MINIGRID in rates:
        for name in (_STILL, _STILL_GRAPH):
            if name in rates:
                print(f"{name}: {rates[name] / rates[_MINIGRID]:.2f} × a step of MiniGrid DoorKey-8x8")


def _digits(value: float) -> int:
    return 0 if value >= 100 else 1 if value >= 10 else 2 if value >= 1 else 3


if __name__ == "__main__":
    sys.exit(main())
