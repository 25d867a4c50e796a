"""gavel-plus: searches come back and are decided again, tasks change places until they have changed the world."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from typing import Any

import gymnasium as gym
import pytest

import gavel_agents
from gavel_agents.methods import COSTS
from gavel_agents.pipeline import PlanningAgent
from gavel_env.errors import BadOption
from gavel_env.exchange import EnvAction
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.world_model.actions import Primitive

SAMPLE = list(read_instructions(shipped("multi")).values())[3::20]


class Run:
    """One episode: what was sent, what came of it."""

    def __init__(self, env: Any, agent: PlanningAgent, instruction: Instruction) -> None:
        observation, info = env.reset(seed=0, options={"instruction": instruction})
        agent.reset(observation, info)
        self.sent: list[EnvAction] = []
        self.reached: list[str | None] = []
        self.tasks: list[int] = []
        while (action := agent.act(observation, info)) is not None:
            self.sent.append(action)
            self.tasks.append(agent.trace.order[-1])
            observation, _, _, _, info = env.step(action)
            self.reached.append(info["observed"].reached)
        self.metres = float(info["metres"])
        self.success = env.unwrapped.judge().success
        self.trace = agent.trace


def runs(name: str, instructions: list[Instruction] = SAMPLE, **options: Any) -> list[Run]:
    env = gym.make("Gavel-MultiTask-v0", terminate_on_success=False, observation="symbolic")
    agent = gavel_agents.make(name, understanding="reference", planner="reference:multi", **options)
    assert isinstance(agent, PlanningAgent)
    return [Run(env, agent, instruction) for instruction in instructions]


@pytest.fixture(scope="module")
def plus() -> list[Run]:
    return runs("gavel-plus")


def test_it_succeeds_and_drives_less_than_full(plus: list[Run]) -> None:
    full = runs("gavel-full")
    assert all(run.success for run in plus)
    assert all(run.success for run in full)
    assert sum(run.metres for run in plus) < 0.97 * sum(run.metres for run in full)


def test_only_searches_come_back_and_every_task_is_done_once(plus: list[Run]) -> None:
    early = 0
    for run, instruction in zip(plus, SAMPLE, strict=True):
        assert sorted(run.trace.order) == list(range(len(instruction.tasks)))
        for action, reached in zip(run.sent, run.reached, strict=True):
            if action.primitive is Primitive.NAVIGATE_TO and reached is None:
                early += 1
                assert action.return_when is not None
                assert action.return_when.room_done
            if action.return_when is None:
                assert (reached is not None) == (action.primitive is Primitive.NAVIGATE_TO)
    assert early > len(plus) / 2


def test_a_task_that_has_changed_the_world_is_finished_before_another_begins(plus: list[Run]) -> None:
    switched = 0
    for run in plus:
        for at, (task, following) in enumerate(itertools.pairwise(run.tasks), start=1):
            if task != following and task in run.tasks[at:]:
                switched += 1
                steps = [action.primitive for action, of in zip(run.sent[:at], run.tasks, strict=False) if of == task]
                assert set(steps) == {Primitive.NAVIGATE_TO}
    assert switched > 0  # some searches were given up for another task


def test_once_the_world_has_changed_a_search_comes_back_for_no_other_task(plus: list[Run]) -> None:
    committed = False
    for run in plus:
        last = None
        for action, task in zip(run.sent, run.tasks, strict=True):
            committed = committed and task == last
            last = task
            if action.return_when is not None and committed:
                assert action.return_when.seen == ()
            committed = committed or action.primitive is not Primitive.NAVIGATE_TO


@pytest.mark.parametrize("cost", COSTS)
def test_every_method_that_orders_takes_every_cost(cost: str) -> None:
    for name in ("gavel-map", "gavel-static", "gavel-full"):
        [run] = runs(name, SAMPLE[1:2], cost=cost)
        assert run.success
        assert run.trace.expected_m is not None


def test_costs_that_make_no_sense_are_refused() -> None:
    with pytest.raises(BadOption, match="'paper', 'carried', 'simulated'"):
        gavel_agents.make("gavel-full", understanding="rules", cost="cheap")
    with pytest.raises(BadOption, match="simulated worlds"):
        gavel_agents.make("gavel-plus", understanding="rules", cost="paper")


_ORDERS = """
import sys
sys.path.insert(0, "tests")
from agents.test_gavel_plus import SAMPLE, runs
for run in runs("gavel-plus", SAMPLE[:4]):
    print(run.trace.order, run.metres, run.trace.expected_m)
"""


def test_the_same_in_another_process_with_another_hash_seed() -> None:
    def output(seed: str) -> str:
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", _ORDERS], capture_output=True, text=True, check=True, env=environment
        )
        return done.stdout

    first = output("1")
    assert first == output("2")
    assert len(first.splitlines()) == 4
