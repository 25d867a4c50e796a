"""The questions that a reading ends with where one fact would let it go on, and how an answer lets it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gavel_agents.understanding.interface import Abstention, Question
from gavel_agents.understanding.rules.elements import Entity
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.nouns import known_nouns, words_of
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.concepts import in_words

__all__ = [
    "answered",
    "asked_anything",
    "asked_end",
    "asked_instead",
    "asked_meaning",
    "asked_what",
    "asked_where",
    "asked_which",
    "asked_which_of",
    "spoken",
]


def spoken(entity: Entity) -> str:
    """Return the words for a thing."""
    return in_words(entity.category)


def asked_meaning(words: str) -> Abstention:
    """Return the refusal of what could name a thing or an act and is not known."""
    asks = f"What is {words[:60]!r}? It names nothing that is known here."
    return Abstention("unknown_word", repr(words[:60]), Question(f"word:{words}", asks, words))


def asked_anything(tokens: Sequence[Token]) -> Abstention:
    """Return the refusal of what asks for nothing: it asks about the thing that is named, or what a pronoun means."""
    nothing = "nothing is asked for"
    for token in tokens:
        named = known_nouns().get(words_of(token.text)) if token.kind is Kind.NOUN else None
        if named is not None and Entity(named.name).movable:
            asks = f"What should be done with the {token.text}?"
            return Abstention("no_goal", nothing, Question(f"what:{token.text}", asks, token.text))
    for token in tokens:
        if token.kind is Kind.PRONOUN:
            asks = f"What is meant by {token.text!r}?"
            return Abstention("no_goal", nothing, Question(f"word:{token.text}", asks, token.text))
    return Abstention("no_goal", nothing)


def asked_where(thing: Entity) -> Abstention:
    """Return the refusal of what does not say where a thing shall go."""
    name = spoken(thing)
    question = Question(f"where:{name}", f"Where should the {name} go?", name)
    return Abstention("no_destination", f"where should the {name} go?", question)


def asked_what(thing: Entity) -> Abstention:
    """Return the refusal of what names a thing and does not say what shall become of it."""
    name = spoken(thing)
    question = Question(f"what:{name}", f"What should be done with the {name}?", name, ("nothing",))
    return Abstention("unparsed", f"nothing is asked for with {name!r}", question)


def asked_which(words: str, choices: Sequence[str]) -> Abstention:
    """Return the refusal of what leaves a choice open."""
    question = Question(f"which:{words}", f"Which is meant by {words!r}?", words, tuple(choices))
    return Abstention("choice", words, question)


def asked_which_of(words: str, many: int) -> Abstention:
    """Return the refusal of several things of kinds that are not said."""
    question = Question(f"count:{words}", f"Which {many} are meant by {words!r}? Name each of them.", words)
    return Abstention("counting", f"{many} {words}", question)


def asked_end(thing: str, places: Sequence[str], detail: str) -> Abstention:
    """Return the refusal of what says that a thing shall be in two places."""
    question = Question(f"end:{thing}", f"Where should the {thing} end up?", thing, tuple(places))
    return Abstention("contradiction", detail, question)


def asked_instead(kind: str, detail: str) -> Abstention:
    """Return the refusal of what cannot be or cannot be read as it stands."""
    asks = f"{detail[:1].upper()}{detail[1:]}"
    asks += "" if asks.endswith("?") else ". What is meant?"
    return Abstention(kind, detail, Question(f"instead:{kind}", asks))


_PLACES = re.compile(r"^(?:in|on|to|into|onto|under|next|beside|inside|from|at|back)\b", re.IGNORECASE)


def answered(text: str, question: Question, answer: str) -> str:
    """Return the text with the answer to a question in it."""
    kind, _, about = question.key.partition(":")
    said = answer.strip().rstrip(".!")
    if kind in ("word", "which", "count"):
        words = r"\W+".join(map(re.escape, re.findall(r"\w+", about)))
        replaced = re.sub(rf"\b{words}\b", lambda _: said, text, count=1, flags=re.IGNORECASE)
        return replaced if replaced != text else f"{text.rstrip(' .')}. {said}."
    if kind == "instead":
        return said
    if kind == "where":
        where = said if _PLACES.match(said) else f"to {said}"
        return f"{text.rstrip(' .')}. In the end put the {about} {where}."
    return f"{text.rstrip(' .')}. {said}." if about in said else f"{text.rstrip(' .')}. The {about}: {said}."
