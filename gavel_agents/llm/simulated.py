"""A simulated planner (`simulated:qwen3-8b`, `simulated:qwen3-4b?seed=1`): published error statistics, no model.

Its answers are the certified reference plans, broken as often and in the ways that a real model of that size was seen
to break its first plans. What is fitted: success by shape of task, kinds of first defect, and the share of wrong plans
that a complaint corrects. Everything else that comes out of it is a prediction, never a result of the model; and since
its plans mean the right places, which a real model at times misreads, what repair makes of them is an upper bound.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from urllib.parse import parse_qsl

import msgspec
import numpy as np

from gavel_agents.llm.defects import DEFECTS, Plan
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Prompt
from gavel_agents.llm.reference import written
from gavel_env.errors import GavelError, UnknownInstruction, nearest_names
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.lookup import InstructionLookup
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.tasks.judging import judge
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import SceneGraph

__all__ = ["PROFILES", "Profile", "SimulatedModel"]

_FILES = ("single", "multi")
_TRIES = 40


class Profile(msgspec.Struct, frozen=True):
    """Error profile of a model.

    Attributes:
        source: where its figures are from.
        good: shape of task -> share of first plans that are right.
        short: the same for shapes that `good` does not have, the short errands of long instructions.
        scale: factor of all `good`, which fits the mean over the 100 single tasks.
        corrected: share of wrong plans that one complaint corrects.
        more_defects: chance of each of two further defects in a plan that has one.
    """

    source: str
    good: Mapping[str, float]
    short: float
    scale: float
    corrected: float
    more_defects: float = 0.5


# First plans that were right, by shape, of a real 8B model (43 of 100; `carry_two` makes up the rest).
_GOOD_8B: Mapping[str, float] = {
    "counter_heat": 6 / 6,
    "fridge_heat": 6 / 6,
    "put_two_away": 17 / 20,
    "bring_three": 10 / 14,
    "carry_two": 1 / 2,
    "carry_two_and_switch": 1 / 9,
    "swap": 2 / 10,
    "take_two_out": 0 / 14,
    "tray": 0 / 9,
    "load_dishwasher": 0 / 7,
    "wash_then_dry": 0 / 3,
}
_SEEN_GOOD = 43.0


def _corrected(first: float, last: float, attempts: int = 5) -> float:
    """Return the share that each complaint corrects, if `attempts` of them bring success from `first` to `last`."""
    return 1 - float(((1 - last) / (1 - first)) ** (1 / (attempts - 1)))


PROFILES: Mapping[str, Profile] = {
    # llm-only 41.2 and sayplan 76.4 % of single tasks; llm-only 19.9 % of long instructions of 3.9 errands.
    "qwen3-8b": Profile(
        "published success of Qwen3-8B, first defects of its plans",
        _GOOD_8B,
        short=0.199 ** (1 / 3.9),
        scale=41.2 / _SEEN_GOOD,
        corrected=_corrected(0.412, 0.764),
    ),
    # llm-only 21.8 and sayplan 55.4 %; 2.4 % of long instructions. By shape and defect as the 8B model.
    "qwen3-4b": Profile(
        "published success of Qwen3-4B; shapes and defects as of Qwen3-8B",
        _GOOD_8B,
        short=0.024 ** (1 / 3.9),
        scale=21.8 / _SEEN_GOOD,
        corrected=_corrected(0.218, 0.554),
    ),
}


class SimulatedModel:
    """Answers with reference plans, broken by a profile; the same spec and seed give the same answers everywhere.

    The seed is the spec's plus the prompt's, so that runs over several seeds vary as a model's sampling would.
    """

    def __init__(self, argument: str, instructions: Iterable[Instruction] | None = None) -> None:
        """Choose a profile.

        Args:
            argument: `PROFILE` or `PROFILE?seed=N`.
            instructions: those it can be asked about; default the shipped ones.

        Raises:
            BadPlannerSpec: unknown profile or option.
        """
        name, _, query = argument.partition("?")
        options = dict(parse_qsl(query, keep_blank_values=True))
        if name not in PROFILES:
            near = nearest_names(name, PROFILES) or tuple(PROFILES)
            raise BadPlannerSpec(f"unknown profile {name!r} in simulated:{argument}; known: {', '.join(near)}")
        seed = options.pop("seed", "0")
        if options or not seed.isdecimal():
            raise BadPlannerSpec(f"simulated:{argument}: write simulated:{name} or simulated:{name}?seed=1")
        self.name = f"simulated {name} (no model)"
        self.decoding: Mapping[str, str | float | int] = {"seed": int(seed)}
        self.profile = PROFILES[name]
        self._name, self._base = name, int(seed)
        self._first: dict[int, dict[tuple[str, int], float]] = {}
        if instructions is None:
            instructions = chain.from_iterable(read_instructions(shipped(file)).values() for file in _FILES)
        self._instructions = {instruction.id: instruction for instruction in instructions}
        self._records = InstructionLookup(self._instructions.values())

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the plans.

        Raises:
            UnknownInstruction: a prompt is about an instruction without reference plans.
        """
        return [Completion(self._answer(prompt)) for prompt in prompts]

    def _answer(self, prompt: Prompt) -> str:
        instruction = self._records.find(prompt.about)
        if instruction is None:
            raise UnknownInstruction(prompt.about.text, (), "what the simulated planner knows")
        graph = instruction_graph(load_scene(instruction.scene), instruction)
        plans = []
        seed = self._base + (prompt.seed or 0)
        for index, task in enumerate(instruction.tasks):
            plan = task.parsed_plan()
            if not self._is_right(instruction, index, prompt.attempt, seed):
                rng = self._rng(seed, instruction.id, index, prompt.attempt, "defects")
                plan = broken(graph, plan, task.parsed_goal(), rng, self.profile.more_defects)
            plans.append(plan)
        return written(instruction, plans)

    def _is_right(self, instruction: Instruction, task: int, attempt: int, seed: int) -> bool:
        """Return whether the plan of an attempt is right; once right, it stays so."""
        shape = _shape(instruction, task)
        good = self.profile.good
        first = good[shape] * self.profile.scale if shape in good else self.profile.short
        if self._first_draws(seed)[instruction.id, task] < first:
            return True
        retries = range(1, attempt + 1)
        return any(self._rng(seed, instruction.id, task, n).random() < self.profile.corrected for n in retries)

    def _first_draws(self, seed: int) -> dict[tuple[str, int], float]:
        """Return a number in [0, 1) for every task: evenly spread over those of a shape, so that shares are kept."""
        if seed in self._first:
            return self._first[seed]
        alike: dict[tuple[str, str], list[tuple[str, int]]] = {}
        for instruction in self._instructions.values():
            for task in range(len(instruction.tasks)):
                alike.setdefault((instruction.kind, _shape(instruction, task)), []).append((instruction.id, task))
        draws: dict[tuple[str, int], float] = {}
        for what, tasks in sorted(alike.items()):
            rng = self._rng(seed, *what)
            offset, order = rng.random(), rng.permutation(len(tasks))
            for rank, place in enumerate(order):
                draws[tasks[int(place)]] = (rank + offset) / len(tasks)
        self._first[seed] = draws
        return draws

    def _rng(self, seed: int, *what: object) -> np.random.Generator:
        digest = hashlib.sha256("/".join(map(str, (self._name, seed, *what))).encode()).digest()
        return np.random.default_rng(int.from_bytes(digest[:8], "big"))


