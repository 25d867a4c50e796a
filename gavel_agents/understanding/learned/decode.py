"""From scores to a reading: each thing's likeliest end, each piece's likeliest wish, and how sure all of it is."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.understanding.learned.network import Scores, rooms_in
from gavel_agents.understanding.learned.options import (
    MOST_KINDS,
    STATES,
    WISHES,
    Group,
    groups,
    kinds_for,
    members,
    piece_of,
    places_for,
    rooms_for,
    wishes_for,
)
from gavel_agents.understanding.learned.spotted import Spotted
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.goals import Designator, Literal, Predicate

__all__ = ["Decision", "Meant", "meant_by"]

Array = NDArray[np.float32]
_NOTHING = -1e4
_TOLD = 0.5
"""Least probability of a location that is taken as stated."""


class Decision(NamedTuple):
    """One choice of the reading: what it is about, how probable it is, and what else was likeliest.

    Attributes:
        mention: index of the mention that it is about.
        literals: what it asks for; empty where nothing is asked.
        probability: of the choice.
        instead: the second choice's literals.
    """

    mention: int
    literals: tuple[Literal, ...]
    probability: float
    instead: tuple[Literal, ...] = ()


class Meant(NamedTuple):
    """What a text asks for, by what is likeliest.

    Attributes:
        goals: by the mention that they are about, in the order of the mentions.
        relations: stated locations, by the index of the mention of the thing.
        decisions: all that was chosen, also that nothing is asked.
        whole: probability that no word for a thing was missed.
    """

    goals: tuple[tuple[int, Literal], ...]
    relations: tuple[tuple[int, Literal], ...]
    decisions: tuple[Decision, ...]
    whole: float = 1.0

    @property
    def sure(self) -> float:
        """Return the probability that every choice is right, if they were independent."""
        return self.whole * float(np.prod([d.probability for d in self.decisions])) if self.decisions else 0.0


class _Probable(NamedTuple):
    """Probabilities of one text: rooms (mentions, indices of rooms), kinds and wishes of mentions."""

    rooms: Array
    kinds: Array
    wishes: Array


def _softmax(x: Array) -> Array:
    e = np.exp(x - x.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))


def _of_mentions(read: Spotted, scored: Scores) -> _Probable:
    count = len(read.mentions)
    said = rooms_in(scored.pairs[4], scored.mentions["unnamed_room"], scored.mentions["room_none"])
    rooms = np.full_like(said, _NOTHING)
    kinds = np.full((count, MOST_KINDS), _NOTHING, dtype=np.float32)
    wishes = np.full((count, len(WISHES)), _NOTHING, dtype=np.float32)
    for index, mention in enumerate(read.mentions):
        allowed = list(wishes_for(mention))
        wishes[index, allowed] = scored.mentions["wish"][index, allowed]
        kinds[index, : len(kinds_for(mention))] = scored.mentions["kind"][index, : len(kinds_for(mention))]
        possible = [room for room, _ in rooms_for(read, mention)]
        rooms[index, possible] = said[index, possible]
    return _Probable(_softmax(rooms), _softmax(kinds), _softmax(wishes))


def _places(read: Spotted, scored: Scores, group: Group, told: bool) -> Array:
    """Return probabilities of (places, and nowhere) for a thing, flat: on top, inside, nowhere."""
    count = len(read.mentions)
    own = list(group.mentions)
    logits = np.full(2 * count + 1, _NOTHING, dtype=np.float32)
    for place, inside in places_for(read, group):
        said = scored.pairs[2 * told + inside, own, place]
        logits[2 * place + inside] = np.logaddexp.reduce(said)
    logits[-1] = scored.mentions["from_none" if told else "none"][own, 0].mean()
    return _softmax(logits)


def meant_by(read: Spotted, scored: Scores) -> Meant:
    """Return the likeliest reading."""
    shared = _of_mentions(read, scored)
    goals: list[tuple[int, Literal]] = []
    relations: list[tuple[int, Literal]] = []
    decisions: list[Decision] = []
    for group in groups(read):
        first = group.mentions[0]
        decided = _decided(read, shared, scored, group)
        goals += [(first, literal) for literal in decided.literals]
        decisions.append(decided)
        told = _ends(read, shared, group, _places(read, scored, group, True))
        if told[0][0] is not None and told[0][1] > _TOLD:
            relations.append((first, told[0][0]))
    for wish in _wished(read, shared):
        goals += [(wish.mention, literal) for literal in wish.literals]
        decisions.append(wish)
    return Meant(
        tuple(dict.fromkeys(goals)), tuple(relations), tuple(decisions), float(1 / (1 + np.exp(-scored.whole)))
    )


def _decided(read: Spotted, shared: _Probable, scored: Scores, group: Group) -> Decision:
    """Return what is likeliest asked of a thing: where it ends, what it becomes, and of how many."""
    own = list(group.mentions)
    ends = _ends(read, shared, group, _places(read, scored, group, False))
    counts = _softmax(scored.mentions["count"][own].mean(axis=0))
    number = int(counts.argmax()) + 1
    states = 1 / (1 + np.exp(-scored.mentions["state"][own].max(axis=0)))
    found = []
    for (end, probability), states_asked in itertools.product(ends[:2], itertools.product((False, True), repeat=3)):
        wanted = list(itertools.compress(STATES, states_asked))
        chosen = probability * float(np.prod(np.where(states_asked, states, 1 - states)))
        literals = []
        for subject in _each(read, group, number) if wanted or end is not None else ():
            literals += [Literal(state, subject) for state in wanted]
            literals += [end._replace(subject=subject)] if end is not None else []
        found.append((chosen * (float(counts[number - 1]) if literals else 1.0), tuple(literals)))
    found.sort(key=lambda one: -one[0])
    (probability, likeliest), (_, instead) = found[:2]
    return Decision(own[0], likeliest, probability, instead)


def _each(read: Spotted, group: Group, number: int) -> list[Designator]:
    """Return so many things of a group; several are of one kind, the first that their word may mean."""
    if number == 1:
        return [Designator(group.name)]
    said = (read.mentions[index].exact for index in group.mentions)
    known = (category for category in default_vocabulary().movables if category in members(group.name))
    kind = next(filter(None, (*said, *known)), group.name)
    return [Designator(f"{kind}_{i}") for i in range(number)]


def _ends(read: Spotted, shared: _Probable, group: Group, where: Array) -> list[tuple[Literal | None, float]]:
    """Return where a thing may end, likeliest first: what comes to the same is taken together."""
    found: dict[Literal | None, float] = defaultdict(float, {None: float(where[-1])})
    thing = Designator(group.name)
    for place, inside in places_for(read, group):
        p = float(where[2 * place + inside])
        if p < 0.001:
            continue
        mention = read.mentions[place]
        if mention.room:
            found[Literal(Predicate.IN_ROOM, thing, Designator(mention.name))] += p
            continue
        predicate = Predicate.INSIDE if inside else Predicate.ON_TOP
        for designator, share in _pieces(read, shared, place).items():
            found[Literal(predicate, thing, designator)] += p * share
    return sorted(found.items(), key=lambda end: -end[1])


def _pieces(read: Spotted, shared: _Probable, place: int) -> Mapping[Designator, float]:
    """Return what a mention of a piece may designate, with probabilities."""
    found: dict[Designator, float] = defaultdict(float)
    mention = read.mentions[place]
    kinds = [(which, kind) for which, kind in enumerate(kinds_for(mention)) if shared.kinds[place, which] > 0.001]
    for room, type_ in rooms_for(read, mention):
        for which, kind in kinds:
            p = float(shared.kinds[place, which] * shared.rooms[place, room])
            if p > 0.001:
                found[piece_of(read, mention, type_, kind)] += p
    return found


def _wished(read: Spotted, shared: _Probable) -> list[Decision]:
    """Return the wish for each mention."""
    found: list[Decision] = []
    for index, mention in enumerate(read.mentions):
        likeliest = sorted(wishes_for(mention), key=lambda wish: -shared.wishes[index, wish])
        probability = float(shared.wishes[index, likeliest[0]])
        meant, second = (WISHES[wish] for wish in likeliest[:2])
        pieces = _pieces(read, shared, index)
        if not pieces:
            continue
        piece, share = max(pieces.items(), key=lambda one: one[1])
        if meant is None:
            other = (Literal(second[0], piece, None, second[1]),) if second else ()
            found.append(Decision(index, (), probability, other))
            continue
        found.append(Decision(index, (Literal(meant[0], piece, None, meant[1]),), probability * share))
    return found
