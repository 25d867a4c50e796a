"""A real model through llama.cpp, in this process and behind a real OpenAI-compatible server on loopback.

What the model writes is its own affair; what is tested holds whatever that is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import pytest

pytest.importorskip("xllamacpp", reason="no llama.cpp: pip install 'gavel-env[llm]'")
pytest.importorskip("openai", reason="no client of servers: pip install 'gavel-env[hosted]'")

import xllamacpp
from support.prompted import first_prompts
from support.tiny_server import CONTEXT, KEY, TinyServer, on_one_thread, tiny_model

import gavel_agents
import gavel_env  # noqa: F401  (registers the environments)
from gavel_agents.llm import Message, Prompt, load_model
from gavel_agents.llm.gguf import GgufModel
from gavel_agents.llm.grammar import step_pattern
from gavel_agents.llm.openai import OpenAIModel
from gavel_agents.llm.service import ModelError
from gavel_agents.methods import METHODS
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.errors import DataError
from gavel_env.instructions.record import read_instructions, shipped

MODEL = tiny_model()
POEM = Prompt((Message("user", "Write a poem about the sea."),))
TOO_LONG = Prompt((Message("user", "wave " * CONTEXT),))
TOKEN_BUDGET = 1200
"""Tokens of a single task's first prompt at most, so that models of 4k context have room for retries."""


# --- in this process ------------------------------------------------------------------------------------------------


class Watched:
    """The server within a `GgufModel`, on one thread; keeps what it answered."""

    answers: ClassVar[list[dict[str, Any]]] = []

    def __init__(self, parameters: Any) -> None:
        self._server = _SERVER(on_one_thread(parameters))

    def handle_chat_completions(self, request: dict[str, Any]) -> Any:
        answer = self._server.handle_chat_completions(request)
        self.answers.append(json.loads(answer) if isinstance(answer, str | bytes) else answer)
        return answer


_SERVER = xllamacpp.Server


@pytest.fixture(autouse=True)
def watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xllamacpp, "Server", Watched)


@pytest.fixture(scope="module")
def model() -> GgufModel:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(xllamacpp, "Server", Watched)
        return GgufModel(str(MODEL), max_tokens=16)


def test_completions_with_tokens_and_time_in_order(model: GgufModel) -> None:
    prompts = [Prompt((Message("user", "sea " * (3 * i + 1)),)) for i in range(4)]
    completions = model.complete(prompts)
    counts = [c.prompt_tokens for c in completions]
    assert counts == sorted(set(counts))
    assert all(c.text and 0 < c.completion_tokens <= 16 and c.seconds > 0 for c in completions)
    assert model.name == MODEL.stem
    assert dict(model.decoding) == {"max_tokens": 16, "temperature": 0.0, "seed": 0}


def test_greedy_answers_repeat_in_a_model_loaded_anew() -> None:
    said = [GgufModel(str(MODEL), max_tokens=16).complete([POEM])[0].text for _ in range(2)]
    assert said[0] == said[1] != ""


def test_the_prefix_that_prompts_share_is_kept(model: GgufModel) -> None:
    rules = Message("system", "You know the names of all the seas and tell them gladly to everyone who asks. " * 4)
    [first] = model.complete([Prompt((rules, Message("user", "Which is the largest?")))])
    [second] = model.complete([Prompt((rules, Message("user", "And the smallest of them?")))])
    kept = Watched.answers[-1]["usage"]["prompt_tokens_details"]["cached_tokens"]
    assert 60 < kept < second.prompt_tokens
    assert kept > 0.8 * first.prompt_tokens


def test_constrained_answers_are_plans_whatever_is_asked() -> None:
    constrained = GgufModel(f"{MODEL}?constrained", max_tokens=64)
    assert (constrained.name, constrained.decoding["constrained"]) == (MODEL.stem, 1)
    [answer] = constrained.complete([POEM])
    parsed = parse_plans(answer.text)
    assert parsed.plan
    assert parsed.problem == ""
    # The limit of tokens may end it within its last line; the lines before are whole.
    *whole, _ = answer.text.split("\n")
    assert whole
    assert [line for line in whole if not re.search(rf"^Task [1-9]:$|{step_pattern()}", line)] == []
    assert parse_plans("\n".join(whole)).dropped == ()


SCHEMA = {
    "type": "object",
    "properties": {"room": {"enum": ["kitchen", "bedroom"]}},
    "required": ["room"],
    "additionalProperties": False,
}


def test_a_prompt_with_a_schema_is_answered_in_its_form(server: TinyServer) -> None:
    asking = Prompt(POEM.messages, schema=SCHEMA)
    for answering in (GgufModel(str(MODEL), max_tokens=96), asked(server, 96)):
        [answer] = answering.complete([asking])
        assert json.loads(answer.text)["room"] in ("kitchen", "bedroom")


def test_what_is_no_model_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no GGUF model at .*nowhere\.gguf"):
        load_model(f"gguf:{tmp_path / 'nowhere.gguf'}")
    torn = tmp_path / "torn.gguf"
    torn.write_bytes(MODEL.read_bytes()[:100_000])
    with pytest.raises(DataError, match=r"torn\.gguf cannot be loaded"):
        load_model(f"gguf:{torn}?constrained")


