"""A house made ready for a sentence: the things that it speaks of are put somewhere plausible, the same for a seed.

What the sentence says of where things are is kept; what the caller says goes before it; everything else is drawn after
the evidence that the task generator uses. Doors are shut at the start, so nothing is drawn into a piece with a door: a
robot that was not told would not look there.
"""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from eval.sentence.said_places import Spot, categories_of, read_place
from eval.sentence.unsaid import with_appliances
from gavel_agents.beliefs.believed_graph import presupposed
from gavel_agents.understanding import TaskUnderstanding
from gavel_env.errors import NotInHouse
from gavel_env.house.scenes import BENCHMARK_HOUSES, load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.instructions.record import Instruction, Placement, TaskSpec
from gavel_env.tasks.placements import House, Place, load_house, pick
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.conditions import Formula
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting
from gavel_env.world_model.ontology import Category, category_of

__all__ = ["Put", "Staged", "stage"]


class Put(NamedTuple):
    """Where one thing was put.

    Attributes:
        name: designator by which the sentence speaks of it, or its category.
        placement: category, id and place.
        room: room id.
        why: "as you said", "as the sentence says" or "drawn".
    """

    name: str
    placement: Placement
    room: str
    why: str


class Staged(NamedTuple):
    """A house made ready.

    Attributes:
        instruction: the sentence with its placements and goals; without reference plans.
        tasks: what was understood, with what goes without saying.
        put: where things were put, in the order in which the sentence speaks of them.
        notes: what was taken for granted, in words.
    """

    instruction: Instruction
    tasks: tuple[TaskUnderstanding, ...]
    put: tuple[Put, ...]
    notes: tuple[str, ...]


def stage(
    text: str, scene: str, tasks: Sequence[TaskUnderstanding], *, seed: int = 0, places: Sequence[str] = ()
) -> Staged:
    """Return a house in which a sentence can be carried out.

    Args:
        text: the sentence.
        scene: name of a scene, or path of a scene file.
        tasks: what was understood.
        seed: of the draw.
        places: where things are, such as `mug on desk@private_office`.

    Raises:
        NotInHouse: the house lacks a piece or a room that the sentence needs.
        BadPlacement: a place in `places` cannot be read, or nothing can be put there.
        UnknownScene, SceneError: the scene cannot be read.
    """
    house = load_house(scene)
    rng = np.random.default_rng(seed)
    notes: list[str] = []
    completed: list[TaskUnderstanding] = []
    for task in tasks:
        task, taken = with_appliances(task, house)
        completed.append(task)
        notes += taken
    stager = _Stager(house, rng, completed, [read_place(place, house, rng) for place in places])
    put, initial = stager.put(), stager.initial()
    notes += [
        f"{one.placement.id} is behind the door of {one.placement.target}, and no search opens doors"
        for one in put
        if one.why == "as you said" and _is_shut(one.placement, house)
    ]
    instruction = Instruction(
        "sentence",
        house.scene.scene,
        text.encode("utf-8", "ignore").decode("utf-8"),
        tuple(one.placement for one in put),
        tuple(TaskSpec(t.text, tuple(map(str, t.goal.literals)), (), _formulas(t.goal)) for t in completed),
        "single" if len(completed) == 1 else "multi",
        initial,
    )
    return Staged(instruction, tuple(completed), put, tuple(notes))


_RELATIONS: Mapping[Predicate, typing.Literal["on", "in"]] = {Predicate.ON_TOP: "on", Predicate.INSIDE: "in"}


def _formulas(goal: Goal) -> tuple[Formula, ...]:
    return tuple(condition for condition in goal.conditions if isinstance(condition, Formula))


def _is_shut(placement: Placement, house: House) -> bool:
    shut = placement.target in house.graph.world.nodes and house.graph.is_shut(placement.target)
    return placement.relation == "in" and shut


