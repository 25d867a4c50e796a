"""Understanding by a language model: an adapter trained for it, or the chat model that plans, asked for JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec

from gavel_agents.llm import ChatModel, Completion, Message, Prompt
from gavel_agents.understanding.answer import read_answer
from gavel_agents.understanding.base import Abstention, Decomposition

__all__ = ["ModelUnderstanding", "adapter_prompt"]

_MOST_CHARACTERS = 4000


def adapter_prompt(text: str) -> tuple[Message, ...]:
    """Return what an adapter is asked: short, since it knows what to do."""
    return Message("system", "Tasks as JSON."), Message("user", text)


class ModelUnderstanding:
    """Asks a model what a text says, and believes of it what the text speaks of."""

    def __init__(
        self,
        name: str,
        model: ChatModel,
        prompt: Callable[[str], tuple[Message, ...]],
        schema: Mapping[str, Any] | None = None,
    ) -> None:
        """Wrap a model.

        Args:
            name: of the understanding, for records.
            model: answers with the JSON of `gavel_agents.understanding.answer`.
            prompt: text -> conversation.
            schema: JSON schema to which backends that can hold the answer.
        """
        self.name = name
        self._model = model
        self._prompt = prompt
        self._schema = schema
        self._known: dict[str, Decomposition] = {}

    def understand(self, text: str, instruction_id: str = "") -> Decomposition:
        """Return the tasks of a text, or the typed reason of an abstention."""
        return self.understand_all([text], [instruction_id])[0]

    def understand_all(self, texts: Sequence[str], ids: Sequence[str]) -> list[Decomposition]:
        """Return the tasks of several texts, which the model may answer in batches; each text is asked once."""
        new = {
            text: instruction_id
            for text, instruction_id in zip(texts, ids, strict=True)
            if text not in self._known and self._refusal(text) is None
        }
        prompts = [
            Prompt(self._prompt(text), instruction_id, schema=self._schema) for text, instruction_id in new.items()
        ]
        for text, completion in zip(new, self._model.complete(prompts) if prompts else (), strict=True):
            self._known[text] = _read(completion, text)
        return [self._known.get(text) or Decomposition((), self._refusal(text) or "") for text in texts]

    def _refusal(self, text: str) -> str | None:
        if not text.strip():
            return "empty: nothing is said"
        if len(text) > _MOST_CHARACTERS:
            return f"too_long: {len(text)} characters; at most {_MOST_CHARACTERS}"
        return None


def _read(completion: Completion, text: str) -> Decomposition:
    try:
        understood = read_answer(completion.text, text)
    except Abstention as why:
        understood = Decomposition((), str(why))
    return msgspec.structs.replace(understood, asked=completion)
