"""Resolving the names that a model writes against a graph: exact, then unique category, else left as they are."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from gavel_env.world_model.actions import Action
from gavel_env.world_model.goals import Designator, Goal, fitting
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import Plan

__all__ = ["resolve", "resolve_name"]

_PLACE_PHRASE = re.compile(r"_(?:in|of|from|at|on)_(?:the_)?")


def resolve(graph: SceneGraph, plan: Sequence[Action], goal: Goal | None = None) -> Plan:
    """Return the plan with its names resolved against a graph.

    Args:
        graph: believed or hidden graph.
        plan: actions as they were written.
        goal: settles categories with several instances: the only one that holds an object of the goal or of the plan;
            else, for a designator that the goal itself uses, the first that fits, since any will do.
    """
    named = dict.fromkeys(name for a in plan for name in a.arguments)
    meant = {name: resolve_name(graph, name) for name in named}
    if goal is not None:
        things = {obj for literal in goal.literals for obj in fitting(graph, literal.subject)} | set(meant.values())
        for name, found in meant.items():
            if found not in graph.world.nodes and found not in graph.world.rooms:
                meant[name] = _any_that_fits(graph, found, things, goal)
    return tuple(
        a if a.target is None else a._replace(target=meant[a.target], others=tuple(meant[o] for o in a.others))
        for a in plan
    )


def _any_that_fits(graph: SceneGraph, name: str, things: set[str], goal: Goal) -> str:
    fits = next((f for form in _forms(name) if (f := fitting(graph, Designator(*_split_room(form))))), ())
    holding = [obj for obj in fits if any(item in things for item in graph.descendants(obj))]
    if len(holding) == 1:
        return holding[0]
    for literal in goal.literals:
        for designator in (literal.subject, literal.object):
            if designator is not None and str(designator) in (name, *_forms(name)):
                return fits[0] if fits else name
    return name


def resolve_name(graph: SceneGraph, name: str) -> str:
    """Return the object or room that a name means: exact, then a category with one instance, else as it is.

    A category may be written in the plural, with its room (`cabinet@kitchen`, `cabinet in the kitchen`), or with an
    index that the graph does not use. A name that stays as it is becomes `unknown_object` in validation.
    """
    world = graph.world
    if name in world.nodes or name in world.rooms:
        return name
    for form in _forms(name):
        if form in world.nodes:
            return form
        fits = fitting(graph, Designator(*_split_room(form)))
        if not fits:
            fits = tuple(n for n in world.nodes if n.partition("@")[0] == form)
        if len(fits) == 1:
            return fits[0]
        if fits:
            return name
    for room in world.rooms.values():
        if name in (room.type, f"the_{room.type}"):
            return room.id
    return name


def _split_room(form: str) -> tuple[str, str | None]:
    name, _, room = form.partition("@")
    return name, room or None


def _forms(name: str) -> Iterator[str]:
    """Yield ways to read a name, likeliest first."""
    yield name
    yield from _singulars(name)
    head, *tail = _PLACE_PHRASE.split(name, maxsplit=1)
    if tail and head:
        room = re.sub(r"_\d+$", "", tail[0])
        yield f"{head}@{room}"
        yield f"{tail[0]}" if head in ("door", "inside", "top", "lid") else head
    bare = re.sub(r"_\d+(?=$|@)", "", name)
    if bare != name:
        yield bare
    if "@" not in name and "_" in bare:
        room, _, rest = bare.partition("_")
        yield f"{rest}@{room}"


def _singulars(name: str) -> Iterator[str]:
    base, at, room = name.partition("@")
    for plural, singular in (("ves", "f"), ("ves", "fe"), ("ies", "y"), ("es", ""), ("s", "")):
        if base.endswith(plural) and len(base) > len(plural) + 1:
            yield base[: -len(plural)] + singular + at + room
