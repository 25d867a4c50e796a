"""Recording by many threads: batches form, nothing depends on them, and the evaluation asks what was recorded."""

from __future__ import annotations

import gzip
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import pytest

import eval.studies.recording
from eval.cli import main
from eval.records.journal import read_records
from eval.records.schema import EpisodeRecord
from eval.run.contestants import choose
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import run, schedule
from eval.studies.recording import Asked, record, recorder
from gavel_agents.llm import ChatModel, Completion, Prompt, load_model
from gavel_agents.llm.batching import BatchingModel
from gavel_agents.llm.deadline import DeadlineModel
from gavel_agents.llm.replay import RecordingModel, compact
from gavel_agents.llm.service import ModelError
from gavel_agents.understanding import load_understanding
from gavel_env.errors import DataError
from gavel_env.instructions.record import Instruction, InstructionSet, read_instructions, shipped
from gavel_env.world_model.dynamics import Profile

SIMULATED = "simulated:qwen3-8b?seed=3"
AGENTS = ("llm-only", "sayplan", "gavel-full")
FOREVER_S = 600.0


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> InstructionSet:
    """Six certified tasks in a file; the simulated planner needs a second try for at least one."""
    chosen = list(read_instructions(shipped("single")).values())[:6]
    path = tmp_path_factory.mktemp("few") / "few.jsonl"
    path.write_bytes(b"".join(msgspec.json.encode(r) + b"\n" for r in chosen))
    return read_instructions(path)


class Counted:
    """A simulated planner that takes half a second by its own account, and notes how much it is asked at a time."""

    def __init__(self, refuse: Callable[[Prompt], None] = lambda prompt: None) -> None:
        self._model = load_model(SIMULATED)
        self._refuse = refuse
        self._writing = threading.Lock()
        self.name, self.decoding = self._model.name, self._model.decoding
        self.sizes: list[int] = []
        self.asked: list[str] = []

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        with self._writing:
            self.sizes.append(len(prompts))
            self.asked += [prompt.about.text for prompt in prompts]
        for prompt in prompts:
            self._refuse(prompt)
        answers = self._model.complete(prompts)
        return [Completion(answer.text, len(answer.text), 7, 0.5) for answer in answers]


def recorded(
    model: ChatModel, few: InstructionSet, path: Path, agents: Sequence[str] = AGENTS, threads: int = 2, **more: Any
) -> list[Asked]:
    instructions: dict[str, Instruction] = dict(few)
    understanding = load_understanding("reference", instructions.values())
    options: dict[str, Any] = {"understanding": understanding, "threads": threads} | more
    return list(record(RecordingModel(model, path), agents, instructions, **options))


