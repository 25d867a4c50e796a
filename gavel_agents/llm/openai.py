"""OpenAI-compatible servers (`openai:MODEL[@URL][?constrained&temperature=T]`): vLLM, llama.cpp, hosted services."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gavel_agents.llm.bounded import bounded_client
from gavel_agents.llm.grammar import json_schema, plan_schema
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Prompt, decoding_of, finish_reason, spec_options
from gavel_agents.llm.service import CHECK, MalformedAnswer, Retries, complete_all, endpoint_of, key_of, retried
from gavel_agents.llm.thinking import without_thinking

__all__ = ["OpenAIModel"]

_KEY = "OPENAI_API_KEY"
_REASONING = re.compile(r"(o\d|gpt-5)")


class OpenAIModel:
    """A chat model behind the chat-completions interface.

    The service's own reasoning models take no temperature; of others, decoding is greedy unless the spec has one.
    """

    def __init__(
        self,
        argument: str,
        *,
        max_tokens: int = 400,
        retries: Retries | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare a client; nothing is sent before the first prompt.

        Args:
            argument: `MODEL` or `MODEL@BASE_URL`; the key is that of the environment variable OPENAI_API_KEY. With
                `?constrained` behind it, answers are held to the JSON schema of plans; `?temperature=T` samples;
                `?max_tokens=N` replaces the argument; `?thinking=off` asks servers that render chat templates (vLLM,
                SGLang) for answers without thinking.
            max_tokens: new tokens at most.
            retries: how often and how patiently requests are made again.
            sleep: replaced in tests.

        Raises:
            BadPlannerSpec: no model, no key, or the package openai is not installed.
        """
        source, options = spec_options(
            "openai",
            argument,
            numbers=("max_tokens",),
            decimals=("temperature",),
            flags=("constrained",),
            words={"thinking": ("off",)},
        )
        max_tokens = int(options.get("max_tokens", max_tokens))
        endpoint = endpoint_of(source, "openai")
        key = key_of(_KEY, endpoint, "openai")
        try:
            import openai
        except ImportError as error:
            raise BadPlannerSpec(
                "planner openai:… needs the package openai: pip install 'gavel-env[hosted]'"
            ) from error
        self.name = endpoint.label
        limit = "max_tokens" if endpoint.base_url else "max_completion_tokens"
        decoding: dict[str, str | float | int] = {limit: max_tokens}
        if endpoint.base_url or not _REASONING.match(endpoint.model):
            decoding["temperature"] = float(options.get("temperature", 0.0))
        elif "temperature" in options:
            raise BadPlannerSpec(f"openai:{argument}: {endpoint.model} takes no temperature")
        self._format: dict[str, Any] = {}
        self._extra: dict[str, Any] = {}
        if "thinking" in options:
            decoding["thinking"] = "off"
            self._extra = {"extra_body": {"chat_template_kwargs": {"enable_thinking": False}}}
        if "constrained" in options:
            decoding["constrained"] = 1
            self._format = json_schema(plan_schema())
        self.decoding: Mapping[str, str | float | int] = decoding
        self._sdk, self._endpoint, self._sleep = openai, endpoint, sleep
        self._retries = retries or Retries()
        client: Any = openai.OpenAI(
            api_key=key,
            base_url=endpoint.base_url,
            timeout=self._retries.timeout_s,
            max_retries=0,
            http_client=bounded_client(openai, self._retries.timeout_s),
        )
        self._create = client.chat.completions.create
        self._secret: Callable[[], str] = lambda: key

    def __repr__(self) -> str:
        return f"OpenAIModel({self.name!r})"

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order.

        Raises:
            ModelError: the server refuses, or still fails after all retries.
        """
        return complete_all(self._complete_one, prompts)

    def check(self) -> None:
        """Ask for one short completion, with little patience.

        Raises:
            ModelError: it does not come.
        """
        self._complete_one(CHECK, self._retries._replace(attempts=min(2, self._retries.attempts)))

    def _complete_one(self, prompt: Prompt, retries: Retries | None = None) -> Completion:
        return retried(
            lambda: self._request(prompt),
            sdk=self._sdk,
            who=f"openai:{self._endpoint.model}",
            key_variable=_KEY,
            secret=self._secret(),
            retries=retries or self._retries,
            sleep=self._sleep,
        )

    def _request(self, prompt: Prompt) -> Completion:
        start = time.perf_counter()
        messages = [{"role": m.role, "content": m.content} for m in prompt.messages]
        held = self._format if prompt.schema is None else json_schema(prompt.schema)
        decoding = decoding_of(self.decoding, prompt)
        for ours in ("constrained", "thinking"):
            decoding.pop(ours, None)
        if "temperature" not in decoding:  # such models take no seed either: it tells calls apart, no more
            decoding.pop("seed", None)
        answer = self._create(model=self._endpoint.model, messages=messages, **decoding, **held, **self._extra)
        choices = getattr(answer, "choices", None)
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = getattr(choice, "message", None)
        text = getattr(message, "content", None)
        if not isinstance(text, str):
            raise MalformedAnswer(f"{str(answer)[:80]!r} has no message")
        usage = getattr(answer, "usage", None)
        return Completion(
            without_thinking(text),
            int(getattr(usage, "prompt_tokens", 0) or 0),
            int(getattr(usage, "completion_tokens", 0) or 0),
            time.perf_counter() - start,
            finish_reason(getattr(choice, "finish_reason", None)),
        )
