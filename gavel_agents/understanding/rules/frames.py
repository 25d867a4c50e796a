"""From tokens to frames: one verb with the things, places and phrases that go with it.

What names nothing and orders nothing is passed over here; a word that could do either and is not known is kept as
`Unknown`, and the frame that it stands in decides whether it matters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from gavel_agents.understanding.interface import Abstention, Question
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
    Unknown,
)
from gavel_agents.understanding.rules.english import could_act, could_name, is_past
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.nouns import known_nouns, room_named, thing_named, words_of
from gavel_agents.understanding.rules.places import process_flag
from gavel_agents.understanding.rules.questions import asked_meaning, asked_which, spoken
from gavel_agents.understanding.rules.words import Kind
from gavel_env.instructions.vocabulary import default_vocabulary

__all__ = ["frames_of"]


_SEPARATORS = (Kind.AND, Kind.COMMA, Kind.STOP, Kind.THEN, Kind.ALSO, Kind.OR)
_STARTS_NOUN = (
    Kind.NOUN, Kind.ROOM, Kind.PRONOUN, Kind.DETERMINER, Kind.THERE, Kind.WHERE, Kind.QUANTIFIER, Kind.ADJECTIVE,
    Kind.COUNT, Kind.UNKNOWN,
)  # fmt: skip
_NUMBERS = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "a couple of": 2, "a pair of": 2, "one": 1}
_MOST = 6
_IT_IS = frozenset({"it 's", "they 're", "it is", "they are"})
_TOLD_BEHIND = {
    "built in|counter|worktop|fitted": "bottom_cabinet_no_top",
    "wall|high|hangs|hanging": "top_cabinet",
    "low|freestanding|free standing|stands|alone|itself": "bottom_cabinet",
}
_CONTAINERS = {
    "box": ("box",), "packet": ("box", "bag", "pack"), "pack": ("box", "bag", "pack"), "bottle": ("bottle",),
    "can": ("can",), "tin": ("can",), "jar": ("jar",), "tube": ("tube",), "bag": ("bag",), "carton": ("carton", "box"),
    "cup": ("cup",), "pot": ("cup", "pot"), "jug": ("jug",), "bar": ("bar",), "roll": ("roll",), "tub": ("cup", "box"),
}  # fmt: skip
_STANDING = ("freestanding", "free standing", "low", "high", "built in")
_CABINETS = ("any_cabinet", "any_lower_cabinet", "bottom_cabinet", "bottom_cabinet_no_top", "any_commode")
_PUT = ("put", "set", "shut", "open")
_SEVERAL = frozenset({"them", "they", "these", "those", "all of them", "em", "the pair", "the lot", "everything"})
_FLOOR = frozenset({"floor", "ground"})
_MEANTIME = frozenset({"meanwhile", "in the meantime", "temporarily", "for the time being", "in between"})
_TAKES_VERB = ("GET", "LET", "USE")
_ACTS = ("MOVE", "FILL", "HEAT", "WASH", "DRY", "FREEZE", "RUN", "SWITCH", "OPEN", "CLOSE", "SWAP", "USE")


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


class _Reader:
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
        index = self.position + ahead
        return self.tokens[index] if index < len(self.tokens) else None

    def kind(self, ahead: int = 0) -> Kind | None:
        token = self.peek(ahead)
        return token.kind if token else None

    def read(self) -> list[Frame]:
        while (token := self.peek()) is not None:
            self.position += 1
            self.take(token)
            self.previous = token
            if token.kind not in _SEPARATORS:
                self.frame.end = max(self.frame.end, self.tokens[self.position - 1].end)
        self.close()
        return corrected(self.frames)

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

    def take(self, token: Token) -> None:
        kind = token.kind
        if self.frame.start < 0 and kind not in _SEPARATORS:
            self.frame.start = token.start
        if token.value in ("(", ")"):
            self.insert(token)
        elif (self.inserted and token.value in ("OPEN", "CLOSE")) or (
            self.inserted and kind in (Kind.FACT, Kind.PRONOUN, Kind.RELATIVE, Kind.WISH)
        ):
            return
        elif kind in _SEPARATORS:
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
        elif kind is Kind.PARTICLE and token.text == "over" and self.kind() in _STARTS_NOUN:
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
            self.close()
            self.frame.aside = True
        elif kind is Kind.CORRECTION:
            self.close()
            self.frame.corrects = True

    # --- marks and small words --------------------------------------------------------------------------------------

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
        alone = after is None or after.kind in _SEPARATORS
        state = following.value in ("on", "off") and (following.kind is Kind.PARTICLE or alone)
        return (state and bool(frame.of(Entity))) or (frame.verb in _ACTS and not frame.elements)

    def lists(self) -> bool:
        """Return whether what was said is a thing that a colon leads to its place from: `mug: dishwasher`."""
        frame = self.frame
        following = self.peek()
        if following is None or frame.verb or frame.mood != "do" or not frame.of(Entity):
            return False
        if any(isinstance(e, Entity) and not e.movable for e in frame.elements) or frame.of(Phrase):
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

    def count(self, token: Token) -> None:
        """Take a number: it says how many of a kind follow."""
        said = _NUMBERS.get(token.text) or (int(token.text) if token.text.isdigit() and len(token.text) < 3 else 0)
        self.many = said or -1
        ahead = 0
        while self.kind(ahead) in (Kind.ADJECTIVE, Kind.DETERMINER):
            ahead += 1
        following = self.peek(ahead)
        if following is not None and following.kind is Kind.UNKNOWN:
            after = self.peek(ahead + 1)
            following = after if after is not None and after.form == "s" else None  # not: a two-handled pot
        if following is None or following.kind not in (Kind.NOUN, Kind.ROOM):
            self.many = 0

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
        if wants and token.close and (self.frame.verb or _says_where(self.frame)):
            self.close()  # … in the laundry room i want both of them
            self.subject = True
            return
        if before is not None and before.kind is Kind.NOUN and token.close:
            self.gap = True  # the mug I used this morning
            return
        if before is None or before.kind in _SEPARATORS or not self.frame.of(Entity):
            marked, aside = self.frame.marked, self.frame.aside
            if not self.frame.empty and (self.frame.verb or self.frame.of(Entity)):
                self.close()  # but: on the desk I want the mug
            self.frame.marked, self.frame.aside = marked, aside or not marked
            self.frame.speaker = not aside and not marked
        self.subject = True

    def stand_for(self, token: Token) -> None:
        """Take a pronoun; `the kitchen one` tells the piece before apart."""
        before = self.previous
        if token.text in ("one", "ones") and before is not None and before.kind in (*_LEADS, Kind.ROOM, Kind.NOUN):
            return
        weak = token.text in ("one", "ones", "that", "this", "each", "each one", "machine")
        self.put(Pronoun(token.value == "whole", token.text in _SEVERAL, weak))

    def negate(self) -> None:
        if self.subject:
            self.frame.aside = True  # I can't find my glasses
            return
        trailing = self.behind_phrase()
        if trailing is not None:
            self.close()
            self.frame.elements, self.frame.negated = trailing, True
            return
        following = self.peek()
        if _goes(self.frame) and (following is None or following.kind is not Kind.VERB):
            self.close()  # in the fridge, the kitchen one, not the pantry
            self.frame.negated = True
            return
        before = self.previous
        apart = before is None or before.kind in (*_SEPARATORS, Kind.NOUN, Kind.ROOM) or before.value in ("(", ")")
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

    def there(self, token: Token) -> None:
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

    def relate(self, token: Token) -> None:
        """Take `that's`, `that I left`: a phrase that follows says where the thing before it is."""
        following = self.peek()
        marked = self.previous is not None and self.previous.kind in _SEPARATORS
        if marked and token.text == "that 's" and following is not None and following.kind is Kind.UNKNOWN:
            self.close()  # hands off, that's dinner
            self.frame.aside, self.frame.verb = True, "TOLD"
            return
        if following is not None and following.kind is Kind.VERB and following.form == "ed":
            self.position += 1  # that was left in the garden
        self.relative = self.kind() is Kind.PREPOSITION

    # --- noun phrases -----------------------------------------------------------------------------------------------

    def noun(self, token: Token) -> None:
        """Take a noun with the room before or after it, or a room that stands alone."""
        room: str | None = None
        if token.kind is Kind.ROOM:
            ahead = 0
            while self.kind(ahead) in (Kind.POSSESSIVE, Kind.ADJECTIVE):
                ahead += 1
            following = self.peek(ahead)
            named = self.named_room(token)
            if following is None or following.kind is not Kind.NOUN or not following.close:
                self.room(named)
                return
            room, token = named, following
            self.position += ahead + 1
        contained = self.contained(token)
        if contained is not None:
            self.put_many(contained, token, self.many)
            self.many = 0
            return
        cabinet = self.kind_of_cabinet(token)
        if cabinet is not None:
            self.many = 0
            self.put(Entity(cabinet, room or self.room_after() or self.under_counter()))
            return
        entity = self.entity(token, None)
        many, self.many = self.many, 0
        if entity.movable:
            self.put_many(entity, token, many)
            if room is not None:  # the bedroom pillow
                self.frame.elements.append(Phrase("in", Room(room), relative=True))
            return
        self.put(self.entity(token, room or self.room_after()))

    def contained(self, token: Token) -> Entity | None:
        """Take `of matches` after `box`, where some kind of them comes in boxes."""
        words = _CONTAINERS.get(token.text.removesuffix("es")) or _CONTAINERS.get(token.text.removesuffix("s"))
        words = words or _CONTAINERS.get(token.text)
        of, content = self.peek(), self.peek(1)
        if words is None or of is None or of.text != "of" or content is None or content.kind is not Kind.NOUN:
            return None
        kinds = Entity(known_nouns()[words_of(content.text)].name).kinds
        fitting = [k.name for k in kinds if set(words) & set(k.name.split("_"))]
        if len(fitting) != 1:
            usual = [name for name in fitting if name in default_vocabulary().movables]
            fitting = usual if len(usual) == 1 else []
        if not fitting:
            return None
        self.position += 2
        return Entity(fitting[0])

    def kind_of_cabinet(self, token: Token) -> str | None:
        """Return which kind of cabinet is meant: a low one, one on the wall, one under the counter."""
        named = known_nouns()[words_of(token.text)]
        if named.name not in _CABINETS or self.house is None:
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
            if isinstance(piece, Entity) and piece.category in _CABINETS:
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

    def put_many(self, entity: Entity, token: Token, many: int) -> None:
        """Add a thing, or each of several of a kind: `two mugs`, `both mugs`.

        Raises:
            Abstention: how many is left open, or it cannot be said of things of several kinds.
        """
        before = self.previous
        single = before is not None and before.text.endswith((" of the", " of my", " of our"))
        if many == 0 and token.form == "s" and not single and not _comes_in_pairs(entity):
            many = 2
        self.pair = False
        if many in (0, 1):
            self.put(entity)
            return
        usual = [kind.name for kind in entity.kinds if kind.name in default_vocabulary().movables]
        if len(entity.kinds) > 1 and len(usual) == 1:
            entity = Entity(usual[0])
        if 1 < many <= _MOST and len(entity.kinds) > 1:
            self.frame.several[entity] = many
            self.put(entity)
            return
        if many < 0 or many > _MOST or len(entity.kinds) > 1:
            words = f"{'' if many < 0 else many} {token.text}".strip()
            asks = f"Which are meant by {words!r}? Name each of them, or how many of one kind."
            raise Abstention("counting", words, Question(f"count:{token.text}", asks, token.text))
        preposition, relative = self.preposition, self.relative
        for index in range(many):
            self.preposition, self.relative = preposition, relative
            self.put(Entity(f"{entity.category}_{index}"))

    def spoken_of(self, word: str) -> Entity | None:
        """Return the thing that `the bowl` takes up: the mixing bowl that was spoken of."""
        for said, entity in reversed(self.memory):
            if " " in said and word in said.split() and not said.startswith(f"{word} "):
                return entity
            if said == word:
                return None
        return next((e for said, e in reversed(self.memory) if said.startswith(f"{word} of ")), None)

    def entity(self, token: Token, room: str | None) -> Entity:
        before = self.previous
        if before is not None and before.text in ("the", "that", "this") and " " not in token.text:
            taken_up = self.spoken_of(token.text)
            if taken_up is not None and taken_up.movable:
                return taken_up
        entity = self.named_entity(token, room)
        if before is not None and before.kind in _LEADS and before.text not in ("a", "an", "some", "any"):
            self.frame.definite.add(entity)
        self.memory.append((token.text, entity))
        return entity

    def named_entity(self, token: Token, room: str | None) -> Entity:
        named = known_nouns()[words_of(token.text)]
        return Entity(thing_named(named, token.text, room, self.house), room)

    def named_room(self, token: Token) -> str:
        return room_named(known_nouns()[words_of(token.text)], self.house)

    def room(self, name: str) -> None:
        """Take a room that stands alone: with the piece before it (`desk, study`), or for itself."""
        behind = len(self.frame.elements) - 1
        while behind > 0 and isinstance(self.frame.elements[behind], Separator) and not self.continues():
            behind -= 1  # the desk (study)
        last = self.frame.elements[behind] if behind >= 0 else None
        if self.either():
            return
        if self.preposition is None:
            if isinstance(last, Entity) and not last.movable and last.room is None:
                self.frame.elements[behind] = last._replace(room=name)
                return
            target = last.target if isinstance(last, Phrase) else None
            if isinstance(last, Phrase) and isinstance(target, Entity) and target.room is None and not target.movable:
                self.frame.elements[behind] = last._replace(target=target._replace(room=name))
                return
            self.preposition = Token(Kind.PREPOSITION, "at", "")
        self.put(Room(name))

    def either(self) -> bool:
        """Take the second of two rooms that will both do: `a counter, kitchen or pantry`."""
        elements = self.frame.elements
        if not elements or not isinstance(elements[-1], Separator) or elements[-1].kind is not Kind.OR:
            return False
        for index in range(len(elements) - 2, -1, -1):
            element = elements[index]
            piece = element.target if isinstance(element, Phrase) else element
            if isinstance(piece, Entity) and piece.room is not None:
                open_ = piece._replace(room=None)
                elements[index] = element._replace(target=open_) if isinstance(element, Phrase) else open_
                self.preposition = None
                return True
        return False

    def continues(self) -> bool:
        """Return whether more than a mark follows."""
        following = self.peek()
        return following is not None and following.kind not in _SEPARATORS and following.kind is not Kind.ARROW

    def room_after(self) -> str | None:
        """Take `in the kitchen` after a piece of furniture."""
        ahead = 1 if self.kind() is Kind.RELATIVE else 0
        while self.kind(ahead) is Kind.VERB and self.tokens[self.position + ahead].value == "OPEN":
            ahead += 1  # the cabinet standing open in the hall
        leading = self.peek(ahead)
        if leading is None or leading.kind is not Kind.PREPOSITION or leading.text not in _IN_ROOM:
            return None
        ahead += 1
        while self.kind(ahead) in (Kind.DETERMINER, Kind.ADJECTIVE):
            ahead += 1
        room = self.peek(ahead)
        following = self.peek(ahead + 1)
        if room is None or room.kind is not Kind.ROOM:
            return None
        if following is not None and following.kind is Kind.NOUN and following.close:
            return None
        self.position += ahead + 1
        return self.named_room(room)

    def unknown(self, token: Token) -> None:
        """Take a word that is not known: it goes with a noun, names something, orders something, or is passed over."""
        if self.frame.aside and could_act(token.text):
            self.frame.verb = self.frame.verb or "TOLD"
        following, before = self.peek(), self.previous
        if len(token.text) < 2 and before is not None:
            return
        if token.text in _FLOOR:
            self.floor()
            return
        if token.text in ("wall", "walls"):
            self.on_the_wall()
            return
        if (
            following is not None
            and following.close
            and following.kind in (Kind.NOUN, Kind.ROOM, Kind.UNKNOWN, Kind.POSSESSIVE)
        ):
            return  # the brass candle holder, Tom's mug
        compound = before is not None and before.kind is Kind.NOUN and token.close
        if compound and could_name(token.text) and not token.name:
            words = f"{before.text} {token.text}" if before else token.text
            raise asked_meaning(words)
        led = before is not None and before.kind in _LEADS and token.close
        taken_up = self.spoken_of(token.text) if before is not None and before.text in ("the", "that") else None
        if taken_up is not None:
            self.put(taken_up)
            return
        starts = self.frame.empty and not self.subject and not self.frame.marked
        told = is_past(token.text) or token.text.endswith("s")
        tells = before is not None and before.kind is Kind.NOUN and token.close and could_act(token.text) and told
        if tells and not self.frame.verb and self.frame.mood == "do" and not self.gap and not could_name(token.text):
            self.state(token._replace(kind=Kind.FACT, value="told", text=token.text))  # my scarf fell
            return
        if (
            not led
            and starts
            and not told
            and could_act(token.text)
            and following is not None
            and following.kind in _STARTS_NOUN
        ):
            self.frame.verb, self.frame.word = "UNKNOWN", token.text
        elif led or self.preposition is not None or (could_name(token.text) and not token.name):
            self.put(Unknown(token.text))

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
            if isinstance(piece, Entity) and piece.category in _CABINETS:
                told = Entity("top_cabinet", piece.room or room)
                elements[index] = element._replace(target=told) if isinstance(element, Phrase) else told
                return

    def floor(self) -> None:
        """Take `the kitchen floor`, `the floor of a bedroom`: where a thing lies, and not where it goes."""
        elements = self.frame.elements
        last = elements[-1] if elements else None
        named = self.previous is not None and self.previous.kind is Kind.ROOM
        if named and isinstance(last, Phrase) and isinstance(last.target, Room):
            elements[-1] = last._replace(preposition="in", relative=True)
        self.preposition = None
        room = self.room_after()
        if room is not None:
            elements.append(Phrase("in", Room(room), relative=True))

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
            said = [t for t in self.tokens[: self.position] if t.close or t.kind not in _SEPARATORS]
            nouns = [index for index, t in enumerate(said) if t.kind is Kind.NOUN][-2:]
            words = " ".join(t.text for t in said[nouns[0] : nouns[-1] + 1]) if len(nouns) == 2 else ""
            raise asked_which(words, (spoken(other), spoken(target)))

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
            if mark.kind is Kind.OR or target.room is None:
                open_ = None if mark.kind is Kind.OR else room.type
                elements[index] = element._replace(target=target._replace(room=open_))
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
        if frame.aside or frame.verb in ("SWAP", "GET", "FILL"):
            return False
        parts = any(isinstance(e, Part) and e.word in ("on", "off") for e in frame.elements)
        lit = any(isinstance(e, Entity) and any(k.toggleable for k in e.kinds) for e in frame.elements)
        apart = all(isinstance(e.target, Room) for e in frame.elements if isinstance(e, Phrase))
        if parts and lit and apart:
            return not frame.verb or frame.mood == "wish"
        following = self.peek()
        marked = bool(frame.elements) and isinstance(frame.elements[-1], Separator)
        switches = (
            following is not None and following.value in ("on", "off") and any(k.toggleable for k in target.kinds)
        )
        if switches and marked and frame.of(Entity) and not target.movable and self.kind(1) in (None, *_SEPARATORS):
            return True  # hockey stick in a bookcase and one computer on
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
        last = self.frame.elements[-1] if self.frame.elements else None
        close = self.previous is not None and self.previous.kind is Kind.NOUN
        return close and isinstance(last, Entity) and last.movable and self.frame.verb in ("", "MOVE")

    def lead(self, token: Token) -> None:
        """Take a preposition: it leads a phrase, a verb, or stands alone."""
        following = self.kind()
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
        if following in _STARTS_NOUN:
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

    # --- verbs ------------------------------------------------------------------------------------------------------

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
        if marked and token.text in _IT_IS and frame.of(Entity) and not _goes(frame) and frame.mood != "fact":
            self.inserted = True  # the potato, it's on the counter, goes …
            return
        complete = not frame.verb and frame.mood == "do" and _says_where(frame) and _goes(frame)
        if (frame.verb and token.value == "told") or (
            complete and frame.elements and isinstance(frame.elements[-1], Separator)
        ):
            self.close()
        elif frame.mood != "do" or frame.verb:
            subject = self.split_subject()
            aside = self.frame.aside
            self.close()
            self.frame.elements = subject
            self.frame.aside = aside
        frame = self.frame
        wished = token.kind is Kind.WISH or frame.marked
        frame.told = token.value == "told"
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
        if nameless and not after_separator and (token.form == "ed" or is_past(token.text)):
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
            if _says_where(frame):
                self.close()  # socks in the hamper wash the jeans
                self.frame.verb, self.frame.word = token.value, token.text
                return
            if following is None or following.kind not in (Kind.PRONOUN, Kind.PREPOSITION, Kind.THERE):
                frame.mood, frame.verb, frame.word, frame.told = "fact", "BE", token.text, True  # the cleaners start
                return
        if frame.mood == "fact" and not after_separator and not frame.of(Phrase):
            return  # a state that is told: "is left", "is clean"
        if (
            (frame.mood == "wish" and not after_separator and not _directed(frame))
            or (
                not frame.verb
                and (frame.marked or not frame.empty)
                and not (frame.aside or frame.heading or (after_separator and orders and _says_where(frame)))
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


_LEADS = (Kind.DETERMINER, Kind.ADJECTIVE, Kind.COUNT, Kind.POSSESSIVE, Kind.QUANTIFIER, Kind.UNKNOWN)
_IN_ROOM = ("in", "of", "over in", "at", "back in", "inside", "from", "up in", "down in", "out in", "within", "by")


def _completes(token: Token, frame: Frame, *, participle: bool, infinitive: bool) -> bool:
    """Return whether a verb says what the verb before it is for: `get it washed`, `use it to wash`, `leave it open`."""
    if frame.verb in _TAKES_VERB and (participle or frame.verb == "LET" or frame.word in ("have", "get")):
        return True
    if infinitive and token.value in ("DRY", "WASH", "HEAT"):
        return True
    return token.value in ("OPEN", "CLOSE") and frame.verb in ("MOVE", "GET")


def _comes_in_pairs(entity: Entity) -> bool:
    """Return whether a plural names one thing: socks, keys, a pair of shoes."""
    pairs = ("sock", "gym_shoe", "sandal", "high_heel", "rubber_glove", "key", "legging", "hiking_boot", "rubber_boot")
    return entity.category in pairs or default_vocabulary().is_plural(entity.category)


def _goes(frame: Frame) -> bool:
    """Return whether a frame says where something goes."""
    return any(isinstance(e, Phrase) and not e.relative and e.preposition not in _FROM for e in frame.elements)


_FROM = ("from", "out", "off", "of", "for", "with")


def _says_where(frame: Frame) -> bool:
    """Return whether a frame without a verb is complete: `mug in the dishwasher, ...`."""
    return bool(frame.of(Phrase) and frame.of(Entity) + frame.of(Pronoun))


def _directed(frame: Frame) -> bool:
    return any(isinstance(e, Phrase) and e.directional for e in frame.elements)
