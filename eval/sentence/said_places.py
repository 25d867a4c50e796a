"""Places that a person gives for things: `mug on desk@private_office`, `ball on the floor of the corridor`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from gavel_env.errors import BadPlacement, nearest_names
from gavel_env.tasks.placements import House, pick
from gavel_env.world_model.actions import normalise_name
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.goals import Designator, fitting
from gavel_env.world_model.ontology import Category, category_of

__all__ = ["Spot", "categories_of", "read_place"]

_PLACE = re.compile(
    r"^\s*(?:the\s+|an?\s+)?(.+?)\s+(on the floor of|on|inside|in|at)\s+(?:the\s+|an?\s+)?(.+?)\s*$", re.IGNORECASE
)


class Spot(NamedTuple):
    """A place: on or in a piece or another thing, or on the floor of a room."""

    relation: Literal["on", "in", "floor"]
    holder: str


def categories_of(designator: Designator, house: House) -> list[Category]:
    """Return the categories that a designator may mean; none if nothing is called so."""
    ontology = house.ontology
    if is_concept(designator.name):
        names: Sequence[str] = ontology.concepts.categories(designator.name)
    else:
        names = (designator.name if designator.name in ontology else category_of(designator.name),)
    return [ontology[name] for name in names if name in ontology]


def read_place(text: str, house: House, rng: np.random.Generator) -> tuple[tuple[Category, ...], Spot]:
    """Return which categories a thing may be of, and where it is; of several pieces that fit, one is drawn.

    Raises:
        BadPlacement: says what is wrong with it.
    """
    match = _PLACE.match(text)
    if match is None:
        raise BadPlacement(f"{text!r} is not a place; write THING on PLACE, such as 'mug on desk@private_office'")
    thing, preposition, target = match.groups()
    able = _movable(text, thing, house)
    rooms = _rooms(target, house)
    if rooms and preposition.lower() != "on":
        return able, Spot("floor", pick(rng, rooms))
    if preposition.lower() in ("at", "on the floor of"):
        raise BadPlacement(f"{text!r}: no room is a {target!r}; rooms: {', '.join(house.graph.world.rooms)}")
    return able, _on_or_in(text, "on" if preposition.lower() == "on" else "in", target, house, rng)


def _movable(text: str, thing: str, house: House) -> tuple[Category, ...]:
    found = categories_of(Designator(_named(thing, house)), house)
    able = tuple(c for c in found if c.liftable)
    if not able:
        near = nearest_names(normalise_name(thing), house.ontology)
        hint = f"; did you mean {near[0]!r}?" if near and not found else ""
        raise BadPlacement(f"{text!r}: {thing!r} is {'not carried about' if found else 'unknown'}{hint}")
    return able


def _rooms(words: str, house: House) -> list[str]:
    name = _named(words, house)
    return [room.id for room in house.graph.world.rooms.values() if room.fits(name)]


def _on_or_in(text: str, relation: Literal["on", "in"], target: str, house: House, rng: np.random.Generator) -> Spot:
    name, at, room = target.partition("@")
    designator = Designator(_named(name, house), _named(room, house) if at else None)
    graph = house.graph
    fits = fitting(graph, designator)
    if not fits:
        here = sorted({node.category.name for node in graph.world.nodes.values()})
        near = nearest_names(designator.name, here) or tuple(here)
        raise BadPlacement(f"{text!r}: the house has no {target!r}; near to it: {', '.join(near[:6])}")
    use = "surface" if relation == "on" else "interior"
    holders = [o for o in fits if getattr(graph.category(o), use)]
    if not holders:
        raise BadPlacement(f"{text!r}: nothing is put {relation} a {target!r}")
    reachable = {piece.id for piece in house.pieces}
    return Spot(relation, pick(rng, [o for o in holders if o in reachable] or holders))


def _named(words: str, house: House) -> str:
    """Return the category, concept, room or id that some words name; the words themselves if none."""
    name = normalise_name(words)
    world = house.graph.world
    if name in house.ontology or name in world.nodes or name in world.rooms:
        return name
    meaning = house.ontology.concepts.meaning(words)
    return meaning.thing or meaning.place or name
