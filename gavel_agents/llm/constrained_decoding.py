"""Holding a transformers model to JSON schemas while it writes (PyPI package llguidance)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gavel_agents.llm.interface import BadPlannerSpec
from gavel_agents.llm.service import ModelError

__all__ = ["Holder"]


class Holder:
    """Makes logits processors that allow only what continues an answer of a schema.

    Separators are `, ` and `: `, as Python's json writes them.
    """

    def __init__(self, tokenizer: Any, vocabulary: int) -> None:
        """Prepare the tokenizer.

        Args:
            tokenizer: a fast one.
            vocabulary: how many logits the model gives.

        Raises:
            BadPlannerSpec: the package llguidance is missing.
        """
        try:
            import llguidance.hf
        except ImportError as error:
            raise BadPlannerSpec("JSON schemas need llguidance: pip install 'gavel-env[llm]'") from error
        self._tokenizer = llguidance.hf.from_tokenizer(tokenizer, n_vocab=vocabulary)
        self._library = llguidance
        self._end = int(tokenizer.eos_token_id)

    def processor(self, schemas: Sequence[Mapping[str, Any] | None]) -> _Processor:
        """Return a processor for a batch: one schema a row, or None where anything may be written."""
        return _Processor([None if schema is None else self._matcher(schema) for schema in schemas], self._end)

    def _matcher(self, schema: Mapping[str, Any]) -> Any:
        guided = {**schema, "x-guidance": {"whitespace_flexible": False, "item_separator": ", ", "key_separator": ": "}}
        grammar = self._library.LLMatcher.grammar_from_json_schema(json.dumps(guided))
        matcher = self._library.LLMatcher(self._tokenizer, grammar)
        if matcher.is_error():
            raise ModelError(f"a schema cannot be enforced: {matcher.get_error()[:200]}")
        return matcher


class _Processor:
    """What `generate` asks before every token (its `LogitsProcessor`)."""

    def __init__(self, matchers: Sequence[Any], end: int) -> None:
        self._matchers, self._end = matchers, end
        self._begun = False

    def __call__(self, input_ids: Any, scores: Any) -> Any:
        """Return scores with -inf where a token would leave the schema.

        Args:
            input_ids: [batch, tokens so far].
            scores: [batch, vocabulary].
        """
        import llguidance.numpy
        import torch

        packed = llguidance.numpy.allocate_token_bitmask(len(self._matchers), scores.shape[1])
        whole = []
        for row, matcher in enumerate(self._matchers):
            if matcher is None:
                continue
            if self._begun and not matcher.is_stopped():
                matcher.consume_token(int(input_ids[row, -1]))
            if matcher.is_stopped():
                whole.append(row)
            else:
                llguidance.numpy.fill_next_token_bitmask(matcher, packed, row)
        self._begun = True
        allowed = np.unpackbits(packed.view(np.uint8), axis=1, bitorder="little")[:, : scores.shape[1]].astype(bool)
        allowed[whole] = False
        allowed[whole, self._end] = True
        return scores.masked_fill(torch.from_numpy(~allowed).to(scores.device), float("-inf"))
