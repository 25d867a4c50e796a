"""What hosted models share: retries with backoff, keys from the environment alone, errors that never show a key."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, Protocol, runtime_checkable

from gavel_agents.llm.deadline import TooSlow, within
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Message, Prompt
from gavel_env.errors import EndpointError, ModelError

__all__ = [
    "CHECK",
    "Checked",
    "Endpoint",
    "EndpointError",
    "MalformedAnswer",
    "ModelError",
    "Retries",
    "complete_all",
    "endpoint_of",
    "key_of",
    "retried",
]

_CONCURRENT = 8

CHECK = Prompt((Message("user", "Answer with the word yes."),))
"""What a server is asked to see whether it answers."""


@runtime_checkable
class Checked(Protocol):
    """A model that can be tried out before a long run."""

    def check(self) -> None:
        """Ask for one short completion.

        Raises:
            ModelError: it does not come.
        """


class MalformedAnswer(Exception):
    """A server's answer without a completion in it; asked for again."""


class Endpoint(NamedTuple):
    """Which model where.

    Attributes:
        model: its name at the server.
        base_url: of the server, or None for the service's own.
    """

    model: str
    base_url: str | None

    @property
    def label(self) -> str:
        """Name for records: without the address, which says nothing about the model."""
        return self.model


class Retries(NamedTuple):
    """How often, and how patiently, a request is made again.

    Attributes:
        attempts: requests at most.
        first_wait_s: before the second one; doubled each time.
        longest_wait_s: also of what the server asks for.
        timeout_s: of one request, in all.
    """

    attempts: int = 6
    first_wait_s: float = 1.0
    longest_wait_s: float = 60.0
    timeout_s: float = 120.0


def endpoint_of(argument: str, kind: str) -> Endpoint:
    """Read `MODEL` or `MODEL@BASE_URL`.

    Raises:
        BadPlannerSpec: no model, or a password in the address (keys come from the environment).
    """
    model, at, url = re.split(r"(@(?=https?://))", argument, maxsplit=1) if "@http" in argument else (argument, "", "")
    if not model:
        raise BadPlannerSpec(f"planner spec {kind}:… names no model; write {kind}:MODEL or {kind}:MODEL@BASE_URL")
    if at and re.match(r"https?://[^/]*@", url):
        raise BadPlannerSpec(f"planner spec {kind}:{model}@… has a password in its address; keys come from environment")
    return Endpoint(model, url.rstrip("/") or None)


def key_of(variable: str, endpoint: Endpoint, kind: str) -> str:
    """Return the key of an environment variable; a server of one's own may need none.

    Raises:
        BadPlannerSpec: the service needs one, and the variable is not set.
    """
    key = os.environ.get(variable, "").strip()
    if not key and endpoint.base_url is None:
        raise BadPlannerSpec(f"planner {kind}:{endpoint.model} needs a key: set the environment variable {variable}")
    return key or "none"


def complete_all(ask: Callable[[Prompt], Completion], prompts: Sequence[Prompt]) -> list[Completion]:
    """Return one completion per prompt, in order; several are asked for at once."""
    if len(prompts) < 2:
        return [ask(prompt) for prompt in prompts]
    with ThreadPoolExecutor(max_workers=min(_CONCURRENT, len(prompts))) as pool:
        return list(pool.map(ask, prompts))


def retried(
    request: Callable[[], Completion],
    *,
    sdk: Any,
    who: str,
    key_variable: str,
    secret: str,
    retries: Retries,
    sleep: Callable[[float], None] = time.sleep,
) -> Completion:
    """Make a request until it is answered.

    Args:
        request: one request by the SDK, whose own retries are off.
        sdk: the SDK's module, for its error classes (openai and anthropic share their names).
        who: what to call the model in errors.
        key_variable: name of the environment variable of the key.
        secret: the key, taken out of whatever a server says.
        retries: how often.
        sleep: replaced in tests.

    Raises:
        EndpointError: key or model refused, or still failing at the last attempt.
        ModelError: this request is refused.
    """
    why = ""
    for attempt in range(retries.attempts):
        wait_s = min(retries.first_wait_s * 2.0**attempt, retries.longest_wait_s)
        try:
            return within(request, retries.timeout_s)
        except TooSlow:
            why = f"no answer within {retries.timeout_s:g} s"
        except (sdk.AuthenticationError, sdk.PermissionDeniedError) as error:
            raise EndpointError(f"{who}: the key in {key_variable} was rejected (HTTP {error.status_code})") from None
        except sdk.NotFoundError as error:
            raise EndpointError(f"{who}: no such model or address: {_said(error, secret)}") from None
        except sdk.APIStatusError as error:
            why = f"HTTP {error.status_code}: {_said(error, secret)}"
            if error.status_code not in (408, 409, 425, 429) and error.status_code < 500:
                raise ModelError(f"{who}: {why}") from None
            wait_s = min(_asked_wait_s(error) or wait_s, retries.longest_wait_s)
        except sdk.APITimeoutError:
            why = f"no answer within {retries.timeout_s:g} s"
        except sdk.APIConnectionError as error:
            why = _clean(f"no connection: {error.__cause__ or error}", secret)
        except (MalformedAnswer, sdk.APIResponseValidationError, ValueError) as error:
            why = _clean(f"not a completion: {error}", secret)
        if attempt + 1 < retries.attempts:
            sleep(wait_s)
    raise EndpointError(f"{who}: {why} (tried {retries.attempts} times)")


def _asked_wait_s(error: Any) -> float | None:
    """Return the seconds of a Retry-After header."""
    text = error.response.headers.get("retry-after", "")
    return float(text) if re.fullmatch(r"\d+(\.\d+)?", text) else None


def _said(error: Any, secret: str) -> str:
    """Return the server's own words, short and without the key."""
    body = error.body if isinstance(error.body, dict) else {}
    inner = body.get("error", body)
    text = inner.get("message", "") if isinstance(inner, dict) else inner
    return _clean(str(text or error.message), secret)


def _clean(text: str, secret: str) -> str:
    if len(secret) >= 6:
        text = text.replace(secret, "[key]")
    text = re.sub(r"\b(?:sk|key)-[\w-]{6,}", "[key]", text)
    text = re.sub(r"(?i)\bbearer\s+\S+", "Bearer [key]", text)
    return " ".join(text.split())[:300]