def _shape(instruction: Instruction, task: int) -> str:
    shapes = instruction.meta.get("shapes", ())
    return str(shapes[task]) if task < len(shapes) else ""


def broken(graph: SceneGraph, plan: Plan, goal: Goal, rng: np.random.Generator, more_defects: float) -> Plan:
    """Return a plan with one defect that makes it fail, and up to two further ones.

    Args:
        graph: what the plan is for.
        plan: a plan that is right.
        goal: what it reaches.
        rng: source of randomness.
        more_defects: chance of each further defect.
    """
    weights = np.array([d.seen for d in DEFECTS], float)
    worst: Plan = plan[:-1]
    for _ in range(_TRIES):
        defect = DEFECTS[int(rng.choice(len(DEFECTS), p=weights / weights.sum()))]
        edited = defect.edit(plan, graph, rng)
        if edited is not None and _fails(graph, edited, goal):
            worst = edited
            break
    for _ in range(2):
        if rng.random() < more_defects:
            defect = DEFECTS[int(rng.choice(len(DEFECTS), p=weights / weights.sum()))]
            edited = defect.edit(worst, graph, rng)
            if edited is not None and _fails(graph, edited, goal):
                worst = edited
    return worst


def _fails(graph: SceneGraph, plan: Plan, goal: Goal) -> bool:
    try:
        return judge(graph, plan, goal).kind != "valid"
    except GavelError:
        return True
