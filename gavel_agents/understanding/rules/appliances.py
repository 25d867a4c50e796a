"""Verbs of appliances, switches and doors: heat, wash, dry, use, switch on, open, close."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.discourse import Act, Discourse, designator_of, movables, said
from gavel_agents.understanding.rules.elements import Cycle, Entity, Frame, Part, Phrase, Pronoun, Room, Separator
from gavel_agents.understanding.rules.groups import locates
from gavel_agents.understanding.rules.places import can_run, flag_of, process_flag, says_where
from gavel_agents.understanding.rules.words import verb_forms
from gavel_env.world_model.goals import Literal, Predicate

__all__ = ["about_doors", "door", "process", "run", "switched", "use"]


def process(discourse: Discourse, act: Act) -> None:
    """Read heat, wash, dry and their nouns: which things, by which appliance.

    Raises:
        Abstention: no things, nothing to do with them, or an appliance that does something else.
    """
    frame = act.frame
    wanted = flag_of(frame.verb)
    if frame.verb == "DO" and not frame.of(Cycle) and not any(isinstance(e, Entity) for e in frame.elements):
        act.passed = True  # could you do these?
        return
    things = discourse.things(act)
    if not things:
        raise Abstention("no_antecedent", f"nothing was named to {frame.word or 'process'}")
    pieces = [e for e in frame.elements if isinstance(e, Entity) and not e.movable and process_flag(e) is None]
    if pieces:
        raise Abstention("cannot_process", f"{said(pieces[0])!r} cannot be put into a machine")
    appliances = [e for e in frame.elements if isinstance(e, Entity) and not e.movable]
    last = things[0]
    for element in frame.elements:
        if isinstance(element, Entity) and element.movable:
            last = element
        if not isinstance(element, Phrase):
            continue
        target = discourse.resolve(element.target)
        if element.preposition == "with" and isinstance(target, Entity) and target.movable:
            continue
        if isinstance(target, Entity) and not locates(element) and _does(target, wanted):
            appliances.append(target)
        elif locates(element) or isinstance(target, Room):
            discourse.state(act, last, element)
        elif isinstance(target, Entity) and _behind(frame, element):
            discourse.wish(act, last, element)  # through the dryer and back on the bed
        elif wanted is Predicate.COOKED:
            discourse.state(act, last, element)
        elif not says_where(element.preposition) or target is None:
            continue
        else:
            raise Abstention("cannot_process", f"{said(target)!r} does not {frame.word or 'do'} anything")
    flags = [wanted] if wanted else []
    for appliance in appliances:
        does = process_flag(appliance)
        if does is None or not _does(appliance, wanted):
            raise Abstention("cannot_process", f"{said(appliance)!r} does not {frame.word or 'do'} anything")
        flags.append(does)
        discourse.instrument = appliance
        discourse.used.add(appliance)
    if not flags:
        flags = [_cycle(discourse, e.what) for e in frame.elements if isinstance(e, Cycle)]
    if not flags:
        raise Abstention("unparsed", f"what should be done with the {said(things[0])}?")
    for thing in things:
        holder = discourse.wished[thing].holder if thing in discourse.wished else None
        if thing in discourse.brought and isinstance(holder, Entity) and process_flag(holder) in flags:
            discourse.used.add(holder)
            discourse.drop(thing)  # "take it to the dryer and dry it" does not say that it stays there
            discourse.instrument = holder
    for flag in dict.fromkeys(flags):
        act.goals.extend(_process_goals(flag, things))


def _behind(frame: Frame, phrase: Phrase) -> bool:
    """Return whether a phrase stands behind `and` or a mark, after what is done."""
    before = frame.elements[: frame.elements.index(phrase)]
    return frame.done < len(before) and any(isinstance(e, Separator) for e in before[max(frame.done, 1) :])


def _does(entity: Entity, wanted: Predicate | None) -> bool:
    """Return whether an appliance does what is wanted, or anything if nothing special is."""
    does = process_flag(entity)
    return does is not None and (wanted is None or does is wanted)


def _cycle(discourse: Discourse, what: str) -> Predicate:
    """Return what a cycle does when no appliance is named: what the one that was filled last does."""
    for holder in reversed(discourse.loaded):
        does = process_flag(holder)
        if does is not None:
            discourse.instrument = holder
            return does
    named = flag_of(what)
    if named is None:
        raise Abstention("no_antecedent", "no appliance was filled before")
    return named


def _process_goals(flag: Predicate, things: Sequence[Entity]) -> Iterator[Literal]:
    """Yield the literals of a heating, washing or drying; what cannot be cooked becomes hot."""
    for thing in things:
        becomes = flag
        if flag is Predicate.COOKED and not any(kind.cookable for kind in thing.kinds):
            if not any(kind.heatable for kind in thing.kinds):
                raise Abstention("cannot_process", f"{said(thing)!r} is nothing to cook")
            becomes = Predicate.HOT
        yield Literal(becomes, designator_of(thing))


def use(discourse: Discourse, act: Act) -> None:
    """Read `use the dryer`: for what was said to be wet or dirty.

    Raises:
        Abstention: no appliance, or nothing to use it for.
    """
    appliance = next((e for e in act.frame.elements if isinstance(e, Entity) and not e.movable), None)
    does = process_flag(appliance) if appliance else None
    if appliance is None or does is None or not discourse.focus:
        raise Abstention("unparsed", "'use' needs an appliance and something to use it for")
    discourse.instrument = appliance
    discourse.used.add(appliance)
    act.things = list(discourse.focus)
    act.goals.extend(_process_goals(does, act.things))


_STOPPING = ("off with", "kill", "deactivate", "stop", "extinguish", "douse", "silence")


def run(discourse: Discourse, act: Act) -> None:
    """Read switching on: a filled appliance does its work, anything else stays switched on.

    Raises:
        Abstention: nothing that could be meant has a switch.
    """
    frame = act.frame
    phrases = [e for e in frame.elements if isinstance(e, Phrase)]
    if frame.word.startswith("stop") and not frame.of(Entity) and not frame.of(Pronoun):
        act.passed = True  # stop it, you two
        return
    if frame.of(Cycle) and not phrases and not frame.of(Entity):
        _run_filled(discourse, act)
        return
    off = any(isinstance(e, Part) and e.word in ("off", "out") for e in frame.elements) or frame.word.endswith(" off")
    off = off or any(p.preposition == "off" for p in phrases) or frame.word.startswith(_STOPPING)
    named = [e for e in frame.elements if isinstance(e, Entity)]
    named += [p.target for p in phrases if isinstance(p.target, Entity) and p.preposition in ("on", "off")]
    for entity in map(discourse.same_place, named or [p for p in reversed(discourse.places) if can_run(p)][:1]):
        does = process_flag(entity)
        if entity in discourse.loaded and does is not None and not off:
            act.goals.extend(_process_goals(does, discourse.loaded[entity]))
            discourse.instrument = entity
            discourse.used.add(entity)
        elif can_run(entity):
            act.goals.append(Literal(Predicate.TOGGLED, designator_of(entity), None, off))
        else:
            raise Abstention("cannot_switch", f"{said(entity)!r} has no switch")
    if not act.goals and frame.word.startswith("light") and not named:
        switch = _there(Entity("electric_switch"), act)  # so much light in the hall was on
        act.mentions.append(switch)
        act.goals.append(Literal(Predicate.TOGGLED, designator_of(switch), None, off))
    if not act.goals:
        raise Abstention("no_antecedent", f"what should be switched {'off' if off else 'on'}?")


def _run_filled(discourse: Discourse, act: Act) -> None:
    """Read `run a cycle`."""
    does = _cycle(discourse, "")
    assert discourse.instrument is not None
    act.things = discourse.loaded[discourse.instrument]
    act.goals.extend(_process_goals(does, act.things))


def switched(discourse: Discourse, act: Act) -> bool:
    """Read `the lamp should be on`; return whether this is what the frame says."""
    parts = {e.word for e in act.frame.elements if isinstance(e, Part)}
    lit = [_there(e, act) for e in act.frame.elements if isinstance(e, Entity) and can_run(e)]
    if not lit or not parts & {"on", "off"}:
        return False
    off = ("off" in parts) != act.frame.negated
    for entity in map(discourse.same_place, lit):
        act.goals.append(Literal(Predicate.TOGGLED, designator_of(entity), None, off))
    return True


def _there(entity: Entity, act: Act) -> Entity:
    """Return a piece with the room that its clause says: `the lamp is on in the study`."""
    rooms = [e.target.type for e in act.frame.elements if isinstance(e, Phrase) and isinstance(e.target, Room)]
    return entity._replace(room=rooms[0]) if rooms and entity.room is None else entity


def door(discourse: Discourse, act: Act) -> None:
    """Read open and close: doors of what is used stand shut in the end anyway, so only others count.

    Raises:
        Abstention: something without a door.
    """
    frame = act.frame
    used = {*discourse.loaded, *(relation.holder for relation in discourse.where.values())}
    pieces = [discourse.same_place(e) for e in frame.elements if isinstance(e, Entity)]
    if not pieces and (frame.of(Pronoun) or frame.empty or not frame.of(Phrase)) and not about_doors(frame):
        pieces = [p for p in reversed(discourse.places) if any(kind.openable for kind in p.kinds)][:1]
    for entity in pieces:
        if entity.movable and not any(kind.openable for kind in entity.kinds):
            act.passed = True  # the yoghurt got shut away
            continue
        if not any(kind.openable for kind in entity.kinds):
            raise Abstention("cannot_open", f"{said(entity)!r} has no door")
        discourse.used.add(entity)
        left = frame.word in _LEAVING or frame.mood == "wish"
        if frame.verb == "OPEN" and left and not frame.negated:
            act.goals.append(Literal(Predicate.OPEN, designator_of(entity)))
        elif entity not in used and not frame.negated and (frame.verb == "CLOSE" or discourse.following is None):
            act.goals.append(Literal(Predicate.OPEN, designator_of(entity), None, frame.verb == "CLOSE"))


_LEAVING = (*verb_forms("leave"), *verb_forms("keep"), "kept", *verb_forms("stay"), *verb_forms("remain"))


def about_doors(frame: Frame) -> bool:
    """Return whether a frame only says how doors are left."""
    return any(isinstance(e, Part) and e.word == "door" for e in frame.elements) and not movables(frame.elements)
