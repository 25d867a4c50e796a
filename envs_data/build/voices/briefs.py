"""What a writer reads of a scenario: rooms, things, and what shall be true at the end, in words of no vocabulary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from envs_data.build.voices.glosses import piece_gloss, room_gloss, thing_gloss
from envs_data.build.voices.voices import MANNERS
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, Placement, TaskSpec
from gavel_env.tasks.placements import House, load_house
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting, parse_literal, unmet
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.ontology import category_of

__all__ = ["brief"]


def brief(record: Instruction) -> str:
    """Return the writer's brief of a scenario, several lines.

    Raises:
        UnknownScene, SceneError: its scene cannot be read.
    """
    return _Brief(load_house(record.scene), record).text()


class _Brief:
    def __init__(self, house: House, record: Instruction) -> None:
        self.house = house
        self.record = record
        self.graph: SceneGraph = instruction_graph(house.scene, record)
        self.types = dict(house.rooms)
        self.copies = Counter(p.category for p in record.placements)

    def text(self) -> str:
        record = self.record
        spoken = {_name(literal.subject) for literal in self._literals()}
        lines = [f"ROOMS: {self._rooms()}.", *self._surroundings(), "AT THE START:"]
        lines += [f"- {self._thing_line(p)}" for p in record.placements if {p.category, p.id} & spoken]
        lines += [f"- {self._piece(_piece_of(state), at=True)} {_state(state)} now" for state in record.initial]
        if lines[-1] == "AT THE START:":
            del lines[-1]
        count = len(record.tasks)
        lines.append("WANTED at the end:" if count == 1 else f"WANTED at the end, {count} errands in any order:")
        for number, task in enumerate(record.tasks, start=1):
            wanted = "; ".join(self._wanted(task))
            lines.append(f"- {wanted}" if count == 1 else f"{number}. {wanted}")
        manner = record.meta.get("manner")
        if manner:
            lines.append(f"IF IT SUITS: {MANNERS[manner]}.")
        return "\n".join(lines)

    # --- the house ------------------------------------------------------------------------------------------------

    def _rooms(self) -> str:
        counts = Counter(kind for _, kind in self.house.rooms)
        return ", ".join(
            room_gloss(kind) if n == 1 else f"{n} {room_gloss(kind, several=True)}"
            for kind, n in sorted(counts.items())
        )

    def _surroundings(self) -> list[str]:
        involved = {self.graph.room_of(obj) for obj in self._instances()}
        lines = []
        for room in sorted(r for r in involved if r is not None):
            counts = Counter(p.category for p in self.house.pieces if p.room == room)
            listed = "; ".join(
                piece_gloss(c) if n == 1 else f"{n} {piece_gloss(c, several=True)}" for c, n in sorted(counts.items())
            )
            lines.append(f"IN {self._room(room)}: {listed or 'no furniture to speak of'}.")
        return lines

    def _instances(self) -> set[str]:
        found = {a.target for a in self.record.reference_plan() if a.target is not None}
        return found & set(self.graph.world.nodes)

    def _room(self, room: str) -> str:
        kind = self.types[room]
        same = [r for r, k in self.house.rooms if k == kind]
        return f"the {room_gloss(kind)}" if len(same) == 1 else f"one of the {room_gloss(kind, several=True)}"

    def _type(self, kind: str) -> str:
        same = [r for r, k in self.house.rooms if k == kind]
        return f"the {room_gloss(kind)}" if len(same) == 1 else f"any of the {room_gloss(kind, several=True)}"

    # --- things ---------------------------------------------------------------------------------------------------

    def _thing_line(self, placement: Placement) -> str:
        name = thing_gloss(placement.category)
        if self.copies[placement.category] > 1:
            name += " (one of two)"
        if placement.relation == "floor":
            return f"{name}: on the floor of {self._room(placement.target)}"
        where = self._piece(placement.target)
        hidden = placement.relation == "in" and self.house.ontology[category_of(placement.target)].has_door
        extra = " (shut away there, so say where it is)" if hidden else ""
        return f"{name}: {placement.relation} the {where}{extra}"

    def _piece(self, obj: str, *, at: bool = False) -> str:
        """Return one instance in words: what, which of how many, where."""
        category, room = category_of(obj), self.graph.room_of(obj)
        assert room is not None
        same = [o for o in self.graph.world.by_category[category] if self.graph.room_of(o) == room]
        gloss = piece_gloss(category)
        which = gloss if len(same) == 1 else f"{gloss} (one of {len(same)} there)"
        return f"{'the ' if at else ''}{which} in {self._room(room)}"

    # --- the goal -------------------------------------------------------------------------------------------------

    def _literals(self) -> Sequence[Literal]:
        return [parse_literal(text) for task in self.record.tasks for text in task.goal]

    def _wanted(self, task: TaskSpec) -> list[str]:
        literals = [parse_literal(text) for text in task.goal]
        placed = {_name(lit.subject) for lit in literals if lit.predicate in (Predicate.ON_TOP, Predicate.INSIDE)}
        return list(dict.fromkeys(self._sentence(task, literal, placed) for literal in literals))

    def _sentence(self, task: TaskSpec, literal: Literal, placed: set[str]) -> str:
        subject = _name(literal.subject)
        if self.house.vocabulary.movables.get(category_of(subject)) is None:
            state = {Predicate.TOGGLED: ("switched on", "switched off"), Predicate.OPEN: ("open", "shut")}
            what = self._as_it_is(literal.subject) if literal.negated else self._target(literal.subject)
            return f"{what}: {state[literal.predicate][literal.negated]}"
        if self.house.vocabulary.movables.get(subject) is None:
            name = f"both of the things called {thing_gloss(category_of(subject))}"
        else:
            name = f"the {thing_gloss(subject)}"
        if literal.object is not None:
            preposition = "on" if literal.predicate is Predicate.ON_TOP else "in"
            back = "back " if not unmet(Goal((literal,)), self.graph) else ""
            return f"{name}: {back}{preposition} {self._target(literal.object)}"
        verb = {Predicate.WASHED: "washed", Predicate.DRIED: "dried", Predicate.COOKED: "heated through"}
        machine = self._machine(task, literal.predicate)
        after = "" if subject in placed else ", no matter where it is left"
        return f"{name}: has been {verb[literal.predicate]} (by the {self._piece(machine)}{after})"

    def _as_it_is(self, designator: Designator) -> str:
        """Return the instance that the scenario has left on or open, in words."""
        found = fitting(self.graph, designator)
        return self._piece(next(o for s in self.record.initial if (o := _piece_of(s)) in found), at=True)

    def _machine(self, task: TaskSpec, predicate: Predicate) -> str:
        for action in task.parsed_plan():
            if action.primitive.name == "TOGGLE_ON" and action.target is not None:
                category = self.house.ontology[category_of(action.target)]
                if {
                    Predicate.WASHED: category.washes,
                    Predicate.DRIED: category.dries,
                    Predicate.COOKED: category.heat is not None,
                }[predicate]:
                    return action.target
        raise AssertionError(f"no appliance gives {predicate.value} in {task.reference_plan}")

    def _target(self, designator: Designator) -> str:
        category, room = designator
        if room is None and self.house.vocabulary.furniture.get(category) is None:  # a tray that something is set on
            return f"the {thing_gloss(category)}"
        found = fitting(self.graph, designator)
        everywhere = fitting(self.graph, Designator(category))
        gloss = piece_gloss(category)
        if len(everywhere) == 1:
            return f"the {gloss} in {self._type(self._kind(found[0]))} (the only one in the building)"
        if room is None:
            rooms = sorted({self._kind(obj) for obj in found})
            places = ", ".join(self._type(kind) for kind in rooms)
            return f"any {gloss} in the building ({len(found)} of them: {places})"
        if len(found) == 1:
            return f"the {gloss} in {self._type(room)} (not one elsewhere)"
        elsewhere = "" if len(found) == len(everywhere) else ", not one elsewhere"
        return f"any of the {len(found)} {piece_gloss(category, several=True)} in {self._type(room)}{elsewhere}"

    def _kind(self, obj: str) -> str:
        room = self.graph.room_of(obj)
        assert room is not None
        return self.types[room]


def _name(designator: Designator) -> str:
    return designator.name


def _piece_of(state: str) -> str:
    return parse_literal(state).subject.name


def _state(state: str) -> str:
    return "is switched on" if parse_literal(state).predicate is Predicate.TOGGLED else "stands open"
