"""What the things of an instruction are called in it, for records that do not say so themselves (`meta["targets"]`).

A thing goes by its id where the goal or the text does, and where a plan needs several of a kind that nothing else tells
apart; otherwise by its category, with its room if goal or text say that. Only the record is read, never the scene.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import msgspec

from gavel_env.instructions.record import Instruction, Placement
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.conditions import (
    ON_FLOOR,
    And,
    Asked,
    Atom,
    Exists,
    ForAll,
    Formula,
    ForN,
    ForPairs,
    Imply,
    Or,
)
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, parse_literal
from gavel_env.world_model.graph import Flag
from gavel_env.world_model.ontology import category_of, default_ontology

__all__ = ["Spoken", "goal_designators", "spoken"]

_RELATIONS = {"on": Predicate.ON_TOP, "in": Predicate.INSIDE}
_BESIDE = (Predicate.NEXT_TO, Predicate.UNDER)
_ID = re.compile(r"\b[a-z][a-z_]*_\d+\b")


class Spoken(NamedTuple):
    """How a task speaks of what it is about.

    Attributes:
        names: id -> designator in text form.
        goal: the goal with these names.
        relations: what the text says of the start, as literals over these names.
    """

    names: Mapping[str, str]
    goal: Goal
    relations: tuple[Literal, ...]


def spoken(instruction: Instruction, index: int) -> Spoken:
    """Return how the task of that index speaks of its objects."""
    return _spoken(_Key(instruction), index)


class _Key:
    """Wraps a record for the cache: records hold dicts, so they are compared by identity."""

    def __init__(self, instruction: Instruction) -> None:
        self.instruction = instruction

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.instruction is self.instruction

    def __hash__(self) -> int:
        return id(self.instruction)


@lru_cache(maxsize=64)
def _spoken(key: _Key, index: int) -> Spoken:
    naming = _Naming(key.instruction, index)
    relations = tuple(dict.fromkeys((*naming.places(), *naming.states(), *naming.rooms())))
    return Spoken(naming.names, naming.goal(), relations)


def goal_designators(goal: Goal) -> tuple[Designator, ...]:
    """Return every object designator of a goal once, in order; rooms are not objects."""
    found: dict[Designator, None] = {}
    for literal in goal.literals:
        found[literal.subject] = None
        if literal.object is not None and literal.predicate is not Predicate.IN_ROOM:
            found[literal.object] = None
    for asked in _asked(goal):
        for members in _members(asked):
            found.update(dict.fromkeys(members))
    return tuple(found)


def _asked(goal: Goal) -> Iterator[Asked]:
    for condition in goal.conditions:
        if isinstance(condition, Formula):
            yield from condition.asked()


def _members(asked: Asked) -> Iterator[tuple[Designator, ...]]:
    """Yield, for every place of an atom that names objects, the designators that may stand there."""
    atom, _, domains = asked
    places = atom.args[:1] if atom.predicate in (ON_FLOOR, Predicate.IN_ROOM.value) else atom.args
    for place in places:
        yield tuple(Designator.parse(member) for member in domains.get(place, (place,)))


def _is_id(name: str) -> bool:
    """Return whether a name is an instance id: no category, but one with an index."""
    ontology = default_ontology()
    return name not in ontology and category_of(name) in ontology


class _Naming:
    """Names the things of one task."""

    def __init__(self, instruction: Instruction, index: int) -> None:
        spec = instruction.tasks[index]
        self._text = instruction.text.lower().replace("_", " ")
        self._goal = spec.parsed_goal()
        self._said_shut = instruction.kind == "behavior"  # their texts name whatever starts in something shut
        self._text_ids = frozenset(i for i in _ID.findall(instruction.text) if _is_id(i))
        self._plan = tuple(dict.fromkeys(a.target for a in spec.parsed_plan() if a.target is not None))
        self._initial = tuple(parse_literal(text) for text in instruction.initial)
        self._placed = _placed(instruction.placements, self._plan)
        goal_ids = (str(d) for d in goal_designators(self._goal) if _is_id(str(d)))
        self._known = tuple(dict.fromkeys((*goal_ids, *self._plan, *self._placed)))
        self._set_down = _set_down(spec.parsed_plan(), self._goal)
        self.names: dict[str, str] = {}
        self._meant: dict[Designator, list[str]] = {}
        self._name_goal()
        self._name_rest()

    # --- names -----------------------------------------------------------------------------------------------------

    def _fitting(self, designator: Designator) -> list[str]:
        """Return the known things that a designator may mean; where pieces stand is not in the record."""
        if str(designator) in self._known:
            return [str(designator)]
        ontology = default_ontology()
        kinds = {kind.name for kind in ontology.kinds(designator.name)} if ontology.knows(designator.name) else ()
        return [obj for obj in self._known if category_of(obj) in kinds]

    def _name_goal(self) -> None:
        """Name what the goal speaks of."""
        said = goal_designators(self._goal)
        self.names.update({str(d): str(d) for d in said if _is_id(str(d))})
        for designator in said:
            if _is_id(str(designator)):
                continue
            fits = self._fitting(designator)
            new = [obj for obj in fits if obj not in self.names]
            used = [obj for obj in new if obj in self._plan]
            self._meant[designator] = new or fits
            for obj in new:
                by_id = obj in self._text_ids or (len(used) > 1 and obj in used)
                self.names[obj] = obj if by_id else str(designator)
            if not fits:
                self.names[str(designator)] = str(designator)

    def _name_rest(self) -> None:
        """Name what only the plan and the start speak of."""
        for obj, room in self._set_down.items():
            if obj not in self.names and obj not in self._placed:
                self.names[obj] = f"{category_of(obj)}@{room}"
        for obj in self._plan:
            if obj not in self.names:
                self.names[obj] = self._called(obj)
        if self._said_shut:
            for obj in [o for o in self._placed if o in self.names]:
                chain = list(self._chain(obj))
                last = max((i for i, p in enumerate(chain) if self._is_shut_in(p)), default=-1)
                for placement in chain[: last + 1]:
                    if placement.target not in self.names:
                        self.names[placement.target] = self._called(placement.target)

    def _called(self, obj: str) -> str:
        """Return a name for what the goal does not speak of."""
        category = category_of(obj)
        alike = sum(category_of(o) == category and self.names.get(o, o) == o for o in self._plan)
        taken = any(name == o and category_of(o) == category for o, name in self.names.items())
        if obj in self._text_ids or alike > 1 or (taken and obj in self._placed):
            return obj
        for noun in default_vocabulary().nouns(category) if self._said_shut and obj not in self._placed else ():
            match = re.search(rf"inside the {noun} in the ([\w ]+?)(?: \((\w+ \d+)\))?, which is shut", self._text)
            if match is not None and match.group(2) is None:
                rooms = default_vocabulary().rooms
                kind = next((kind for kind, nouns in rooms.items() if match.group(1) in nouns), match.group(1))
                return f"{category}@{kind.replace(' ', '_')}"
        return category

    def goal(self) -> Goal:
        """Return the goal, with what has an id in one place called by it everywhere."""

        def renamed(designator: Designator) -> Designator:
            names = {self.names[obj] for obj in self._meant.get(designator, ())}
            return Designator.parse(names.pop()) if len(names) == 1 else designator

        literals = []
        for literal in self._goal.literals:
            second = literal.object
            if second is not None and literal.predicate is not Predicate.IN_ROOM:
                second = renamed(second)
            literals.append(literal._replace(subject=renamed(literal.subject), object=second))
        conditions = tuple(_used(c) if isinstance(c, Formula) else c for c in self._goal.conditions)
        return Goal(tuple(literals), conditions)

    # --- the start -------------------------------------------------------------------------------------------------

    def _chain(self, obj: str) -> Iterator[Placement]:
        """Yield the placements of a thing, of what it is on or in, and so on outwards."""
        while (placement := self._placed.get(obj)) is not None:
            yield placement
            obj = placement.target

    def _is_shut_in(self, placement: Placement) -> bool:
        """Return whether a placement is into something that starts shut."""
        if placement.relation != "in":
            return False
        category = default_ontology()[category_of(Designator.parse(placement.target).name)]
        is_open = any(i.predicate is Predicate.OPEN and str(i.subject) == placement.target for i in self._initial)
        holder = self._placed.get(placement.target)
        is_open = is_open or (holder is not None and "open" in holder.states)
        return category.openable and not is_open

    def places(self) -> Iterator[Literal]:
        """Yield where movables start, as far as the text names the place or says that it is shut."""
        for obj in [o for o in self._placed if o in self.names]:
            chain = list(self._chain(obj))
            for index, placement in enumerate(chain):
                if placement.relation == "floor":
                    room = category_of(placement.target)
                    if self._mentions(default_vocabulary().room_nouns(room)):
                        said = placement.target if self._mentions((placement.target,)) else room
                        yield Literal(Predicate.IN_ROOM, self._said(obj), Designator(said))
                    break
                shut = self._said_shut and any(map(self._is_shut_in, chain[index:]))
                name = self.names.get(placement.target) if shut else self._place(placement.target)
                if name is None:
                    break
                self.names.setdefault(placement.target, name)
                yield Literal(_RELATIONS[placement.relation], self._said(obj), Designator.parse(name))
                obj = placement.target

    def _place(self, holder: str) -> str | None:
        """Return the name of a place that the text names, or None."""
        category = category_of(Designator.parse(holder).name)
        if not self._mentions((category, *default_vocabulary().nouns(category))):
            return None
        if holder in self.names:
            return self.names[holder]
        names = list(dict.fromkeys(name for obj, name in self.names.items() if category_of(obj) == category))
        if not self._said_shut and len(names) == 1:
            return names[0]
        return None if names else category

    def _mentions(self, words: Sequence[str]) -> bool:
        return any(word.lower().replace("_", " ") in self._text for word in words)

    def _said(self, obj: str) -> Designator:
        return Designator.parse(self.names[obj])

    def states(self) -> Iterator[Literal]:
        """Yield the states and neighbourhoods of the start that the goal speaks of: what shall be clean is dirty."""
        asked: dict[str, set[str]] = {}
        for literal in self._goal.literals:
            asked.setdefault(literal.predicate.value, set()).update(self._fitting(literal.subject))
        for said in _asked(self._goal):
            for designator in next(_members(said)):
                asked.setdefault(said.atom.predicate, set()).update(self._fitting(designator))
        placed = ((state, obj) for obj, p in self._placed.items() for state in p.states)
        initial = ((i.predicate.value, str(i.subject)) for i in self._initial if i.object is None)
        known = {flag.name.lower() for flag in Flag}
        for state, obj in (*placed, *initial):
            if state in known and obj in asked.get(state, ()) and obj in self.names:
                yield Literal(Predicate(state), self._said(obj))
        for literal in self._initial:
            ends = tuple(str(end) for end in (literal.subject, literal.object) if end is not None)
            wanted = any(end in asked.get(predicate.value, ()) for predicate in _BESIDE for end in ends)
            if literal.predicate in _BESIDE and wanted and all(end in self.names for end in ends):
                yield literal._replace(subject=self._said(ends[0]), object=self._said(ends[1]))

    def rooms(self) -> Iterator[Literal]:
        """Yield the room that the goal says of a piece which goes by another name."""
        for designator, meant in self._meant.items():
            for obj in meant if designator.room is not None else ():
                if self.names.get(obj) == obj and obj not in self._placed:
                    yield Literal(Predicate.IN_ROOM, Designator(obj), Designator(str(designator.room)))


def _set_down(plan: Sequence[Action], goal: Goal) -> dict[str, str]:
    """Return beside what a plan sets things down on the floor -> the room in whose floor the goal wants them."""
    rooms: dict[str, str] = {}
    for atom, positive, domains in _asked(goal):
        if atom.predicate == ON_FLOOR and positive:
            rooms.update(dict.fromkeys(domains.get(atom.args[0], atom.args[:1]), atom.args[1]))
    beside: dict[str, str] = {}
    held = there = ""
    for primitive, target, _ in plan:
        if primitive is Primitive.GRASP:
            held = target or ""
        elif primitive is Primitive.NAVIGATE_TO:
            there = target or ""
        elif primitive is Primitive.RELEASE and held in rooms:
            beside[there] = rooms[held]
    return beside


def _used(formula: Formula) -> Formula:
    """Return a condition without the quantifiers whose variable nothing asks for."""
    if isinstance(formula, And | Or):
        return msgspec.structs.replace(formula, parts=tuple(map(_used, formula.parts)))
    if isinstance(formula, Atom | Imply | ForN | ForPairs):
        return formula
    body = _used(formula.body)
    if isinstance(formula, ForAll | Exists) and formula.domain and not _mentions(body, formula.variable):
        return body
    return msgspec.structs.replace(formula, body=body)


def _mentions(formula: Formula, variable: str) -> bool:
    return any(variable in said.atom.args for said in formula.asked())


def _placed(placements: Iterable[Placement], plan: Sequence[str]) -> dict[str, Placement]:
    """Return the placements by id; those without one get an id that the plan uses, or their category for a name."""
    found: dict[str, Placement] = {p.id: p for p in placements if p.id is not None}
    for placement in placements:
        if placement.id is None:
            free = (obj for obj in plan if category_of(obj) == placement.category and obj not in found)
            found.setdefault(next(free, placement.category), placement)
    return found
