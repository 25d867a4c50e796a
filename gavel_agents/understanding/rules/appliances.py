"""Verbs of appliances, switches and doors: heat, wash, dry, use, switch on, open, close."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.discourse import Act, Discourse, designator_of, movables, said
from gavel_agents.understanding.rules.elements import Cycle, Entity, Frame, Part, Phrase, Room
from gavel_agents.understanding.rules.groups import locates
from gavel_agents.understanding.rules.places import can_run, flag_of, process_flag
from gavel_env.world_model.goals import Literal, Predicate
from gavel_env.world_model.ontology import default_ontology

__all__ = ["about_doors", "door", "process", "run", "switched", "use"]


def process(discourse: Discourse, act: Act) -> None:
    """Read heat, wash, dry and their nouns: which things, by which appliance.

    Raises:
        Abstention: no things, nothing to do with them, or an appliance that does something else.
    """
    frame = act.frame
    wanted = flag_of(frame.verb)
    things = discourse.things(act)
    if not things:
        raise Abstention("no_antecedent", f"what shall be {frame.word or 'processed'}?")
    appliances = [e for e in frame.elements if isinstance(e, Entity) and not e.movable]
    last = things[0]
    for element in frame.elements:
        if isinstance(element, Entity) and element.movable:
            last = element
        if not isinstance(element, Phrase):
            continue
        target = discourse.resolve(element.target)
        if isinstance(target, Entity) and not locates(element) and _does(target, wanted):
            appliances.append(target)
        elif locates(element) or isinstance(target, Room) or wanted is Predicate.COOKED:
            discourse.state(act, last, element)
        else:
            raise Abstention("cannot_process", f"{said(target)!r} does not {frame.word or 'do'} anything")
    flags = [wanted] if wanted else []
    for appliance in appliances:
        does = process_flag(appliance)
        if does is None or not _does(appliance, wanted):
            raise Abstention("cannot_process", f"{said(appliance)!r} does not {frame.word or 'do'} anything")
        flags.append(does)
        discourse.instrument = appliance
    if not flags:
        flags = [_cycle(discourse, e.what) for e in frame.elements if isinstance(e, Cycle)]
    if not flags:
        raise Abstention("unparsed", f"what shall be done with the {said(things[0])}?")
    for thing in things:
        holder = discourse.wished[thing].holder if thing in discourse.wished else None
        if thing in discourse.brought and isinstance(holder, Entity) and process_flag(holder) in flags:
            discourse.drop(thing)  # "take it to the dryer and dry it" does not say that it stays there
            discourse.instrument = holder
    for flag in dict.fromkeys(flags):
        act.goals.extend(_process_goals(flag, things))


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
        category = default_ontology()[thing.category]
        becomes = flag
        if flag is Predicate.COOKED and not category.cookable:
            if not category.heatable:
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
    act.things = list(discourse.focus)
    act.goals.extend(_process_goals(does, act.things))


def run(discourse: Discourse, act: Act) -> None:
    """Read switching on: a filled appliance does its work, anything else stays switched on.

    Raises:
        Abstention: nothing that could be meant has a switch.
    """
    frame = act.frame
    phrases = [e for e in frame.elements if isinstance(e, Phrase)]
    if frame.of(Cycle) and not phrases and not frame.of(Entity):
        _run_filled(discourse, act)
        return
    off = any(isinstance(e, Part) and e.word == "off" for e in frame.elements) or frame.word.endswith(" off")
    off = off or any(p.preposition == "off" for p in phrases)
    named = [e for e in frame.elements if isinstance(e, Entity)]
    named += [p.target for p in phrases if isinstance(p.target, Entity) and p.preposition in ("on", "off")]
    for entity in map(discourse.same_place, named or [p for p in reversed(discourse.places) if can_run(p)][:1]):
        does = process_flag(entity)
        if entity in discourse.loaded and does is not None and not off:
            act.goals.extend(_process_goals(does, discourse.loaded[entity]))
            discourse.instrument = entity
        elif can_run(entity):
            act.goals.append(Literal(Predicate.TOGGLED, designator_of(entity), None, off))
        else:
            raise Abstention("cannot_switch", f"{said(entity)!r} has no switch")
    if not act.goals:
        raise Abstention("no_antecedent", f"what shall be switched {'off' if off else 'on'}?")


def _run_filled(discourse: Discourse, act: Act) -> None:
    """Read `run a cycle`."""
    does = _cycle(discourse, "")
    assert discourse.instrument is not None
    act.things = discourse.loaded[discourse.instrument]
    act.goals.extend(_process_goals(does, act.things))


def switched(discourse: Discourse, act: Act) -> bool:
    """Read `the lamp should be on`; return whether this is what the frame says."""
    parts = {e.word for e in act.frame.elements if isinstance(e, Part)}
    lit = [e for e in act.frame.elements if isinstance(e, Entity) and can_run(e)]
    if not lit or not parts & {"on", "off"}:
        return False
    for entity in map(discourse.same_place, lit):
        act.goals.append(Literal(Predicate.TOGGLED, designator_of(entity), None, "off" in parts))
    return True


def door(discourse: Discourse, act: Act) -> None:
    """Read open and close: doors of what is used stand shut in the end anyway, so only others count.

    Raises:
        Abstention: something without a door.
    """
    frame = act.frame
    used = {*discourse.loaded, *(relation.holder for relation in discourse.where.values())}
    for entity in [discourse.same_place(e) for e in frame.elements if isinstance(e, Entity)]:
        if not default_ontology()[entity.category].openable:
            raise Abstention("cannot_open", f"{said(entity)!r} has no door")
        if entity not in used and not frame.negated and (frame.verb == "CLOSE" or discourse.following is None):
            act.goals.append(Literal(Predicate.OPEN, designator_of(entity), None, frame.verb == "CLOSE"))


def about_doors(frame: Frame) -> bool:
    """Return whether a frame only says how doors are left."""
    return any(isinstance(e, Part) and e.word == "door" for e in frame.elements) and not movables(frame.elements)
