"""What goes without saying: which appliance gives a state."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from eval.sentence.said_places import categories_of
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.errors import NotInHouse
from gavel_env.tasks.placements import House
from gavel_env.world_model.dynamics import conferred
from gavel_env.world_model.goals import Designator, Predicate, fitting
from gavel_env.world_model.graph import Flag, Node, Relation, Support
from gavel_env.world_model.ontology import Category

__all__ = ["with_appliances"]

_GIVEN = {Predicate.COOKED: Flag.COOKED, Predicate.WASHED: Flag.WASHED, Predicate.DRIED: Flag.DRIED}


def with_appliances(task: TaskUnderstanding, house: House) -> tuple[TaskUnderstanding, tuple[str, ...]]:
    """Return a task with the appliances of the house that its states need and that it does not name, and notes.

    Raises:
        NotInHouse: the house has none.
    """
    objects, notes = list(task.objects), []
    for literal in task.goal.literals:
        flag = _GIVEN.get(literal.predicate)
        if flag is None or literal.negated:
            continue
        treated = categories_of(literal.subject, house)
        named = [piece for d in objects for piece in fitting(house.graph, d)]
        if any(_gives(piece, flag, c, house) for piece in named for c in treated):
            continue
        able = [piece for piece in house.pieces if any(_gives(piece.id, flag, c, house) for c in treated)]
        if not able:
            raise NotInHouse(f"{house.scene.scene} has nothing to make {literal.subject} {flag.name.lower()}")
        suited = [piece for piece in able if _suits(piece.category, treated, house)] or able
        objects.append(Designator(suited[0].category))
        words = suited[0].category.replace("_", " ")
        notes.append(f"no appliance is named for it to be {flag.name.lower()} in: the {words} is used")
    return msgspec.structs.replace(task, objects=tuple(dict.fromkeys(objects))), tuple(notes)


def _gives(piece: str, flag: Flag, category: Category, house: House) -> bool:
    """Return whether running a piece gives a state to a thing of a category that lies in or on it."""
    own = house.graph.category(piece)
    if not own.toggleable:
        return False
    shut = house.graph.with_nodes({"thing": Node("thing", category, False)})
    shut = shut.with_flag(Flag.OPEN, frozenset((piece,)), value=False)
    ways = [Relation.INSIDE] * own.interior + [Relation.ON_TOP] * own.surface
    return any("thing" in conferred(shut.place("thing", Support(way, piece)), piece).get(flag, ()) for way in ways)


def _suits(piece: str, categories: Sequence[Category], house: House) -> bool:
    """Return whether people put things of one of the categories into a piece."""
    words = house.vocabulary.furniture.get(piece)
    known = [house.vocabulary.movables[c.name].theme for c in categories if c.name in house.vocabulary.movables]
    return words is not None and (not words.suits or bool(set(known) & set(words.suits)))