def test_as_many_prompts_as_threads_reach_the_model_together(few: InstructionSet, tmp_path: Path) -> None:
    for threads in (1, 2, 3, 6):
        inner = Counted()
        batching = BatchingModel(inner, threads, FOREVER_S)
        asked = recorded(batching, few, tmp_path / f"{threads}.jsonl.gz", ("llm-only",), threads)
        assert inner.sizes == [threads] * (6 // threads)
        assert sorted(one.instruction_id for one in asked) == sorted(few)


def test_a_recording_does_not_depend_on_batches(few: InstructionSet, tmp_path: Path) -> None:
    alone, together = tmp_path / "alone.jsonl.gz", tmp_path / "together.jsonl.gz"
    one = recorded(Counted(), few, alone, threads=1)
    batched = Counted()
    other = recorded(BatchingModel(batched, 4, 0.0), few, together, threads=4)
    assert sorted(one) == sorted(other)
    assert max(asked.attempts for asked in one) > 1
    assert compact(alone) == compact(together) == len(batched.asked)
    assert gzip.decompress(alone.read_bytes()) == gzip.decompress(together.read_bytes())


def test_only_planners_that_gain_by_it_are_asked_in_batches(
    few: InstructionSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models: dict[str, Counted] = {}
    monkeypatch.setattr(eval.studies.recording, "load_model", lambda spec: models.setdefault(spec, Counted()))
    monkeypatch.setattr(
        eval.studies.recording, "BatchingModel", lambda model, size: BatchingModel(model, size, FOREVER_S)
    )
    for planner in ("hf:some/model?batch=3", "openai:some-model"):
        model = recorder(planner, tmp_path / f"{planner[:2]}.jsonl.gz", 3)
        understanding = load_understanding("reference", few.values())
        assert len(list(record(model, ["llm-only"], dict(few), understanding=understanding, threads=3))) == 6
    assert models["hf:some/model?batch=3"].sizes == [3, 3]
    assert models["openai:some-model"].sizes == [1] * 6


def test_the_evaluation_replays_what_it_would_have_asked(few: InstructionSet, tmp_path: Path) -> None:
    """Records of a replay are those of the model itself, but for who answered and for seconds."""
    path = tmp_path / "recorded.jsonl.gz"
    for understanding, profile in (("reference", Profile.PAPER), ("rules", Profile.OMNIGIBSON)):
        recorded(
            load_model(SIMULATED), few, path, understanding=load_understanding(understanding, few.values()),
            profile=profile, threads=4, seeds=(0, 1),
        )  # fmt: skip
        settings = EnvironmentSettings(profile=profile.value)
        found: list[list[EpisodeRecord]] = []
        for planner in (SIMULATED, f"replay:{path}"):
            contestants = choose(AGENTS, settings, planners=[planner], understanding=understanding)
            plan = schedule(contestants, [few], (0, 1), settings=settings)
            records = run(plan, tmp_path / f"{understanding}-{planner.partition(':')[0]}")
            found.append([comparable(r) for _, r in sorted(read_records([records]).records.items(), key=in_order)])
        direct, replayed = found
        assert len(direct) == len(AGENTS) * len(few) * 2
        assert direct == replayed
        assert max(r.trace.attempts for r in direct) > 1


def in_order(item: tuple[Any, EpisodeRecord]) -> tuple[str, str, int]:
    return item[1].contestant.agent, item[1].instruction, item[1].seed


def comparable(record: EpisodeRecord) -> EpisodeRecord:
    who = msgspec.structs.replace(record.contestant, planner="", config="")
    trace = msgspec.structs.replace(record.trace, seconds={})
    return msgspec.structs.replace(record, contestant=who, trace=trace, seconds={}, finished="")


def test_after_an_error_nothing_more_is_begun(
    few: InstructionSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cancelled = threading.Event()

    class Watched(ThreadPoolExecutor):
        def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
            super().shutdown(wait=False, cancel_futures=cancel_futures)
            cancelled.set()
            super().shutdown(wait=wait)

    def refuse(prompt: Prompt) -> None:
        assert len(model.asked) == 1 or cancelled.wait(60)
        raise ModelError("the key was refused")

    monkeypatch.setattr(eval.studies.recording, "ThreadPoolExecutor", Watched)
    model = Counted(refuse)
    with pytest.raises(ModelError, match="the key was refused"):
        recorded(model, few, tmp_path / "none.jsonl.gz", threads=1)
    assert len(model.asked) <= 2


def test_an_agent_that_asks_no_model_cannot_be_recorded(few: InstructionSet, tmp_path: Path) -> None:
    for agent in ("epog", "oracle"):
        with pytest.raises(DataError, match=f"'{agent}' is not one of .* gavel-basic, .*, sayplan"):
            recorded(Counted(), few, tmp_path / "none.jsonl.gz", (agent,))


def test_the_command_records_what_the_command_replays(
    few: InstructionSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "said.jsonl.gz")
    chosen = ["--instructions", str(few.source), "--agents", "gavel-full", "--understanding", "rules"]
    assert main(["record", "--planner", SIMULATED, "--out", out, "--threads", "3", *chosen]) == 0
    assert "[6/6," in capsys.readouterr().out
    run_it = ["eval", "--planner", f"replay:{out}", "--out", str(tmp_path / "run"), "--quiet", *chosen]
    assert main(run_it) == 0
    assert {r.outcome for r in read_records([tmp_path / "run"]).records.values()} & {"error", "rejected"} == set()
    with pytest.raises(SystemExit):
        main(["record", "--planner", SIMULATED, "--out", out, "--threads", "0"])
    assert "'0' is not a whole number above 0" in capsys.readouterr().err


class Silent(Counted):
    """A model that answers once it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go = threading.Event()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        self.let_go.wait()
        return super().complete(prompts)


def test_a_call_has_its_time_in_all_and_recording_goes_on_later(
    few: InstructionSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    model = Silent()
    monkeypatch.setattr(eval.studies.recording, "load_model", lambda spec: model)
    out = str(tmp_path / "said.jsonl.gz")
    chosen = ["--instructions", str(few.source), "--agents", "llm-only", "--out", out, "--threads", "2"]
    asked = ["record", "--planner", "openai:m", *chosen]
    assert main([*asked, "--timeout", "0.05"]) == 2
    assert f"{model.name}: no answer within 0.05 s" in capsys.readouterr().err
    model.let_go.set()
    assert main([*asked, "--timeout", "600"]) == 0
    assert len(model.asked) >= len(few)


def test_what_a_model_says_and_refuses_passes_through_a_deadline(few: InstructionSet, tmp_path: Path) -> None:
    one, other = tmp_path / "one.jsonl.gz", tmp_path / "other.jsonl.gz"
    assert sorted(recorded(Counted(), few, one)) == sorted(recorded(DeadlineModel(Counted(), FOREVER_S), few, other))

    def refuse(prompt: Prompt) -> None:
        raise ModelError("the key was refused")

    with pytest.raises(ModelError, match="the key was refused"):
        recorded(DeadlineModel(Counted(refuse), FOREVER_S), few, tmp_path / "none.jsonl.gz")


@pytest.mark.parametrize("said", ["0", "-1", "nan", "inf", "soon"])
def test_a_timeout_is_a_number_above_0(tmp_path: Path, capsys: pytest.CaptureFixture[str], said: str) -> None:
    with pytest.raises(SystemExit):
        main(["record", "--planner", SIMULATED, "--out", str(tmp_path / "a.jsonl.gz"), "--timeout", said])
    assert f"{said!r} is not a number above 0" in capsys.readouterr().err
