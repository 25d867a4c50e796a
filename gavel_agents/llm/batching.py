"""Prompts that several threads ask at the same time, put to a model in one call.

For backends that answer a batch in little more time than one prompt, such as a local model on a GPU. Episodes are
planned in as many threads as the batch is to have prompts; each asks one prompt and waits.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

from gavel_agents.llm.interface import ChatModel, Completion, Prompt
from gavel_agents.llm.service import ModelError

__all__ = ["BatchingModel"]


class _Call:
    """What one thread asks, and what comes of it: answers or an error."""

    def __init__(self, prompts: Sequence[Prompt]) -> None:
        self.prompts = tuple(prompts)
        self.answers: list[Completion] | None = None
        self.error: Exception | None = None

    @property
    def answered(self) -> bool:
        return self.answers is not None or self.error is not None

    def outcome(self) -> list[Completion]:
        if self.error is not None:
            raise self.error
        assert self.answers is not None
        return self.answers


class BatchingModel:
    """Another model, asked by many threads and called by one of them at a time.

    Of the threads that wait, one leads: it collects calls until they have as many prompts as a batch, or until none has
    come for a while; asks the model; and hands the lead on. Calls that come meanwhile are the next batch. The model is
    never called twice at the same time.
    """

    def __init__(self, model: ChatModel, size: int, window_s: float = 0.5) -> None:
        """Wrap a model.

        Args:
            model: what is asked; its name and decoding are kept.
            size: prompts that a batch waits for. A call is never split, so a batch can be larger.
            window_s: seconds without another call after which a smaller batch is asked.

        Raises:
            ValueError: a batch of no prompts.
        """
        if size < 1:
            raise ValueError(f"a batch has at least one prompt, not {size}")
        self.name = model.name
        self.decoding: Mapping[str, str | float | int] = model.decoding
        self._model = model
        self._size = size
        self._window_s = window_s
        self._changed = threading.Condition()
        self._waiting: list[_Call] = []
        self._arrived = 0
        self._led = False
        self._asking = ThreadPoolExecutor(max_workers=1)  # its futures bring errors to the threads that asked

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order; raise what the model raises for these prompts."""
        if not prompts:
            return []
        call = _Call(prompts)
        with self._changed:
            self._waiting.append(call)
            self._arrived += 1
            self._changed.notify_all()
        try:
            while self._takes_the_lead(call):
                self._lead(call)
        finally:
            with self._changed:
                if call in self._waiting:  # interrupted: nobody waits for the answer any more
                    self._waiting.remove(call)
        return call.outcome()

    def _takes_the_lead(self, call: _Call) -> bool:
        """Wait until the call is answered, or until nobody leads: then this thread does."""
        with self._changed:
            self._changed.wait_for(lambda: call.answered or not self._led)
            if call.answered:
                return False
            self._led = True
            return True

    def _lead(self, own: _Call) -> None:
        """Ask the model one batch, in the thread that made the call `own`.

        However that ends, the lead is free again. If this thread is interrupted, the others of its batch wait on.
        """
        batch: list[_Call] = []
        try:
            with self._changed:
                batch = self._collect()
            self._ask(batch)
        finally:
            with self._changed:
                self._waiting[:0] = [call for call in batch if not call.answered and call is not own]
                self._led = False
                self._changed.notify_all()

    def _collect(self) -> list[_Call]:
        """Take the calls of a batch off those that wait, in the order in which they came."""
        while sum(len(call.prompts) for call in self._waiting) < self._size:
            if not self._another_comes():
                break
        batch: list[_Call] = []
        while self._waiting and sum(len(call.prompts) for call in batch) < self._size:
            batch.append(self._waiting.pop(0))
        return batch

    def _another_comes(self) -> bool:
        """Wait for another call, no longer than the window."""
        seen = self._arrived
        return self._changed.wait_for(lambda: self._arrived != seen, self._window_s)

    def _ask(self, batch: Sequence[_Call]) -> None:
        """Ask the calls of a batch together; if that fails, each alone, so that an error reaches its callers only."""
        prompts = [prompt for call in batch for prompt in call.prompts]
        asked = self._asking.submit(self._model.complete, prompts)
        error = asked.exception()
        if error is not None and not isinstance(error, Exception):  # an interruption is this thread's own
            raise error
        answers = asked.result() if error is None else []
        if error is None and len(answers) != len(prompts):
            error = ModelError(f"{self.name} gave {len(answers)} completions for {len(prompts)} prompts")
        if error is not None and len(batch) > 1:
            for call in batch:
                self._ask([call])
            return
        if error is not None:
            batch[0].error = error
            return
        for call in batch:
            call.answers, answers = answers[: len(call.prompts)], answers[len(call.prompts) :]
