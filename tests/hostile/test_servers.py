"""Servers that drip, flood or send what unpacks to gigabytes: said in time and without the memory."""

from __future__ import annotations

import itertools
import resource
import threading
from concurrent.futures import ThreadPoolExecutor
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


AT_ONCE = 32

ANSWERED: dict[str, tuple[str, ...]] = {
    "good": ("answer", "stop"),
    "length": ("answer", "length"),
    "500": ("error", "HTTP 500"),
    "no json": ("error", "not a completion"),
    "reset": ("error", "no connection"),
    "flood": ("error", "than 16777216 bytes"),
}
ENDLESS = ("drip on", "hang")


def _result(model: Any, fault: str) -> tuple[str, str]:
    try:
        [completion] = model.complete([Prompt((Message("user", f"fault: {fault}"),))])
    except ModelError as error:
        return "error", str(error)
    return "answer", f"{completion.text} {completion.finish_reason}"


@pytest.mark.parametrize("kind", KINDS)
def test_of_many_calls_at_once_each_comes_to_its_own_end(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the others meet; and every connection is closed, by the client where the server never would.

    Those that never end have a short time, the others as long as the machine takes.
    """
    monkeypatch.setenv("OPENAI_API_KEY", "none-needed")
    monkeypatch.setenv("ANTHROPIC_API_KEY", "none-needed")
    faults = list(itertools.islice(itertools.cycle([*ANSWERED, *ENDLESS]), AT_ONCE))
    with faulty_server() as server:
        server.at_once = threading.Barrier(AT_ONCE)
        address = f"{server.url}/v1" if kind == "openai" else server.url
        patient, hasty = (
            KINDS[kind](f"m@{address}", retries=Retries(attempts=1, timeout_s=time_s)) for time_s in (600.0, 1.0)
        )
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with ThreadPoolExecutor(AT_ONCE) as pool:
            asked = [pool.submit(_result, hasty if fault in ENDLESS else patient, fault) for fault in faults]
            found = [one.result() for one in asked]
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400_000
        assert server.all_closed()
        assert len(server.asked) == AT_ONCE
    for fault, (outcome, said) in zip(faults, found, strict=True):
        expected, words = ANSWERED.get(fault, ("error", "no answer within 1 s"))
        assert (outcome, words in said) == (expected, True), (fault, said)
        assert outcome == "error" or f"echo: fault: {fault}" in said
