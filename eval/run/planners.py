"""The language models of a process: loaded once, shared by its episodes, and each call kept for the records."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence

import msgspec

from eval.records.conversations import Exchange
from eval.records.schema import Usage
from gavel_agents.llm import ChatModel, Completion, Prompt, load_model
from gavel_agents.llm.batching import BatchingModel
from gavel_agents.llm.interface import decoding_of
from gavel_agents.llm.sharing import Answered, SharingModel

__all__ = ["SERVED", "STORED", "EpisodeModel", "Planners", "default_connections", "usage"]

SERVED = ("anthropic", "openai")
"""Kinds of planners behind a server, which answers many calls at once."""

STORED = ("classical", "reference", "replay", "scripted", "simulated")
"""Kinds of planners that ask no model: their answers cost nothing, and some depend on which attempt it is."""

_BATCHED = ("hf",)
"""Kinds to which prompts of several episodes go together, if more than one call is under way."""

_SERVER_CONNECTIONS = 8


def default_connections(planners: Sequence[str]) -> int:
    """Return how many calls are under way at once unless said otherwise: several only where all planners are servers.

    Args:
        planners: specs.
    """
    kinds = {spec.partition(":")[0] for spec in planners} - set(STORED)
    return _SERVER_CONNECTIONS if kinds and kinds <= set(SERVED) else 1


class EpisodeModel:
    """A model as one episode has it: every call that is made through it is kept."""

    def __init__(self, model: ChatModel, exchanges: list[Exchange]) -> None:
        """Wrap a model.

        Args:
            model: what is asked.
            exchanges: to which calls are appended.
        """
        self.name = model.name
        self.decoding: Mapping[str, str | float | int] = model.decoding
        self._model, self._exchanges = model, exchanges

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order."""
        if isinstance(self._model, SharingModel):
            answers = self._model.ask(prompts)
        else:
            answers = [Answered(completion, False) for completion in self._model.complete(prompts)]
        for prompt, (completion, asked) in zip(prompts, answers, strict=True):
            schema = "" if prompt.schema is None else msgspec.json.encode(prompt.schema, order="sorted").decode()
            decoding = decoding_of(self.decoding, prompt)
            self._exchanges.append(Exchange(self.name, decoding, prompt.messages, completion, schema, asked))
        return [answer.completion for answer in answers]


def usage(exchanges: Sequence[Exchange]) -> Usage:
    """Return what calls really asked of a model."""
    asked = [exchange.completion for exchange in exchanges if exchange.asked]
    return Usage(len(asked), sum(c.prompt_tokens for c in asked), sum(c.completion_tokens for c in asked))


class Planners:
    """Models by their specs; safe for several threads."""

    def __init__(self, connections: int = 1) -> None:
        """Prepare.

        Args:
            connections: calls of each model under way at the same time.
        """
        self._connections = connections
        self._models: dict[str, ChatModel] = {}
        self._turn = threading.Lock()

    def load(self, planner: str) -> ChatModel | None:
        """Return the model of a spec; None for an empty one.

        Raises:
            BadPlannerSpec: the spec, or what it needs.
        """
        if not planner:
            return None
        with self._turn:
            if planner not in self._models:
                self._models[planner] = self._made(planner)
            return self._models[planner]

    def _made(self, planner: str) -> ChatModel:
        model = load_model(planner)
        kind = planner.partition(":")[0]
        if kind in STORED:
            return model
        if kind in _BATCHED and self._connections > 1:
            model = BatchingModel(model, self._connections)
        return SharingModel(model, self._connections)
