"""Understanding by a language model: an adapter trained for it, or the chat model that plans, asked for JSON.

Where the backend can, the answer is held to what the text speaks of, so that nothing can be invented; what comes back
is read with distrust all the same (`gavel_agents.understanding.answer`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec

from gavel_agents.llm import ChatModel, Completion, Message, Prompt
from gavel_agents.understanding.answer import answer_schema, read_answer
from gavel_agents.understanding.chat import chat_prompt
from gavel_agents.understanding.interface import Abstention, Decomposition, Rooms
from gavel_agents.understanding.mentions import Mentions
from gavel_env.instructions.lookup import About

__all__ = ["ModelUnderstanding", "adapter_prompt"]

_MOST_CHARACTERS = 4000


def adapter_prompt(text: str) -> tuple[Message, ...]:
    """Return what an adapter is asked: short, since it knows what to do."""
    return Message("system", "Tasks as JSON."), Message("user", text)


class ModelUnderstanding:
    """Asks a model what a text says, and believes of it what the text speaks of."""

    def __init__(self, name: str, model: ChatModel, *, trained: bool) -> None:
        """Wrap a model.

        Args:
            name: of the understanding, for records.
            model: answers with the JSON of `gavel_agents.understanding.answer`.
            trained: it is an adapter, which knows the form and the names of categories; a chat model is shown the form,
                and names things as the text does.
        """
        self.name = name
        self._model = model
        self._trained = trained
        self._known: dict[str, Decomposition] = {}

    def asking(self, through: Callable[[ChatModel], ChatModel]) -> ModelUnderstanding:
        """Return the same understanding whose model is asked through another, which may count or keep its calls."""
        return ModelUnderstanding(self.name, through(self._model), trained=self._trained)

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of a text, or the typed reason of an abstention; it asks nothing back."""
        return self.understand_all([text])[0]

    def understand_all(self, texts: Sequence[str], *, rooms: Sequence[Rooms | None] = ()) -> list[Decomposition]:
        """Return the tasks of several texts, which the model may answer in batches; each text is asked once."""
        prompts: dict[str, Prompt] = {}
        for text in texts:
            if text in self._known or text in prompts:
                continue
            try:
                prompts[text] = self._prompt(text)
            except Abstention as why:
                self._known[text] = Decomposition.refusal(why)
        for text, completion in zip(prompts, self._ask(list(prompts.values())), strict=True):
            self._known[text] = _read(completion, text)
        return [self._known[text] for text in texts]

    def _prompt(self, text: str) -> Prompt:
        """Return what is asked about a text.

        Raises:
            Abstention: `empty`, `too_long`, or `no_goal` where nothing known is spoken of.
        """
        if not text.strip():
            raise Abstention("empty", "nothing is said")
        if len(text) > _MOST_CHARACTERS:
            raise Abstention("too_long", f"{len(text)} characters; at most {_MOST_CHARACTERS}")
        mentions = Mentions(text)
        if not mentions.categories:
            raise Abstention("no_goal", f"nothing known is spoken of in {text[:60]!r}")
        if self._trained:
            categories = {category: (category,) for category in mentions.categories}
            schema = answer_schema(categories, mentions.rooms, brief=True)
            return Prompt(adapter_prompt(text), About(text), schema=schema, temperature=0.0)
        schema = answer_schema(mentions.phrases, mentions.room_phrases)
        return Prompt(chat_prompt(text), About(text), schema=schema, temperature=0.0)

    def _ask(self, prompts: Sequence[Prompt]) -> Sequence[Completion]:
        return self._model.complete(prompts) if prompts else ()


def _read(completion: Completion, text: str) -> Decomposition:
    try:
        understood = read_answer(completion.text, text)
    except Abstention as why:
        understood = Decomposition.refusal(why)
    return msgspec.structs.replace(understood, asked=completion)
