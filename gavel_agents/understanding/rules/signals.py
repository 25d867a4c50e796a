"""A second look at the words: what plainly asks for something must have led to a goal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gavel_agents.understanding.rules.elements import Entity, Frame
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.nouns import kinds_of, known_nouns, words_of
from gavel_agents.understanding.rules.places import flag_of, process_flag
from gavel_agents.understanding.rules.questions import asked_instead
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.goals import Literal, Predicate

__all__ = ["check_signals"]

_PROCESSED = {
    Predicate.WASHED: (Predicate.WASHED,),
    Predicate.DRIED: (Predicate.DRIED,),
    Predicate.COOKED: (Predicate.COOKED, Predicate.HOT),
    Predicate.FROZEN: (Predicate.FROZEN,),
}


def check_signals(
    tokens: Sequence[Token], asides: Sequence[Frame], asked: Sequence[Literal], stated: Sequence[Literal]
) -> None:
    """Refuse a reading in which a word of washing, drying, heating, a machine, or a switch has led to nothing.

    Args:
        tokens: of the text.
        asides: frames that were passed over: what stands in them may lead to nothing.
        asked: the goals.
        stated: the relations.

    Raises:
        Abstention: `unparsed`.
    """
    states = {literal.predicate for literal in asked}
    located = [literal for literal in (*asked, *stated) if literal.predicate is not Predicate.IN_ROOM]
    places = {literal.object.name for literal in located if literal.object is not None}
    pieces = {literal.subject.name for literal in asked}
    for index, token in enumerate(tokens):
        if any(frame.start <= token.start < frame.end for frame in asides):
            continue
        for wanted in _wanted(tokens, index):
            if not states & set(_PROCESSED[wanted]) and not (_is_machine(token) and _placed(token, places | pieces)):
                raise asked_instead("unparsed", f"{token.text!r} asks for something that is not understood")
        switched = token.text in ("off", "on") and token.kind in (Kind.PREPOSITION, Kind.PARTICLE)
        if switched and Predicate.TOGGLED not in states and _ends(tokens, index) and _follows_piece(tokens, index):
            raise asked_instead("unparsed", f"what is switched {token.text} is not understood")


def _is_machine(token: Token) -> bool:
    return token.kind is Kind.NOUN


def _wanted(tokens: Sequence[Token], index: int) -> Iterator[Predicate]:
    """Yield what a word asks to be done: a verb, a cycle, a machine."""
    token = tokens[index]
    if token.kind is Kind.VERB and token.value in ("WASH", "DRY", "HEAT"):
        following = tokens[index + 1] if index + 1 < len(tokens) else None
        adjective = token.close and following is not None and following.close and following.kind is Kind.NOUN
        before = tokens[index - 1].kind if index else None
        flag = flag_of(token.value)
        if flag is not None and not (adjective and before in (Kind.DETERMINER, Kind.ADJECTIVE, Kind.POSSESSIVE)):
            yield flag
    elif token.kind is Kind.CYCLE and token.value in ("WASH", "DRY", "HEAT"):
        flag = flag_of(token.value)
        if flag is not None:
            yield flag
    elif token.kind is Kind.NOUN:
        machine = Entity(token.value)
        does = None if machine.movable else process_flag(machine)
        if does in _PROCESSED and does is not Predicate.FROZEN and does is not None:
            yield does


def _placed(token: Token, names: set[str]) -> bool:
    """Return whether a machine is itself where something is or goes, or is switched or opened."""
    mine = set(kinds_of(known_nouns()[words_of(token.text)].name))
    return any(mine & set(kinds_of(name)) for name in names)


def _ends(tokens: Sequence[Token], index: int) -> bool:
    following = tokens[index + 1] if index + 1 < len(tokens) else None
    return following is None or following.kind in (Kind.STOP, Kind.COMMA, Kind.AND, Kind.FILLER, Kind.REQUEST)


def _follows_piece(tokens: Sequence[Token], index: int) -> bool:
    """Return whether a piece with a switch stands within a few words before."""
    for token in tokens[max(index - 3, 0) : index]:
        if token.kind is Kind.NOUN and any(kind.toggleable for kind in Entity(token.value).kinds):
            return not Entity(token.value).movable
    return False
