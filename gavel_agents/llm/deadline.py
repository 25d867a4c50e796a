"""A total deadline for a call, whatever it is made of: retries, waits, or a model that never comes to an end."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.pool import ThreadPool
from typing import TypeVar

from gavel_agents.llm.interface import ChatModel, Completion, Prompt
from gavel_env.errors import ModelError

__all__ = ["DeadlineModel", "TooSlow", "within"]

T = TypeVar("T")


class TooSlow(Exception):
    """A call did not return in time."""


def within(call: Callable[[], T], seconds: float) -> T:
    """Make a call that has so many seconds in all.

    The timeouts of HTTP clients are of one read each, so a server that sends a byte now and then outlives them. What
    does not return in time is left to a thread that holds nothing up.

    Raises:
        TooSlow: it did not return.
    """
    pool = ThreadPool(1)
    try:
        return pool.apply_async(call).get(timeout=seconds)
    except multiprocessing.TimeoutError:
        raise TooSlow from None
    finally:
        pool.close()


class DeadlineModel:
    """Another model, each of whose calls has so many seconds in all, retries included."""

    def __init__(self, model: ChatModel, timeout_s: float) -> None:
        """Wrap a model.

        Args:
            model: what is asked; its name and decoding are kept.
            timeout_s: of one call of `complete`, seconds.
        """
        self.name = model.name
        self.decoding: Mapping[str, str | float | int] = model.decoding
        self._model, self._timeout_s = model, timeout_s

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order.

        Raises:
            ModelError: the model does not answer in time, or for a reason of its own.
        """
        try:
            return within(lambda: self._model.complete(prompts), self._timeout_s)
        except TooSlow:
            raise ModelError(f"{self.name}: no answer within {self._timeout_s:g} s") from None
