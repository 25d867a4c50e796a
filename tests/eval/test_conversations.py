"""What models were asked and answered is kept once, led to by records, mergeable, and without secrets."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.records.conversations import ConversationWriter, Exchange, read_conversations
from eval.records.journal import read_records
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import run, schedule
from gavel_agents.llm import Completion, Message
from gavel_env.appended import read_members
from gavel_env.instructions.record import InstructionSet, read_instructions, shipped

RULES = Message("system", "Plan. " * 200)


def exchange(question: str, answer: str = "GRASP mug", seed: int = 0) -> Exchange:
    decoding: dict[str, str | float | int] = {"temperature": 0.7, "seed": seed}
    return Exchange("m", decoding, (RULES, Message("user", question)), Completion(answer, 10, 3, 0.5))


def write(path: Path, *exchanges: Exchange) -> list[str]:
    with ConversationWriter(path) as writer:
        return [call for one in exchanges for call in writer.add([one])]


def test_a_call_leads_to_what_was_asked_and_answered(tmp_path: Path) -> None:
    path = tmp_path / "conversations.jsonl.gz"
    [first, again, other] = write(path, exchange("a"), exchange("a"), exchange("a", seed=1))
    assert first == again != other
    call = read_conversations([tmp_path]).get(first)
    assert call is not None
    assert call.messages == (RULES, Message("user", "a"))
    assert call.completion == Completion("GRASP mug", 10, 3, 0.5)
    assert call.decoding == {"temperature": 0.7, "seed": 0}
    assert read_conversations([tmp_path]).get("0" * 32) is None


@pytest.mark.parametrize("reason", ["", "stop", "length", "filter"])
def test_how_an_answer_ended_is_kept(tmp_path: Path, reason: str) -> None:
    asked = exchange("a")
    completion = msgspec.structs.replace(asked.completion, finish_reason=reason)
    [key] = write(tmp_path / "conversations.jsonl.gz", msgspec.structs.replace(asked, completion=completion))
    found = read_conversations([tmp_path])
    call = found.get(key)
    assert call is not None
    assert (call.completion.finish_reason, call.completion.cut) == (reason, reason in ("length", "filter"))
    assert not found.changed()


def test_every_text_is_written_once_also_when_a_run_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "conversations.jsonl.gz"
    write(path, exchange("a"), exchange("b"))
    size = path.stat().st_size
    write(path, exchange("a"), exchange("b"))
    assert path.stat().st_size == size
    write(path, exchange("c"))
    lines = [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]
    assert sum(line["kind"] == "text" and line["text"] == RULES.content for line in lines) == 1
    assert len({line["id"] for line in lines}) == len(lines)


def test_two_files_merge_by_concatenation(tmp_path: Path) -> None:
    one, two, both = (tmp_path / f"{name}.jsonl.gz" for name in ("one", "two", "both"))
    calls = write(one, exchange("a"), exchange("b")) + write(two, exchange("b"), exchange("c"))
    both.write_bytes(one.read_bytes() + two.read_bytes())
    found = read_conversations([both])
    assert len(found) == 3
    assert all(call in found for call in calls)
    assert not found.changed()


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(1, 400), junk=st.binary(max_size=20))
def test_a_torn_end_costs_the_last_call_alone(tmp_path_factory: pytest.TempPathFactory, cut: int, junk: bytes) -> None:
    path = tmp_path_factory.mktemp("torn") / "conversations.jsonl.gz"
    calls = write(path, exchange("a"), exchange("b"), exchange("c"))
    *_, last = read_members(path)
    path.write_bytes(path.read_bytes()[: last.end - min(cut, last.end - last.start)] + junk)
    found = read_conversations([path])
    assert [call in found for call in calls] == [True, True, False]
    assert found.damaged or path.stat().st_size == last.start
    assert write(path, exchange("c")) == calls[2:]
    assert all(call in read_conversations([path]) for call in calls)


def test_damage_in_the_middle_costs_one_member_and_is_said(tmp_path: Path) -> None:
    path = tmp_path / "conversations.jsonl.gz"
    calls = write(path, exchange("a"), exchange("b"), exchange("c"))
    _, second, _ = read_members(path)
    content = bytearray(path.read_bytes())
    content[(second.start + second.end) // 2] ^= 0xFF
    path.write_bytes(content)
    found = read_conversations([path])
    assert calls[0] in found
    assert found.get(calls[1]) is None
    assert calls[2] in found
    assert found.damaged


def test_a_small_file_that_unpacks_to_much_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gavel_env.appended.MEMBER_BYTES", 1 << 20)
    path = tmp_path / "conversations.jsonl.gz"
    small, large = gzip.compress(b"0" * (1 << 20)), gzip.compress(b"0" * (4 << 20))
    path.write_bytes(small + large + small)
    assert [(m.start, len(m.content)) for m in read_members(path)] == [(0, 1 << 20), (len(small + large), 1 << 20)]


def test_secrets_are_out_before_anything_is_hashed_or_encoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", 'abc"def\\ghi')
    monkeypatch.setenv("SESSION_TOKEN", "messages")
    path = tmp_path / "conversations.jsonl.gz"
    [call] = write(path, exchange('my key is abc"def\\ghi', 'yes, abc"def\\ghi'))
    found = read_conversations([path])
    assert not found.changed()
    stored = found.get(call)
    assert stored is not None
    assert stored.messages[1].content == "my key is [OPENAI_API_KEY]"
    assert stored.completion.text == "yes, [OPENAI_API_KEY]"


@pytest.fixture(scope="module")
def few() -> InstructionSet:
    records = list(read_instructions(shipped("single")).values())[:3]
    return InstructionSet(records, (), "a stamp", "three.jsonl")


def test_records_of_a_run_lead_to_their_calls_and_methods_share_them(few: InstructionSet, tmp_path: Path) -> None:
    settings_ = EnvironmentSettings()
    agents = ["llm-only", "sayplan", "gavel-full", "epog"]
    contestants = choose(agents, settings_, planners=["simulated:qwen3-4b"])
    path = run(schedule(contestants, [few], (0, 1), settings=settings_), tmp_path)
    records = read_records([path]).records.values()
    found = read_conversations([tmp_path])
    assert not found.damaged
    for record in records:
        assert len(record.calls) == record.trace.attempts
        assert not record.trace.completions
        calls = [found.get(call) for call in record.calls]
        for call in calls:
            assert call is not None
            assert record.text in call.messages[-1].content or len(call.messages) > 8
            assert call.decoding["seed"] == record.seed
    first = {(r.instruction, r.seed): set[str]() for r in records}
    for record in records:
        if record.contestant.planner:
            first[record.instruction, record.seed].add(record.calls[0])
    assert all(len(calls) == 1 for calls in first.values())


def test_setting_records_aside_sets_their_conversations_aside(few: InstructionSet, tmp_path: Path) -> None:
    settings_ = EnvironmentSettings()
    plan = schedule(choose(["llm-only"], settings_, planners=["reference:single"]), [few], settings=settings_)
    run(plan, tmp_path)
    before = (tmp_path / "conversations.jsonl.gz").read_bytes()
    run(plan, tmp_path, existing="fresh")
    assert (tmp_path / "conversations.1.jsonl.gz").read_bytes() == before
    assert read_conversations([tmp_path / "records.1.jsonl"]).get(
        next(iter(read_records([tmp_path / "records.1.jsonl"]).records.values())).calls[0]
    )
