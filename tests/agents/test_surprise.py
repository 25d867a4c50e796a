"""What was said to be somewhere is not there: stop, or try the next piece that fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import gymnasium as gym
import pytest
from support.houses import unwrapped

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm import Completion, Prompt
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import Instruction, parse_instruction

PLAN = "NAVIGATE_TO {0}\nOPEN {0}\nGRASP apple\nCLOSE {0}\nNAVIGATE_TO sofa\nPLACE_ON_TOP sofa"


class Fixed:
    name = "fixed"

    def __init__(self, text: str) -> None:
        self.decoding: dict[str, Any] = {}
        self.text = text

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return [Completion(self.text) for _ in prompts]


def instruction(cabinet: str) -> Instruction:
    text = "Take the apple from the bottom cabinet and put it on the sofa."
    return parse_instruction(
        {
            "id": cabinet,
            "scene": "Rs_int",
            "text": text,
            "placements": [{"category": "apple", "relation": "in", "target": cabinet}],
            "tasks": [{"text": text, "goal": ["on_top(apple, sofa)"], "reference_plan": []}],
        },
        "test",
    )


def succeeded(where: str, on_surprise: Literal["stop", "next"]) -> tuple[bool, list[str]]:
    record = instruction(where)
    env = gym.make("Gavel-MultiTask-v0", instructions=[record], terminate_on_success=False, observation="symbolic")
    agent = gavel_agents.make(
        "llm-only",
        understanding=ReferenceUnderstanding([record]),
        model=Fixed(PLAN.format("bottom_cabinet")),
        on_surprise=on_surprise,
    )
    observation, info = env.reset(seed=0)
    agent.reset(observation, info)
    done: list[str] = []
    while (action := agent.act(observation, info)) is not None:
        observation, _, terminated, _, info = env.step(action)
        done.append(info["action"])
        if terminated:
            break
    return unwrapped(env).judge().success, done


CABINETS = [f"bottom_cabinet_{i}" for i in range(6)]


def test_the_first_piece_that_fits_is_opened_and_only_there_it_can_be_found() -> None:
    found = [cabinet for cabinet in CABINETS if succeeded(cabinet, "stop")[0]]
    assert len(found) == 1


@pytest.mark.parametrize("cabinet", CABINETS)
def test_the_next_pieces_are_tried_and_every_door_is_shut_again(cabinet: str) -> None:
    success, done = succeeded(cabinet, "next")
    assert success, done
    opened = [text[5:-1] for text in done if text.startswith("OPEN")]
    closed = [text[6:-1] for text in done if text.startswith("CLOSE")]
    assert opened == closed
    assert opened[-1] == cabinet
    assert len(set(opened)) == len(opened)
