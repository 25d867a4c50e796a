"""Noun phrases: things with their number and room, rooms, pronouns, and words that are not known."""

from __future__ import annotations

from gavel_agents.understanding.interface import Abstention, Question
from gavel_agents.understanding.rules.cabinets import Cabinets
from gavel_agents.understanding.rules.elements import Entity, Phrase, Pronoun, Room, Separator, Unknown
from gavel_agents.understanding.rules.english import could_act, could_name, is_past
from gavel_agents.understanding.rules.lexer import Token
from gavel_agents.understanding.rules.nouns import known_nouns, room_named, thing_named, words_of
from gavel_agents.understanding.rules.stream import IN_ROOM, LEADS, STARTS_NOUN
from gavel_agents.understanding.rules.words import Kind
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import any_of

__all__ = ["NounPhrases"]

_NUMBERS = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "a couple of": 2, "a pair of": 2, "one": 1}
_MOST = 6
_CONTAINERS = {
    "box": ("box",), "packet": ("box", "bag", "pack"), "pack": ("box", "bag", "pack"), "bottle": ("bottle",),
    "can": ("can",), "tin": ("can",), "jar": ("jar",), "tube": ("tube",), "bag": ("bag",), "carton": ("carton", "box"),
    "cup": ("cup",), "pot": ("cup", "pot"), "jug": ("jug",), "bar": ("bar",), "roll": ("roll",), "tub": ("cup", "box"),
}  # fmt: skip
_SEVERAL = frozenset({"them", "they", "these", "those", "all of them", "em", "the pair", "the lot", "everything"})
_FLOOR = frozenset({"floor", "ground"})


class NounPhrases(Cabinets):
    """Takes noun phrases."""

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

    def stand_for(self, token: Token) -> None:
        """Take a pronoun; `the kitchen one` tells the piece before apart."""
        before = self.previous
        if token.text in ("one", "ones") and before is not None and before.kind in (*LEADS, Kind.ROOM, Kind.NOUN):
            return
        weak = token.text in ("one", "ones", "that", "this", "each", "each one", "machine")
        self.put(Pronoun(token.value == "whole", token.text in _SEVERAL, weak))

    def spoken_of(self, word: str) -> Entity | None:
        """Return the thing that `the bowl` takes up: the mixing bowl that was spoken of."""
        for said, entity in reversed(self.memory):
            if " " in said and word in said.split() and not said.startswith(f"{word} "):
                return entity
            if said == word:
                return None
        return next((e for said, e in reversed(self.memory) if said.startswith(f"{word} of ")), None)

    def entity(self, token: Token, room: str | None) -> Entity:
        """Return the thing that a noun names, or takes up from before."""
        before = self.previous
        if before is not None and before.text in ("the", "that", "this") and " " not in token.text:
            taken_up = self.spoken_of(token.text)
            if taken_up is not None and taken_up.movable:
                return taken_up
        entity = self.named_entity(token, room)
        if before is not None and before.kind in LEADS and before.text not in ("a", "an", "some", "any"):
            self.frame.definite.add(entity)
        self.memory.append((token.text, entity))
        return entity

    def named_entity(self, token: Token, room: str | None) -> Entity:
        """Return the thing that a noun names by itself."""
        named = known_nouns()[words_of(token.text)]
        return Entity(thing_named(named, token.text, room, self.house), room)

    def named_room(self, token: Token) -> str:
        """Return the room type that a token names in this house."""
        return room_named(known_nouns()[words_of(token.text)], self.house)

    def room(self, name: str) -> None:
        """Take a room that stands alone: with the piece before it (`desk, study`), or for itself."""
        behind = len(self.frame.elements) - 1
        while behind > 0 and isinstance(self.frame.elements[behind], Separator) and not self.continues():
            behind -= 1  # the desk (study)
        last = self.frame.elements[behind] if behind >= 0 else None
        if self.either(name):
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

    def either(self, name: str) -> bool:
        """Take the second of two rooms that will both do: `a counter, kitchen or pantry`."""
        elements = self.frame.elements
        if not elements or not isinstance(elements[-1], Separator) or elements[-1].kind is not Kind.OR:
            return False
        for index in range(len(elements) - 2, -1, -1):
            element = elements[index]
            piece = element.target if isinstance(element, Phrase) else element
            if isinstance(piece, Entity) and piece.room is not None:
                both = piece._replace(room=any_of(piece.room, name))
                elements[index] = element._replace(target=both) if isinstance(element, Phrase) else both
                self.preposition = None
                return True
        return False

    def room_after(self) -> str | None:
        """Take `in the kitchen` after a piece of furniture."""
        ahead = 1 if self.kind() is Kind.RELATIVE else 0
        while self.kind(ahead) is Kind.VERB and self.tokens[self.position + ahead].value == "OPEN":
            ahead += 1  # the cabinet standing open in the hall
        leading = self.peek(ahead)
        if leading is None or leading.kind is not Kind.PREPOSITION or leading.text not in IN_ROOM:
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

    def compound(self, unknown: Unknown) -> None:
        """Put `mug rack`, which is not a mug, in the place of the noun that was taken."""
        elements = self.frame.elements
        last = elements[-1] if elements else None
        if isinstance(last, Phrase):
            elements[-1] = last._replace(target=unknown)
        elif isinstance(last, Entity):
            elements[-1] = unknown

    def unknown(self, token: Token) -> None:
        """Take a word that is not known: it goes with a noun, names something, orders something, or is passed over."""
        if self.frame.aside and could_act(token.text):
            self.frame.verb = self.frame.verb or "TOLD"
            self.frame.told = self.frame.told or is_past(token.text)
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
        if compound and could_name(token.text) and not token.name and before is not None:
            self.compound(Unknown(f"{before.text} {token.text}"))
            return
        led = before is not None and before.kind in LEADS and token.close
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
            and following.kind in STARTS_NOUN
        ):
            self.frame.verb, self.frame.word = "UNKNOWN", token.text
        elif led or self.preposition is not None or (could_name(token.text) and not token.name):
            self.put(Unknown(token.text))

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


def _comes_in_pairs(entity: Entity) -> bool:
    """Return whether a plural names one thing: socks, keys, a pair of shoes."""
    pairs = ("sock", "gym_shoe", "sandal", "high_heel", "rubber_glove", "key", "legging", "hiking_boot", "rubber_boot")
    return entity.category in pairs or default_vocabulary().is_plural(entity.category)
