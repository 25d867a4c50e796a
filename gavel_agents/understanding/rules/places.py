"""What prepositions mean with each kind of furniture, and what appliances do."""

from __future__ import annotations

from typing import NamedTuple

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.rules.elements import Entity, Room
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.goals import Predicate
from gavel_env.world_model.ontology import Category

__all__ = [
    "Relation",
    "can_become",
    "can_run",
    "destination",
    "says_where",
    "flag_of",
    "process_flag",
    "stated_location",
]

_FLAGS = {
    "HEAT": Predicate.COOKED,
    "WASH": Predicate.WASHED,
    "DRY": Predicate.DRIED,
    "FREEZE": Predicate.FROZEN,
}
_PLAIN = {"on": Predicate.ON_TOP, "in": Predicate.INSIDE, "under": Predicate.UNDER, "beside": Predicate.NEXT_TO}


class Relation(NamedTuple):
    """Where something is or shall be."""

    predicate: Predicate
    holder: Entity | Room


def flag_of(verb: str) -> Predicate | None:
    """Return what a verb of heating, washing, drying or freezing makes true."""
    return _FLAGS.get(verb)


def process_flag(entity: Entity) -> Predicate | None:
    """Return what an appliance makes of what is in or on it."""
    category = entity.kinds[0]
    if category.washes:
        return Predicate.WASHED
    if category.dries:
        return Predicate.DRIED
    if category.heat is not None and not category.graspable:
        return Predicate.COOKED
    return Predicate.FROZEN if category.cold is not None and category.cold.freezes else None


def can_become(category: Category, state: Predicate) -> bool:
    """Return whether things of a category are what people would have cooked, washed or dried."""
    if state in (Predicate.WASHED, Predicate.DRIED):
        return category.washable
    return state is Predicate.COOKED and category.cookable


def says_where(preposition: str) -> bool:
    """Return whether a preposition says where something is or goes: not `of`, `for`, `with`."""
    return preposition in (*_PLAIN, "from", "to", "out", "off", "arrow", "at", "where")


def can_run(entity: Entity) -> bool:
    """Return whether it has a switch."""
    return any(kind.toggleable for kind in entity.kinds)


def stated_location(preposition: str, target: Entity | Room) -> Relation:
    """Return where something is said to be: `from` a container is inside it, from a table on top.

    Raises:
        Abstention: nothing can be there.
    """
    if isinstance(target, Room):
        return Relation(Predicate.IN_ROOM, target)
    if preposition == "off":
        return Relation(Predicate.ON_TOP, target)
    if preposition == "out":
        return Relation(Predicate.INSIDE, target)
    if preposition in ("from", "to", "arrow", "at"):
        return Relation(_usual(target), target)
    return _checked(preposition, target)


def destination(preposition: str, target: Entity | Room) -> Relation:
    """Return where something shall be: `to` the bookcase is inside it, to the bed on top.

    Raises:
        Abstention: nothing can be put there.
    """
    if isinstance(target, Room):
        return Relation(Predicate.IN_ROOM, target)
    if preposition in ("to", "arrow", "at"):
        return Relation(_usual(target), target)
    return _checked(preposition, target)


def _usual(target: Entity) -> Predicate:
    first = target.kinds[0]
    if first.interior and not first.graspable:
        return Predicate.INSIDE
    if not first.surface and not first.interior:
        raise _cannot_hold(target)
    return Predicate.ON_TOP


def _checked(preposition: str, target: Entity) -> Relation:
    """Return the relation that is said, or the only one that is possible (`in the chair`)."""
    predicate = _PLAIN.get(preposition)
    if predicate is None:
        raise Abstention("unparsed", f"{preposition!r} does not say where")
    surface = any(kind.surface for kind in target.kinds)
    interior = any(kind.interior for kind in target.kinds)
    if predicate is Predicate.INSIDE and not interior and surface:
        predicate = Predicate.ON_TOP
    if predicate is Predicate.ON_TOP and not surface and interior:
        predicate = Predicate.INSIDE
    if predicate in (Predicate.INSIDE, Predicate.ON_TOP) and not (interior or surface):
        raise _cannot_hold(target)
    return Relation(predicate, target)


def _cannot_hold(target: Entity) -> Abstention:
    words = in_words(target.category)
    return Abstention("cannot_hold", f"nothing can be put on or in {words!r}")
