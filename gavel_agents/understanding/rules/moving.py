"""Verbs of moving: what goes where; and frames without a verb, which mostly mean the same."""

from __future__ import annotations

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.appliances import about_doors, process, run, switched
from gavel_agents.understanding.rules.discourse import Act, Discourse, designator_of, movables, said
from gavel_agents.understanding.rules.elements import Cycle, Entity, Frame, Part, Phrase, Pronoun, Room, There
from gavel_agents.understanding.rules.groups import Group, grouped, locate, place
from gavel_agents.understanding.rules.places import can_become, can_run, process_flag
from gavel_agents.understanding.rules.questions import asked_where
from gavel_env.world_model.goals import Literal, Predicate

__all__ = ["move", "through"]


def move(discourse: Discourse, act: Act) -> None:
    """Read `put`, `take`, `move`, and frames without a verb: what goes where, unless a machine or a switch is meant.

    Raises:
        Abstention: nothing to move, or nothing that moves.
    """
    frame = act.frame
    if frame.of(Cycle) or through(frame):
        process(discourse, act)
        return
    if switched(discourse, act) or about_doors(frame):
        return
    machines = [e for e in frame.elements if isinstance(e, Entity) and process_flag(e) is not None and not e.movable]
    if frame.mood == "wish" and machines and (movables(frame.elements) or frame.of(Pronoun)) and not frame.of(Phrase):
        process(discourse, act)  # the baking sheet needs the dishwasher
        return
    if frame.of(Pronoun) and not frame.of(Phrase) and _turned(discourse, frame):
        run(discourse, act)  # set it going
        return
    furniture = [e for e in frame.elements if isinstance(e, Entity) and not e.movable]
    if furniture and not movables(frame.elements) and frame.word.startswith(("leave", "left", "leaving")):
        act.passed = True  # leave the bookcase alone
        return
    if furniture and not movables(frame.elements) and not frame.of(Pronoun):
        if not frame.verb and _for_thing(discourse, act, furniture[0]):
            return
        if not frame.verb and not frame.of(Phrase):
            _run_alone(discourse, act, furniture)
            discourse.places.extend(furniture)  # "The fridge. Put the milk in it."
            return
        raise Abstention("cannot_move", f"{said(furniture[0])!r} is not carried about")
    if not frame.verb and not movables(frame.elements) and not frame.of(Pronoun) and _only_rooms(frame):
        act.passed = True  # "… The study or the playroom, whichever."
        return
    leading, groups = grouped(discourse, act)
    things = discourse.things(act)
    going = [phrase for group in groups for phrase in group.going if not isinstance(phrase.target, There)]
    if any(isinstance(e, Part) and e.word == "back" for e in frame.elements) and not going:
        _put_back(discourse, act, groups, things)
        return
    if groups and not groups[0].things:
        groups[0].things = list(things)
    if discourse.instrument and any(isinstance(e, Part) and e.word == "in" for e in frame.elements):
        groups = groups or [Group(list(things))]
        groups[-1].phrases.append((Phrase("in", There()), None))  # leave it inside
    if any(not g.things for g in groups):
        if len(groups) == 1 and groups[0].going and not frame.of(Pronoun):
            discourse.offered = groups[0].going[-1]  # three things have to be on the desk: ...
            return
        raise Abstention("no_antecedent", f"what should be {frame.word or 'moved'}?")
    if not frame.verb and not any(p.directional for g in groups for p in g.going):
        for group in groups:
            if group.things and group.going and all(isinstance(p.target, Room) for p in group.going):
                discourse.homeless.update(dict.fromkeys(group.things))  # "The key, in the bathroom": there it is
                for phrase, owner in group.phrases:
                    locate(discourse, act, group, phrase, owner)
                group.phrases.clear()
    place(discourse, act, leading, groups)


def _only_rooms(frame: Frame) -> bool:
    phrases = [e for e in frame.elements if isinstance(e, Phrase)]
    return bool(phrases) and all(isinstance(p.target, Room) and not p.directional for p in phrases)


def _for_thing(discourse: Discourse, act: Act, piece: Entity) -> bool:
    """Read `Hairbrush. Bathroom counter.` and `the sink for the vest`: where a thing goes, said as the place alone."""
    earlier = [p for p in discourse.places[:-1] if set(p.kinds) & set(piece.kinds)]
    phrases = [e for e in act.frame.elements if isinstance(e, Phrase) and e.preposition in ("with", "for")]
    named = [e.target for e in phrases if isinstance(e.target, Entity) and e.target.movable]
    waiting = [thing for thing in discourse.focus if thing not in discourse.wished]
    holds = any(kind.surface or kind.interior for kind in piece.kinds)
    if phrases and (named or any(isinstance(e.target, Pronoun) for e in phrases)):
        things = named or waiting
    elif not act.frame.of(Phrase) and process_flag(piece) in (None, Predicate.FROZEN):
        things = waiting
    else:
        things = []
    if things and holds:
        act.things = things
        for thing in things:
            discourse.wish(act, thing, Phrase("to", piece))
        return True
    if earlier and not act.frame.of(Phrase):
        act.passed = True  # any sink, kitchen or bathroom
        return True
    return False


def _run_alone(discourse: Discourse, act: Act, pieces: list[Entity]) -> None:
    """Read `The knife is filthy. Dishwasher!`: a machine alone does its work on what was spoken of."""
    does = process_flag(pieces[0])
    if does is None or not discourse.focus or any(t in discourse.wished for t in discourse.focus):
        return
    if all(any(can_become(kind, does) for kind in thing.kinds) for thing in discourse.focus):
        discourse.used.add(pieces[0])
        discourse.instrument = pieces[0]
        act.things = list(discourse.focus)
        act.goals.extend(Literal(does, designator_of(thing)) for thing in act.things)


def _turned(discourse: Discourse, frame: Frame) -> bool:
    """Return whether a clause switches what was spoken of last: `set it going`, `put it out`."""
    parts = {e.word for e in frame.elements if isinstance(e, Part)}
    last = discourse.places[-1] if discourse.places else None
    put_out = "out" in parts and frame.word.startswith(("put", "turn", "switch", "blow"))
    return bool(parts & {"on", "off"}) or (put_out and last is not None and can_run(last))


def _put_back(discourse: Discourse, act: Act, groups: list[Group], things: list[Entity]) -> None:
    """Read `put it back`: where it was said to be.

    Raises:
        Abstention: nothing says where that is.
    """
    for group in groups:
        for phrase, owner in group.phrases:
            locate(discourse, act, group, phrase, owner)
    act.things = things
    for thing in things:
        if thing not in discourse.first:
            raise asked_where(thing)
        discourse.returned.add(thing.category)
        discourse.put(act, thing, discourse.first[thing])


def through(frame: Frame) -> bool:
    """Return whether something goes through a machine: `run the shirt through the washer`."""
    return any(isinstance(e, Phrase) and e.preposition == "through" for e in frame.elements)
