"""Models of Anthropic's service (`anthropic:MODEL[@BASE_URL]`)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gavel_agents.llm.bounded import bounded_client
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Prompt, finish_reason
from gavel_agents.llm.service import CHECK, MalformedAnswer, Retries, complete_all, endpoint_of, key_of, retried

__all__ = ["AnthropicModel"]

_KEY = "ANTHROPIC_API_KEY"


class AnthropicModel:
    """A chat model behind the messages interface, which takes no temperature: record what must be repeatable."""

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
            argument: `MODEL` or `MODEL@BASE_URL`; the key is that of the environment variable ANTHROPIC_API_KEY.
            max_tokens: new tokens at most.
            retries: how often and how patiently requests are made again.
            sleep: replaced in tests.

        Raises:
            BadPlannerSpec: no model, no key, or the package anthropic is not installed.
        """
        endpoint = endpoint_of(argument, "anthropic")
        key = key_of(_KEY, endpoint, "anthropic")
        try:
            import anthropic
        except ImportError as error:
            raise BadPlannerSpec(
                "planner anthropic:… needs the package anthropic: pip install 'gavel-env[hosted]'"
            ) from error
        self.name = endpoint.label
        self.decoding: Mapping[str, str | float | int] = {"max_tokens": max_tokens}
        self._sdk, self._endpoint, self._sleep = anthropic, endpoint, sleep
        self._retries = retries or Retries()
        client: Any = anthropic.Anthropic(
            api_key=key,
            base_url=endpoint.base_url,
            timeout=self._retries.timeout_s,
            max_retries=0,
            http_client=bounded_client(anthropic, self._retries.timeout_s),
        )
        self._create = client.messages.create
        self._secret: Callable[[], str] = lambda: key

    def __repr__(self) -> str:
        return f"AnthropicModel({self.name!r})"

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order.

        Raises:
            ModelError: the service refuses, or still fails after all retries.
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
            who=f"anthropic:{self._endpoint.model}",
            key_variable=_KEY,
            secret=self._secret(),
            retries=retries or self._retries,
            sleep=self._sleep,
        )

    def _request(self, prompt: Prompt) -> Completion:
        start = time.perf_counter()
        system = "\n\n".join(m.content for m in prompt.messages if m.role == "system")
        turns = [{"role": m.role, "content": m.content} for m in prompt.messages if m.role != "system"]
        extra: dict[str, Any] = {"system": system} if system else {}
        answer = self._create(model=self._endpoint.model, messages=turns, **extra, **self.decoding)
        blocks = getattr(answer, "content", None)
        texts = (
            [b.text for b in blocks if isinstance(getattr(b, "text", None), str)] if isinstance(blocks, list) else []
        )
        if not texts:
            raise MalformedAnswer(f"{str(answer)[:80]!r} has no text")
        usage = getattr(answer, "usage", None)
        return Completion(
            "".join(texts),
            int(getattr(usage, "input_tokens", 0) or 0),
            int(getattr(usage, "output_tokens", 0) or 0),
            time.perf_counter() - start,
            finish_reason(getattr(answer, "stop_reason", None)),
        )
