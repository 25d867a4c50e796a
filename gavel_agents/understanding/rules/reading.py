"""`RulesUnderstanding`: text -> frames -> acts -> tasks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import zip_longest

from gavel_agents.understanding.checks import check_possible
from gavel_agents.understanding.interface import Abstention, Decomposition, Rooms, TaskUnderstanding
from gavel_agents.understanding.rules.discourse import Discourse
from gavel_agents.understanding.rules.frames import frames_of
from gavel_agents.understanding.rules.lexer import sentences_of
from gavel_agents.understanding.rules.tasks import Sentence, split_tasks
from gavel_agents.understanding.rules.verbs import read_frame
from gavel_env.world_model.ontology import default_ontology

__all__ = ["RulesUnderstanding"]


class RulesUnderstanding:
    """Understands what it has words for, and says what it has none for; never guesses."""

    name = "rules"

    def understand(
        self, text: str, *, rooms: Rooms | None = None, answers: Mapping[str, str] | None = None
    ) -> Decomposition:
        """Return the tasks of an instruction's text, or the typed reason of an abstention."""
        try:
            return Decomposition(_tasks(text))
        except Abstention as why:
            return Decomposition.refusal(why)


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
    check_possible([literal for task in tasks for literal in task.relations], "is said to be")
    check_possible([literal for task in tasks for literal in task.goal.literals], "shall be")
    return tasks


def _check_complete(tasks: Iterable[TaskUnderstanding]) -> None:
    """Refuse what names a thing and then asks for nothing about it: something was not understood."""
    for task in tasks:
        used = {d for literal in (*task.relations, *task.goal.literals) for d in (literal.subject, literal.object)}
        for designator in task.objects:
            if default_ontology()[designator.name].graspable and designator not in used:
                raise Abstention("unparsed", f"nothing is asked for with {designator.name.replace('_', ' ')!r}")
