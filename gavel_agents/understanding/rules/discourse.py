"""What an instruction has said so far: what pronouns stand for, where things are, where they shall be."""

from __future__ import annotations

from dataclasses import dataclass, field

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.elements import (
    Element,
    Entity,
    Frame,
    Phrase,
    Pronoun,
    Room,
    Separator,
    There,
    Unknown,
)
from gavel_agents.understanding.rules.places import (
    Relation,
    can_become,
    destination,
    process_flag,
    says_where,
    stated_location,
)
from gavel_agents.understanding.rules.questions import asked_which_of
from gavel_agents.understanding.rules.words import Kind
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.goals import Designator, Literal

__all__ = ["Act", "Discourse", "designator_of", "said"]


@dataclass
class Act:
    """What one frame contributes.

    Attributes:
        frame: what was said.
        things: what it acts on, in order.
        mentions: every noun phrase in it.
        goals, relations: literals.
        passed: it asks for nothing: a remark, or what shall not be done.
    """

    frame: Frame
    things: list[Entity] = field(default_factory=list)
    mentions: list[Entity] = field(default_factory=list)
    goals: list[Literal] = field(default_factory=list)
    relations: list[Literal] = field(default_factory=list)
    passed: bool = False


@dataclass
class Discourse:
    """The state that frames are read in.

    Attributes:
        focus: the things spoken of last: `it`, `them`.
        places: furniture spoken of, oldest first.
        there: the piece that was spoken of before the clause.
        room: that was spoken of last.
        where: where things were said to be.
        wished: where things shall be.
        loaded: furniture -> what shall be in or on it.
        container: the movable that something was put on or in last: `the whole thing`.
        instrument: the appliance used last: `there` after a wash.
        telling: the frame before stated a fact, so that the next fact adds to the focus.
        following: the frame that comes next in the sentence.
        acts: what was read so far.
        offered: a destination that was said before what goes there.
        visited: where the robot was sent to take something.
        brought: things that were brought `to` an appliance.
        first: where things were said to be at first: where they are put back to.
        heading: the verb of a heading: what is done with what follows.
        known: movables by name, in the order said.
        used: pieces that serve to do what is asked.
        swapped: two things shall trade places.
        returned: names of what shall be put back.
        fetched: what shall be taken up, and nothing said yet of where it goes.
        homeless: what shall be moved, and nothing said yet of where to.
        loosely: things whose place was said without a verb: where they are, if another place follows.
    """

    focus: list[Entity] = field(default_factory=list)
    places: list[Entity] = field(default_factory=list)
    there: Entity | None = None
    room: str | None = None
    where: dict[Entity, Relation] = field(default_factory=dict)
    wished: dict[Entity, Relation] = field(default_factory=dict)
    loaded: dict[Entity, list[Entity]] = field(default_factory=dict)
    container: Entity | None = None
    instrument: Entity | None = None
    telling: bool = False
    following: Frame | None = None
    acts: list[Act] = field(default_factory=list)
    offered: Phrase | None = None
    visited: Phrase | None = None
    brought: set[Entity] = field(default_factory=set)
    first: dict[Entity, Relation] = field(default_factory=dict)
    heading: str = ""
    known: list[Entity] = field(default_factory=list)
    used: set[Entity] = field(default_factory=set)
    swapped: bool = False
    returned: set[str] = field(default_factory=set)
    fetched: set[Entity] = field(default_factory=set)
    homeless: dict[Entity, None] = field(default_factory=dict)
    loosely: set[Entity] = field(default_factory=set)

    def name(self, act: Act) -> None:
        """Note the noun phrases of a frame; `the bottle` is the wine bottle that was spoken of."""
        elements = act.frame.elements
        self.there = self.places[-1] if self.places else None
        for element in elements:
            target = element.target if isinstance(element, Phrase) else element
            if isinstance(target, Room):
                self.room = target.type
            elif isinstance(target, Entity) and target.room is not None:
                self.room = target.room
        for index, element in enumerate(elements):
            entity = element.target if isinstance(element, Phrase) else element
            if not isinstance(entity, Entity):
                continue
            meant = self.same_thing(entity) if entity.movable else self.same_place(entity)
            elements[index] = element._replace(target=meant) if isinstance(element, Phrase) else meant
            act.mentions.append(meant)
            (self.known if meant.movable else self.places).append(meant)
        self._drop_groups(act)

    def same_thing(self, entity: Entity) -> Entity:
        """Return the thing that was spoken of before and that a vaguer word now names."""
        if len(entity.kinds) == 1:
            return entity
        others = [e for e in dict.fromkeys(reversed(self.known)) if e != entity]
        fitting = [e for e in others if set(e.kinds) <= set(entity.kinds)]
        fitting = fitting or [e for e in others if set(e.kinds) & set(entity.kinds)]
        word = entity.category.removeprefix("any_")  # the bottle: the lemonade, which comes in bottles
        fitting = fitting or [e for e in others if any(word in kind.name.split("_") for kind in e.kinds)]
        return fitting[0] if len(fitting) == 1 else entity

    def _drop_groups(self, act: Act) -> None:
        """Take out a group whose members are named: `both bottles, the wine bottle and the water bottle`."""
        things = movables(act.frame.elements)
        for group in things:
            members = [e for e in things if e != group and set(e.kinds) < set(group.kinds)]
            many = act.frame.several.get(group, 0)
            known = [e for e in dict.fromkeys(self.known) if e != group and set(e.kinds) < set(group.kinds)]
            if many and len(members) < 2:
                if len(known) != many:
                    alone = not act.frame.verb and not act.frame.of(Phrase)  # Shoes, everyone!
                    if alone or act.frame.heading or act.frame.aside or act.frame.mood == "fact":
                        act.frame.elements[:] = [e for e in act.frame.elements if e != group]
                        act.mentions[:] = [e for e in act.mentions if e != group]
                        continue  # toiletries: the comb, the brush
                    raise asked_which_of(said(group), many)
                at = act.frame.elements.index(group)
                act.frame.elements[at : at + 1] = known
                act.mentions[:] = [e for e in act.mentions if e != group] + known
            elif len(members) > 1 or (members and _apposed(act.frame.elements, group, members[0])):
                act.frame.elements[:] = [e for e in act.frame.elements if e != group]
                act.mentions[:] = [e for e in act.mentions if e != group]

    def settle(self, frame: Frame) -> None:
        """Move the focus to the things of a frame that was read."""
        things = movables(frame.elements)
        if not things and not frame.verb and not self.focus:
            things = [e.target for e in frame.elements if isinstance(e, Phrase) and isinstance(e.target, Entity)]
            things = [thing for thing in things if thing.movable]  # when you are done with the jeans
        if things:
            adds = frame.mood == "fact" and self.telling
            self.focus = list(dict.fromkeys([*self.focus, *things])) if adds else things
        self.telling = frame.mood == "fact"

    def things(self, act: Act) -> list[Entity]:
        """Return what a frame acts on; if it names nothing, what was spoken of last."""
        act.things = movables(act.frame.elements)
        if not act.things:
            whole = any(isinstance(e, Pronoun) and e.whole for e in act.frame.elements)
            act.things = [self.container] if whole and self.container else list(self.focus or self.known[-1:])
        return act.things

    def antecedents(self, pronoun: Pronoun) -> list[Entity]:
        """Return what a pronoun stands for.

        Raises:
            Abstention: nothing that it could stand for was said.
        """
        if pronoun.whole and self.container:
            return [self.container]
        if pronoun.both and len(self.focus) == 1 and self.container and self._rides(self.focus[0]):
            return [self.container]  # both: the tray with what is on it
        pending = [thing for thing in dict.fromkeys(self.known) if thing in self.fetched and thing not in self.wished]
        several = list(dict.fromkeys(self.known))[-2:]
        if pronoun.both and not self.focus and len(several) > 1:
            return several
        if pronoun.both and len(self.focus) == 1 and len(pending) > 1:
            return pending  # pick up the doll; pick up the car; both go on the bed
        return list(self.focus or self.known[-1:])

    def _rides(self, thing: Entity) -> bool:
        return thing in self.wished and self.wished[thing].holder == self.container

    def same_place(self, entity: Entity) -> Entity:
        """Return the piece with the room that an earlier mention gave it."""
        if entity.room is None:
            for earlier in reversed(self.places):
                alike = earlier.category == entity.category and earlier.room is not None
                if alike or set(earlier.kinds) < set(entity.kinds):
                    return earlier
        return entity

    def resolve(self, target: Entity | Room | Pronoun | There | Unknown) -> Entity | Room | None:
        """Return what the target of a phrase means."""
        if isinstance(target, Entity):
            return self.same_place(target)
        if isinstance(target, Room):
            return target
        if isinstance(target, Unknown):
            return None
        if isinstance(target, There):
            return self.instrument or self.there
        return self.container or (self.focus[0] if self.focus else None)

    def state(self, act: Act, thing: Entity, phrase: Phrase) -> None:
        """Note where a thing is said to be."""
        target = self.resolve(phrase.target)
        if target is None or phrase.preposition == "where" or not says_where(phrase.preposition):
            return
        relation = stated_location(phrase.preposition, target)
        if isinstance(phrase.target, There) and self.where:
            relation = list(self.where.values())[-1]
        self.where[thing] = relation
        self.first.setdefault(thing, relation)
        act.relations.append(literal_of(relation, thing))

    def wish(self, act: Act, thing: Entity, phrase: Phrase) -> None:
        """Note where a thing shall be.

        Raises:
            Abstention: the phrase leads to nothing known, or nothing can be there.
        """
        if phrase.preposition == "where":
            other = phrase.target
            if not isinstance(other, Entity) or other not in self.where:
                raise Abstention("unknown_place", f"nothing says where the {said(other)} is")
            relation = self.where[other]
        else:
            target = self.resolve(phrase.target)
            if target is None:
                self.homeless[thing] = None
                return
            if isinstance(target, Entity) and self._processes(act, thing, phrase, target):
                return
            relation = destination(phrase.preposition, target)
        if relation.holder == thing:
            raise Abstention("unparsed", f"the {said(thing)} cannot hold itself")
        self.put(act, thing, relation)
        if phrase.preposition == "to":
            self.brought.add(thing)
        else:
            self.brought.discard(thing)
        if isinstance(relation.holder, Entity):
            self.loaded.setdefault(relation.holder, []).append(thing)
            if relation.holder.movable:
                self.container = relation.holder

    def _processes(self, act: Act, thing: Entity, phrase: Phrase, machine: Entity) -> bool:
        """Read `mug: dishwasher`, `the jeans to the dryer`: a machine named as the place alone does its work."""
        does = None if machine.movable else process_flag(machine)
        bare = phrase.preposition == "arrow" or (not act.frame.verb and phrase.preposition == "to")
        if does is None or not bare or not any(can_become(kind, does) for kind in thing.kinds):
            return False
        self.used.add(machine)
        self.instrument = machine
        self.loaded.setdefault(machine, []).append(thing)
        act.goals.append(Literal(does, designator_of(thing)))
        return True

    def put(self, act: Act, thing: Entity, relation: Relation) -> None:
        """Note a relation that shall hold; an appliance that a thing was brought to before was only on its way."""
        earlier = self.wished.get(thing)
        if earlier is not None and earlier != relation:
            relation = self._instead(act, thing, earlier, relation)
        self.loosely.discard(thing)
        if not act.frame.verb:
            self.loosely.add(thing)
        self.wished[thing] = relation
        act.goals.append(literal_of(relation, thing))

    def _instead(self, act: Act, thing: Entity, earlier: Relation, relation: Relation) -> Relation:
        """Take back where a thing was to go before, where that was only on its way, and return where it goes."""
        if thing in self.loosely:
            self.drop(thing)  # "Pork chop, in the fridge: …" says where it is
            self.where[thing] = earlier
            act.relations.append(literal_of(earlier, thing))
        elif isinstance(earlier.holder, Room) and isinstance(relation.holder, Entity):
            self.drop(thing)  # to the bathroom, and there into the sink
            if relation.holder.room is None and not relation.holder.movable:
                return relation._replace(holder=relation.holder._replace(room=earlier.holder.type))
        elif earlier.holder == self.instrument:
            self.drop(thing)
        elif isinstance(earlier.holder, Entity):
            does = process_flag(earlier.holder)
            if does is not None and any(can_become(kind, does) for kind in thing.kinds):
                self.drop(thing)  # into the oven and then on the table
                self.used.add(earlier.holder)
                act.goals.append(Literal(does, designator_of(thing)))
        return relation

    def drop(self, thing: Entity) -> None:
        """Forget where a thing was to go."""
        literal = literal_of(self.wished.pop(thing), thing)
        for act in self.acts:
            act.goals[:] = [goal for goal in act.goals if goal != literal]


def _apposed(elements: list[Element], group: Entity, member: Entity) -> bool:
    """Return whether a thing is named twice: `a towel, the hand towel`."""
    first, second = elements.index(group), elements.index(member)
    between = elements[first + 1 : second]
    return len(between) == 1 and isinstance(between[0], Separator) and between[0].kind is Kind.COMMA


def movables(elements: list[Element]) -> list[Entity]:
    """Return the movables among the noun phrases that stand alone, each once."""
    return list(dict.fromkeys(e for e in elements if isinstance(e, Entity) and e.movable))


def designator_of(entity: Entity) -> Designator:
    """Return the designator of a noun phrase."""
    return Designator(entity.category, entity.room)


def literal_of(relation: Relation, thing: Entity) -> Literal:
    """Return `relation(thing, holder)`."""
    holder = relation.holder
    target = designator_of(holder) if isinstance(holder, Entity) else Designator(holder.type)
    return Literal(relation.predicate, designator_of(thing), target)


def said(target: object) -> str:
    """Return what to call something in a reason."""
    return in_words(target.category) if isinstance(target, Entity) else "it"
