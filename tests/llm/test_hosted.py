"""Hosted models against a loopback server: retries, errors that say what to do, and keys that never show."""

from __future__ import annotations

import logging
import traceback
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("openai")
pytest.importorskip("anthropic")

from support.faulty_server import Faults, faulty_server

from gavel_agents.llm import BadPlannerSpec, Message, Prompt, load_model
from gavel_agents.llm.anthropic import AnthropicModel
from gavel_agents.llm.openai import OpenAIModel
from gavel_agents.llm.replay import RecordingModel, ReplayModel
from gavel_agents.llm.service import ModelError, Retries
from gavel_env.instructions.lookup import About

KEY = "sk-test-0123456789abcdef-secret"
QUICK = Retries(attempts=4, first_wait_s=1.0, timeout_s=0.4)
KINDS: dict[str, Any] = {"openai": OpenAIModel, "anthropic": AnthropicModel}
PROMPT = Prompt((Message("system", "You plan."), Message("user", "hello")), About("hello"))


@pytest.fixture(autouse=True)
def keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    for variable in ("OPENAI_BASE_URL", "ANTHROPIC_BASE_URL", "ANTHROPIC_AUTH_TOKEN"):
        monkeypatch.delenv(variable, raising=False)


@pytest.fixture(params=["openai", "anthropic"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def model_of(kind: str, server: Faults, waits: list[float] | None = None) -> Any:
    slept = waits if waits is not None else []
    address = f"{server.url}/v1" if kind == "openai" else server.url
    return KINDS[kind](f"some-model@{address}", retries=QUICK, sleep=slept.append)


def test_completion_with_tokens_and_time(kind: str) -> None:
    with faulty_server() as server:
        [completion] = model_of(kind, server).complete([PROMPT])
    assert completion.text == "echo: hello"
    assert (completion.prompt_tokens, completion.completion_tokens) == (7, 3)
    assert completion.seconds > 0
    [asked] = server.asked
    assert asked["model"] == "some-model"
    assert asked.get("temperature") == (0.0 if kind == "openai" else None)
    assert KEY in server.keys[0]
    assert ("system" in asked) == (kind == "anthropic")
    assert len(asked["messages"]) == (1 if kind == "anthropic" else 2)


@pytest.mark.parametrize(("fault", "reason"), [("good", "stop"), ("length", "length"), ("filter", "filter")])
def test_how_an_answer_ended_is_kept_also_in_a_recording(kind: str, fault: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "r.jsonl.gz"
    with faulty_server(fault) as server:
        recording = RecordingModel(model_of(kind, server), path)
        [completion] = recording.complete([PROMPT])
        recording.close()
    assert (completion.finish_reason, completion.cut) == (reason, reason != "stop")
    assert ReplayModel(str(path)).complete([PROMPT]) == [completion]


def test_many_prompts_come_back_in_order(kind: str) -> None:
    prompts = [Prompt((Message("user", f"number {i}"),)) for i in range(20)]
    with faulty_server("429", "500") as server:
        texts = [c.text for c in model_of(kind, server).complete(prompts)]
    assert texts == [f"echo: number {i}" for i in range(20)]


@pytest.mark.parametrize(
    "fault", ["429", "500", "503", "529", "slow", "cut", "nonsense", "no json", "no choices", "null"]
)
def test_a_fault_is_got_over(kind: str, fault: str) -> None:
    waits: list[float] = []
    with faulty_server(fault, fault) as server:
        [completion] = model_of(kind, server, waits).complete([PROMPT])
        assert len(server.asked) == 3
    assert completion.text == "echo: hello"
    assert waits == ([7.0, 7.0] if fault == "429" else [1.0, 2.0])


@pytest.mark.parametrize("fault", ["429", "500", "slow", "cut", "nonsense", "no json", "no choices", "null"])
def test_a_fault_that_stays_is_reported(kind: str, fault: str) -> None:
    with faulty_server(*[fault] * 9) as server:
        with pytest.raises(ModelError, match=r"some-model: .*\(tried 4 times\)"):
            model_of(kind, server).complete([PROMPT])
        assert len(server.asked) == 4


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("401", "the key in {KIND}_API_KEY was rejected"),
        ("403", "the key in {KIND}_API_KEY was rejected"),
        ("404", "no such model or address: fault 404"),
        ("400", "HTTP 400: fault 400"),
    ],
)
def test_what_will_not_get_better_is_said_at_once(kind: str, fault: str, says: str) -> None:
    with faulty_server(*[fault] * 9) as server:
        with pytest.raises(ModelError, match=says.format(KIND=kind.upper())):
            model_of(kind, server).complete([PROMPT])
        assert len(server.asked) == 1


def test_nobody_listening_is_said() -> None:
    with pytest.raises(ModelError, match="no connection"):
        OpenAIModel("m@http://127.0.0.1:9/v1", retries=QUICK, sleep=lambda _: None).complete([PROMPT])


@pytest.mark.parametrize("fault", ["401", "403", "404", "400", "429", "500", "nonsense", "slow", "good"])
def test_the_key_never_shows(kind: str, fault: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    with faulty_server(*[fault] * 9) as server:
        model = model_of(kind, server)
        shown = ""
        try:
            shown = repr(model.complete([PROMPT]))
        except ModelError as error:
            shown = "".join(traceback.format_exception(error))
        assert any(KEY in key for key in server.keys)
    seen = [shown, caplog.text, repr(model), str(model), repr(vars(model)), model.name, repr(model.decoding)]
    assert all(KEY not in text for text in seen)


def test_spec_errors(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadPlannerSpec, match=f"{kind}:MODEL"):
        load_model(f"{kind}:@http://127.0.0.1:9/v1")
    with pytest.raises(BadPlannerSpec, match="password in its address") as caught:
        load_model(f"{kind}:m@https://me:hunter22@example.org/v1")
    assert "hunter22" not in str(caught.value)
    monkeypatch.delenv(f"{kind.upper()}_API_KEY")
    with pytest.raises(BadPlannerSpec, match=f"set the environment variable {kind.upper()}_API_KEY"):
        load_model(f"{kind}:m")
    assert load_model(f"{kind}:m@http://127.0.0.1:9/v1").name == "m"


def test_reasoning_models_get_no_temperature() -> None:
    assert dict(load_model("openai:o3").decoding) == {"max_completion_tokens": 400}
    assert load_model("openai:gpt-4.1").decoding["temperature"] == 0.0
    assert dict(load_model("openai:o3@http://127.0.0.1:9/v1").decoding) == {"max_tokens": 400, "temperature": 0.0}
