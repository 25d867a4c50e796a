"""What goes without saying: "wash the shirt" speaks of no machine, and needs one.

The agent does not know what the house holds, but it knows what gives which state. Where nothing that a task speaks of
can give a wanted state, the task is taken to be about an appliance that can: the category that people use for such
things, or, if there are several, the concept that names them all ("oven, microwave, stove or burner"); the search
settles which.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from gavel_agents.beliefs.narrowing import Narrowed
from gavel_agents.edits.wants import GIVEN_BY_APPLIANCES, confers
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.goals import Designator
from gavel_env.world_model.graph import Flag, Node, SceneGraph, World
from gavel_env.world_model.ontology import Category, Ontology

__all__ = ["with_appliances"]


def with_appliances(narrowed: Narrowed, graph: SceneGraph, ontology: Ontology) -> Narrowed:
    """Return the tasks with the appliances that their goals need and that nothing in them names.

    Only states that goals ask for by literals; a goal of the language of conditions names what it is about.

    Args:
        narrowed: the tasks, their concepts narrowed.
        graph: the believed graph of these tasks.
        ontology: says which categories give which states.
    """
    tasks, kinds = list(narrowed.tasks), dict(narrowed.kinds)
    added: dict[str, tuple[Category, ...]] = {}
    for number, task in enumerate(tasks):
        missing: dict[Designator, None] = {}
        for literal in task.goal.literals:
            flag, subject = literal.predicate.flag, graph.world.nodes.get(str(literal.subject))
            if flag not in GIVEN_BY_APPLIANCES or literal.negated or subject is None or subject.fixed:
                continue
            others = (node for node in graph.world.nodes if node != subject.id)
            if any(confers(graph, node, subject.id, flag) is not None for node in others):
                continue
            name, able = _appliance(subject, flag, ontology)
            if not able:
                continue
            missing[Designator(name)] = None
            shared = tuple(kind for kind in added.get(name, able) if kind in able)
            added[name] = shared or tuple(dict.fromkeys((*added[name], *able)))
        if missing:
            tasks[number] = msgspec.structs.replace(task, objects=tuple(dict.fromkeys((*task.objects, *missing))))
    kinds.update({name: able for name, able in added.items() if len(able) > 1 and name not in kinds})
    return Narrowed(tuple(tasks), kinds) if added else narrowed


def _appliance(subject: Node, flag: Flag, ontology: Ontology) -> tuple[str, tuple[Category, ...]]:
    """Return the name of what gives a state to a thing, and the categories that it may be of; none if nothing does.

    Of the categories that can, those that people run for such things (`FurnitureWords.suits`); of these names, the
    category if there is one, else the concept of fewest members that has them all.
    """
    able = [c for c in ontology.values() if c.name != subject.category.name and _gives(c, subject.category, flag)]
    able = list(_suited(able, subject.category)) or able
    if len(able) < 2:
        return (able[0].name, tuple(able)) if able else ("", ())
    names = {category.name for category in able}
    having = [(len(c.members), name) for name, c in ontology.concepts.things.items() if names <= set(c.members)]
    if not having:
        return able[0].name, (able[0],)
    concept = min(having)[1]
    return concept, tuple(c for c in ontology.kinds(concept) if c.name in names)


def _gives(appliance: Category, category: Category, flag: Flag) -> bool:
    """Return whether running an appliance gives a state to a thing of a category that lies in or on it."""
    nodes = {"appliance": Node("appliance", appliance, True), "thing": Node("thing", category, False)}
    graph = SceneGraph(World.of({}, frozenset(), nodes), {}, {})
    return confers(graph, "appliance", "thing", flag) is not None


def _suited(able: Sequence[Category], category: Category) -> Iterator[Category]:
    """Yield the categories that people put such things into; of a thing that the vocabulary lacks, all that are run."""
    vocabulary = default_vocabulary()
    thing = vocabulary.movables.get(category.name)
    for appliance in able:
        words = vocabulary.furniture.get(appliance.name)
        if words is not None and words.suits and (thing is None or thing.theme in words.suits):
            yield appliance
