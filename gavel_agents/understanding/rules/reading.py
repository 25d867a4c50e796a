"""`RulesUnderstanding`: text -> frames -> acts -> tasks."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import zip_longest

from gavel_agents.understanding.base import Decomposition, TaskUnderstanding
from gavel_agents.understanding.rules.discourse import Discourse
from gavel_agents.understanding.rules.frames import frames_of
from gavel_agents.understanding.rules.lexer import Abstention, sentences_of
from gavel_agents.understanding.rules.tasks import Sentence, split_tasks
from gavel_agents.understanding.rules.verbs import read_frame
from gavel_env.goals import Designator, Literal, Predicate
from gavel_env.ontology import default_ontology

__all__ = ["RulesUnderstanding"]


class RulesUnderstanding:
    """Understands what it has words for, and says what it has none for; never guesses."""

    name = "rules"

    def understand(self, text: str, instruction_id: str = "") -> Decomposition:
        """Return the tasks of an instruction's text, or the typed reason of an abstention."""
        try:
            return Decomposition(_tasks(text))
        except Abstention as why:
            return Decomposition((), str(why))


def _tasks(text: str) -> tuple[TaskUnderstanding, ...]:
    discourse = Discourse()
    read: list[Sentence] = []
    opened = False
    for sentence in sentences_of(text):
        frames = frames_of(sentence.tokens)
        opened = opened or sentence.opened
        if not frames:
            opened = True
            continue
        read.append(Sentence(sentence.text, opened))
        for frame, following in zip_longest(frames, frames[1:]):
            read[-1].acts.append(read_frame(discourse, frame, following))
    tasks = split_tasks(read)
    if not tasks:
        raise Abstention("no_goal", "nothing is asked for")
    _check_complete(tasks)
    _check_possible([literal for task in tasks for literal in task.relations], "is said to be")
    _check_possible([literal for task in tasks for literal in task.goal.literals], "shall be")
    return tasks


def _check_complete(tasks: Iterable[TaskUnderstanding]) -> None:
    """Refuse what names a thing and then asks for nothing about it: something was not understood."""
    for task in tasks:
        used = {d for literal in (*task.relations, *task.goal.literals) for d in (literal.subject, literal.object)}
        for designator in task.objects:
            if default_ontology()[designator.name].graspable and designator not in used:
                raise Abstention("unparsed", f"nothing is asked for with {designator.name.replace('_', ' ')!r}")


def _check_possible(literals: Iterable[Literal], verb: str) -> None:
    """Refuse what cannot be: one thing in two places, or things that hold each other."""
    holders: dict[Designator, Designator] = {}
    for predicate, subject, target, _ in literals:
        if predicate not in (Predicate.ON_TOP, Predicate.INSIDE) or target is None:
            continue
        if holders.setdefault(subject, target) != target:
            raise Abstention("contradiction", f"{subject} {verb} both at {holders[subject]} and at {target}")
    for subject in holders:
        above, steps = holders.get(subject), 0
        while above is not None and above != subject and steps <= len(holders):
            above, steps = holders.get(above), steps + 1
        if above == subject:
            raise Abstention("contradiction", f"{subject} {verb} in or on itself")
