"""What the goal wants of an object: where it belongs, and which states an appliance must give it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gavel_agents.edits.rule import Case
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import apply, conferred
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting, unmet
from gavel_env.world_model.graph import Flag, Relation, SceneGraph, Support

__all__ = ["Errand", "chosen_subject", "confers", "destinations", "errands", "wanted_flag", "works_of"]

SPATIAL = {Predicate.ON_TOP: Relation.ON_TOP, Predicate.INSIDE: Relation.INSIDE}

GIVEN_BY_APPLIANCES = (Flag.COOKED, Flag.WASHED, Flag.DRIED, Flag.HOT, Flag.FROZEN)


class Errand(NamedTuple):
    """Something to be brought somewhere: `obj` on, in or beside `place`."""

    obj: str
    relation: Relation
    place: str


def wanted_flag(literal: Literal) -> Flag | None:
    """Return the state that an appliance must give for this literal, or None if it asks for no such state."""
    flag = literal.predicate.flag
    if flag is Flag.DIRTY and literal.negated:
        return Flag.WASHED
    return flag if flag in GIVEN_BY_APPLIANCES and not literal.negated else None


def chosen_subject(case: Case, designator: Designator, graph: SceneGraph) -> str | None:
    """Return the instance that a literal's subject is taken for.

    Of several that fit: the one of which most of the goal's literals hold, then the one that the plan names.
    """
    fits = fitting(graph, designator)
    if len(fits) <= 1:
        return fits[0] if fits else None
    about = [lit for lit in case.goal.literals if lit.subject == designator and not lit.negated]

    def left(name: str) -> int:
        return len(unmet(Goal(tuple(lit._replace(subject=Designator(name)) for lit in about)), graph))

    return min(case.preferred(fits), key=left)


def destinations(case: Case, graph: SceneGraph, obj: str) -> Iterator[Errand]:
    """Yield where the goal wants `obj` and it is not, best first."""
    for literal in case.goal.literals:
        relation = SPATIAL.get(literal.predicate)
        if relation is None or literal.negated or literal.object is None:
            continue
        if chosen_subject(case, literal.subject, graph) != obj:
            continue
        places = fitting(graph, literal.object)
        if graph.supports.get(obj) in [(relation, place) for place in places]:
            continue
        for place in case.preferred(places)[:1]:
            if place != obj:
                yield Errand(obj, relation, place)


def works_of(case: Case, graph: SceneGraph, obj: str) -> Iterator[Errand]:
    """Yield the appliances that the plan names and that give `obj` a state which the goal wants and it lacks."""
    for literal in case.goal.literals:
        flag = wanted_flag(literal)
        if flag is None or obj in graph.flags[flag] or chosen_subject(case, literal.subject, graph) != obj:
            continue
        if literal.predicate.flag is Flag.DIRTY and obj not in graph.flags[Flag.DIRTY]:
            continue
        yield from appliances(case, graph, obj, flag)


def appliances(case: Case, graph: SceneGraph, obj: str, flag: Flag) -> Iterator[Errand]:
    """Yield the appliances that the plan names and that can give `flag` to `obj`: operated ones first."""
    operated = {a.target for a in case.plan if a.primitive in (Primitive.TOGGLE_ON, Primitive.PLACE_INSIDE)}
    named = [name for name in case.first_mention if name in graph.world.nodes and name != obj]
    for name in sorted(named, key=lambda n: n not in operated):
        relation = confers(graph, name, obj, flag)
        if relation is not None:
            yield Errand(obj, relation, name)


def confers(graph: SceneGraph, appliance: str, obj: str, flag: Flag) -> Relation | None:
    """Return how `obj` must lie in or on `appliance` to be given `flag` by it, or None if it cannot.

    The world model answers: the object is put there in thought and the appliance run.
    """
    category = graph.category(appliance)
    gives = category.heat is not None or category.cold is not None or category.washes or category.dries
    if not gives or graph.world.nodes[obj].fixed or graph.contains(obj, appliance):
        return None
    shut = graph.with_flag(Flag.OPEN, frozenset((appliance,)), value=False)
    for relation, possible in ((Relation.INSIDE, category.interior), (Relation.ON_TOP, category.surface)):
        if not possible:
            continue
        loaded = shut.place(obj, Support(relation, appliance))
        if flag is Flag.FROZEN:
            if category.openable and obj in apply(loaded, Action(Primitive.CLOSE, appliance)).flags[flag]:
                return relation
        elif category.toggleable and obj in conferred(loaded, appliance).get(flag, ()):
            return relation
    return None


def errands(case: Case, graph: SceneGraph, obj: str) -> list[Errand]:
    """Return what the goal still wants done with `obj`: states first, since they come before delivery."""
    return [*works_of(case, graph, obj), *destinations(case, graph, obj)]
