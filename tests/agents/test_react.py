"""The react baseline: one action at a time, told what came of it; refusals do not reach the environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pytest
from support.houses import INSTRUCTIONS, make, unwrapped

import gavel_agents
from eval.cli import main
from gavel_agents.llm import Completion, Prompt
from gavel_agents.react import ReActAgent
from gavel_env.errors import BadOption


class Script:
    """A chat model that answers from a list, or by a function of the last turn."""

    name = "script"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self, *answers: str | Callable[[str], str]) -> None:
        self.answers = list(answers)
        self.prompts: list[Prompt] = []

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        [prompt] = prompts
        self.prompts.append(prompt)
        answer = self.answers[min(len(self.prompts), len(self.answers)) - 1]
        text = answer if isinstance(answer, str) else answer(prompt.messages[-1].content)
        return [Completion(text, 10, 2, 0.5)]


def run(model: Script, instruction: str = "rs_apple_to_table", **options: Any) -> tuple[ReActAgent, list[str], bool]:
    env = make(on_violation="terminate", terminate_on_success=False)
    agent = gavel_agents.make("react", planner=model, **options)
    assert isinstance(agent, ReActAgent)
    observation, info = env.reset(seed=0, options={"instruction": instruction})
    agent.reset(observation, {})
    outcomes = []
    while (action := agent.act(observation, {})) is not None:
        observation, _, terminated, _, info = env.step(action)
        outcomes.append(info["outcome"])
        if terminated:
            break
    return agent, outcomes, unwrapped(env).judge().success


STEPS = (
    "Thought: I need the apple.\nAction: find apple",
    "Action: take apple_0",
    "Thought: now the table\nAction: find coffee table\nObservation: You are there.\nAction: drop",
    "**Action:** put on coffee_table_0.",
    "Thought: all is done.\nAction: done",
)


def test_it_acts_step_by_step() -> None:
    model = Script(*STEPS)
    agent, outcomes, success = run(model)
    assert success
    assert outcomes == ["ok"] * 4
    assert agent.trace.attempts == 5
    assert (agent.trace.prompt_tokens, agent.trace.completion_tokens) == (50, 10)
    assert agent.trace.seconds["plan"] == pytest.approx(2.5)
    assert [task.plan for task in agent.trace.tasks] == [
        ("NAVIGATE_TO(apple)", "GRASP(apple_0)", "NAVIGATE_TO(coffee_table)", "PLACE_ON_TOP(coffee_table_0)")
    ]
    roles = [message.role for message in model.prompts[-1].messages]
    assert roles == ["system", "user"] + ["assistant", "user"] * 4
    told = [message.content for message in model.prompts[-1].messages]
    assert INSTRUCTIONS["rs_apple_to_table"].text in told[1]
    assert "You are at apple_0" in told[3]
    assert "Possible here: take apple_0" in told[3]
    assert not any("Observation: You are there" in text for text in told)
    assert [prompt.attempt for prompt in model.prompts] == [0, 1, 2, 3, 4]


def test_what_the_world_model_refuses_is_told_and_not_sent() -> None:
    model = Script("Action: find unicorn", "Action: put on the sofa", *STEPS)
    _, outcomes, success = run(model)
    assert success
    assert outcomes == ["ok"] * 4
    assert "Nothing happens: there is no unicorn." in model.prompts[1].messages[-1].content
    assert "Nothing happens: the hand is empty." in model.prompts[2].messages[-1].content


def test_chatter_is_answered_and_the_budget_ends_it() -> None:
    model = Script("What a lovely house!")
    agent, outcomes, success = run(model, max_calls=4)
    assert (outcomes, success) == ([], False)
    assert len(model.prompts) == 4
    assert agent.trace.stopped == "gave up after 4 calls of the model"
    assert "That is no action" in model.prompts[1].messages[-1].content


def test_a_whole_plan_is_carried_out_until_something_is_refused() -> None:
    plan = "Task 1:\nNAVIGATE_TO apple\nGRASP apple\nNAVIGATE_TO coffee_table\nPLACE_ON_TOP coffee_table"
    model = Script(plan)
    agent, outcomes, success = run(model)
    assert success
    assert (outcomes, agent.trace.attempts) == (["ok"] * 4, 1)
    broken = Script(plan.replace("GRASP apple\n", "OPEN apple\n"), "Action: done")
    agent, outcomes, success = run(broken)
    assert (outcomes, success, agent.trace.attempts) == (["ok"], False, 2)
    assert "apple_0 has no door" in broken.prompts[1].messages[-1].content


def test_what_cannot_be_used_is_a_typed_error() -> None:
    with pytest.raises(BadOption, match="planner="):
        gavel_agents.make("react")
    with pytest.raises(BadOption, match="'paper', 'omnigibson'"):
        gavel_agents.make("react", planner=Script(""), profile="papier")


@pytest.mark.parametrize("planner", ["reference:single", "simulated:qwen3-8b"])
def test_it_stands_in_a_table(planner: str, capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    arguments = ["eval", "--agents", "react,llm-only", "--planner", planner, "--kind", "single", "--sample", "3"]
    assert main([*arguments, "--out", str(tmp_path), "--format", "csv"]) == 0
    header, *rows = [line.split(",") for line in capsys.readouterr().out.splitlines()]
    shares = {row[header.index("agent")]: float(row[header.index("success_pct")]) for row in rows}
    assert set(shares) == {"llm-only", "react"}
    if planner.startswith("reference"):
        assert set(shares.values()) == {100.0}
