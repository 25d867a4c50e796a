"""The state that tokens are taken in: where the reader stands, the frame that it fills, and what was said before."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence

from gavel_agents.understanding.rules.elements import Entity, Frame, Phrase, Pronoun, Room, Separator, There, Unknown
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.words import Kind

__all__ = [
    "ACTS",
    "CABINETS",
    "FROM",
    "IN_ROOM",
    "LEADS",
    "SEPARATORS",
    "STARTS_NOUN",
    "Stream",
    "directed",
    "goes",
    "says_where",
]

SEPARATORS = (Kind.AND, Kind.COMMA, Kind.STOP, Kind.THEN, Kind.ALSO, Kind.OR)
STARTS_NOUN = (
    Kind.NOUN, Kind.ROOM, Kind.PRONOUN, Kind.DETERMINER, Kind.THERE, Kind.WHERE, Kind.QUANTIFIER, Kind.ADJECTIVE,
    Kind.COUNT, Kind.UNKNOWN,
)  # fmt: skip
LEADS = (Kind.DETERMINER, Kind.ADJECTIVE, Kind.COUNT, Kind.POSSESSIVE, Kind.QUANTIFIER, Kind.UNKNOWN)
IN_ROOM = ("in", "of", "over in", "at", "back in", "inside", "from", "up in", "down in", "out in", "within", "by")
CABINETS = ("any_cabinet", "any_lower_cabinet", "bottom_cabinet", "bottom_cabinet_no_top", "any_commode")
ACTS = ("MOVE", "FILL", "HEAT", "WASH", "DRY", "FREEZE", "RUN", "SWITCH", "OPEN", "CLOSE", "SWAP", "USE")
FROM = ("from", "out", "off", "of", "for", "with")


class Stream(ABC):
    """Reads tokens one after the other; what each does stands in the classes that build on it."""

    def __init__(
        self, tokens: Sequence[Token], house: Counter[str] | None, room: str | None, memory: list[tuple[str, Entity]]
    ) -> None:
        self.tokens = tokens
        self.memory = memory
        self.room_before = room
        self.house = house
        self.position = 0
        self.frames: list[Frame] = []
        self.frame = Frame()
        self.preposition: Token | None = None
        self.relative = False
        self.infinitive = False
        self.subject = False
        self.gap = False
        self.listed = False
        self.inserted = False
        self.many = 0
        self.pair = False
        self.previous: Token | None = None

    def peek(self, ahead: int = 0) -> Token | None:
        """Return a token that comes, or None behind the last."""
        index = self.position + ahead
        return self.tokens[index] if index < len(self.tokens) else None

    def kind(self, ahead: int = 0) -> Kind | None:
        """Return the kind of a token that comes."""
        token = self.peek(ahead)
        return token.kind if token else None

    def close(self) -> None:
        """End the frame; separators at its end lead to the next one."""
        trailing: list[Kind] = []
        while self.frame.elements and isinstance(self.frame.elements[-1], Separator):
            trailing.insert(0, self.frame.elements.pop().kind)  # type: ignore[union-attr]
        if self.frame.empty:
            trailing = [*self.frame.before, *trailing]
        else:
            self.frames.append(self.frame)
        marked = self.frame.marked and self.frame.empty
        self.listed = self.listed or marked
        self.frame = Frame(before=trailing, marked=marked or self.listed)
        self.subject = False

    def last_room(self) -> str | None:
        """Return the room that was spoken of last."""
        for frame in (self.frame, *reversed(self.frames)):
            for element in reversed(frame.elements):
                target = element.target if isinstance(element, Phrase) else element
                if isinstance(target, Room):
                    return target.type
                if isinstance(target, Entity) and target.room is not None:
                    return target.room
        return self.room_before

    def continues(self) -> bool:
        """Return whether more than a mark follows."""
        following = self.peek()
        return following is not None and following.kind not in SEPARATORS and following.kind is not Kind.ARROW

    # --- what the classes that build on it do -------------------------------------------------------------------------

    @abstractmethod
    def put(self, target: Entity | Pronoun | Room | There | Unknown) -> None:
        """Add a thing, or the phrase of the preposition before it."""

    @abstractmethod
    def state(self, token: Token) -> None:
        """Take `is`, `should`, `belongs`, `Tom left`."""

    @abstractmethod
    def room_after(self) -> str | None:
        """Take `in the kitchen` after a piece of furniture."""

    @abstractmethod
    def named_room(self, token: Token) -> str:
        """Return the room type that a token names in this house."""


def goes(frame: Frame) -> bool:
    """Return whether a frame says where something goes."""
    return any(isinstance(e, Phrase) and not e.relative and e.preposition not in FROM for e in frame.elements)


def says_where(frame: Frame) -> bool:
    """Return whether a frame without a verb is complete: `mug in the dishwasher, ...`."""
    return bool(frame.of(Phrase) and frame.of(Entity) + frame.of(Pronoun))


def directed(frame: Frame) -> bool:
    """Return whether a frame says `into`, `onto`, `to`."""
    return any(isinstance(e, Phrase) and e.directional for e in frame.elements)
