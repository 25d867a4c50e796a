"""What each verb makes true: one table from what a verb asks for to how its frame is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.appliances import about_doors, door, process, run, switched, use
from gavel_agents.understanding.rules.discourse import Act, Discourse, movables, said
from gavel_agents.understanding.rules.elements import Cycle, Entity, Frame, Part, Phrase, Pronoun, Room, There
from gavel_agents.understanding.rules.groups import Group, grouped, locate, place
from gavel_agents.understanding.rules.verb_words import verb_forms

__all__ = ["read_frame"]

_TAKING = ("MOVE", "HEAT", "WASH", "DRY", "GET", "USE")
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
    if frame.negated and frame.mood != "fact" and frame.verb not in ("OPEN", "CLOSE") and not about_doors(frame):
        raise Abstention("negation", f"{frame.word or 'something'!r} shall not be: cannot be said as a goal")
    discourse.acts.append(act)
    _READ[frame.verb](discourse, act)
    discourse.settle(frame)
    return act


def _move(discourse: Discourse, act: Act) -> None:
    frame = act.frame
    if frame.of(Cycle) or _through(frame):
        process(discourse, act)
        return
    if switched(discourse, act) or about_doors(frame):
        return
    furniture = [e for e in frame.elements if isinstance(e, Entity) and not e.movable]
    if furniture and not movables(frame.elements):
        raise Abstention("cannot_move", f"{said(furniture[0])!r} is not carried about")
    leading, groups = grouped(discourse, act)
    things = discourse.things(act)
    if groups and not groups[0].things:
        groups[0].things = list(things)
    if discourse.instrument and any(isinstance(e, Part) and e.word == "in" for e in frame.elements):
        groups = groups or [Group(list(things))]
        groups[-1].phrases.append((Phrase("in", There()), None))  # leave it inside
    if any(not g.things for g in groups):
        if len(groups) == 1 and groups[0].going:
            discourse.offered = groups[0].going[-1]  # three things have to be on the desk: ...
            return
        raise Abstention("no_antecedent", f"what shall be {frame.word or 'moved'}?")
    place(discourse, act, leading, groups)


def _through(frame: Frame) -> bool:
    return any(isinstance(e, Phrase) and e.preposition == "through" for e in frame.elements)


def _be(discourse: Discourse, act: Act) -> None:
    """Read `is` and `should be`: a fact states locations, a wish destinations."""
    if act.frame.mood == "wish":
        _move(discourse, act)
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
    """Read `the desk is in the study`: its later mentions mean that one.

    Raises:
        Abstention: it is said to be anywhere but in a room.
    """
    for phrase in act.frame.elements:
        if isinstance(phrase, Phrase):
            if not isinstance(phrase.target, Room):
                raise Abstention("unparsed", f"where {said(piece)!r} is can only be said as a room")
            discourse.places.append(piece._replace(room=phrase.target.type))


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
    if act.frame.of(Cycle) or not (taken or act.frame.word.partition(" ")[0] in _SEARCHING):
        _move(discourse, act)
        return
    leading, groups = grouped(discourse, act)
    things = discourse.things(act)
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
            raise Abstention("unparsed", "going somewhere is nothing that shall be")
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
    elif _through(act.frame):
        process(discourse, act)
    else:
        run(discourse, act)


def _swap(discourse: Discourse, act: Act) -> None:
    """Read swaps: each thing shall be where the other is said to be."""
    things: list[Entity] = []
    for element in act.frame.elements:
        entity = element.target if isinstance(element, Phrase) and element.preposition == "with" else element
        if isinstance(entity, Entity) and entity.movable:
            things.append(entity)
        elif isinstance(element, Phrase) and things:
            discourse.state(act, things[-1], element)
    act.things = things or list(discourse.focus)
    if len(act.things) != 2:
        raise Abstention("unparsed", f"a swap is between two things, not {len(act.things)}")
    for thing, other in (act.things, act.things[::-1]):
        if other not in discourse.where:
            raise Abstention("unknown_place", f"nothing says where the {said(other)} is")
        discourse.put(act, thing, discourse.where[other])


def _same(discourse: Discourse, act: Act) -> None:
    """Read `do the same for the fork`."""
    things = movables(act.frame.elements)
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
    "": _move,
    "MOVE": _move,
    "GIVE": _move,
    "LET": _move,
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
