"""Which cabinet is meant: people tell them apart by where they stand, low, on the wall, under the counter."""

from __future__ import annotations

from gavel_agents.understanding.rules.elements import Entity, Phrase, Room
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.nouns import known_nouns, words_of
from gavel_agents.understanding.rules.stream import CABINETS, Stream
from gavel_agents.understanding.rules.words import Kind

__all__ = ["Cabinets"]

_TOLD_BEHIND = {
    "built in|counter|worktop|fitted": "bottom_cabinet_no_top",
    "wall|high|hangs|hanging": "top_cabinet",
    "low|freestanding|free standing|stands|alone|itself": "bottom_cabinet",
}
_STANDING = ("freestanding", "free standing", "low", "high", "built in")


class Cabinets(Stream):
    """Tells cabinets apart."""

    def kind_of_cabinet(self, token: Token) -> str | None:
        """Return which kind of cabinet is meant: a low one, one on the wall, one under the counter."""
        named = known_nouns()[words_of(token.text)]
        if named.name not in CABINETS or self.house is None:
            return None
        words: list[str] = []
        at = self.tokens.index(token) - 1
        while at >= 0 and self.tokens[at].kind in (Kind.ADJECTIVE, Kind.UNKNOWN, Kind.ROOM, Kind.POSSESSIVE, Kind.NOUN):
            words.append(self.tokens[at].text)
            at -= 1
        said = " ".join(words)
        behind = self.said_behind()
        if self.under_counter_follows() or any(word in said for word in ("counter", "built in", "fitted", "base")):
            return "bottom_cabinet_no_top"
        if any(word in words for word in ("high", "upper", "wall", "overhead", "wall mounted", "top", "hanging")):
            return "top_cabinet"
        if any(word in said for word in ("low", "freestanding", "free standing", "floor standing", "bottom")):
            return "bottom_cabinet_no_top" if "built in" in behind else "bottom_cabinet"
        return next((kind for words, kind in _TOLD_BEHIND.items() if any(w in behind for w in words.split("|"))), None)

    def said_behind(self) -> str:
        """Return what is said behind a cabinet's word and may tell its kind: `…, the built-in kind`."""
        words: list[str] = []
        for token in self.tokens[self.position : self.position + 9]:
            if token.kind in (Kind.STOP, Kind.AND, Kind.VERB, Kind.MARK, Kind.SUBJECT):
                break
            if token.kind is Kind.COMMA:
                rest = self.tokens[self.tokens.index(token) + 1 :][:5]
                kinds = [t.text for t in rest]
                if not ({"one", "ones", "kind", "type", "sort"} & set(kinds) or (rest and rest[0].text in _STANDING)):
                    break
            if token.kind is Kind.NOT:
                break
            words.append(token.text)
        return " ".join(words)

    def under_counter_follows(self) -> int:
        """Return how many tokens say that a cabinet stands under the counter; 0 if none do."""
        ahead = 0
        if self.kind(ahead) is Kind.COMMA:
            ahead += 1
        while self.kind(ahead) in (Kind.DETERMINER, Kind.PRONOUN, Kind.RELATIVE, Kind.ADJECTIVE) and ahead < 5:
            ahead += 1
        under = self.peek(ahead)
        if under is None or under.value != "under":
            return 0
        ahead += 1
        while self.kind(ahead) in (Kind.DETERMINER, Kind.ROOM, Kind.ADJECTIVE):
            ahead += 1
        counter = self.peek(ahead)
        return ahead + 1 if counter is not None and counter.value in ("any_counter", "countertop") else 0

    def refines_cabinet(self) -> bool:
        """Take `under the worktop` where it tells which cabinet is meant that was said before."""
        self.position -= 1
        count = self.under_counter_follows()
        elements = self.frame.elements
        for index in range(len(elements) - 1, -1, -1) if count else ():
            element = elements[index]
            piece = element.target if isinstance(element, Phrase) else element
            if isinstance(piece, Entity) and piece.category in CABINETS:
                told = piece._replace(category="bottom_cabinet_no_top")
                elements[index] = element._replace(target=told) if isinstance(element, Phrase) else told
                self.position += count
                return True
        self.position += 1
        return False

    def under_counter(self) -> str | None:
        """Take `under the kitchen counter` after a cabinet; return the room that it says."""
        count = self.under_counter_follows()
        rooms = [t for t in self.tokens[self.position : self.position + count] if t.kind is Kind.ROOM]
        self.position += count
        if count and not rooms:
            return self.room_after()
        return self.named_room(rooms[0]) if rooms else None

    def on_the_wall(self) -> None:
        """Take `on the kitchen wall` after a cabinet: it tells which kind is meant."""
        elements = self.frame.elements
        if elements and isinstance(elements[-1], Phrase) and isinstance(elements[-1].target, Room):
            room: str | None = elements.pop().target.type  # type: ignore[union-attr]
        else:
            room = self.room_after()
        self.preposition = None
        for index in range(len(elements) - 1, -1, -1):
            element = elements[index]
            piece = element.target if isinstance(element, Phrase) else element
            if isinstance(piece, Entity) and piece.category in CABINETS:
                told = Entity("top_cabinet", piece.room or room)
                elements[index] = element._replace(target=told) if isinstance(element, Phrase) else told
                return
