"""`gavel_agents.make`: takes specs or objects, and rejects what it does not know, with the nearest names."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest

import gavel_agents
from gavel_agents.agent import AgentTrace
from gavel_env.errors import BadOption, GavelError, UnknownOption
from gavel_env.exchange import EnvAction


class Idle:
    """Does nothing, and keeps what it was made with."""

    name = "idle-keeper"

    def __init__(self, prior: str, patience: int = 3) -> None:
        self.prior, self.patience = prior, patience
        self.trace = AgentTrace()

    def reset(self, observation: Any, info: dict[str, Any]) -> None: ...

    def act(self, observation: Any, info: dict[str, Any]) -> EnvAction | None:
        return None


gavel_agents.register("idle-keeper", Idle)


def test_defaults_alone_carry_out_a_sentence() -> None:
    instruction = {
        "id": "mine",
        "scene": "Rs_int",
        "text": "Put the apple on the breakfast table.",
        "placements": [{"category": "apple", "relation": "on", "target": "sofa_0"}],
        "tasks": [{"text": "t", "goal": ["on_top(apple, breakfast_table)"], "reference_plan": []}],
    }
    env = gym.make("Gavel-SingleTask-v0", instructions=[instruction], terminate_on_success=False)
    agent = gavel_agents.make("gavel-full")
    observation, info = env.reset(seed=0)
    agent.reset(observation, info)
    while (action := agent.act(observation, info)) is not None:
        observation, _, _, _, info = env.step(action)
    world: Any = env.unwrapped
    assert world.judge().success


def test_specs_alone_make_an_agent_that_solves_an_instruction() -> None:
    env = gym.make("Gavel-SingleTask-v0", terminate_on_success=False)
    agent = gavel_agents.make("gavel", understanding="reference", planner="reference:single")
    observation, info = env.reset(seed=0)
    agent.reset(observation, info)
    while (action := agent.act(observation, info)) is not None:
        observation, _, _, _, info = env.step(action)
    world: Any = env.unwrapped
    assert world.judge().success


@pytest.mark.parametrize("name", ["gavel-full", "epog", "oracle", "idle-keeper"])
def test_options_that_nothing_takes_are_rejected_with_the_nearest(name: str) -> None:
    with pytest.raises(UnknownOption, match=r"'priorr'.*did you mean 'prior'"):
        gavel_agents.make(name, priorr="choice")


def test_factories_get_the_options_that_they_name() -> None:
    agent: Any = gavel_agents.make("idle-keeper", prior="uniform", patience=7)
    assert (agent.prior, agent.patience) == ("uniform", 7)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"on_surprise": "nxt"}, "'nxt'; known: 'stop', 'next'"),
        ({"profile": "papr"}, "'papr'; known: 'paper', 'omnigibson'"),
        ({"prior": "chioce"}, "unknown prior 'chioce'"),
        ({"understanding": "rulez"}, "unknown understanding 'rulez'"),
        ({"understanding": None}, "needs an understanding"),
    ],
)
def test_values_that_cannot_be_are_rejected(options: dict[str, Any], said: str) -> None:
    with pytest.raises(GavelError, match=said):
        gavel_agents.make("epog", **options)


def test_a_method_that_asks_a_model_needs_one() -> None:
    with pytest.raises(BadOption, match="'llm-only' asks a language model"):
        gavel_agents.make("llm-only", planner=None)
