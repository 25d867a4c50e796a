"""Which pieces and kinds stand for the objects of an activity in a scene.

Objects with an `inroom` line are pieces of the scene: every room type of the activity becomes one room that has a piece
for each of them, and each gets a piece of its own. All others are movables that the grounding adds; one category stands
for all instances of a synset. Roles (something stands on it, in it, ...) decide which categories will do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from gavel_env.activities.bddl import Node, Problem, synset_of
from gavel_env.activities.definitions import Activities
from gavel_env.errors import Ungroundable
from gavel_env.house.scenes import Scene
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["AGENT", "GROUND", "Roles", "Scope", "Ungroundable", "choose_kinds", "choose_pieces", "is_thing", "roles_of"]

AGENT = "agent.n.01"
GROUND = frozenset({"driveway.n.01", "floor.n.01", "lawn.n.01", "paving_stone.n.01", "patio.n.01"})
"""What is the floor of a room here, whatever it is made of."""

BUILDING = frozenset({"ceiling.n.01", "door.n.01", "wall.n.01", "wall_nail.n.01", "rail_fence.n.01"})
"""Parts of a building that scenes do not have as pieces; they stand for nothing and need nothing."""


class Roles(NamedTuple):
    """What is expected of a synset.

    Attributes:
        must: roles that the initial state gives it.
        should: roles that the goal gives it.
    """

    must: frozenset[str]
    should: frozenset[str]


class Scope(NamedTuple):
    """What the names of an activity stand for.

    Attributes:
        pieces: name -> id of a piece of the scene.
        rooms: name of a floor -> room id.
        fitting: name -> ids of all pieces in its room that it could stand for.
        room_types: room type -> room id.
    """

    pieces: Mapping[str, str]
    rooms: Mapping[str, str]
    fitting: Mapping[str, tuple[str, ...]]
    room_types: Mapping[str, str]


Test = Callable[[Category], bool]
ROLES: Mapping[str, Test] = {
    "surface": lambda c: c.surface,
    "interior": lambda c: c.interior,
    "open": lambda c: c.openable,
    "toggle": lambda c: c.toggleable,
    "clearance": lambda c: c.clearance,
    "moved": lambda c: c.liftable,
    "cooked": lambda c: c.cookable,
    "hot": lambda c: c.heatable,
    "frozen": lambda c: c.freezable,
    "stands": lambda c: c.mount in ("floor", "carpet"),
}
_PLACES: Mapping[str, tuple[tuple[int, str], ...]] = {
    "ontop": ((0, "moved"), (1, "surface")),
    "inside": ((0, "moved"), (1, "interior")),
    "nextto": ((0, "moved"),),
    "under": ((0, "moved"), (1, "clearance")),
    "open": ((0, "open"),),
    "toggled_on": ((0, "toggle"),),
    "cooked": ((0, "cooked"),),
    "hot": ((0, "hot"),),
    "frozen": ((0, "frozen"),),
}


def is_thing(synset: str, activities: Activities) -> bool:
    """Return True if a synset is an object of the graph: not a substance, a floor or the robot."""
    return synset != AGENT and synset not in GROUND and bool(activities.kinds.get(synset))


def roles_of(problem: Problem) -> dict[str, Roles]:
    """Return the roles of every synset of a problem."""
    must: dict[str, set[str]] = {synset: set() for synset in problem.objects}
    should: dict[str, set[str]] = {synset: set() for synset in problem.objects}
    for fact in problem.init:
        for place, role in _PLACES.get(fact.predicate, ()):
            if not fact.negated and role != "moved":
                must[synset_of(fact.args[place])].add(role)

    def walk(node: Node, kinds: Mapping[str, str], positive: bool) -> None:
        kinds = {**kinds, **dict(node.variables)}
        for place, role in _PLACES.get(node.head, ()):
            synset = kinds.get(node.args[place], synset_of(node.args[place]))
            if positive and synset in should:
                should[synset].add(role)
        for index, part in enumerate(node.parts):
            flips = node.head == "not" or (node.head == "imply" and index == 0)
            walk(part, kinds, positive != flips)

    walk(problem.goal, {}, True)
    return {s: Roles(frozenset(must[s]), frozenset(should[s])) for s in problem.objects}


def _filled(category: Category, roles: Iterable[str]) -> int:
    return sum(ROLES[role](category) for role in sorted(roles))


def choose_kinds(
    problem: Problem, names: Iterable[str], activities: Activities, ontology: Ontology, roles: Mapping[str, Roles]
) -> dict[str, str]:
    """Return synset -> category for the movables of a problem.

    The category that fills most roles of the goal is taken, then one of the synset itself before one of a narrower
    kind, then the shortest name.

    Raises:
        Ungroundable: no category of the synset can be what the initial state asks.
    """
    chosen: dict[str, str] = {}
    for synset in dict.fromkeys(map(synset_of, names)):
        members = [ontology[c] for c in activities.kinds.get(synset, ())]
        must, should = roles[synset]
        able = [c for c in members if _filled(c, must) == len(must)]
        if not able:
            missing = ", ".join(sorted(must)) if members else "a model"
            raise Ungroundable(f"no category of {synset} has what the initial state needs: {missing}")
        best = min(
            able,
            key=lambda c: (
                -_filled(c, should),
                not ROLES["stands"](c),
                c.synset != synset,
                not c.graspable,
                len(c.name),
                c.name,
            ),
        )
        chosen[synset] = best.name
    return chosen


def choose_pieces(
    problem: Problem,
    scene: Scene,
    activities: Activities,
    ontology: Ontology,
    roles: Mapping[str, Roles],
    reachable: Callable[[str], bool],
) -> Scope:
    """Return what the names with an `inroom` line stand for.

    Raises:
        Ungroundable: names the room or the piece that the scene lacks.
    """
    wanted: dict[str, list[str]] = {}
    for fact in problem.init:
        if fact.predicate == "inroom" and not fact.negated:
            wanted.setdefault(fact.args[1], []).append(fact.args[0])
    pieces: dict[str, str] = {}
    rooms: dict[str, str] = {}
    fitting: dict[str, tuple[str, ...]] = {}
    room_types: dict[str, str] = {}
    standing = [(f.id, f.room, ontology[f.category]) for f in scene.furniture]
    standing += [(i.id, i.room, ontology[i.category]) for i in scene.items]
    for room_type, names in wanted.items():
        candidates = [room.id for room in scene.rooms if room.type == room_type]
        if not candidates:
            raise Ungroundable(f"{scene.scene} has no {room_type}")
        things = [n for n in names if _needs_piece(n)]
        failure = ""
        best: tuple[int, str, dict[str, str], dict[str, tuple[str, ...]]] | None = None
        for room_id in candidates:
            here = [(piece, category) for piece, room, category in standing if room == room_id]
            options = {n: _options(n, here, activities, roles[synset_of(n)], reachable) for n in things}
            matched = _matching({n: o for n, o in options.items() if not n.endswith("_*")})
            if isinstance(matched, str):
                failure = failure or f"no {synset_of(matched)} left for {matched} in {room_type} of {scene.scene}"
                continue
            categories = dict(here)
            score = sum(_filled(categories[p], roles[synset_of(n)].should) for n, p in matched.items())
            if best is None or score > best[0]:
                best = (score, room_id, matched, options)
        if best is None:
            raise Ungroundable(failure)
        _, room_id, matched, options = best
        room_types[room_type] = room_id
        rooms.update({n: room_id for n in names if synset_of(n) in GROUND})
        pieces.update(matched)
        fitting.update(options)
        taken = set(matched.values())
        for name in (n for n in things if n.endswith("_*")):
            others = [p for p in options[name] if p not in taken]
            for index, piece in enumerate(others):
                pieces[f"{name[:-1]}more{index}"] = piece
            taken.update(others)
    return Scope(pieces, rooms, fitting, room_types)


def _needs_piece(name: str) -> bool:
    synset = synset_of(name)
    return synset not in GROUND and synset not in BUILDING


def _options(
    name: str,
    here: Iterable[tuple[str, Category]],
    activities: Activities,
    roles: Roles,
    reachable: Callable[[str], bool],
) -> tuple[str, ...]:
    """Return the pieces that a name can stand for, those that fill most roles of the goal first."""
    members = frozenset(activities.kinds.get(synset_of(name), ()))
    able = [
        (piece, category)
        for piece, category in here
        if category.name in members and _filled(category, roles.must) == len(roles.must) and reachable(piece)
    ]
    able.sort(key=lambda pair: (-_filled(pair[1], roles.should), _by_number(pair[0])))
    return tuple(piece for piece, _ in able)


def _by_number(piece: str) -> tuple[str, int]:
    stem, _, index = piece.rpartition("_")
    return (stem, int(index)) if index.isdigit() else (piece, -1)


def _matching(options: Mapping[str, tuple[str, ...]]) -> dict[str, str] | str:
    """Return name -> piece with every piece taken once (augmenting paths), or the name for which none is left."""
    owner: dict[str, str] = {}

    def place(name: str, tried: set[str]) -> bool:
        for piece in options[name]:
            if piece in tried:
                continue
            tried.add(piece)
            if piece not in owner or place(owner[piece], tried):
                owner[piece] = name
                return True
        return False

    for name in options:
        if not place(name, set()):
            return name
    return {name: piece for piece, name in owner.items()}
