"""Verbs, states, wishes and tellers: where one frame ends and the next begins."""

from __future__ import annotations

from gavel_agents.understanding.rules.elements import Element, Entity, Frame, Part, Phrase, Pronoun, Separator, Unknown
from gavel_agents.understanding.rules.english import is_past
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.phrases import Phrases
from gavel_agents.understanding.rules.stream import SEPARATORS, directed, goes, says_where
from gavel_agents.understanding.rules.words import Kind

__all__ = ["Clauses"]

_IT_IS = frozenset({"it 's", "they 're", "it is", "they are"})
_PUT = ("put", "set", "shut", "open")
_TAKES_VERB = ("GET", "LET", "USE")


class Clauses(Phrases):
    """Takes verbs and what makes clauses of them."""

    def tell(self, token: Token) -> None:
        """Take `I`, `she`: who speaks of themselves asks for nothing until they say what they want."""
        before = self.previous
        following = self.peek()
        wants = following is not None and following.kind in (Kind.VERB, Kind.WISH) and following.value in ("GET", "")
        if (
            before is not None
            and before.kind is Kind.NOUN
            and wants
            and not self.frame.verb
            and not self.frame.of(Phrase)
        ):
            self.subject = True  # both sheets I'd like on the table
            return
        if wants and token.close and (self.frame.verb or says_where(self.frame)):
            self.close()  # … in the laundry room i want both of them
            self.subject = True
            return
        if before is not None and before.kind is Kind.NOUN and token.close:
            self.gap = True  # the mug I used this morning
            return
        if before is None or before.kind in SEPARATORS or not self.frame.of(Entity):
            marked, aside = self.frame.marked, self.frame.aside
            if not self.frame.empty and (self.frame.verb or self.frame.of(Entity)):
                self.close()  # but: on the desk I want the mug
            self.frame.marked, self.frame.aside = marked, aside or not marked
            self.frame.speaker = not aside and not marked
        self.subject = True

    def negate(self) -> None:
        """Take `not`, `don't`: the clause says what shall not be, or tells of what someone cannot do."""
        if self.subject:
            self.frame.aside = True  # I can't find my glasses
            return
        trailing = self.behind_phrase()
        if trailing is not None:
            self.close()
            self.frame.elements, self.frame.negated = trailing, True
            return
        following = self.peek()
        if goes(self.frame) and (following is None or following.kind is not Kind.VERB):
            self.close()  # in the fridge, the kitchen one, not the pantry
            self.frame.negated = True
            return
        before = self.previous
        apart = before is None or before.kind in (*SEPARATORS, Kind.NOUN, Kind.ROOM) or before.value in ("(", ")")
        if self.frame.of(Entity) + self.frame.of(Phrase) and apart and self.kind() is not Kind.VERB:
            self.close()  # on the worktop (not the table)
        elif self.frame.verb and self.frame.mood == "do" and not self.frame.marked:
            self.close()
        self.frame.negated = True

    def behind_phrase(self) -> list[Element] | None:
        """Take what stands behind the last phrase and a mark off the frame, if it does not go on with it."""
        elements = self.frame.elements
        last = max((i for i, e in enumerate(elements) if isinstance(e, Phrase)), default=-1)
        behind = elements[last + 1 :]
        if last < 0 or not behind or not isinstance(behind[0], Separator):
            return None
        del elements[last + 1 :]
        return [e for e in behind if not isinstance(e, Separator)]

    def state(self, token: Token) -> None:
        """Take `is`, `should`, `belongs`, `Tom left`: what was said last is its subject."""
        frame = self.frame
        if self.previous is not None and self.previous.kind is Kind.WISH and token.kind is Kind.WISH:
            return  # should go, needs to end up
        before = self.previous
        modal = frame.verb == "LET" or (before is not None and (before.kind is Kind.WISH or before.text == "to"))
        if modal and token.text in ("lie", "sit", "stand", "remain", "live"):
            return  # let it lie in there
        if token.text == "go" and frame.empty and not frame.marked:
            if self.kind() is not Kind.VERB:  # "go find it" says no more than "find it"
                frame.verb, frame.word = "GET", "go"  # go to the fridge for the milk
            return
        if token.kind is Kind.WISH and frame.empty and self.subject:
            frame.verb, frame.word, frame.aside = "GET", token.text, False  # I must have the mug on the desk
            return
        marked = self.previous is not None and self.previous.kind in (Kind.COMMA, Kind.STOP)
        if marked and token.text in _IT_IS and frame.of(Entity) and not goes(frame) and frame.mood != "fact":
            self.inserted = True  # the potato, it's on the counter, goes …
            return
        complete = not frame.verb and frame.mood == "do" and says_where(frame) and goes(frame)
        if (frame.verb and token.value == "told") or (
            complete and frame.elements and isinstance(frame.elements[-1], Separator)
        ):
            self.close()
        elif (
            frame.mood != "do"
            or frame.verb
            or any(isinstance(e, Part) and e.word in ("on", "off") for e in frame.elements)
        ):
            subject = self.split_subject()
            aside = self.frame.aside
            self.close()
            self.frame.elements = subject
            self.frame.aside = aside
        if self.frame.aside and token.text in ("was", "were"):
            self.frame.told = True
        frame = self.frame
        wished = token.kind is Kind.WISH or frame.marked
        frame.told = token.value == "told" or (frame.aside and token.text in ("was", "were"))
        frame.mood, frame.verb, frame.word = ("wish" if wished and not frame.told else "fact"), "BE", token.text

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
        last = elements[-1] if elements else None
        if len(elements) > 1 and isinstance(last, Pronoun | Entity) and isinstance(elements[-2], Phrase):
            return [elements.pop()]  # it is in the low cabinet that goes on a table
        return []

    def verb(self, token: Token) -> None:
        """Take a verb: it begins a frame, completes the one that is open, or only says what a thing is like."""
        frame = self.frame
        infinitive, self.infinitive = self.infinitive, False
        after_separator = bool(frame.elements) and isinstance(frame.elements[-1], Separator)
        before_token = self.previous
        if self.previous is not None and self.previous.kind is Kind.DOOR and token.value in ("OPEN", "CLOSE"):
            return  # "door shut"
        got = token.text == "get" and before_token is not None and before_token.kind is Kind.NOUN and token.close
        if (
            (got or token.text in ("need", "want", "require"))
            and not self.subject
            and not frame.verb
            and frame.of(Entity) + frame.of(Pronoun)
        ):
            self.state(token._replace(kind=Kind.WISH))  # the jeans need a wash
            return
        if self.gap:
            self.gap = False
            return  # the mug I used
        nameless = (
            not frame.verb and frame.mood == "do" and frame.of(Unknown) and not frame.of(Entity) + frame.of(Phrase)
        )
        begins = token.value in ("RUN", "OPEN", "CLOSE")  # the meeting starts
        if nameless and not after_separator and (token.form == "ed" or is_past(token.text) or begins):
            frame.mood, frame.verb, frame.word, frame.told = "fact", "BE", token.text, True
            return  # Rosa brought …
        if self.modifies(token):
            return  # the empty bottle, the frozen pizza
        if self.subject and token.value == "GET" and not frame.verb:
            frame.verb, frame.word, frame.aside = "GET", token.text, False  # I would like
            return
        participle = token.form in ("ed", "ing") or infinitive
        orders = token.form == "base" or token.text in ("put", "set", "shut")
        if token.form == "ed" and frame.verb and not frame.aside and not after_separator:
            subject = self.split_participle() or self.split_subject()
            if subject:
                self.close()
                self.frame.elements = subject
                self.frame.verb, self.frame.word, self.frame.mood = token.value, token.text, "wish"
                self.frame.done = len(subject)
                return
        if frame.aside and not (after_separator and orders and not infinitive):
            frame.verb, frame.word = frame.verb or token.value, token.text
            return
        alone = not frame.verb and frame.mood == "do" and not after_separator and not frame.marked and not frame.aside
        before, following = self.previous, self.peek()
        after_noun = (
            before is not None and before.kind in (Kind.NOUN, Kind.ROOM) and token.close and bool(frame.elements)
        )
        if alone and after_noun and token.form == "base" and not infinitive and token.text not in _PUT:
            if says_where(frame):
                self.close()  # socks in the hamper wash the jeans
                self.frame.verb, self.frame.word = token.value, token.text
                return
            if following is None or following.kind not in (Kind.PRONOUN, Kind.PREPOSITION, Kind.THERE):
                frame.mood, frame.verb, frame.word, frame.told = "fact", "BE", token.text, True  # the cleaners start
                return
        if frame.mood == "fact" and not after_separator and not frame.of(Phrase):
            return  # a state that is told: "is left", "is clean"
        if (
            (frame.mood == "wish" and not after_separator and not directed(frame))
            or (
                not frame.verb
                and (frame.marked or not frame.empty)
                and not (frame.aside or frame.heading or (after_separator and orders and says_where(frame)))
            )
            or (frame.verb in ("GET", "BE", "UNKNOWN", "DO", "LET") and frame.mood == "do" and not frame.elements)
            or (not after_separator and _completes(token, frame, participle=participle, infinitive=infinitive))
        ):
            left = frame.verb == "MOVE" and token.value in ("OPEN", "CLOSE")
            frame.verb, frame.word = token.value, frame.word if left else token.text
            frame.done = len(frame.elements) if token.form == "ed" else 0
        else:
            negated = frame.negated and frame.empty
            self.close()
            self.frame.verb, self.frame.word, self.frame.negated = token.value, token.text, negated

    def split_participle(self) -> list[Element]:
        """Take what stands behind `washed` off the frame: the subject of `the plates washed and the jeans dried`."""
        frame = self.frame
        if not frame.done or len(frame.elements) <= frame.done:
            return []
        behind = frame.elements[frame.done :]
        if not isinstance(behind[0], Separator) or not any(isinstance(e, Entity) for e in behind):
            return []
        subject: list[Element] = [e for e in behind if not isinstance(e, Separator)]
        if any(isinstance(e, Phrase) and not e.relative for e in subject):
            return []
        del frame.elements[frame.done :]
        return subject

    def modifies(self, token: Token) -> bool:
        """Return whether a verb only says what a thing is like: `the empty bottle`, `the freshly washed mug`."""
        before, following = self.previous, self.peek()
        led = (
            before is not None
            and token.close
            and (
                before.kind in (Kind.DETERMINER, Kind.ADJECTIVE, Kind.POSSESSIVE)
                or before.text in ("that", "this", "those")
            )
        )
        return led and following is not None and following.close and following.kind in (Kind.NOUN, Kind.ADJECTIVE)


def _completes(token: Token, frame: Frame, *, participle: bool, infinitive: bool) -> bool:
    """Return whether a verb says what the verb before it is for: `get it washed`, `use it to wash`, `leave it open`."""
    if frame.verb in _TAKES_VERB and (participle or frame.verb == "LET" or frame.word in ("have", "get")):
        return True
    if infinitive and token.value in ("DRY", "WASH", "HEAT"):
        return True
    return token.value in ("OPEN", "CLOSE") and frame.verb in ("MOVE", "GET")
