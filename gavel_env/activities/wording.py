"""The text of an activity: its title as a sentence, what the goal needs, and what starts inside something shut."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from gavel_env.activities.english import joined, plural, title_of
from gavel_env.activities.grounding import Grounding
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.conditions import (
    ON_FLOOR,
    WITHIN,
    And,
    Atom,
    Exists,
    ForAll,
    Formula,
    ForN,
    ForPairs,
    Imply,
    Not,
    Or,
    conjuncts,
)
from gavel_env.world_model.graph import Relation, SceneGraph

__all__ = ["text_of"]

_PRESENT = {
    "on_top": "on top of", "inside": "inside", WITHIN: "inside", "under": "under", "next_to": "next to",
    ON_FLOOR: "on the floor of",
}  # fmt: skip
_STATES = {
    "open": ("open", "shut"), "toggled": ("switched on", "switched off"), "cooked": ("cooked", "not cooked"),
    "hot": ("hot", "not hot"), "frozen": ("frozen", "not frozen"), "dirty": ("dirty", "clean"),
}  # fmt: skip


def text_of(grounding: Grounding, graph: SceneGraph) -> str:
    """Return the text of a grounded activity; `graph`: G*_0."""
    return _Writer(grounding, graph).text()


class _Writer:
    def __init__(self, grounding: Grounding, graph: SceneGraph) -> None:
        self.grounding, self.graph = grounding, graph
        self.words = default_vocabulary()
        self.plurals: set[str] = set()

    def text(self) -> str:
        """Return title, goal and what starts behind a door."""
        clauses = self.clauses(conjuncts(_pushed(self.grounding.goal, True)), {})
        sentences = [f"{title_of(self.grounding.activity.name)}.", f"In the end, {joined(clauses, '; ')}."]
        sentences += self._hidden()
        return " ".join(sentences)

    # --- names ---------------------------------------------------------------------------------------------------

    def noun(self, obj: str) -> str:
        """Return what an object is called."""
        return self.words.nouns(self.graph.category(obj).name)[0]

    def room(self, room: str) -> str:
        """Return a room's name, with its id if the house has several of its type."""
        kind = self.graph.world.rooms[room].type
        name = f"the {self.words.room_nouns(kind)[0]}"
        several = sum(r.type == kind for r in self.graph.world.rooms.values()) > 1
        return f"{name} ({room})" if several else name

    def the(self, obj: str, bound: Mapping[str, str]) -> str:
        """Return a reference to an object, a room or a variable; with the id where the noun alone would not do."""
        if obj in bound:
            return bound[obj]
        if obj in self.graph.world.rooms:
            return self.room(obj)
        same = self.graph.world.by_category[self.graph.category(obj).name]
        name = f"the {self.noun(obj)}"
        if len(same) == 1:
            return name
        room = self.graph.room_of(obj)
        if self.graph.world.nodes[obj].fixed and room is not None:
            name = f"{name} in {self.room(room)}"
            if sum(self.graph.room_of(o) == room for o in same) == 1:
                return name
        return f"{name} ({obj})"

    def group(self, domain: Sequence[str]) -> tuple[str, str]:
        """Return a domain's noun in the singular and in the plural, with ids if it is not all there are of a kind."""
        nouns = list(dict.fromkeys(self.noun(o) for o in domain))
        kinds = dict.fromkeys(self.graph.category(o).name for o in domain)
        everything = {o for kind in kinds for o in self.graph.world.by_category[kind]}
        one, many = " or ".join(nouns), " and ".join(map(plural, nouns))
        if everything == set(domain):
            return one, many
        rooms = dict.fromkeys(self.graph.room_of(o) for o in domain)
        fixed = all(self.graph.world.nodes[o].fixed for o in domain)
        room = next(iter(rooms))
        if fixed and len(rooms) == 1 and room is not None:
            there = {o for o in everything if self.graph.room_of(o) == room}
            if there == set(domain):
                return f"{one} in {self.room(room)}", f"{many} in {self.room(room)}"
        ids = f" ({', '.join(domain)})"
        return one + ids, many + ids

    # --- clauses -------------------------------------------------------------------------------------------------

    def clauses(self, parts: Iterable[Formula], bound: Mapping[str, str]) -> list[str]:
        """Return conditions as clauses; those that say the same of several subjects become one."""
        found: dict[str, list[_Said] | str] = {}
        for part in parts:
            said = self._said(part, bound)
            if said is None:
                clause = self.clause(part, bound)
                found[clause] = clause
            elif "one of the" in said.what or "one and the same" in said.what:
                found[str(said)] = str(said)
            else:
                group = found.setdefault(said.what, [])
                assert isinstance(group, list)
                if said not in group:
                    group.append(said)
        return _merged(found.values())

    def clause(self, formula: Formula, bound: Mapping[str, str]) -> str:
        """Return a condition (negations pushed inwards) as a clause."""
        said = self._said(formula, bound)
        if said is not None:
            return str(said)
        if isinstance(formula, And):
            return joined(self.clauses(formula.parts, bound), ", ")
        if isinstance(formula, Or):
            return "either " + joined(self.clauses(formula.parts, bound), ", ", "or")
        if isinstance(formula, Imply):
            return f"if {self.clause(formula.premise, bound)}, then {self.clause(formula.body, bound)}"
        assert not isinstance(formula, Atom | Not)
        short = {**bound, formula.variable: f"the {self.noun(formula.domain[0])}"}
        one, many = self.group(formula.domain)
        self._note_number(formula.variable, formula.domain)
        if isinstance(formula, ForPairs):
            self._note_number(formula.other_variable, formula.other_domain)
            short[formula.other_variable] = f"the {self.noun(formula.other_domain[0])}"
            others = self.group(formula.other_domain)[1]
            return f"the {many} and the {others} form pairs, such that {self.clause(formula.body, short)}"
        if isinstance(formula, ForN):
            counted = f"exactly {formula.count} of the {many} {'is' if formula.count == 1 else 'are'}"
            return f"{counted} such that {self.clause(formula.body, short)}"
        if len(formula.domain) == 1:
            return self.clause(formula.body, {**bound, formula.variable: self.the(formula.domain[0], bound)})
        if not self._mentions(formula):
            return self.clause(formula.body, bound)
        if isinstance(formula, ForAll):
            every = "all" if formula.variable in self.plurals else "every"
            if self._mentions(formula) == 1:
                return self.clause(formula.body, {**bound, formula.variable: f"{every} {one}"})
            return f"for {every} {one}, {self.clause(formula.body, short)}"
        that = {**bound, formula.variable: f"that {self.noun(formula.domain[0])}"}
        return f"for one of the {many}, {self.clause(formula.body, that)}"

    def _mentions(self, formula: ForAll | Exists | ForN) -> int:
        return sum(formula.variable in asked.atom.args for asked in formula.body.asked())

    def _note_number(self, variable: str, domain: Sequence[str]) -> None:
        if self._is_plural(domain[0]):
            self.plurals.add(variable)

    def _said(self, formula: Formula, bound: Mapping[str, str]) -> _Said | None:
        """Return a condition that says one thing of one subject, or None if it says more."""
        if isinstance(formula, Atom):
            return self._atom(formula, bound, positive=True)
        if isinstance(formula, Not):
            return self._atom(formula.body, bound, positive=False) if isinstance(formula.body, Atom) else None
        if not isinstance(formula, ForAll | Exists) or self._mentions(formula) != 1:
            return None
        one, many = self.group(formula.domain)
        self._note_number(formula.variable, formula.domain)
        if len(formula.domain) == 1:
            name = self.the(formula.domain[0], bound)
        elif isinstance(formula, ForAll):
            name = f"{'all' if formula.variable in self.plurals else 'every'} {one}"
        else:
            name = f"one and the same {one}" if _has_for_all(formula.body) else f"one of the {many}"
        return self._said(formula.body, {**bound, formula.variable: name})

    def _atom(self, atom: Atom, bound: Mapping[str, str], *, positive: bool) -> _Said:
        subject = self.the(atom.args[0], bound)
        several = atom.args[0] in self.plurals or self._is_plural(atom.args[0])
        if atom.predicate in _STATES:
            return _Said(subject, several, _STATES[atom.predicate][0 if positive else 1])
        holder = self.the(atom.args[1], bound)
        where = f"{_PRESENT[atom.predicate]} {holder}"
        if positive:
            return _Said(subject, several, where)
        if holder.startswith(("every ", "all ")):
            where = f"{_PRESENT[atom.predicate]} any {holder.partition(' ')[2]}"
        if subject.startswith(("every ", "all ")):
            return _Said(f"no {subject.partition(' ')[2]}", several, where)
        return _Said(subject, several, f"not {where}")

    def _is_plural(self, obj: str) -> bool:
        if obj not in self.graph.world.nodes:
            return False
        head = self.noun(obj).partition(" of ")[0]
        looks_plural = head.endswith("s") and not head.endswith(("ss", "us", "is"))
        return looks_plural or self.words.is_plural(self.graph.category(obj).name)

    # --- the start -----------------------------------------------------------------------------------------------

    def _hidden(self) -> list[str]:
        """Return a sentence for every shut container that something of the activity starts in."""
        inside: dict[str, list[str]] = {}
        for placement in self.grounding.placements:
            obj = placement.id or ""
            container = self.graph.closed_container(obj)
            if container is not None:
                inside.setdefault(container, []).append(obj)
        sentences = []
        for container, objects in inside.items():
            named: list[str] = []
            for support in dict.fromkeys(self.graph.supports[o] for o in objects):
                things = self._listed(o for o in objects if self.graph.supports[o] == support)
                if support.holder != container:
                    where = "in" if support.relation is Relation.INSIDE else "on"
                    things[-1] += f" {where} {self.the(support.holder, {})}"
                named += things
            verb = "is" if len(objects) == 1 and not self._is_plural(objects[0]) else "are"
            where = f"inside {self.the(container, {})}, which is shut."
            sentences.append(f"At the start, {joined(named, ', ')} {verb} {where}")
        return sentences

    def _listed(self, objects: Iterable[str]) -> list[str]:
        """Return some objects by noun and number."""
        by_noun: dict[str, list[str]] = {}
        for obj in objects:
            by_noun.setdefault(self.noun(obj), []).append(obj)
        named = []
        for noun, members in by_noun.items():
            everywhere = self.graph.world.by_category[self.graph.category(members[0]).name]
            if len(members) == 1:
                named.append(self.the(members[0], {}))
            elif len(members) == len(everywhere):
                named.append(f"the {len(members)} {plural(noun)}")
            else:
                named.append(f"{len(members)} {plural(noun)} ({', '.join(members)})")
        return named


