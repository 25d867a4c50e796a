"""Prepositional phrases of a clause: which say where things are, and which where they shall go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.discourse import Act, Discourse, movables, said
from gavel_agents.understanding.rules.elements import Entity, Phrase, Pronoun, Unknown
from gavel_agents.understanding.rules.places import says_where
from gavel_agents.understanding.rules.words import verb_forms

__all__ = ["Group", "grouped", "locate", "locates", "place"]

# Verbs that take the source as their own argument: `bring the mug and the cup from the sink to the table` speaks of
# both, `put the mug and the cup from the sink on the table` of the cup.
_TAKE_FROM = frozenset(
    form
    for verb in (
        "bring",
        "take",
        "move",
        "carry",
        "transfer",
        "remove",
        "empty",
        "clear",
        "relocate",
        "transport",
        "collect",
        "pull",
    )
    for form in verb_forms(verb)
)


@dataclass
class Group:
    """Things that share a destination, and the phrases that follow them, each with the thing before it."""

    things: list[Entity] = field(default_factory=list)
    phrases: list[tuple[Phrase, Entity | None]] = field(default_factory=list)

    @property
    def going(self) -> list[Phrase]:
        """The phrases that can say where the things go."""
        return [p for p, _ in self.phrases if not locates(p)]


def locates(phrase: Phrase) -> bool:
    """Return whether a phrase can only say where something is."""
    return phrase.relative or phrase.preposition in ("from", "out", "off")


def grouped(discourse: Discourse, act: Act) -> tuple[list[Phrase], list[Group]]:
    """Return the phrases that lead a clause, and its groups of things with the phrases that follow them.

    A group ends where a phrase has ended and another thing follows: `the mug on the table and the fork in the sink`.
    """
    leading: list[Phrase] = []
    groups = [Group()]
    last: Entity | None = None
    accompanied = False
    named = movables(act.frame.elements)
    for element in act.frame.elements:
        group = groups[-1]
        if isinstance(element, Phrase):
            target = element.target
            if element.preposition == "with" and isinstance(target, Entity) and target.movable:
                groups.append(Group([target]))
                last, accompanied = target, True
            elif not says_where(element.preposition) or isinstance(target, Unknown):
                continue
            elif not group.things and not leading and named:
                leading.append(element)
            elif accompanied and isinstance(target, Pronoun) and named:
                group.phrases.append((element._replace(target=named[0]), None))
            else:
                if element.preposition in ("beside", "under") and group.going:
                    raise Abstention("ambiguous", f"what is {element.preposition} the {said(target)}?")
                group.phrases.append((element, last))
                last = target if isinstance(target, Entity) and target.movable else last
        elif isinstance(element, Entity) and element.movable:
            if group.going:
                groups.append(Group())
            groups[-1].things.append(element)
            last = element
        elif isinstance(element, Pronoun):
            found = discourse.antecedents(element)
            group.things.extend(t for t in found if t not in group.things)
            last = found[-1] if found else last
    return leading, [g for g in groups if g.things or g.phrases]


def locate(
    discourse: Discourse, act: Act, group: Group, phrase: Phrase, owner: Entity | None, *, spreads: bool = True
) -> None:
    """State where things are: a relative clause speaks of the last thing, `out of` and `off` of all before it.

    Args:
        discourse: where it is noted.
        act: of the frame.
        group: the things.
        phrase: says where.
        owner: the thing before the phrase.
        spreads: the phrase can speak of several things.
    """
    before = group.things[: group.things.index(owner) + 1] if owner in group.things else []
    source = phrase.preposition in ("out", "off") or (
        phrase.preposition == "from" and act.frame.word.partition(" ")[0] in _TAKE_FROM
    )
    spread = source and spreads and not phrase.relative and not any(t in discourse.where for t in before[:-1])
    last = [owner] if owner is not None else group.things[-1:]
    for thing in before if before and spread else last:
        discourse.state(act, thing, phrase)


def place(discourse: Discourse, act: Act, leading: Sequence[Phrase], groups: Sequence[Group]) -> None:
    """Read destinations: the last phrase says where a group goes, those before it where its things are.

    Raises:
        Abstention: things are to be put, and nothing says where.
    """
    ends = [_end_of(discourse, act, group, alone=len(groups) == 1) for group in groups]
    for phrase in leading:
        if locates(phrase):
            for group in groups:
                for thing in group.things:
                    discourse.state(act, thing, phrase)
        elif not any(ends):
            ends = [phrase] * len(groups)
    _share(discourse, act, groups, ends)
    if discourse.offered is not None and not any(ends) and not act.frame.verb:
        ends = [discourse.offered] * len(groups)
    for index in range(1, len(ends)):
        if ends[index] is None:
            ends[index] = ends[index - 1]  # ..., and the fork too
    for end, group in zip(ends, groups, strict=True):
        if end is not None:
            for thing in group.things:
                discourse.wish(act, thing, end)
        elif act.frame.verb in ("MOVE", "BE") and discourse.following is None and not _placed(discourse, group):
            discourse.homeless.update(dict.fromkeys(group.things))


def _placed(discourse: Discourse, group: Group) -> bool:
    return any(t in discourse.wished for t in group.things)


def _end_of(discourse: Discourse, act: Act, group: Group, *, alone: bool) -> Phrase | None:
    """State the locations of a group; return the phrase that says where it goes."""
    going = group.going
    for phrase, owner in group.phrases:
        if phrase.preposition == "arrow" and phrase is not going[-1]:
            for thing in group.things:
                discourse.wish(act, thing, phrase)  # scarf: washer, then dryer
        elif locates(phrase) or phrase is not going[-1]:
            locate(discourse, act, group, phrase, owner, spreads=alone or bool(going))
    return going[-1] if going else None


def _share(discourse: Discourse, act: Act, groups: Sequence[Group], ends: list[Phrase | None]) -> None:
    """Give groups without a destination that of the next one.

    In `the mug on the table and the fork on the desk into the sink`, two phrases after the fork make the one after the
    mug a location too.
    """
    several = len(groups) > 1 and len(groups[-1].going) > 1
    plain = all(end is not None and not end.directional and end.preposition in ("on", "in") for end in ends[:-1])
    for index in range(len(groups) - 2, -1, -1):
        end = ends[index]
        if end is not None and several and plain:
            discourse.state(act, groups[index].things[-1], end)
            ends[index] = ends[-1]
        elif end is None:
            ends[index] = ends[index + 1]
