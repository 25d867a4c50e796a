"""What makes no sense in any house, though its words are understood: then it is asked, not guessed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from gavel_agents.understanding.interface import TaskUnderstanding
from gavel_agents.understanding.rules.nouns import kinds_of
from gavel_agents.understanding.rules.questions import asked_end, asked_instead
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import in_words
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate
from gavel_env.world_model.ontology import Category

__all__ = ["check_already", "check_sense", "one_end"]

_BULKIER = 2.0
"""How many times the space of what holds it a thing may take."""


def check_sense(literals: Sequence[Literal]) -> None:
    """Refuse goals that no one means.

    Raises:
        Abstention: `too_big`, `cannot_process`.
    """
    for literal in literals:
        subject, target = literal.subject, literal.object
        if literal.predicate is Predicate.HOT and not any(map(_edible, kinds_of(subject.name))):
            raise asked_instead("cannot_process", f"the {_words(subject)} is nothing to warm")
        if target is not None and literal.predicate is Predicate.INSIDE and not _fits(subject, target):
            raise asked_instead("too_big", f"the {_words(subject)} is too big for the {_words(target)}")


def check_already(literals: Sequence[Literal], stated: Collection[Literal]) -> None:
    """Refuse goals that are said to be so already.

    Raises:
        Abstention: `already`.
    """
    for literal in literals:
        if literal in stated and literal.predicate is not Predicate.IN_ROOM:
            raise asked_instead("already", f"the {_words(literal.subject)} is said to be there already: {literal}")


def _words(designator: Designator) -> str:
    return in_words(designator.name)


def _edible(category: Category) -> bool:
    """Return whether things of a category are food or drink, which people have warmed."""
    said = default_vocabulary().movables.get(category.name)
    return category.cookable or (said is not None and said.theme in ("food", "hot_food", "drink", "pantry"))


def _fits(thing: Designator, holder: Designator) -> bool:
    """Return whether a thing is not far too big for what is carried about and shall hold it."""
    for inner in kinds_of(thing.name):
        for outer in kinds_of(holder.name):
            if not outer.graspable or inner.size_m is None or outer.size_m is None:
                return True
            if _volume(inner.size_m) <= _BULKIER * _volume(outer.size_m):
                return True
    return False


def _volume(size_m: tuple[float, float, float]) -> float:
    return size_m[0] * size_m[1] * size_m[2]


def one_end(tasks: Sequence[TaskUnderstanding], answers: Mapping[str, str]) -> tuple[TaskUnderstanding, ...]:
    """Return tasks that leave each thing in one place, by the answers where the text names several.

    Raises:
        Abstention: `contradiction`, with the question where it shall be.
    """
    places: dict[Designator, list[Literal]] = {}
    for literal in (literal for task in tasks for literal in task.goal.literals):
        if literal.predicate in (Predicate.ON_TOP, Predicate.INSIDE) and literal not in places.get(literal.subject, []):
            places.setdefault(literal.subject, []).append(literal)
    dropped: set[Literal] = set()
    rooms = {
        literal.subject
        for task in tasks
        for literal in task.goal.literals
        if literal.predicate is Predicate.IN_ROOM and not literal.negated
    }
    for subject, literals in places.items():
        if subject in rooms:
            raise asked_instead(
                "contradiction", f"the {_words(subject)} should be in a room and at {literals[0].object}"
            )
        if len(literals) < 2:
            continue
        why = asked_end(
            _words(subject),
            [_words(literal.object) for literal in literals if literal.object],
            f"the {_words(subject)} should be both at {literals[0].object} and at {literals[1].object}",
        )
        said = answers.get(why.question.key, "").lower() if why.question else ""
        meant = [literal for literal in literals if literal.object and _words(literal.object) in said]
        if len(meant) != 1:
            raise why
        dropped.update(literal for literal in literals if literal != meant[0])
    return tuple(_without(task, dropped) for task in tasks) if dropped else tuple(tasks)


def _without(task: TaskUnderstanding, dropped: Collection[Literal]) -> TaskUnderstanding:
    goal = Goal(tuple(literal for literal in task.goal.literals if literal not in dropped))
    return TaskUnderstanding(task.text, task.objects, task.relations, goal)
