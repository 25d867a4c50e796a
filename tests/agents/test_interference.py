"""Tasks that get in each other's way: the next-cheapest ordering that validates is taken (Alg. 1, lines 22-26)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
from support.houses import unwrapped

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm import load_model
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import Instruction, parse_instruction

OPEN = {
    "text": "Open the bottom cabinet in the bedroom.",
    "goal": ["open(bottom_cabinet@bedroom)"],
    "reference_plan": ["NAVIGATE_TO(bottom_cabinet@bedroom)", "OPEN(bottom_cabinet@bedroom)"],
}
PUT_AWAY = {
    "text": "Put the apple in the bottom cabinet in the bedroom.",
    "goal": ["inside(apple, bottom_cabinet@bedroom)"],
    "reference_plan": [
        "NAVIGATE_TO(apple)",
        "GRASP(apple)",
        "NAVIGATE_TO(bottom_cabinet@bedroom)",
        "OPEN(bottom_cabinet@bedroom)",
        "PLACE_INSIDE(bottom_cabinet@bedroom)",
        "CLOSE(bottom_cabinet@bedroom)",
    ],
}


def instruction(tasks: list[dict[str, Any]]) -> Instruction:
    record = {
        "id": "both",
        "scene": "Rs_int",
        "kind": "multi",
        "text": " ".join(task["text"] for task in tasks),
        "placements": [{"category": "apple", "relation": "on", "target": "sofa"}],
        "tasks": tasks,
    }
    return parse_instruction(record, "test")


def run(method: str, record: Instruction, tmp_path: Path) -> tuple[bool, list[int]]:
    file = tmp_path / "both.jsonl"
    lines = [f"Task {n}:\n" + "\n".join(task.reference_plan) for n, task in enumerate(record.tasks, start=1)]
    file.write_text(json.dumps({"instruction": record.text, "completions": ["\n".join(lines)]}))
    model = load_model(f"scripted:{file}")
    env = gym.make("Gavel-MultiTask-v0", instructions=[record], terminate_on_success=False, observation="symbolic")
    agent: Any = gavel_agents.make(method, understanding=ReferenceUnderstanding([record]), model=model)
    observation, info = env.reset(seed=0)
    agent.reset(observation, info)
    while (action := agent.act(observation, info)) is not None:
        observation, _, terminated, _, info = env.step(action)
        if terminated:
            break
    return unwrapped(env).judge().success, agent.trace.order


@pytest.mark.parametrize("method", ["gavel-map", "gavel-static", "gavel-full"])
@pytest.mark.parametrize("opening_first", [True, False])
def test_what_is_to_stay_open_is_opened_last(method: str, opening_first: bool, tmp_path: Path) -> None:
    tasks = [OPEN, PUT_AWAY] if opening_first else [PUT_AWAY, OPEN]
    success, order = run(method, instruction(tasks), tmp_path)
    assert success
    assert order == ([1, 0] if opening_first else [0, 1])


def test_in_the_order_written_the_second_task_undoes_the_first(tmp_path: Path) -> None:
    assert run("llm-only", instruction([OPEN, PUT_AWAY]), tmp_path) == (False, [0, 1])
    assert run("llm-only", instruction([PUT_AWAY, OPEN]), tmp_path) == (True, [0, 1])
