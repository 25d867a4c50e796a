"""One completion per call: methods that ask a model the same thing get the same answer, and ask it once.

Two calls are the same if model, decoding (with the seed, where something is sampled), conversation and schema are. The
paper's methods share their first proposals; so do runs of a greedy model over several seeds.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from concurrent.futures import CancelledError, Future
from typing import NamedTuple

from gavel_agents.llm.interface import ChatModel, Completion, Prompt, decoding_of
from gavel_agents.llm.replay import completion_key

__all__ = ["Answered", "SharingModel"]

_KEPT = 8192


class Answered(NamedTuple):
    """A completion, and whether the model was asked for it now."""

    completion: Completion
    asked: bool


class SharingModel:
    """Another model, asked by many threads, by at most so many at the same time, and never twice for the same call.

    A thread whose call is under way in another one waits for that answer. The last few thousand completions are kept.
    """

    def __init__(self, model: ChatModel, connections: int = 1) -> None:
        """Wrap a model.

        Args:
            model: what is asked; its name and decoding are kept.
            connections: calls under way at the same time.
        """
        self.name = model.name
        self.decoding: Mapping[str, str | float | int] = model.decoding
        self._model = model
        self._connections = threading.BoundedSemaphore(connections)
        self._turn = threading.Lock()
        self._known: OrderedDict[str, Future[Completion]] = OrderedDict()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order."""
        return [answered.completion for answered in self.ask(prompts)]

    def ask(self, prompts: Sequence[Prompt]) -> list[Answered]:
        """Return one completion per prompt, in order, each with whether it is new.

        Raises:
            ModelError: the model does not answer; the next thread that wants the same asks again.
        """
        keys = [
            completion_key(self.name, decoding_of(self.decoding, prompt), prompt.messages, prompt.schema)
            for prompt in prompts
        ]
        mine: dict[str, Prompt] = {}
        answers: dict[str, Future[Completion]] = {}
        with self._turn:
            for key, prompt in zip(keys, prompts, strict=True):
                if key in answers:
                    continue
                if key not in self._known:
                    self._known[key] = Future()
                    mine[key] = prompt
                self._known.move_to_end(key)
                answers[key] = self._known[key]
        if mine:
            self._answer(mine, answers)
        found = [self._wait(answers[key], prompt, key in mine) for key, prompt in zip(keys, prompts, strict=True)]
        self._forget()
        return found

    def _wait(self, answer: Future[Completion], prompt: Prompt, asked: bool) -> Answered:
        """Return an answer; if the thread that asked got none, ask again in this one."""
        try:
            return Answered(answer.result(), asked)
        except CancelledError:
            [answered] = self.ask([prompt])
            return answered

    def _answer(self, mine: Mapping[str, Prompt], answers: Mapping[str, Future[Completion]]) -> None:
        """Ask the model what nobody has asked yet."""
        told = False
        try:
            with self._connections:
                completions = self._model.complete(list(mine.values()))
            for key, completion in zip(mine, completions, strict=True):
                answers[key].set_result(completion)
            told = True
        finally:
            if not told:
                with self._turn:
                    for key in mine:
                        self._known.pop(key, None)
                for key in mine:
                    if not answers[key].done():
                        answers[key].cancel()

    def _forget(self) -> None:
        with self._turn:
            while len(self._known) > _KEPT and next(iter(self._known.values())).done():
                self._known.popitem(last=False)
