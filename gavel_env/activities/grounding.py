"""An activity in a scene: what stands for its objects, how everything starts, and its goal over the graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

from gavel_env.activities.bddl import Fact, Problem, synset_of
from gavel_env.activities.definitions import Activities, Activity, load_activities
from gavel_env.activities.goal import GoalReader, substances_of, with_variable
from gavel_env.activities.scope import (
    AGENT,
    Roles,
    Ungroundable,
    choose_kinds,
    choose_pieces,
    is_thing,
    roles_of,
)
from gavel_env.house.scenes import Scene, load_scene
from gavel_env.instructions.record import Placement
from gavel_env.world_model.conditions import (
    Exists,
    Formula,
)
from gavel_env.world_model.ontology import Ontology, category_of, default_ontology

__all__ = ["Grounding", "ground", "reachable_in"]

_STATES = {"open": "open", "toggled_on": "toggled", "cooked": "cooked", "hot": "hot", "frozen": "frozen"}
_ON = frozenset({"ontop", "draped", "overlaid", "attached"})
_SUPPORTS = _ON | {"inside", "under", "nextto"}
_DIRTY = "dirty"


class Grounding(NamedTuple):
    """An activity in a scene.

    Attributes:
        activity: the activity.
        scene: name of the scene.
        scope: name in the activity -> id of its object in the graph, or of its room.
        placements: the movables and where they start.
        initial: what else holds at the start, as literals.
        goal: what is to hold.
        any_of: pieces for which another would do as well -> all that would.
        left_out: facts of the initial state that graphs do not have (liquids, attachments).
    """

    activity: Activity
    scene: str
    scope: Mapping[str, str]
    placements: tuple[Placement, ...]
    initial: tuple[str, ...]
    goal: Formula
    any_of: Mapping[str, tuple[str, ...]]
    left_out: tuple[str, ...]


def ground(
    activity: Activity | str,
    scene: Scene | str,
    *,
    activities: Activities | None = None,
    ontology: Ontology | None = None,
) -> Grounding:
    """Return an activity grounded in a scene.

    Raises:
        UnknownActivity, UnknownScene: there is none of this name.
        DataError: the activity's goal is not expressible.
        Ungroundable: the scene lacks a room or a piece, or the initial state cannot be built.
    """
    activities = activities or load_activities()
    ontology = ontology or default_ontology()
    chosen = activities[activity] if isinstance(activity, str) else activity
    house = load_scene(scene) if isinstance(scene, str) else scene
    return _Grounder(chosen, house, activities, ontology).result()


@lru_cache(maxsize=1024)
def _parsed(activity: Activity) -> tuple[Problem, Mapping[str, Roles]]:
    problem = activity.problem()
    return problem, roles_of(problem)


class _Grounder:
    """The working state of one grounding."""

    def __init__(self, activity: Activity, scene: Scene, activities: Activities, ontology: Ontology) -> None:
        self.activity, self.scene, self._ontology = activity, scene, ontology
        self.problem, roles = _parsed(activity)
        self.things = {s for s in self.problem.objects if is_thing(s, activities)}
        self.pieces = choose_pieces(self.problem, scene, activities, ontology, roles, reachable_in(scene))
        in_rooms = {f.args[0] for f in self.problem.init if f.predicate == "inroom"}
        movables = [
            name
            for synset, names in self.problem.objects.items()
            if synset in self.things
            for name in names
            if name not in in_rooms and not name.endswith("_*")
        ]
        self.kinds = choose_kinds(self.problem, movables, activities, ontology, roles)
        self.scope = {**self.pieces.rooms, **self.pieces.pieces, **self._new_ids(movables)}
        self.movables = movables
        self.dirt = frozenset(activities.dirt)
        self.soiled = frozenset(s for s in substances_of(self.problem.goal) if s in self.dirt) or self.dirt
        self.left_out: list[str] = []

    def result(self) -> Grounding:
        """Return the grounding."""
        placements, initial = self._start()
        any_of = self._interchangeable()
        rooms = frozenset(self.pieces.room_types.values())
        goal = GoalReader(self.problem.goal, self.scope, self.things, rooms, self._members).condition()
        for name, (piece, others) in any_of.items():
            variable = f"?{category_of(piece)}"
            goal = Exists(variable, others, with_variable(goal, piece, variable))
            self.scope[name] = piece
        return Grounding(
            self.activity,
            self.scene.scene,
            dict(self.scope),
            placements,
            initial,
            goal,
            dict(any_of.values()),
            tuple(self.left_out),
        )

    # --- names ---------------------------------------------------------------------------------------------------

    def _new_ids(self, names: list[str]) -> dict[str, str]:
        counts: dict[str, int] = {}
        taken = [
            *(f.id for f in self.scene.furniture),
            *(i.id for i in self.scene.items),
            *(r.id for r in self.scene.rooms),
        ]
        for obj in taken:
            stem = category_of(obj)
            index = int(obj.rsplit("_", 1)[1]) + 1 if obj != stem else 0
            counts[stem] = max(counts.get(stem, 0), index)
        ids: dict[str, str] = {}
        for name in names:
            kind = self.kinds[synset_of(name)]
            ids[name] = f"{kind}_{counts.get(kind, 0)}"
            counts[kind] = counts.get(kind, 0) + 1
        return ids

    def _members(self, synset: str) -> tuple[str, ...]:
        """Return the ids of all objects of a synset, those of a `_*` included."""
        names = list(self.problem.objects.get(synset, ()))
        if f"{synset}_*" in names:
            names += [n for n in self.pieces.pieces if n.startswith(f"{synset}_more")]
        return tuple(self.scope[n] for n in names if n in self.scope)

    def _interchangeable(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """Return the pieces that only the goal speaks of and that others of their room could stand for."""
        spoken = {arg for f in self.problem.init if f.predicate != "inroom" for arg in f.args}
        taken = set(self.scope.values())
        found = {}
        for name, piece in self.pieces.pieces.items():
            names = self.problem.objects.get(synset_of(name), ())
            others = self.pieces.fitting.get(name, ())
            if name in spoken or len(names) > 1 or len(others) < 2 or any(o in taken for o in others if o != piece):
                continue
            found[name] = (piece, (piece, *(o for o in others if o != piece)))
        return found

    # --- the start -----------------------------------------------------------------------------------------------

    def _start(self) -> tuple[tuple[Placement, ...], tuple[str, ...]]:
        states: dict[str, list[str]] = {}
        supports: dict[str, list[Fact]] = {}
        for fact in self.problem.init:
            name = fact.args[0]
            if fact.predicate == "inroom" or fact.negated or synset_of(name) == AGENT:
                continue
            if fact.predicate in _SUPPORTS:
                supports.setdefault(name, []).append(fact)
            elif fact.predicate in _STATES:
                states.setdefault(name, []).append(_STATES[fact.predicate])
            elif fact.predicate == "covered" and name in self.scope and name not in self.pieces.rooms:
                if synset_of(fact.args[1]) in self.soiled:
                    states.setdefault(name, []).append(_DIRTY)
            else:
                self.left_out.append(str(fact))
        placements = []
        initial: list[str] = []
        for name in self.movables:
            placement, beside = self._placement(name, supports.get(name, []), states.get(name, []))
            placements.append(placement)
            initial.extend(beside)
        for name, found in states.items():
            if name not in self.movables and name in self.scope:
                initial.extend(f"{state}({self.scope[name]})" for state in dict.fromkeys(found))
        return tuple(placements), tuple(initial)

    def _placement(self, name: str, facts: list[Fact], states: list[str]) -> tuple[Placement, list[str]]:
        kind, new = self.kinds[synset_of(name)], self.scope[name]
        flags = tuple(dict.fromkeys(states))
        beside: list[str] = []
        placed: Placement | None = None
        for fact in facts:
            holder = fact.args[1]
            if holder not in self.scope:
                raise Ungroundable(f"{fact}: graphs have no {synset_of(holder)}")
            target = self.scope[holder]
            if holder in self.pieces.rooms:
                placed = placed or Placement(kind, "floor", target, new, flags)
            elif fact.predicate in _ON and self._ontology[category_of(target)].surface:
                placed = placed or Placement(kind, "on", target, new, flags)
            elif fact.predicate == "inside":
                placed = placed or Placement(kind, "in", target, new, flags)
            else:
                beside.append(f"{'under' if fact.predicate == 'under' else 'next_to'}({new}, {target})")
        if placed is None:
            room = self._room_of(facts[0].args[1]) if facts else None
            if room is None:
                raise Ungroundable(f"the initial state does not say where {name} is")
            placed = Placement(kind, "floor", room, new, flags)
        return placed, beside

    def _room_of(self, name: str) -> str | None:
        """Return the room that a name is in, followed through what holds it."""
        for _ in self.problem.init:
            for fact in self.problem.init:
                if fact.args[0] == name and fact.predicate == "inroom":
                    return self.pieces.room_types[fact.args[1]]
            name = next((f.args[1] for f in self.problem.init if f.args[0] == name and f.predicate in _SUPPORTS), name)
        return None


@lru_cache(maxsize=64)
def _reachability(scene_name: str, scene: _ById) -> Callable[[str], bool]:
    from gavel_env.house.floor_map import floor_map

    floor = floor_map(scene.scene)
    held_by = {item.id: item.holder for item in scene.scene.items if item.relation != "floor"}
    loose = {item.id for item in scene.scene.items if item.relation == "floor"}

    def reachable(piece: str) -> bool:
        while piece in held_by:
            piece = held_by[piece]
        return piece in loose or floor.stances(piece).size > 0

    return reachable


class _ById:
    """A scene as a cache key: compared by identity, since scenes are read once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ById) and other.scene is self.scene

    def __hash__(self) -> int:
        return id(self.scene)


def reachable_in(scene: Scene) -> Callable[[str], bool]:
    """Return the test of whether the robot can get at a piece or item of a scene."""
    return _reachability(scene.scene, _ById(scene))
