"""From tokens to frames: one verb with the things, places and phrases that go with it.

What names nothing and orders nothing is passed over here; a word that could do either and is not known is kept as
`Unknown`, and the frame that it stands in decides whether it matters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from gavel_agents.understanding.rules.clauses import Clauses
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
)
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.stream import ACTS, SEPARATORS, STARTS_NOUN, goes
from gavel_agents.understanding.rules.words import Kind

__all__ = ["frames_of"]

_THANKING = frozenset(
    [
        "thankful",
        "grateful",
        "glad",
        "happy",
        "obliged",
        "pleased",
        "delighted",
        "relieved",
        "great",
        "nice",
        "lovely",
        "wonderful",
        "good",
        "appreciate",
        "kind",
        "appreciated",
        "like",
        "love",
        "mind",
        "welcome",
    ]
)
_HESITATIONS = frozenset(["um", "uh", "er", "erm", "hmm", "like", "well", "oh", "ah"])
_MEANTIME = frozenset({"meanwhile", "in the meantime", "temporarily", "for the time being", "in between"})


class _Reader(Clauses):
    def read(self) -> list[Frame]:
        while (token := self.peek()) is not None:
            self.position += 1
            self.take(token)
            self.previous = token
            if token.kind not in SEPARATORS:
                self.frame.end = max(self.frame.end, self.tokens[self.position - 1].end)
        self.close()
        return corrected(self.frames)

    def take(self, token: Token) -> None:
        kind = token.kind
        if self.frame.start < 0 and kind not in SEPARATORS:
            self.frame.start = token.start
        if token.value in ("(", ")"):
            self.insert(token)
        elif (self.inserted and token.value in ("OPEN", "CLOSE")) or (
            self.inserted and kind in (Kind.FACT, Kind.PRONOUN, Kind.RELATIVE, Kind.WISH)
        ):
            return
        elif kind in SEPARATORS:
            self.separate(token)
        elif kind is Kind.COUNT:
            self.count(token)
        elif kind in (Kind.NOUN, Kind.ROOM):
            self.noun(token)
        elif kind is Kind.UNKNOWN:
            self.unknown(token)
        elif kind is Kind.PREPOSITION:
            self.lead(token)
        elif kind is Kind.RELATIVE:
            self.relate(token)
        elif kind is Kind.PRONOUN:
            if not (token.text == "that" and self.previous is not None and self.previous.kind is Kind.MARK):
                self.stand_for(token)
        elif kind is Kind.QUANTIFIER:
            self.quantifier()
        elif kind is Kind.THERE:
            self.there(token)
        elif kind is Kind.WHERE:
            self.where()
        elif kind in (Kind.FACT, Kind.WISH):
            self.state(token)
        elif kind is Kind.MARK:
            if token.text.startswith(("when", "by")) and self.frame.mood == "fact" and self.frame.of(Entity):
                self.frame.mood = "wish"  # the lamp is off when she returns
                return
            self.close()
            self.frame.marked = True
        elif kind is Kind.VERB:
            self.verb(token)
        elif kind is Kind.NOT:
            self.negate()
        elif kind is Kind.ADJECTIVE and token.value:
            self.verb(token._replace(kind=Kind.VERB, form="ed"))
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
        elif kind is Kind.PARTICLE and token.text == "over" and self.kind() in STARTS_NOUN:
            self.preposition = Token(Kind.PREPOSITION, "on", "over")  # drape it over the armchair
        elif kind is Kind.REQUEST:
            self.request()
        elif kind is Kind.PARTICLE and token.value:
            self.frame.elements.append(Part(token.value))
        elif kind is Kind.SUBJECT:
            self.tell(token)
        elif kind is Kind.ARROW:
            self.arrow()
        elif kind in (Kind.ASIDE, Kind.IF):
            following = self.peek()
            self.close()
            wants = following is not None and following.kind is Kind.VERB and following.value == "GET"
            if token.text.endswith((" i", " we")) and wants:
                self.subject = True  # so I want …
            else:
                self.frame.aside = True
        elif kind is Kind.CORRECTION:
            self.close()
            self.frame.corrects = True

    def separate(self, token: Token) -> None:
        frame = self.frame
        self.preposition, self.inserted = None, False
        following = self.peek()
        if token.text in ("while", "whereas") and following is not None and following.form == "ing":
            self.close()
            frame = self.frame
            frame.aside, frame.verb = True, "TOLD"  # while making tea
            return
        if token.text in _MEANTIME and frame.verb and not self.continues():
            frame.meantime = True
            return
        lists = (
            token.kind is Kind.COMMA and not frame.verb and frame.elements and isinstance(frame.elements[-1], Entity)
        )
        if frame.negated and not frame.verb and token.kind is Kind.COMMA and frame.mood == "do":
            self.close()  # instead of the sofa, …
            return
        if frame.aside and not lists and token.kind not in (Kind.AND, Kind.OR):
            self.close()
        frame = self.frame
        if token.text in (":", "-"):
            if self.lists():
                self.arrow()
                return
            if self.goes_on():
                return
            frame.heading = token.text == ":" and frame.mood != "fact"
        frame.elements.append(Separator(token.kind, token.start))
        if token.kind is Kind.STOP:
            self.close()

    def request(self) -> None:
        """Take `please`, `could you`: a remark ends where a request begins."""
        frame = self.frame
        if frame.aside or self.subject or (frame.mood == "fact" and frame.of(Phrase)):
            self.close()

    def insert(self, token: Token) -> None:
        """Take a bracket: what stands in brackets behind a thing says where it is, unless it is a clause."""
        self.inserted = False
        if token.value == ")":
            if self.frame.negated or self.frame.aside:
                self.close()
            return
        inside: list[Kind] = []
        while (ahead := self.peek(len(inside))) is not None and ahead.value != ")":
            inside.append(ahead.kind)
        last = self.frame.elements[-1] if self.frame.elements else None
        self.inserted = (
            isinstance(last, Entity) and last.movable and not {Kind.VERB, Kind.MARK, Kind.STOP} & set(inside)
        )
        if not self.inserted:
            self.separate(token._replace(value=","))

    def goes_on(self) -> bool:
        """Return whether a colon stands inside of what is asked: `lamp: on`, `wash: the mug`."""
        frame, following, after = self.frame, self.peek(), self.peek(1)
        if following is None:
            return False
        alone = after is None or after.kind in SEPARATORS
        state = following.value in ("on", "off") and (following.kind is Kind.PARTICLE or alone)
        return (state and bool(frame.of(Entity))) or (frame.verb in ACTS and not frame.elements)

    def lists(self) -> bool:
        """Return whether what was said is a thing that a colon leads to its place from: `mug: dishwasher`."""
        frame = self.frame
        following = self.peek()
        if following is None or frame.verb or frame.mood != "do" or not frame.of(Entity):
            return False
        if any(isinstance(e, Entity) and not e.movable for e in frame.elements) or goes(frame):
            return False
        ahead = 0
        while self.kind(ahead) in (Kind.DETERMINER, Kind.ADJECTIVE, Kind.UNKNOWN):
            ahead += 1
        if self.kind(ahead) is Kind.ROOM:
            return True
        token = self.peek(ahead)
        return following.kind is Kind.PREPOSITION or (
            token is not None and token.kind is Kind.NOUN and not Entity(token.value).movable
        )

    def arrow(self) -> None:
        """Take an arrow: what follows is where it goes; a piece before it is where it is."""
        elements = self.frame.elements
        moved = [e for e in elements if isinstance(e, Entity) and e.movable] or self.frame.of(Pronoun)
        for index, element in enumerate(elements):
            if isinstance(element, Entity) and not element.movable and moved:
                elements[index] = Phrase("from", element, relative=True)
            elif isinstance(element, Phrase) and element.preposition in ("in", "on", "at", "to", "arrow"):
                elements[index] = Phrase(
                    "from" if element.preposition in ("to", "arrow") else element.preposition,
                    element.target,
                    relative=True,
                )
        self.preposition = Token(Kind.PREPOSITION, "arrow", "->")


def frames_of(
    tokens: Sequence[Token],
    house: Counter[str] | None = None,
    room: str | None = None,
    memory: list[tuple[str, Entity]] | None = None,
) -> list[Frame]:
    """Return the frames of one sentence.

    Args:
        tokens: of the sentence.
        house: how many rooms of each type the house has, if it is known.
        room: that was spoken of last, before this sentence.
        memory: nouns that were said before, with what they named; it grows.

    Raises:
        Abstention: something in it has no reading.
    """
    return _Reader(list(_without_fillers(tokens)), house, room, [] if memory is None else memory).read()


def _without_fillers(tokens: Sequence[Token]) -> Iterator[Token]:
    """Yield the tokens that say something, without marks around a hesitation or after `at:`."""
    compared = -1
    for index, token in enumerate(tokens):
        if index <= compared:
            continue
        following = tokens[index + 1] if index + 1 < len(tokens) else None
        if token.text == "like" and following is not None and following.kind is Kind.UNKNOWN:
            compared = index + 1  # like reeds
            continue
        if token.text in ("like", "as") and following is not None and following.text in ("a", "an"):
            compared = index + 1  # tall as a tower
            while compared + 1 < len(tokens) and tokens[compared + 1].kind in (Kind.ADJECTIVE, Kind.UNKNOWN, Kind.NOUN):
                compared += 1
            continue
        around = (*tokens[max(index - 1, 0) : index], *tokens[index + 1 : index + 2])
        if token.kind is Kind.FILLER:
            continue
        if token.kind is Kind.IF and any(t.text in _THANKING for t in tokens[max(index - 8, 0) : index]):
            yield token._replace(kind=Kind.MARK)  # I'd be so grateful if the mug could …
            continue
        if token.kind is Kind.COMMA and any(t.text in _HESITATIONS for t in around):
            continue
        if token.value == ":" and index and tokens[index - 1].kind is Kind.PREPOSITION:
            continue
        yield token


def corrected(frames: Sequence[Frame]) -> list[Frame]:
    """Return frames with `no wait, the dishwasher` put in the place of what it corrects."""
    kept: list[Frame] = []
    for frame in frames:
        new = next((e for e in frame.elements if isinstance(e, Entity | Phrase)), None)
        if not frame.corrects or frame.verb or new is None or not kept:
            kept.append(frame)
            continue
        elements = kept[-1].elements
        for index in range(len(elements) - 1, -1, -1):
            replaced = _replaced(elements[index], new)
            if replaced is not None:
                elements[index] = replaced
                rest = frame.elements[frame.elements.index(new) + 1 :]
                elements.extend(e for e in rest if not isinstance(e, Separator))
                break
        else:
            elements.extend(frame.elements)
        kept[-1].end = frame.end
    return kept


def _replaced(old: Element, new: Entity | Phrase) -> Element | None:
    """Return what stands for an element after a correction, or None if it is not what is corrected."""
    if isinstance(new, Phrase):
        return new._replace(relative=old.relative) if isinstance(old, Phrase) else None
    if isinstance(old, Phrase):
        target = old.target
        alike = isinstance(target, Room) or (isinstance(target, Entity) and target.movable == new.movable)
        return old._replace(target=new) if alike else None
    return new if isinstance(old, Entity) and old.movable == new.movable else None
