"""Reference plans driven through the house: the executor's part of a certificate, and the route for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import Instruction
from gavel_env.sim.executor import Executor, Outcome
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import shortfall

__all__ = ["Drive", "drive"]


class Drive(NamedTuple):
    """A reference plan as it was driven.

    Attributes:
        executor: the house at the end.
        outcomes: what each step did, up to the first violation.
        faults: what went wrong: the violation, what is unmet, what is left open or on; empty = the plan works.
        starts: x, y in metres at the start of everything that the plan names.
    """

    executor: Executor
    outcomes: tuple[Outcome, ...]
    faults: tuple[str, ...]
    starts: Mapping[str, tuple[float, float]]

    @property
    def metres(self) -> float:
        """Return the metres driven."""
        return sum(outcome.metres for outcome in self.outcomes)

    def route(self) -> tuple[tuple[float, float], ...]:
        """Return the points driven through, x and y in metres."""
        cells = np.concatenate([outcome.route for outcome in self.outcomes])
        return tuple((float(x), float(y)) for x, y in self.executor.floor.points(cells))


def drive(graph: SceneGraph, instruction: Instruction, seed: int = 0) -> Drive:
    """Drive the reference plan of an instruction from where the robot starts.

    The ids of the plan are known to the reference alone: a drive to something unseen searches for exactly that
    instance, in its room first.

    Args:
        graph: hidden graph at the start.
        instruction: the record.
        seed: decides where on the floor things lie that start there.

    Raises:
        UnknownScene, SceneError: the scene cannot be read.
    """
    executor = Executor(load_scene(instruction.scene), graph, rng=np.random.default_rng(seed))
    start = executor.hidden
    targets = {action.target for action in instruction.reference_plan() if action.target is not None}
    named = targets & set(graph.world.nodes)
    starts = {name: executor.position(name) for name in sorted(named)}
    outcomes: list[Outcome] = []
    for step, action in enumerate(instruction.reference_plan()):
        target = action.target
        unseen = target is not None and target not in executor.graph.world.nodes
        if action.primitive is Primitive.NAVIGATE_TO and target is not None and unseen and target in graph.world.nodes:
            room = executor.hidden.room_of(target)
            prior = {} if room is None else {room: 1.0}
            outcome = executor.step(action, prior, target.__eq__)
        else:
            outcome = executor.step(action)
        outcomes.append(outcome)
        if outcome.violation is not None:
            return Drive(executor, tuple(outcomes), (f"step {step} {action}: {outcome.violation}",), starts)
    goal, end = instruction.goal(), executor.hidden
    return Drive(executor, tuple(outcomes), tuple(shortfall(start, end, goal).reasons()), starts)