class _Stager:
    """Puts the things of some tasks in a house."""

    def __init__(
        self,
        house: House,
        rng: np.random.Generator,
        tasks: Sequence[TaskUnderstanding],
        given: Sequence[tuple[tuple[Category, ...], Spot]],
    ) -> None:
        self._house, self._rng, self._tasks = house, rng, tasks
        self._given = list(given)
        self._said = [literal for task in tasks for literal in task.relations]
        self._goal = Goal(tuple(literal for task in tasks for literal in task.goal.literals))
        self._put: dict[str, Put] = {}

    def put(self) -> tuple[Put, ...]:
        """Put what the sentence speaks of and the house lacks, then what the caller put there besides."""
        for designator in dict.fromkeys(d for task in self._tasks for d in _spoken_of(task)):
            self._make_sure_of(designator)
        for categories, spot in self._given:
            category = self._one_of(categories)
            self._add(category.name, category.name, spot, "as you said")
        return tuple(self._put.values())

    def initial(self) -> tuple[str, ...]:
        """Return the states of pieces that hold at the start, as literals over ids."""
        states = []
        reachable = {piece.id for piece in self._house.pieces}
        for literal in (*self._said, *presupposed(self._tasks)):
            put = self._put.get(str(literal.subject))
            found = fitting(self._house.graph, literal.subject) if put is None else (put.placement.id or "",)
            found = tuple(o for o in found if o in reachable) or found
            if literal.predicate.flag is not None and found:
                states.append(str(literal._replace(subject=Designator(pick(self._rng, found)))))
        return tuple(dict.fromkeys(states))

    def _make_sure_of(self, designator: Designator) -> None:
        """Leave what the house has, and put what it lacks."""
        name = str(designator)
        if name in self._put:
            return
        able = [c for c in categories_of(designator, self._house) if self._is_put(c, designator)]
        given = next((g for g in self._given if any(c in able for c in g[0])), None)
        if given is not None:
            self._given.remove(given)
            category = self._one_of([c for c in given[0] if c in able])
            self._add(name, category.name, given[1], "as you said")
            return
        where = _source(designator, self._said)
        if fitting(self._house.graph, designator) and not (able and where):
            return
        if not able:
            raise NotInHouse(self._lacking(designator))
        if where is not None and where.object is not None and where.predicate in _RELATIONS:
            self._make_sure_of(where.object)
        category = self._one_of(able)
        spot = self._said_spot(category, where) or self._drawn(category, designator, where)
        why = "drawn" if where is None and designator.room is None else "as the sentence says"
        self._add(name, category.name, spot, why)

    def _is_put(self, category: Category, designator: Designator) -> bool:
        """Return whether a thing is put by us: what one hand lifts, and of the rest what the goal wants moved."""
        if category.name in self._house.vocabulary.furniture:
            return False
        moved = any(lit.subject == designator and lit.object is not None for lit in self._goal.literals)
        return category.graspable or (category.carryable and moved)

    def _one_of(self, able: Sequence[Category]) -> Category:
        """Return one of the categories that a word may mean: one that the evidence knows, if there is one."""
        known = [c for c in able if c.name in self._house.vocabulary.movables]
        return pick(self._rng, known or list(able))

    def _add(self, name: str, category: str, spot: Spot, why: str) -> None:
        graph = self._house.graph
        placed = {put.placement.id: put.room for put in self._put.values()}
        taken = {*placed, *graph.world.nodes}
        own = name if category_of(name) == category and name != category else ""
        number = 0
        while (identifier := own or f"{category}_{number}") in taken:
            own, number = "", number + 1
        room = spot.holder if spot.relation == "floor" else placed.get(spot.holder) or graph.room_of(spot.holder)
        placement = Placement(category, spot.relation, spot.holder, identifier)
        self._put[identifier if name in self._put else name] = Put(name, placement, room or "", why)

    # --- where ---------------------------------------------------------------------------------------------------

    def _said_spot(self, category: Category, where: Literal | None) -> Spot | None:
        """Return the place that the sentence says, on or in one of the pieces that fit; None if it names none."""
        if where is None or where.object is None or where.predicate not in _RELATIONS:
            return None
        relation = _RELATIONS[where.predicate]
        held = self._put.get(str(where.object))
        if held is not None:
            return Spot(relation, held.placement.id or "")
        graph = self._house.graph
        use = "surface" if relation == "on" else "interior"
        holders = [h for h in fitting(graph, where.object) if getattr(graph.category(h), use)]
        if not holders:
            raise NotInHouse(
                f"{self._house.scene.scene} has no {in_words(where.object.name)} to put anything {relation}"
            )
        reachable = {piece.id for piece in self._house.pieces}
        holders = [h for h in holders if h in reachable] or holders
        return Spot(relation, pick(self._rng, [h for h in holders if self._fits(category, relation, h)] or holders))

    def _drawn(self, category: Category, designator: Designator, where: Literal | None) -> Spot:
        """Return a place drawn after the evidence, in the room that is said if one is."""
        house, rooms = self._house, self._house.graph.world.rooms
        said = designator.room if where is None or where.object is None else str(where.object)
        options: list[Spot] = []
        weights: list[float] = []
        for place, weight in self._weighed(category):
            spot = Spot(place.relation, place.target)
            if house.shuts(place) or not (said is None or rooms[place.room].fits(said)):
                continue
            if not self._fits(category, *spot) or self._would_do(designator, place):
                continue
            options.append(spot)
            weights.append(weight)
        if not options:
            raise NotInHouse(f"{house.scene.scene} has no place for a {category.name} in {said or 'any room'}")
        return pick(self._rng, options, weights if sum(weights) > 0 else None)

    def _weighed(self, category: Category) -> Iterator[tuple[Place, float]]:
        """Yield every place with its weight; of what the evidence does not know, every surface alike."""
        if category.name in self._house.vocabulary.movables:
            yield from zip(*self._house.places(category.name), strict=True)
        else:
            yield from ((place, float(place.relation == "on")) for place in self._house.supports)

    def _fits(self, category: Category, relation: str, holder: str) -> bool:
        """Return whether a thing is small enough to lie on or in a piece."""
        size = None if relation == "floor" else self._house.graph.category(holder).size_m
        if category.size_m is None or size is None:
            return True
        if relation == "in":
            return all(a <= b for a, b in zip(sorted(category.size_m), sorted(size), strict=True))
        return all(a <= b for a, b in zip(sorted(category.size_m)[:2], sorted(size[:2]), strict=True))

    def _would_do(self, designator: Designator, place: Place) -> bool:
        """Return whether a thing put there would be where the goal wants it already."""
        graph = self._house.graph
        for literal in self._goal.literals:
            if literal.subject != designator or literal.negated or literal.object is None:
                continue
            if literal.predicate is Predicate.IN_ROOM and graph.world.rooms[place.room].fits(str(literal.object)):
                return True
            same = _RELATIONS.get(literal.predicate) == place.relation
            if same and place.target in fitting(graph, literal.object):
                return True
        return False

    def _lacking(self, designator: Designator) -> str:
        """Say what the house lacks, and which houses have it."""
        house = self._house.scene.scene
        rooms = self._house.graph.world.rooms
        if designator.room is not None and not any(room.fits(designator.room) for room in rooms.values()):
            return f"{house} has no {in_words(designator.room)}; rooms: {', '.join(rooms)}"
        within = "" if designator.room is None else f" in a {in_words(designator.room)}"
        others = [h for h in BENCHMARK_HOUSES if h != house and fitting(scene_graph(load_scene(h)), designator)]
        hint = f"houses that have one: {', '.join(others[:4])}" if others else "nor has any benchmark house"
        return f"{house} has no {in_words(designator.name)}{within}; {hint}"


def _spoken_of(task: TaskUnderstanding) -> Iterator[Designator]:
    yield from task.objects
    for literal in (*task.relations, *task.goal.literals):
        yield literal.subject
        if literal.object is not None and literal.predicate is not Predicate.IN_ROOM:
            yield literal.object


def _source(designator: Designator, said: Sequence[Literal]) -> Literal | None:
    """Return where a sentence says that a thing is."""
    places = (*_RELATIONS, Predicate.IN_ROOM)
    return next((lit for lit in said if lit.subject == designator and lit.predicate in places), None)
