"""Seeds and temperatures reach the model, and matter only where something is sampled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from support.faulty_server import faulty_server

import gavel_agents
from gavel_agents.llm import BadPlannerSpec, Completion, Message, Prompt, load_model
from gavel_agents.llm.interface import decoding_of
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.llm.replay import RecordingModel, ReplayModel
from gavel_agents.llm.simulated import SimulatedModel
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import read_instructions, shipped

SINGLE = read_instructions(shipped("single"))
ASKED = (Message("user", "plan"),)


def test_a_seed_is_part_of_a_call_only_where_it_matters() -> None:
    assert decoding_of({"temperature": 0.0}, Prompt(ASKED, seed=3)) == {"temperature": 0.0}
    assert decoding_of({"temperature": 0.7}, Prompt(ASKED, seed=3)) == {"temperature": 0.7, "seed": 3}
    assert decoding_of({"temperature": 0.7}, Prompt(ASKED, seed=3, temperature=0.0)) == {"temperature": 0.0}
    assert decoding_of({"max_tokens": 9}, Prompt(ASKED, seed=3, temperature=0.5)) == {"max_tokens": 9, "seed": 3}


def test_a_server_is_sent_seed_and_temperature() -> None:
    with faulty_server() as server:
        model = load_model(f"openai:m@{server.url}?temperature=0.7")
        model.complete([Prompt(ASKED, seed=4)])
        model.complete([Prompt(ASKED, seed=4, temperature=0.0)])
    assert [(body["temperature"], body.get("seed")) for body in server.asked] == [(0.7, 4), (0.0, None)]
    assert model.decoding["temperature"] == 0.7


def test_a_server_is_asked_not_to_think() -> None:
    with faulty_server() as server:
        model = load_model(f"openai:m@{server.url}?thinking=off&max_tokens=77")
        model.complete([Prompt(ASKED), Prompt((Message("user", "<think>hm</think>GRASP mug"),))])
    assert server.asked[0]["chat_template_kwargs"] == {"enable_thinking": False}
    assert server.asked[0]["max_tokens"] == 77
    assert model.decoding["thinking"] == "off"


@pytest.mark.parametrize("value", ["-1", "hot", "nan", ""])
def test_a_temperature_is_a_number(value: str) -> None:
    with pytest.raises(BadPlannerSpec, match="temperature is"):
        load_model(f"openai:m@http://127.0.0.1:9/v1?temperature={value}")


def test_simulated_seeds_vary_and_repeat() -> None:
    def texts(seed: int | None, spec: str = "qwen3-8b") -> list[str]:
        model = SimulatedModel(spec, SINGLE.values())
        return [c.text for c in model.complete([Prompt((), About(one.text), seed=seed) for one in SINGLE.values()])]

    assert texts(0) == texts(None)
    assert texts(1) == texts(1) == texts(0, "qwen3-8b?seed=1")
    plans = [texts(seed) for seed in range(5)]
    right = [
        c.text for c in ReferencePlans("single").complete([Prompt((), About(one.text)) for one in SINGLE.values()])
    ]
    solved = [[text == good for text, good in zip(answers, right, strict=True)] for answers in plans]
    assert all(np.mean([a != b for a, b in zip(solved[0], other, strict=True)]) > 0 for other in solved[1:])


class Sampling:
    """Answers with the seed that it is given."""

    def __init__(self, temperature: float) -> None:
        self.name, self.decoding = "sampling", {"temperature": temperature}
        self.calls = 0

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.calls += len(prompts)
        return [Completion(str(decoding_of(self.decoding, prompt).get("seed"))) for prompt in prompts]


@pytest.mark.parametrize(("temperature", "answers", "calls"), [(0.7, ["1", "2"], 2), (0.0, ["None", "None"], 1)])
def test_recordings_tell_seeds_apart_where_they_matter(
    tmp_path: Path, temperature: float, answers: list[str], calls: int
) -> None:
    model = Sampling(temperature)
    recording = RecordingModel(model, tmp_path / "r.jsonl.gz")
    for seed in (1, 2):
        recording.complete([Prompt(ASKED, seed=seed)])
    replay = ReplayModel(str(tmp_path / "r.jsonl.gz"))
    assert [replay.complete([Prompt(ASKED, seed=seed)])[0].text for seed in (1, 2)] == answers
    assert model.calls == calls


class Learning:
    """Answers badly first and well after a complaint; remembers its seeds."""

    name, decoding = "learning", {"temperature": 0.5}

    def __init__(self) -> None:
        self.seeds: list[int | None] = []

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.seeds += [prompt.seed for prompt in prompts]
        good = ReferencePlans("single").complete(prompts)
        return [Completion("GRASP moon") if p.attempt == 0 else c for p, c in zip(prompts, good, strict=True)]


def test_every_attempt_and_its_verdicts_are_in_the_trace() -> None:
    instruction = next(iter(SINGLE.values()))
    env = gym.make("Gavel-SingleTask-v0", instructions=[instruction])
    model = Learning()
    agent = gavel_agents.make("sayplan", understanding=ReferenceUnderstanding([instruction]), model=model, seed=7)
    agent.reset(*env.reset(seed=0))
    trace = agent.trace  # type: ignore[attr-defined]
    assert model.seeds == [7, 7]
    assert len(trace.earlier) == trace.attempts - 1 == 1
    [[first]], [last] = trace.earlier, trace.tasks
    assert first.proposed_verdict == first.verdict != "valid"
    assert last.proposed_verdict == last.verdict == "valid"
    assert last.objects
