"""From tokens to frames: one verb with the things, places and phrases that go with it."""

from __future__ import annotations

from collections.abc import Sequence

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.elements import (
    Cycle,
    Element,
    Entity,
    Frame,
    Part,
    Phrase,
    Pronoun,
    Room,
    Separator,
    There,
)
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.words import Kind

__all__ = ["frames_of"]


_SEPARATORS = (Kind.AND, Kind.COMMA, Kind.STOP, Kind.THEN, Kind.ALSO)
_STARTS_NOUN = (Kind.NOUN, Kind.ROOM, Kind.PRONOUN, Kind.DETERMINER, Kind.THERE, Kind.WHERE, Kind.QUANTIFIER)
_TAKES_VERB = ("GET", "LET", "USE")


def frames_of(tokens: Sequence[Token]) -> list[Frame]:
    """Return the frames of one sentence.

    Raises:
        Abstention: something in it has no reading.
    """
    reader = _Reader([t for t in tokens if not (t.kind is Kind.ADJECTIVE and not t.value)])
    return reader.read()


class _Reader:
    def __init__(self, tokens: Sequence[Token]) -> None:
        self.tokens = tokens
        self.position = 0
        self.frames: list[Frame] = []
        self.frame = Frame()
        self.preposition: Token | None = None
        self.relative = False
        self.infinitive = False
        self.previous: Kind | None = None

    def peek(self, ahead: int = 0) -> Token | None:
        index = self.position + ahead
        return self.tokens[index] if index < len(self.tokens) else None

    def kind(self, ahead: int = 0) -> Kind | None:
        token = self.peek(ahead)
        return token.kind if token else None

    def read(self) -> list[Frame]:
        while (token := self.peek()) is not None:
            self.position += 1
            self.take(token)
            self.previous = token.kind
            if token.kind not in _SEPARATORS:
                self.frame.end = max(self.frame.end, self.tokens[self.position - 1].end)
        self.close()
        return self.frames

    def close(self) -> None:
        """End the frame; separators at its end lead to the next one."""
        trailing: list[Kind] = []
        while self.frame.elements and isinstance(self.frame.elements[-1], Separator):
            trailing.insert(0, self.frame.elements.pop().kind)  # type: ignore[union-attr]
        if self.frame.empty:
            trailing = [*self.frame.before, *trailing]
        else:
            self.frames.append(self.frame)
        self.frame = Frame(before=trailing)

    def take(self, token: Token) -> None:
        kind = token.kind
        if kind in _SEPARATORS:
            self.frame.elements.append(Separator(kind, token.start))
            if kind is Kind.STOP:
                self.close()
        elif kind is Kind.COUNT:
            raise Abstention("counting", f"goals over {token.text!r} things cannot be said")
        elif kind in (Kind.NOUN, Kind.ROOM):
            self.noun(token)
        elif kind is Kind.PREPOSITION:
            self.lead(token)
        elif kind is Kind.RELATIVE:
            self.relative = self.kind() is Kind.PREPOSITION
        elif kind is Kind.PRONOUN:
            self.put(Pronoun(token.value == "whole"))
        elif kind is Kind.QUANTIFIER:
            self.quantifier()
        elif kind is Kind.THERE:
            if token.text.startswith("where"):
                self.close()
                self.frame.verb, self.frame.word = "MOVE", "stay"
            if token.text.startswith("from"):
                self.preposition = Token(Kind.PREPOSITION, "from", "from")
            self.preposition = self.preposition or Token(Kind.PREPOSITION, "in", "there")
            self.put(There())
        elif kind is Kind.WHERE:
            self.where()
        elif kind in (Kind.FACT, Kind.WISH):
            self.state(token)
        elif kind is Kind.GOAL_MARK:
            self.close()
            self.frame.marked = True
        elif kind is Kind.VERB:
            self.verb(token)
        elif kind is Kind.NOT:
            if self.frame.verb and self.frame.mood == "do" and not self.frame.marked:
                self.close()
            self.frame.negated = True
        elif kind is Kind.ADJECTIVE:
            self.verb(token._replace(form="ed"))
        elif kind is Kind.SWAPPED:
            self.frame.verb = "SWAP"
        elif kind is Kind.SAME:
            self.close()
            self.frame.verb = "SAME"
        elif kind is Kind.CYCLE:
            self.preposition = None
            self.frame.elements.append(Cycle(token.value))
        elif kind is Kind.DOOR:
            self.frame.elements.append(Part("door"))
        elif kind is Kind.PARTICLE and token.value:
            self.frame.elements.append(Part(token.value))

    # --- noun phrases -----------------------------------------------------------------------------------------------

    def noun(self, token: Token) -> None:
        """Take a noun with the room before or after it, or a room that stands alone."""
        room: str | None = None
        if token.kind is Kind.ROOM:
            following = self.peek()
            if following is None or following.kind is not Kind.NOUN:
                self.put(Room(token.value))
                return
            room, token = token.value, following
            self.position += 1
        entity = _entity(token)
        if not entity.movable:
            entity = Entity(token.value, room or self.room_after())
        self.put(entity)

    def room_after(self) -> str | None:
        """Take `in the kitchen` after a piece of furniture."""
        ahead = 1 if self.kind() is Kind.RELATIVE else 0
        leading = self.peek(ahead)
        if leading is None or leading.kind is not Kind.PREPOSITION or leading.text not in ("in", "of", "over in"):
            return None
        ahead += 2 if self.kind(ahead + 1) is Kind.DETERMINER else 1
        room = self.peek(ahead)
        if room is None or room.kind is not Kind.ROOM or self.kind(ahead + 1) is Kind.NOUN:
            return None
        self.position += ahead + 1
        return room.value

    def put(self, target: Entity | Pronoun | Room | There) -> None:
        """Add a thing, or the phrase of the preposition before it."""
        if self.preposition is None:
            if isinstance(target, Room | There):
                raise Abstention("unparsed", "a room without a preposition before it")
            self.frame.elements.append(target)
            return
        word = self.preposition.text
        directional = self.preposition.value == "to" or word in ("into", "onto", "on to", "in to")
        self.frame.elements.append(Phrase(self.preposition.value, target, self.relative, directional))
        self.preposition, self.relative = None, False

    def lead(self, token: Token) -> None:
        """Take a preposition: it leads a phrase, a verb, or stands alone."""
        following = self.kind()
        if following in _STARTS_NOUN:
            self.preposition = token
        elif following is Kind.VERB and token.value == "to":
            self.infinitive = True
        elif following is Kind.VERB and token.text == "by":
            self.frame.elements.append(Separator(Kind.THEN))
        elif following not in (Kind.PREPOSITION, Kind.CYCLE) and token.value in ("on", "off", "out", "in"):
            self.frame.elements.append(Part(token.value))

    def quantifier(self) -> None:
        """Take `both` as a pronoun where nothing else says what is meant."""
        if self.kind() is Kind.DETERMINER:
            return
        if self.kind() is not Kind.NOUN and self.frame.verb and not self.frame.of(Entity) + self.frame.of(Pronoun):
            self.put(Pronoun(both=True))

    def where(self) -> None:
        """Take `where the mug is`, or turn `in the sink is where` into a phrase that leads."""
        if self.frame.mood == "fact" and self.frame.of(Phrase) and not self.frame.of(Entity):
            self.frame.mood, self.frame.verb = "do", ""
            return
        while self.kind() is Kind.DETERMINER:
            self.position += 1
        target, stated = self.peek(), self.peek(1)
        if target is None or stated is None or target.kind is not Kind.NOUN or stated.kind is not Kind.FACT:
            raise Abstention("unparsed", "'where' without a thing that is somewhere")
        self.position += 2
        owner = _entity(target)
        self.frame.elements.append(Phrase("where", owner))
        ahead = 1 if self.kind() is Kind.COMMA else 0
        leading = self.peek(ahead)
        if leading is not None and leading.kind is Kind.PREPOSITION:
            self.position += ahead
            self.frame.elements.append(owner)
            self.relative = True

    # --- verbs ------------------------------------------------------------------------------------------------------

    def state(self, token: Token) -> None:
        """Take `is`, `should`, `belongs`: what was said last is its subject."""
        frame = self.frame
        if self.previous is Kind.WISH and token.kind is Kind.WISH:
            return  # should go, needs to end up
        if token.text == "go" and frame.empty and not frame.marked:
            if self.kind() is not Kind.VERB:  # "go find it" says no more than "find it"
                frame.verb, frame.word = "GET", "go"  # go to the fridge for the milk
            return
        if frame.mood != "do" or frame.verb:
            subject = self.split_subject()
            self.close()
            self.frame.elements = subject
        wished = token.kind is Kind.WISH or self.frame.marked
        self.frame.mood, self.frame.verb, self.frame.word = ("wish" if wished else "fact"), "BE", token.text

    def split_subject(self) -> list[Element]:
        """Take what stands behind the last complete phrase off the frame: the subject of a new one."""
        elements = self.frame.elements
        for index in range(len(elements) - 1, 0, -1):
            before, element = elements[index - 1], elements[index]
            placed = (isinstance(before, Phrase) and not before.relative) or isinstance(before, Part)
            if isinstance(element, Separator) and placed:
                start = index
                while start < len(elements) and isinstance(elements[start], Separator):
                    start += 1
                subject = elements[start:]
                del elements[start:]
                self.frame.end = element.start
                return subject
        return []

    def verb(self, token: Token) -> None:
        frame = self.frame
        infinitive, self.infinitive = self.infinitive, False
        after_separator = bool(frame.elements) and isinstance(frame.elements[-1], Separator)
        if self.previous is Kind.DOOR and token.value in ("OPEN", "CLOSE"):
            return  # "door shut"
        participle = token.form in ("ed", "ing") or infinitive
        if frame.mood == "fact" and not after_separator and not frame.of(Phrase):
            return  # a state that is told: "is left", "is clean"
        if (
            (frame.mood == "wish" and not after_separator and not _directed(frame))
            or (not frame.verb and (frame.marked or not frame.empty))
            or (not after_separator and _completes(token, frame, participle=participle, infinitive=infinitive))
        ):
            frame.verb, frame.word = token.value, token.text
        else:
            negated = frame.negated and frame.empty
            self.close()
            self.frame.verb, self.frame.word, self.frame.negated = token.value, token.text, negated


def _entity(token: Token) -> Entity:
    """Return the noun phrase of a noun.

    Raises:
        Abstention: it could mean several categories.
    """
    if "|" in token.value:
        raise Abstention("ambiguous", f"{token.text!r} could be {', '.join(token.value.split('|'))}")
    return Entity(token.value)


def _completes(token: Token, frame: Frame, *, participle: bool, infinitive: bool) -> bool:
    """Return whether a verb says what the verb before it is for: `get it washed`, `use it to wash`, `leave it open`."""
    if frame.verb in _TAKES_VERB and (participle or frame.verb == "LET" or frame.word in ("have", "get")):
        return True
    if infinitive and token.value in ("DRY", "WASH", "HEAT"):
        return True
    return token.value in ("OPEN", "CLOSE") and frame.verb in ("MOVE", "GET")


def _directed(frame: Frame) -> bool:
    return any(isinstance(e, Phrase) and e.directional for e in frame.elements)
