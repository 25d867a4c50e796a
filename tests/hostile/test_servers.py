"""Servers that drip, flood or send what unpacks to gigabytes: said in time and without the memory."""

from __future__ import annotations

import resource
from typing import Any

import pytest
from support.faulty_server import faulty_server

from gavel_agents.llm import Message, Prompt
from gavel_agents.llm.anthropic import AnthropicModel
from gavel_agents.llm.openai import OpenAIModel
from gavel_agents.llm.service import Retries
from gavel_env.errors import ModelError
from gavel_env.instructions.lookup import About

pytestmark = pytest.mark.hostile

KINDS: dict[str, Any] = {"openai": OpenAIModel, "anthropic": AnthropicModel}
PROMPT = Prompt((Message("user", "hello"),), About("hello"))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("fault", "says"),
    [("drip", "no answer within 1 s"), ("bomb", "than 65536 bytes"), ("flood", "than 16777216 bytes")],
)
def test_a_server_that_never_ends_is_given_up(
    kind: str, fault: str, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none-needed")
    monkeypatch.setenv("ANTHROPIC_API_KEY", "none-needed")
    with faulty_server(fault) as server:
        address = f"{server.url}/v1" if kind == "openai" else server.url
        retries = Retries(attempts=1, timeout_s=1.0 if fault == "drip" else 60.0)
        model = KINDS[kind](f"m@{address}", retries=retries, sleep=lambda _: None)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with pytest.raises(ModelError, match=says):
            model.complete([PROMPT])
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 150_000