def test_a_prompt_longer_than_the_context_is_refused(model: GgufModel) -> None:
    with pytest.raises(DataError, match=r"rejected the prompt.*context size"):
        model.complete([TOO_LONG])


# --- behind a server ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server() -> Iterator[TinyServer]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(xllamacpp, "Server", _SERVER)
        yield TinyServer(MODEL)


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)


def asked(server: TinyServer, max_tokens: int, options: str = "") -> OpenAIModel:
    return OpenAIModel(f"smollm2@{server.url}/v1{options}", max_tokens=max_tokens)


def test_a_server_answers_and_counts(server: TinyServer) -> None:
    model = load_model(f"openai:smollm2@{server.url}/v1")
    assert isinstance(model, OpenAIModel)
    assert model.name == "smollm2"
    prompts = [Prompt((Message("user", "Say yes."),)), POEM]
    for prompt, answer in zip(prompts, asked(server, 12).complete(prompts), strict=True):
        assert answer.text
        assert answer.prompt_tokens == server.tokens(prompt.messages)
        assert 0 < answer.completion_tokens <= 12
        assert answer.seconds > 0


def test_a_constrained_server_answers_with_plans(server: TinyServer) -> None:
    shown = json.dumps({"tasks": [{"task": 1, "plan": ["NAVIGATE_TO mug", "GRASP mug"]}]})
    turns = (Message("user", "Take the mug."), Message("assistant", shown), Message("user", "Take the apple."))
    [answer] = asked(server, 200, "?constrained").complete([Prompt(turns)])
    [task] = json.loads(answer.text)["tasks"]
    assert all(re.search(step_pattern(), step) for step in task["plan"])
    parsed = parse_plans(answer.text)
    assert len(parsed.plan) == len(task["plan"]) > 0
    assert (parsed.dropped, parsed.problem) == ((), "")


def test_a_constrained_server_begins_a_plan_whatever_is_asked(server: TinyServer) -> None:
    [free] = asked(server, 24).complete([POEM])
    [held] = asked(server, 24, "?constrained").complete([POEM])
    assert not free.text.startswith("{")
    begun, form = re.sub(r"\s", "", held.text), '{"tasks":[{"task":'
    assert begun.startswith(form) or form.startswith(begun)


@pytest.mark.parametrize(
    ("path", "key", "prompt", "says"),
    [
        ("/v7", KEY, POEM, "no such model or address"),
        ("/v1", "sk-wrong-0123456789", POEM, "the key in OPENAI_API_KEY was rejected"),
        ("/v1", KEY, TOO_LONG, r"HTTP 400: .*context size"),
    ],
    ids=["path", "key", "length"],
)
def test_what_a_server_refuses_is_said_at_once(
    server: TinyServer, monkeypatch: pytest.MonkeyPatch, path: str, key: str, prompt: Prompt, says: str
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", key)

    def never(_: float) -> None:
        raise AssertionError("asked again")

    with pytest.raises(ModelError, match=says) as caught:
        OpenAIModel(f"smollm2@{server.url}{path}", sleep=never).complete([prompt])
    assert key not in str(caught.value)


# --- prompts and agents ---------------------------------------------------------------------------------------------


def test_every_single_task_keeps_to_the_token_budget(server: TinyServer) -> None:
    prompts = first_prompts("single")
    counts = {prompt.about.text: server.tokens(prompt.messages) for prompt in prompts}
    assert len(counts) == 100
    assert {name: count for name, count in counts.items() if count > TOKEN_BUDGET} == {}


def test_an_agent_plans_with_a_real_model_behind_a_server(server: TinyServer) -> None:
    name = "single-Beechwood_0_int-02"
    instructions = [read_instructions(shipped("single"))[name]]
    env: gym.Env[Any, Any] = gym.make("Gavel-SingleTask-v0", instructions=instructions, observation="symbolic")
    agent: Any = gavel_agents.make(
        "gavel-basic", understanding=ReferenceUnderstanding(instructions), model=asked(server, 48)
    )
    observation, info = env.reset(seed=0, options={"instruction": name})
    agent.reset(observation, info)
    trace = agent.trace
    assert trace.attempts == METHODS["gavel-basic"].attempts == 1
    [prompt] = first_prompts("single", [name])
    assert trace.prompt_tokens == trace.attempts * server.tokens(prompt.messages) > 1000
    assert trace.attempts <= trace.completion_tokens <= trace.attempts * 48
    assert len(trace.completions) == len(trace.prompts) == trace.attempts
    [task] = trace.tasks
    assert task.verdict
    assert len(task.proposed) == len(parse_plans(trace.completions[-1], None, 1).plan)
    steps, ended = 0, False
    while not ended and (action := agent.act(observation, info)) is not None:
        observation, _, terminated, truncated, info = env.step(action)
        steps, ended = steps + 1, terminated or truncated
    assert ended or trace.stopped or steps == len(task.plan)
