"""What a noun phrase does in its frame: it is acted on, or with a preposition says where something is or goes."""

from __future__ import annotations

from gavel_agents.understanding.rules.elements import Entity, Part, Phrase, Pronoun, Room, Separator, There, Unknown
from gavel_agents.understanding.rules.english import could_act, could_name
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.noun_phrases import NounPhrases
from gavel_agents.understanding.rules.places import process_flag
from gavel_agents.understanding.rules.questions import asked_which, spoken
from gavel_agents.understanding.rules.stream import SEPARATORS, STARTS_NOUN, goes
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.concepts import any_of

__all__ = ["Phrases"]


class Phrases(NounPhrases):
    """Puts noun phrases where they belong."""

    def put(self, target: Entity | Pronoun | Room | There | Unknown) -> None:
        """Add a thing, or the phrase of the preposition before it.

        Raises:
            Abstention: it is one of two that are left open.
        """
        self.choose(target)
        if isinstance(target, Entity) and self.preposition is None and self.starts_anew(target):
            separators = [e for e in self.frame.elements if isinstance(e, Separator)]
            self.close()
            self.frame.before = self.frame.before or [e.kind for e in separators[-1:]]
        if self.repeats(target):
            return
        if self.inserted:
            self.preposition = self.preposition or Token(Kind.PREPOSITION, "at", "")
            self.relative = True
        if self.preposition is None and isinstance(target, Entity) and not target.movable and self.goes_there():
            self.preposition = Token(Kind.PREPOSITION, "arrow", "->")
        if self.preposition is None:
            if isinstance(target, Room | There):
                self.preposition = Token(Kind.PREPOSITION, "at", "")
            else:
                self.frame.elements.append(target)
                return
        if isinstance(target, Room) and self.room_of_piece_before(target):
            self.preposition = None
            return
        target = self.with_room_before(target)
        word = self.preposition.text
        preposition = self.preposition.value
        directional = preposition in ("to", "arrow") or word in ("into", "onto", "on to", "in to")
        self.frame.elements.append(Phrase(preposition, target, self.relative, directional))
        self.preposition, self.relative = None, False

    def choose(self, target: object) -> None:
        """Refuse `the sink or the dishwasher`."""
        elements = self.frame.elements
        if len(elements) < 2 or not isinstance(elements[-1], Separator) or elements[-1].kind is not Kind.OR:
            return
        other = elements[-2].target if isinstance(elements[-2], Phrase) else elements[-2]
        if isinstance(other, Entity) and isinstance(target, Entity) and not self.frame.aside:
            said = [t for t in self.tokens[: self.position] if t.close or t.kind not in SEPARATORS]
            nouns = [index for index, t in enumerate(said) if t.kind is Kind.NOUN][-2:]
            words = " ".join(t.text for t in said[nouns[0] : nouns[-1] + 1]) if len(nouns) == 2 else ""
            raise asked_which(words, (spoken(other), spoken(target)))

    def there(self, token: Token) -> None:
        """Take `there`: the place or the room that was spoken of."""
        if token.text.startswith("where"):
            self.close()
            self.frame.verb, self.frame.word = "MOVE", "stay"
        last = self.frame.elements[-1] if self.frame.elements else None
        target = last.target if isinstance(last, Phrase) else last
        if isinstance(target, Entity) and not target.movable and target.room is None and token.text != "from there":
            room = self.last_room()
            if room is not None:  # on the worktop in there
                piece = target._replace(room=room)
                self.frame.elements[-1] = last._replace(target=piece) if isinstance(last, Phrase) else piece
                self.preposition = None
                return
        if token.text.startswith("from"):
            self.preposition = Token(Kind.PREPOSITION, "from", "from")
        self.preposition = self.preposition or Token(Kind.PREPOSITION, "in", "there")
        self.put(There())

    def relate(self, token: Token) -> None:
        """Take `that's`, `that I left`: a phrase that follows says where the thing before it is."""
        following = self.peek()
        marked = self.previous is not None and self.previous.kind in SEPARATORS
        if marked and token.text == "that 's" and following is not None and following.kind is Kind.UNKNOWN:
            self.close()  # hands off, that's dinner
            self.frame.aside, self.frame.verb = True, "TOLD"
            return
        if following is not None and following.kind is Kind.VERB and following.form == "ed":
            self.position += 1  # that was left in the garden
        self.relative = self.kind() is Kind.PREPOSITION

    def quantifier(self) -> None:
        """Take `both` as a pronoun where nothing else says what is meant."""
        self.pair = True
        if self.kind() is Kind.DETERMINER:
            return
        alone = self.kind() is not Kind.NOUN and not self.frame.of(Entity) + self.frame.of(Pronoun)
        if alone and (self.frame.verb or self.kind() in (Kind.WISH, Kind.FACT)):
            self.put(Pronoun(both=True))

    def where(self) -> None:
        """Take `where the mug is`, or turn `in the sink is where` into a phrase that leads."""
        if self.frame.mood == "fact" and self.frame.of(Phrase) and not self.frame.of(Entity):
            self.frame.mood, self.frame.verb = "do", ""
            return
        ahead = 0
        while self.kind(ahead) in (Kind.DETERMINER, Kind.ADJECTIVE):
            ahead += 1
        target, stated = self.peek(ahead), self.peek(ahead + 1)
        if target is None or stated is None or target.kind is not Kind.NOUN or stated.kind is not Kind.FACT:
            return
        self.position += ahead + 2
        owner = self.entity(target, None)
        self.frame.elements.append(Phrase("where", owner))
        ahead = 1 if self.kind() is Kind.COMMA else 0
        leading = self.peek(ahead)
        if leading is not None and leading.kind is Kind.PREPOSITION:
            self.position += ahead
            self.frame.elements.append(owner)
            self.relative = True

    def room_of_piece_before(self, room: Room) -> bool:
        """Take the room of `in a bookcase, in the kitchen`; of `in the study or in a bedroom`, either will do."""
        elements = self.frame.elements
        if self.preposition is None or self.preposition.value not in ("in", "at") or len(elements) < 2:
            return False
        mark = elements[-1]
        if not isinstance(mark, Separator) or mark.kind not in (Kind.COMMA, Kind.OR):
            return False
        for index in range(len(elements) - 2, -1, -1):
            element = elements[index]
            if isinstance(element, Separator):
                continue
            target = element.target if isinstance(element, Phrase) and not element.relative else None
            if not isinstance(element, Phrase) or not isinstance(target, Entity) or target.movable:
                return False
            if mark.kind is Kind.OR and target.room is not None:
                elements[index] = element._replace(target=target._replace(room=any_of(target.room, room.type)))
                return True
            if target.room is None:
                either = None if mark.kind is Kind.OR else room.type
                elements[index] = element._replace(target=target._replace(room=either))
                return True
            return False
        return False

    def with_room_before(
        self, target: Entity | Pronoun | Room | There | Unknown
    ) -> Entity | Pronoun | Room | There | Unknown:
        """Return a piece with the room that was said just before: `in the pantry, in a cupboard`."""
        elements = self.frame.elements
        if not isinstance(target, Entity) or target.movable or target.room is not None or len(elements) < 2:
            return target
        before, mark = elements[-2], elements[-1]
        if not isinstance(mark, Separator) or mark.kind is not Kind.COMMA:
            return target
        room = before.target if isinstance(before, Phrase) and before.preposition in ("in", "at", "to") else None
        if isinstance(before, Phrase) and isinstance(room, Room) and not before.relative:
            elements.remove(before)
            return target._replace(room=room.type)
        return target

    def starts_anew(self, target: Entity) -> bool:
        """Return whether a thing begins another clause: `hall light off, the mug in the sink`."""
        frame = self.frame
        if frame.aside:
            return False
        following = self.peek()
        marked = bool(frame.elements) and isinstance(frame.elements[-1], Separator)
        state = following is not None and following.value in ("on", "off") and self.kind(1) not in STARTS_NOUN
        if state and marked and frame.of(Entity) and any(k.toggleable for k in target.kinds) and not target.movable:
            return goes(frame)  # hockey stick in a bookcase and one computer on
        if frame.verb in ("SWAP", "GET", "FILL"):
            return False
        parts = any(isinstance(e, Part) and e.word in ("on", "off") for e in frame.elements)
        lit = any(isinstance(e, Entity) and any(k.toggleable for k in e.kinds) for e in frame.elements)
        apart = all(isinstance(e.target, Room) for e in frame.elements if isinstance(e, Phrase))
        if parts and lit and apart:
            return not frame.verb or frame.mood == "wish"
        if frame.mood == "fact" and marked and process_flag(target) is not None and not target.movable:
            return True  # my pajamas are wet, dryer please
        placed = following is not None and following.kind is Kind.PREPOSITION and following.value in ("on", "in", "to")
        through = any(isinstance(e, Phrase) and e.preposition == "through" for e in frame.elements)
        processed = (through or frame.verb in ("WASH", "DRY", "HEAT")) and bool(frame.of(Entity) + frame.of(Pronoun))
        return processed and target.movable and placed and marked and bool(frame.of(Phrase) or frame.done)

    def repeats(self, target: object) -> bool:
        """Return whether a piece only says again what was said: `into a bookcase, any bookcase`."""
        elements = self.frame.elements
        if self.preposition is not None or not isinstance(target, Entity) or target.movable or len(elements) < 2:
            return False
        before = elements[-2]
        piece = before.target if isinstance(before, Phrase) else before
        comma = isinstance(elements[-1], Separator) and elements[-1].kind is Kind.COMMA
        if not comma or not isinstance(piece, Entity) or piece.movable or not isinstance(before, Phrase):
            return False
        return bool(set(piece.kinds) & set(target.kinds))

    def goes_there(self) -> bool:
        """Return whether a piece without a preposition can only be where the thing before goes: `mug dishwasher`."""
        elements, frame = self.frame.elements, self.frame
        if not elements or frame.verb not in ("", "MOVE") or frame.mood == "fact" or frame.aside:
            return False
        last = elements[-1]
        if isinstance(last, Entity):
            return last.movable and self.previous is not None and self.previous.kind is Kind.NOUN
        after = self.kind() in (None, *SEPARATORS) or self.kind() in (Kind.PREPOSITION, Kind.REQUEST)
        marked = isinstance(last, Separator) and last.kind in (Kind.COMMA, Kind.THEN)
        thing = any(isinstance(e, Entity) and e.movable for e in elements)
        return marked and thing and after and not frame.verb  # mug, desk; scarf: washer, then dryer

    def lead(self, token: Token) -> None:
        """Take a preposition: it leads a phrase, a verb, or stands alone."""
        following = self.kind()
        if token.text == "of" and self.previous is not None and self.previous.text in ("turn", "switch", "turned"):
            self.frame.elements.append(Part("off"))  # a slip of the pen
            return
        if token.text == "for" and self.wished_for():
            return
        if token.value == "under" and self.refines_cabinet():
            return
        after = self.peek()
        purpose = token.text == "to" and after is not None and after.kind is Kind.UNKNOWN
        if purpose and after is not None and could_act(after.text) and not could_name(after.text):
            self.close()  # to measure my boats
            self.frame.aside, self.frame.verb = True, "TOLD"
            return
        if following in STARTS_NOUN:
            self.preposition = token
        elif following is Kind.VERB and token.value == "to":
            self.infinitive = True
        elif following is Kind.VERB and token.text == "by":
            self.frame.elements.append(Separator(Kind.THEN))
        elif token.value in ("on", "off", "out", "in") and (
            following not in (Kind.PREPOSITION, Kind.CYCLE) or self.after_switched(token)
        ):
            self.frame.elements.append(Part(token.value))

    def wished_for(self) -> bool:
        """Return whether `for` leads to what shall be: `it is time for the mug to be washed`."""
        before = self.previous
        if before is not None and before.kind in (Kind.DETERMINER, Kind.PRONOUN, Kind.NOUN):
            return False  # the thing for the soup
        ahead = 0
        while self.kind(ahead) in (Kind.DETERMINER, Kind.ADJECTIVE, Kind.NOUN, Kind.ROOM, Kind.AND, Kind.POSSESSIVE):
            ahead += 1
        wish = self.peek(ahead)
        return ahead > 0 and wish is not None and wish.kind is Kind.WISH

    def after_switched(self, token: Token) -> bool:
        """Return whether `on` and `off` say how the piece before is left: `lights on in the hall`."""
        last = self.frame.elements[-1] if self.frame.elements else None
        piece = isinstance(last, Entity) and not last.movable and any(kind.toggleable for kind in last.kinds)
        return token.text in ("on", "off") and piece
