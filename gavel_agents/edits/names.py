"""Edit rule for names that the graph does not have: what a model meant by `cabinet`, `tshirt`, `shampoo_water_bottle`.

`proposing.resolve` reads names that differ from the graph's in form alone: plurals, articles, indices, rooms. Here a
name is read as people's words are: by the table of concepts, else by the words that it shares with those for a node. It
is replaced, in the whole plan, only where one node is left that could do what the plan wants of it, or where the goal
leaves open which.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache

from gavel_agents.edits.rule import Case, Change
from gavel_env.world_model.actions import Primitive
from gavel_env.world_model.concepts import default_concepts, normal_phrase, singulars
from gavel_env.world_model.goals import fitting
from gavel_env.world_model.graph import Node, Room, SceneGraph

__all__ = ["meant_by", "read_name"]

_ROOM = re.compile(r"^(?P<thing>.+?)(?:@|_(?:in|of|from|at|on)_(?:the_)?)(?P<room>.+)$")
_INDEX = re.compile(r"_\d+$")
_IDLE = frozenset({"the", "a", "an", "of", "my", "your", "any", "some", "one", "this", "that"})

_NEEDS: Mapping[Primitive, Callable[[Node], bool]] = {
    Primitive.GRASP: lambda node: not node.fixed and any(c.liftable for c in node.categories),
    Primitive.PLACE_ON_TOP: lambda node: any(c.surface for c in node.categories),
    Primitive.PLACE_INSIDE: lambda node: any(c.interior for c in node.categories),
    Primitive.TOGGLE_ON: lambda node: any(c.toggleable for c in node.categories),
}


def read_name(case: Case) -> Iterator[Change]:
    """Unknown name: read it as the one node that people's words for it name."""
    nodes = meant_by(case.target, case.graph)
    wanted = [need for a in case.plan if a.target == case.target and (need := _NEEDS.get(a.primitive)) is not None]
    nodes = [n for n in nodes if all(need(case.graph.world.nodes[n]) for need in wanted)]
    for prefers in (_of_the_goal(case), _not_named_yet(case)):
        nodes = [n for n in nodes if n in prefers] or nodes
    if len(nodes) == 1 or _any_will_do(case, nodes):
        plan = tuple(a._replace(target=nodes[0]) if a.target == case.target else a for a in case.plan)
        yield Change(plan, f"read {case.target} as {nodes[0]}")


def meant_by(name: str, graph: SceneGraph) -> list[str]:
    """Return the nodes that a name may mean, in the graph's order; empty if it names nothing here."""
    thing, there = name, list(graph.world.nodes.values())
    for thing, room in _readings(name, graph):
        there = [node for node in graph.world.nodes.values() if room is None or _may_be_in(graph, node, room)]
        named = default_concepts().meaning(thing).thing
        members = () if named is None else default_concepts().categories(named)
        if found := [node.id for node in there if any(c.name in members for c in node.categories)]:
            return found
        if found := [node.id for node in there if any(_is_called(thing, word) for word in _own_words(node))]:
            return found
    return _with_most_words(thing, there)


def _readings(name: str, graph: SceneGraph) -> Iterator[tuple[str, str | None]]:
    """Yield what a name says of thing and room: `cabinet_in_kitchen_2` is a cabinet in a kitchen."""
    bare = _INDEX.sub("", name)
    yield from ((form, None) for form in dict.fromkeys((name, bare)))
    match = _ROOM.match(bare)
    if match is not None:
        room = match["room"]
        known = any(r.fits(room) for r in graph.world.rooms.values())
        if known or default_concepts().meaning(room).place is not None:
            yield match["thing"], room


def _may_be_in(graph: SceneGraph, node: Node, said: str) -> bool:
    where = graph.room_of(node.id)
    room = graph.world.rooms[where] if where is not None else None
    if room is None and node.stated_room is not None:
        room = Room(node.stated_room, node.stated_room)
    place = default_concepts().meaning(said).place
    return room is None or room.fits(said) or (place is not None and room.fits(place))


def _own_words(node: Node) -> Iterable[str]:
    return (word for category in node.categories for word in category.words)


def _is_called(thing: str, word: str) -> bool:
    return normal_phrase(word) in singulars(normal_phrase(thing), default_concepts().plurals)


def _with_most_words(name: str, nodes: Sequence[Node]) -> list[str]:
    """Return the nodes of which a name has most words: `shampoo_water_bottle` has two of `bottle of shampoo`.

    A word that no thing is called by may be what matters: `imaginary_bottle` names nothing.
    """
    said = _words(name)
    if not said <= _known_words():
        return []
    shared = {node.id: max((len(words) for words in _phrases(node) if words <= said), default=0) for node in nodes}
    most = max(shared.values(), default=0)
    return [] if most == 0 else [node for node, count in shared.items() if count == most]


@cache
def _known_words() -> frozenset[str]:
    return frozenset(word for phrase in default_concepts().thing_words for word in _words(phrase))


def _phrases(node: Node) -> Iterator[frozenset[str]]:
    """Yield the words of everything that a node is called."""
    concepts = default_concepts()
    for category in node.categories:
        named = concepts.meaning(category.name).thing
        phrases = (category.name, *category.words, *concepts.words(category.name), *concepts.words(named or ""))
        yield from map(_words, phrases)


def _words(phrase: str) -> frozenset[str]:
    words = frozenset(re.split(r"[ @]", normal_phrase(phrase))) - _IDLE
    return frozenset(min(singulars(word, default_concepts().plurals), key=len) for word in words if word)


def _of_the_goal(case: Case) -> frozenset[str]:
    """Return what the goal speaks of."""
    said = (d for literal in case.goal.literals for d in (literal.subject, literal.object) if d is not None)
    return frozenset(node for designator in said for node in fitting(case.graph, designator))


def _any_will_do(case: Case, nodes: Sequence[str]) -> bool:
    """Return whether one designator of the goal fits all of the nodes."""
    said = (d for literal in case.goal.literals for d in (literal.subject, literal.object) if d is not None)
    return bool(nodes) and any(set(nodes) <= set(fitting(case.graph, designator)) for designator in said)


def _not_named_yet(case: Case) -> frozenset[str]:
    """Return the nodes that the plan does not name by their names."""
    return frozenset(case.graph.world.nodes) - case.first_mention.keys()
