"""The author of a record, who answers what an understanding asks about it: what was meant stands in the record."""

from __future__ import annotations

import re

from gavel_agents.understanding import Question
from gavel_agents.understanding.pairs import Sample
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import default_concepts, in_words
from gavel_env.world_model.goals import Designator, Literal, Predicate, parse_literal

__all__ = ["Author"]

_WHERE = {
    Predicate.ON_TOP: "on",
    Predicate.INSIDE: "in",
    Predicate.IN_ROOM: "in",
    Predicate.UNDER: "under",
    Predicate.NEXT_TO: "next to",
}
_DONE = {
    Predicate.WASHED: "wash the {}",
    Predicate.DRIED: "dry the {}",
    Predicate.COOKED: "cook the {}",
    Predicate.TOGGLED: "switch the {} on",
    Predicate.OPEN: "leave the {} open",
}
_UNDONE = {Predicate.TOGGLED: "switch the {} off", Predicate.OPEN: "close the {}"}


class Author:
    """Answers in the words of the vocabulary, and only what the record says; None where it says nothing."""

    def __init__(self, sample: Sample) -> None:
        self._text = sample.text.lower()
        self._goal = [parse_literal(text) for task in sample.tasks for text in task.goal]

    def answer(self, question: Question) -> str | None:
        """Return the answer to a question, or None if the record does not tell."""
        kind, _, about = question.key.partition(":")
        if kind in ("where", "end"):
            return next((_place(literal) for literal in self._about(about) if literal.predicate in _WHERE), None)
        if kind == "what":
            wanted = " and ".join(filter(None, map(_order, self._about(about))))
            return wanted or "nothing"
        if kind in ("word", "which"):
            named = [d for literal in self._goal for d in (literal.subject, literal.object) if d is not None]
            unsaid = [d for d in dict.fromkeys(named) if not self._says(d)]
            fitting = [d for d in named if _spoken(d) in question.choices]
            return next((_spoken(d) for d in (fitting or unsaid)[:1]), None)
        return None

    def _about(self, words: str) -> list[Literal]:
        """Return the literals about what some words may name."""
        name = default_concepts().meaning(words).thing or words.replace(" ", "_")
        members = {name, words.replace(" ", "_"), *default_concepts().categories(name)}
        return [literal for literal in self._goal if literal.subject.name in members]

    def _says(self, designator: Designator) -> bool:
        """Return whether the text has a word for something."""
        nouns = (*default_vocabulary().nouns(designator.name), designator.name.replace("_", " "))
        return any(re.search(rf"\b{re.escape(noun.lower())}", self._text) for noun in nouns)


def _spoken(designator: Designator) -> str:
    nouns = default_vocabulary().nouns(designator.name)
    name = nouns[0] if nouns else designator.name.replace("_", " ")
    return name if designator.room is None else f"{name} in the {in_words(designator.room)}"


def _place(literal: Literal) -> str:
    assert literal.object is not None
    return f"{_WHERE[literal.predicate]} the {_spoken(literal.object)}"


def _order(literal: Literal) -> str:
    if literal.object is not None:
        return f"put the {_spoken(literal.subject)} {_place(literal)}"
    return (_UNDONE if literal.negated else _DONE).get(literal.predicate, "").format(_spoken(literal.subject))