class _Said(NamedTuple):
    """One thing said of one subject: `the apple`, not several, `inside the fridge`."""

    subject: str
    several: bool
    what: str

    def __str__(self) -> str:
        return f"{self.subject} {'are' if self.several else 'is'} {self.what}"


def _merged(groups: Iterable[list[_Said] | str]) -> list[str]:
    """Return clauses: one for all subjects of which the same is said, and one for all that is said of the same."""
    clauses: dict[str, list[str] | None] = {}
    for group in groups:
        if isinstance(group, str):
            clauses[group] = None
            continue
        subjects = joined([said.subject for said in group], ", ")
        verb = "are" if len(group) > 1 or group[0].several else "is"
        things = clauses.setdefault(f"{subjects} {verb}", [])
        assert things is not None
        things.append(group[0].what)
    return [start if things is None else f"{start} {joined(things, ', ')}" for start, things in clauses.items()]


def _has_for_all(formula: Formula) -> bool:
    """Return whether a `forall` stands in a condition."""
    if isinstance(formula, ForAll):
        return True
    if isinstance(formula, And | Or):
        return any(map(_has_for_all, formula.parts))
    if isinstance(formula, Imply):
        return _has_for_all(formula.premise) or _has_for_all(formula.body)
    return not isinstance(formula, Atom) and _has_for_all(formula.body)


def _pushed(formula: Formula, positive: bool) -> Formula:
    """Return a condition with its negations pushed down to the atoms."""
    if isinstance(formula, Atom):
        return formula if positive else Not(formula)
    if isinstance(formula, Not):
        return _pushed(formula.body, not positive)
    if isinstance(formula, And | Or):
        parts = tuple(_pushed(part, positive) for part in formula.parts)
        return And(parts) if isinstance(formula, And) == positive else Or(parts)
    if isinstance(formula, Imply):
        if positive:
            return Imply(_pushed(formula.premise, True), _pushed(formula.body, True))
        return And((_pushed(formula.premise, True), _pushed(formula.body, False)))
    if isinstance(formula, ForAll | Exists):
        kind = ForAll if isinstance(formula, ForAll) == positive else Exists
        return kind(formula.variable, formula.domain, _pushed(formula.body, positive))
    return formula
