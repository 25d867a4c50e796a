"""What each verb makes true: one table from what a verb asks for to how its frame is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gavel_agents.understanding.interface import Abstention, Question
from gavel_agents.understanding.rules.appliances import about_doors, door, process, run, use
from gavel_agents.understanding.rules.discourse import Act, Discourse, designator_of, movables, said
from gavel_agents.understanding.rules.elements import Cycle, Entity, Frame, Part, Phrase, Pronoun, Room, Unknown
from gavel_agents.understanding.rules.english import could_name
from gavel_agents.understanding.rules.groups import grouped, locate, locates
from gavel_agents.understanding.rules.moving import move, through
from gavel_agents.understanding.rules.places import says_where
from gavel_agents.understanding.rules.questions import asked_instead, asked_meaning
from gavel_agents.understanding.rules.words import verb_forms
from gavel_env.world_model.goals import Predicate

__all__ = ["read_frame"]

_TAKING = ("MOVE", "HEAT", "WASH", "DRY", "GET", "USE")
_ORDERS = ("MOVE", "FILL", "HEAT", "WASH", "DRY", "FREEZE", "RUN", "SWITCH", "OPEN", "CLOSE", "SWAP", "USE", "GIVE")
_SEARCHING = frozenset(
    form for verb in ("find", "locate", "track", "look", "search", "hunt", "seek") for form in verb_forms(verb)
)


def read_frame(discourse: Discourse, frame: Frame, following: Frame | None) -> Act:
    """Return what a frame contributes, and note in the discourse what it says.

    Args:
        discourse: what was said before.
        frame: to be read.
        following: the next frame of the sentence.

    Raises:
        Abstention: it cannot be read.
    """
    act = Act(frame)
    discourse.following = following
    discourse.name(act)
    discourse.acts.append(act)
    parked = discourse.swapped and (frame.meantime or frame.verb == "USE" or frame.word.startswith("park"))
    if frame.aside or parked or (frame.negated and not _about_states(frame)):
        _remark(discourse, act)
        return act
    if (
        frame.mood == "fact"
        and frame.of(Pronoun)
        and not (movables(frame.elements) or discourse.focus or discourse.known)
    ):
        act.passed = True  # it is dark in here
        return act
    _check_known(frame)
    if frame.heading and frame.of(Pronoun) and not discourse.known:
        frame.elements[:] = [e for e in frame.elements if not isinstance(e, Pronoun)]  # all of this goes there: …
    if frame.heading and _leads(discourse, frame):
        return act
    if not frame.verb and discourse.heading and movables(frame.elements) and not frame.of(Phrase):
        frame.verb, frame.word = discourse.heading, discourse.heading.lower()
    _READ[frame.verb](discourse, act)
    discourse.settle(frame)
    return act


def _about_states(frame: Frame) -> bool:
    """Return whether a negation says how something is left: `don't leave the fridge open`, `isn't on the desk`."""
    lit = any(isinstance(e, Part) and e.word in ("on", "off") for e in frame.elements)
    return frame.mood == "fact" or frame.verb in ("OPEN", "CLOSE") or about_doors(frame) or lit


def _remark(discourse: Discourse, act: Act) -> None:
    """Read what asks for nothing: it may say where a thing is, and what `it` will be."""
    frame = act.frame
    act.passed = True
    named = movables(frame.elements)
    elsewhere = frame.verb and not frame.told and frame.mood == "do" and not frame.negated and not frame.speaker
    if elsewhere and named and any(isinstance(e, Phrase) and e.directional for e in frame.elements):
        raise asked_instead("unparsed", "this may ask for something that is not understood")
    placed = any(
        isinstance(e, Phrase)
        and isinstance(e.target, Entity)
        and says_where(e.preposition)
        and e.preposition != "at"
        and not locates(e)
        for e in frame.elements
    )
    if frame.speaker and placed and (named or frame.of(Pronoun)) and not frame.verb and frame.mood == "do":
        raise asked_instead("unparsed", "this may ask for something that is not understood")
    if frame.mood == "fact" and not frame.negated and named:
        for element in frame.elements:
            if (
                isinstance(element, Phrase)
                and element.preposition in ("on", "in", "at")
                and frame.of(Phrase) == [element]
            ):
                _be(discourse, act)
    if named and not discourse.focus and not frame.negated:
        discourse.focus = named


def _check_known(frame: Frame) -> None:
    """Refuse an order that names an unknown thing or act.

    Raises:
        Abstention: `unknown_word`.
    """
    if frame.verb == "UNKNOWN":
        if frame.of(Entity) or frame.of(Phrase) or frame.of(Unknown):
            raise asked_meaning(frame.word)
        frame.verb = ""
    if frame.mood == "fact" or frame.told:
        return
    for element in frame.elements:
        target = element.target if isinstance(element, Phrase) else element
        if not isinstance(target, Unknown) or not could_name(target.words):
            continue
        if target.words in ("floor", "ground"):
            if (
                isinstance(element, Phrase)
                and element.preposition == "on"
                and not frame.of(Room)
                and not _in_a_room(frame)
            ):
                raise Abstention("no_destination", "on the floor of which room?", _FLOOR_QUESTION)
            continue
        places = ("on", "in", "to", "from", "out", "off", "arrow", "under", "beside")
        if isinstance(element, Phrase) and element.preposition not in places:
            continue
        if frame.verb in _ORDERS or frame.of(Entity) or frame.of(Pronoun):
            raise asked_meaning(target.words)


_FLOOR_QUESTION = Question("word:floor", "On the floor of which room?", "floor")


def _in_a_room(frame: Frame) -> bool:
    return any(isinstance(e, Phrase) and isinstance(e.target, Room) for e in frame.elements)


def _leads(discourse: Discourse, frame: Frame) -> bool:
    """Read a heading: `desk: …` says where what follows goes, `wash: …` what is done with it."""
    pieces = [e for e in frame.elements if isinstance(e, Entity)]
    phrases = [e for e in frame.elements if isinstance(e, Phrase)]
    discourse.heading = ""
    if frame.verb in ("WASH", "DRY", "HEAT", "OPEN", "CLOSE", "RUN") and not pieces and not phrases:
        discourse.heading = frame.verb
        return True
    if frame.verb in ("", "MOVE") and len(pieces) == 1 and not pieces[0].movable and not phrases:
        discourse.offered = Phrase("to", pieces[0])
        return True
    if not frame.verb and not pieces and len(phrases) == 1 and not locates(phrases[0]):
        discourse.offered = phrases[0]
        return True
    return False


def _be(discourse: Discourse, act: Act) -> None:
    """Read `is` and `should be`: a fact states locations, a wish destinations."""
    if act.frame.mood == "wish":
        move(discourse, act)
        return
    furniture = [e for e in act.frame.elements if isinstance(e, Entity) and not e.movable]
    if furniture and not movables(act.frame.elements):
        _furniture_is(discourse, act, furniture[-1])
        return
    leading, groups = grouped(discourse, act)
    things = discourse.things(act)
    for group in groups:
        for phrase, _ in group.phrases:
            for thing in group.things or things:
                discourse.state(act, thing, phrase)
    for phrase in leading:
        for thing in things:
            discourse.state(act, thing, phrase)


def _furniture_is(discourse: Discourse, act: Act, piece: Entity) -> None:
    """Read `the desk is in the study`: its later mentions mean that one; what else is told of it asks for nothing."""
    for phrase in act.frame.elements:
        if isinstance(phrase, Phrase) and phrase.preposition in ("in", "on") and isinstance(phrase.target, Entity):
            raise Abstention("unparsed", f"where the {said(piece)} is can only be said as a room")
        if isinstance(phrase, Phrase) and isinstance(phrase.target, Room) and piece.room is None:
            named = piece._replace(room=phrase.target.type)
            discourse.places.append(named)


def _get(discourse: Discourse, act: Act) -> None:
    """Read `get`, `find`, `want`: a phrase is where the thing is if the next verb takes it elsewhere."""
    if act.frame.word == "go":
        _go_for(discourse, act)
        return
    if discourse.visited is not None and not act.frame.of(Phrase):
        for thing in discourse.things(act):
            discourse.state(act, thing, discourse.visited)
        discourse.visited = None
        return
    following = discourse.following
    taken = (
        following is not None
        and following.verb in _TAKING
        and not movables(following.elements)
        and any(isinstance(e, Pronoun | Phrase) for e in following.elements)
    )
    if not act.frame.of(Phrase):
        discourse.fetched.update(movables(act.frame.elements))
    if act.frame.of(Cycle) or not (taken or act.frame.word.partition(" ")[0] in _SEARCHING):
        move(discourse, act)
        return
    leading, groups = grouped(discourse, act)
    things = discourse.things(act)
    discourse.fetched.update(things)
    for group in groups:
        for phrase, owner in group.phrases if group.things else ():
            locate(discourse, act, group, phrase, owner)
    for phrase in leading:
        for thing in things:
            discourse.state(act, thing, phrase)


def _go_for(discourse: Discourse, act: Act) -> None:
    """Read `go to the fridge for the milk`."""
    phrases = [e for e in act.frame.elements if isinstance(e, Phrase)]
    things = [p.target for p in phrases if p.preposition == "for" and isinstance(p.target, Entity)]
    if not things:
        going = [p for p in phrases if p.preposition == "to" and discourse.following is not None]
        if not going:
            raise Abstention("unparsed", "going somewhere is not a goal")
        discourse.visited = going[-1]
        return
    for phrase in phrases:
        if phrase.preposition in ("to", "in"):
            for thing in things:
                discourse.state(act, thing, phrase)
    act.things = discourse.focus = things


def _fill(discourse: Discourse, act: Act) -> None:
    """Read `fill the dishwasher with the mug and the plate`."""
    holder = next((e for e in act.frame.elements if isinstance(e, Entity) and not e.movable), None)
    things: list[Entity] = []
    for element in act.frame.elements:
        entity = element.target if isinstance(element, Phrase) and element.preposition == "with" else element
        if isinstance(entity, Entity) and entity.movable:
            things.append(entity)
        elif isinstance(element, Phrase) and things:
            discourse.state(act, things[-1], element)
    if holder is None or not things:
        raise Abstention("unparsed", "'fill' needs a container and what goes into it")
    act.things = things
    for thing in things:
        discourse.wish(act, thing, Phrase("in", holder))
    discourse.focus = things


def _run(discourse: Discourse, act: Act) -> None:
    """Read `switch on the lamp`, `switch the mug with the bowl` and `run the shirt through the washer`."""
    if any(isinstance(e, Phrase) and e.preposition == "with" for e in act.frame.elements):
        _swap(discourse, act)
    elif through(act.frame):
        process(discourse, act)
    else:
        run(discourse, act)


def _swap(discourse: Discourse, act: Act) -> None:
    """Read swaps: each thing shall be where the other is said to be."""
    if sum(isinstance(e, Phrase) and e.directional for e in act.frame.elements) > 1:
        act.frame.verb = "MOVE"
        move(discourse, act)
        return
    things: list[Entity] = []
    for element in act.frame.elements:
        entity = element.target if isinstance(element, Phrase) and element.preposition in ("with", "for") else element
        if isinstance(entity, Entity) and entity.movable:
            things.append(entity)
        elif isinstance(element, Phrase) and things:
            discourse.state(act, things[-1], element)
    if not things and act.frame.heading:
        act.passed = True  # swap these: …
        return
    act.things = things or list(discourse.focus)
    discourse.swapped = True
    if len(act.things) != 2:
        raise Abstention("unparsed", f"a swap is between two things, not {len(act.things)}")
    for thing, other in (act.things, act.things[::-1]):
        if other not in discourse.where:
            raise Abstention("unknown_place", f"nothing says where the {said(other)} is")
        discourse.put(act, thing, discourse.where[other])


def _same(discourse: Discourse, act: Act) -> None:
    """Read `do the same for the fork`."""
    things = movables(act.frame.elements) or [e for e in discourse.focus if e not in discourse.wished]
    act.things = things
    pieces = [e for e in act.frame.elements if isinstance(e, Entity) and not e.movable]
    states = [
        g for earlier in discourse.acts for g in earlier.goals if g.predicate in (Predicate.TOGGLED, Predicate.OPEN)
    ]
    if pieces and states and not movables(act.frame.elements):
        act.goals.extend(states[-1]._replace(subject=designator_of(piece)) for piece in pieces)  # so is the television
        return
    if not things or not discourse.wished:
        raise Abstention("no_antecedent", "nothing was done before that could be done again")
    relation = list(discourse.wished.values())[-1]
    _, groups = grouped(discourse, act)
    for group in groups:
        for phrase, owner in group.phrases:
            locate(discourse, act, group, phrase, owner)
    for thing in things:
        discourse.put(act, thing, relation)


_READ: Mapping[str, Callable[[Discourse, Act], None]] = {
    "": move,
    "MOVE": move,
    "GIVE": move,
    "LET": move,
    "BE": _be,
    "GET": _get,
    "FILL": _fill,
    "HEAT": process,
    "WASH": process,
    "DRY": process,
    "FREEZE": process,
    "DO": process,
    "USE": use,
    "RUN": _run,
    "SWITCH": _run,
    "OPEN": door,
    "CLOSE": door,
    "SWAP": _swap,
    "SAME": _same,
}
