"""Record and replay: exact, mergeable, killed at any moment, and in step with the prompts of the code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import gymnasium as gym
import pytest

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from eval.records.sampling import sample
from gavel_agents.llm import Completion, Message, Prompt
from gavel_agents.llm.replay import (
    NotRecorded,
    RecordingModel,
    ReplayModel,
    compact,
    completion_key,
    read_recording,
    shipped_recordings,
)
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.errors import DataError
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import read_instructions, shipped


class Echo:
    """Answers with the last turn, and counts how often it is asked."""

    name = "echo"

    def __init__(self, temperature: float = 0.0) -> None:
        self.decoding = {"temperature": temperature}
        self.asked = 0

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.asked += len(prompts)
        return [Completion(prompt.messages[-1].content.upper(), 7, 3, 0.5) for prompt in prompts]


def prompt(text: str, attempt: int = 0) -> Prompt:
    return Prompt((Message("system", "be brief"), Message("user", text)), About(text), attempt)


def test_what_was_said_once_is_replayed_exactly_without_asking_again(tmp_path: Path) -> None:
    path = tmp_path / "echo.jsonl.gz"
    model = Echo()
    recording = RecordingModel(model, path)
    first = recording.complete([prompt("a"), prompt("b")])
    assert recording.complete([prompt("b"), prompt("a")]) == first[::-1]
    assert model.asked == 2
    recording.close()
    assert RecordingModel(model, path).complete([prompt("a")]) == first[:1]
    assert model.asked == 2
    replay = ReplayModel(str(path))
    assert replay.complete([prompt("a"), prompt("b")]) == first
    assert (replay.name, replay.decoding) == ("echo", {"temperature": 0.0})


def test_a_prompt_that_was_not_recorded_is_named_with_the_way_to_record_it(tmp_path: Path) -> None:
    path = tmp_path / "echo.jsonl.gz"
    RecordingModel(Echo(), path).complete([prompt("a")])
    with pytest.raises(NotRecorded, match=r"attempt 2 of instruction 'c'.*gavel record"):
        ReplayModel(str(path)).complete([prompt("c", 2)])


def test_the_key_tells_model_decoding_and_every_turn_apart() -> None:
    base = prompt("a").messages
    keys = {
        completion_key("m", {"t": 0.0}, base),
        completion_key("n", {"t": 0.0}, base),
        completion_key("m", {"t": 0.1}, base),
        completion_key("m", {"t": 0.0}, base[1:]),
        completion_key("m", {"t": 0.0}, (*base, Message("assistant", ""))),
    }
    assert len(keys) == 5
    assert completion_key("m", {"t": 0.0, "s": 1}, base) == completion_key("m", {"s": 1, "t": 0.0}, base)


def test_recordings_merge_by_concatenation_and_compact_in_a_fixed_order(tmp_path: Path) -> None:
    one, other = tmp_path / "one.jsonl.gz", tmp_path / "other.jsonl.gz"
    RecordingModel(Echo(), one).complete([prompt("b"), prompt("a")])
    RecordingModel(Echo(), other).complete([prompt("c"), prompt("a")])
    merged, reverse = tmp_path / "merged.jsonl.gz", tmp_path / "reverse.jsonl.gz"
    merged.write_bytes(one.read_bytes() + other.read_bytes())
    reverse.write_bytes(other.read_bytes() + one.read_bytes())
    assert compact(merged) == compact(reverse) == 3
    assert merged.read_bytes() == reverse.read_bytes()
    assert [r.text for r in read_recording(merged)] == ["A", "B", "C"]


def test_a_recording_of_two_models_and_one_that_is_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mixed.jsonl.gz"
    RecordingModel(Echo(), path).complete([prompt("a")])
    RecordingModel(Echo(0.7), path).complete([prompt("a")])
    with pytest.raises(DataError, match="one model"):
        ReplayModel(str(path))
    path.write_bytes(b"not gzip at all")
    with pytest.raises(DataError, match="not gzip"):
        ReplayModel(str(path))
    with pytest.raises(DataError, match="no recording 'nowhere'"):
        ReplayModel("nowhere")


@pytest.mark.parametrize("name", sorted(shipped_recordings()))
def test_shipped_recordings_answer_every_prompt_of_the_code(name: str) -> None:
    recording = shipped_recordings()[name]
    instructions = read_instructions(shipped(recording.instructions))
    model = ReplayModel(name)
    assert model.name == recording.model
    understanding = ReferenceUnderstanding(instructions.values())
    env = gym.make("Gavel-MultiTask-v0", instructions=instructions, observation="symbolic")
    for agent in recording.agents:
        planner = gavel_agents.make(agent, understanding=understanding, model=model)
        for instruction_id in sample(instructions, recording.sample):
            planner.reset(*env.reset(seed=0, options={"instruction": instruction_id}))
            assert planner.trace.attempts >= 1  # type: ignore[attr-defined]
