"""Seeds and temperature of a transformers model through a whole evaluation, on a tiny random one."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from support.tiny_transformer import tiny_model

pytest.importorskip("torch")
pytest.importorskip("transformers")

from eval.records.conversations import Call, read_conversations
from eval.records.journal import read_records
from eval.records.schema import EpisodeRecord
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import run, schedule
from gavel_env.instructions.record import InstructionSet, read_instructions, shipped

SETTINGS = EnvironmentSettings()
SEEDS = (0, 1, 2)

# The libraries warn about each other's deprecations.
pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model whose tokens are bytes, with room for whole prompts."""
    return tiny_model(tmp_path_factory.mktemp("tiny") / "tiny-chat", context=16_384)


@pytest.fixture(scope="module")
def two() -> InstructionSet:
    return InstructionSet(list(read_instructions(shipped("single")).values())[:2], (), "a stamp", "two.jsonl")


def evaluated(planner: str, two: InstructionSet, out: Path, connections: int) -> dict[object, EpisodeRecord]:
    plan = schedule(choose(["llm-only", "gavel-basic"], SETTINGS, planners=[planner]), [two], SEEDS)
    records = read_records([run(plan, out, connections=connections)]).records
    return {
        key: msgspec.structs.replace(
            record,
            seconds={},
            finished="",
            usage=type(record.usage)(),
            trace=msgspec.structs.replace(record.trace, seconds={}),
        )
        for key, record in records.items()
    }


def first_calls(out: Path, records: dict[object, EpisodeRecord]) -> dict[tuple[str, str, int], Call]:
    """Return the first call of every episode, by agent, instruction and seed."""
    conversations = read_conversations([out])
    calls = {(r.contestant.agent, r.instruction, r.seed): conversations.get(r.calls[0]) for r in records.values()}
    return {key: call for key, call in calls.items() if call is not None}


def test_a_seed_decides_what_is_sampled_whatever_is_asked_beside_it(
    folder: Path, two: InstructionSet, tmp_path: Path
) -> None:
    planner = f"hf:{folder}?batch=3&max_tokens=16&temperature=1.5"
    alone = evaluated(planner, two, tmp_path / "alone", 1)
    assert evaluated(planner, two, tmp_path / "beside", 4) == alone
    assert len(alone) == 2 * len(two) * len(SEEDS)
    assert not {"error", "rejected", "timeout"} & {record.outcome for record in alone.values()}
    calls = first_calls(tmp_path / "alone", alone)
    assert len(calls) == len(alone)
    for (agent, name, seed), call in calls.items():
        assert (call.decoding["temperature"], call.decoding["seed"]) == (1.5, seed)
        assert call == calls["llm-only", name, seed], f"{agent} asks the same, and shares the answer"
    for name in two:
        assert len({calls["llm-only", name, seed].completion.text for seed in SEEDS}) == len(SEEDS)


def test_a_greedy_model_is_asked_once_for_all_seeds(folder: Path, two: InstructionSet, tmp_path: Path) -> None:
    records = evaluated(f"hf:{folder}?batch=3&max_tokens=16", two, tmp_path, 4)
    assert len(read_conversations([tmp_path])) == len(two)
    calls = first_calls(tmp_path, records)
    assert len(calls) == 2 * len(two) * len(SEEDS)
    assert all(call == calls["llm-only", name, SEEDS[0]] for (_, name, _), call in calls.items())
