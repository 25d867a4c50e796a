"""The JSON in which a language model says what it understood, written for training and read with distrust.

    {"tasks": [{"start": "Get the potato", "relations": ["inside(potato, fridge)"], "goal": ["cooked(potato)"]}, ...]}

`start` are the first words of a task's own sentence, `relations` what it states (E_i), `goal` its goal (g_i), `objects`
what else it speaks of (O_i without the others); what is empty may be left out. An answer is refused as a whole when it
is no such JSON, names what the ontology does not know, or speaks of what the text does not: an invented location costs
more than none.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import msgspec

from gavel_agents.llm.grammar import MOST_TASKS
from gavel_agents.understanding.checks import can_be, check_capable, check_possible
from gavel_agents.understanding.interface import Abstention, Decomposition, TaskUnderstanding
from gavel_agents.understanding.mentions import Mentions
from gavel_agents.understanding.pairs import Target
from gavel_env.data import decode
from gavel_env.errors import MalformedGoal
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, parse_literal
from gavel_env.world_model.ontology import Category, default_ontology

__all__ = ["answer_schema", "read_answer", "write_answer"]

_START_WORDS = 3
_LOCATIONS = (Predicate.ON_TOP, Predicate.INSIDE, Predicate.IN_ROOM)


def answer_schema(
    things: Mapping[str, Collection[str]], rooms: Sequence[str], *, brief: bool = False
) -> dict[str, Any]:
    """Return the JSON schema of answers about a text, for backends that can hold a model to it.

    Args:
        things: names of what the text speaks of -> the categories that they may mean; at least one.
        rooms: names of the rooms that it speaks of.
        brief: what is empty may be left out, as `write_answer` does.
    """
    room = _one_of(rooms)
    at = f"(@{room})?" if rooms else ""
    ontology = default_ontology()

    def able(test: Callable[[Category], bool]) -> str:
        return _one_of([name for name, meant in things.items() if any(test(ontology[c]) for c in meant)])

    moved = able(lambda category: category.liftable)
    places = {
        Predicate.ON_TOP: able(lambda category: category.surface),
        Predicate.INSIDE: able(lambda category: category.interior),
    }
    relations = [rf"{p.value}\({moved}{at}, {holder}{at}\)" for p, holder in places.items() if moved and holder]
    if rooms and moved:
        relations.append(rf"in_room\({moved}{at}, {room}\)")
    states = [rf"{p.value}\({names}{at}\)" for p in Predicate if p.arity == 1 and (names := able(partial(can_be, p)))]
    properties = {
        "start": {"type": "string", "maxLength": 60},
        "relations": _several(relations),
        "objects": _several([_one_of(list(things)) + at]),
        "goal": {**_several([rf"(not )?{literal}" for literal in (*relations, *states)]), "minItems": 1},
    }
    task = {
        "type": "object",
        "properties": properties,
        "required": ["start", "goal"] if brief else list(properties),
        "additionalProperties": False,
    }
    return {
        "type": "object",
        "properties": {"tasks": {"type": "array", "items": task, "minItems": 1, "maxItems": MOST_TASKS}},
        "required": ["tasks"],
        "additionalProperties": False,
    }


def _one_of(names: Sequence[str]) -> str:
    """Return the pattern of one of some names, or nothing if there are none."""
    return f"({'|'.join(map(re.escape, names))})" if names else ""


def _several(patterns: Sequence[str]) -> dict[str, Any]:
    """Return the schema of a list of strings of some patterns; of an empty list, if there are none."""
    items = {"type": "string", "pattern": f"^({'|'.join(patterns)})$"}
    return {"type": "array", "items": items, "maxItems": 20} if patterns else {"type": "array", "maxItems": 0}


class _Task(msgspec.Struct, frozen=True):
    start: str = ""
    relations: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    goal: tuple[str, ...] = ()


class _Answer(msgspec.Struct, frozen=True):
    tasks: tuple[_Task, ...]


def write_answer(tasks: Iterable[Target]) -> str:
    """Return the answer that says these targets."""
    said = []
    for task in tasks:
        parts = {
            "start": " ".join(task.text.split()[:_START_WORDS]),
            "relations": list(task.relations),
            "objects": [name for name in task.objects if name not in _named((*task.relations, *task.goal))],
            "goal": list(task.goal),
        }
        said.append({name: part for name, part in parts.items() if part})
    return json.dumps({"tasks": said}, ensure_ascii=False)


def _named(literals: Iterable[str]) -> set[str]:
    return {str(d) for text in literals for d in _objects_of(parse_literal(text))}


def _objects_of(literal: Literal) -> tuple[Designator, ...]:
    """Return what a literal speaks of; the room of `in_room` is not an object."""
    if literal.object is None or literal.predicate is Predicate.IN_ROOM:
        return (literal.subject,)
    return (literal.subject, literal.object)


def read_answer(answer: str, text: str) -> Decomposition:
    """Return the tasks that an answer says a text has.

    Raises:
        Abstention: `malformed`, `no_goal`, `unknown_name`, `ambiguous`, `not_in_text`, `contradiction` or what is
            impossible (`cannot_hold`, ...); with what and where.
    """
    try:
        said = decode(_outermost(answer), _Answer)
    except (msgspec.DecodeError, UnicodeEncodeError) as error:
        raise Abstention("malformed", f"{error} in {answer[:80]!r}") from error
    if not said.tasks:
        raise Abstention("no_goal", "nothing is asked for")
    mentions = Mentions(text)
    texts = _texts(text, [task.start for task in said.tasks])
    tasks = tuple(_task(task, own, mentions) for task, own in zip(said.tasks, texts, strict=True))
    stated = [literal for task in tasks for literal in task.relations]
    asked = [literal for task in tasks for literal in task.goal.literals]
    for literal in stated:
        if literal.negated or literal.predicate not in _LOCATIONS:
            raise Abstention("malformed", f"{literal} is not a location")
    check_capable([*stated, *asked])
    check_possible(stated, "is said to be")
    check_possible(asked, "should be")
    return Decomposition(tasks)


def _outermost(answer: str) -> bytes:
    """Return the JSON object in an answer, without prose or a fence around it."""
    return answer[max(answer.find("{"), 0) : answer.rfind("}") + 1].encode()


def _task(task: _Task, text: str, mentions: Mentions) -> TaskUnderstanding:
    relations = tuple(_literal(literal, mentions) for literal in task.relations)
    goal = tuple(_literal(literal, mentions) for literal in task.goal)
    if not goal:
        raise Abstention("no_goal", f"nothing is asked for in {text[:60]!r}")
    others = tuple(mentions.designator(name) for name in task.objects)
    named = (d for literal in (*relations, *goal) for d in _objects_of(literal))
    return TaskUnderstanding(text, tuple(dict.fromkeys((*named, *others))), relations, Goal(goal))


def _literal(written: str, mentions: Mentions) -> Literal:
    try:
        literal = parse_literal(written)
    except MalformedGoal as error:
        raise Abstention("malformed", str(error)) from error
    subject = mentions.designator(str(literal.subject))
    if literal.object is None:
        return literal._replace(subject=subject)
    if literal.predicate is Predicate.IN_ROOM:
        return literal._replace(subject=subject, object=Designator(mentions.room(str(literal.object))))
    return literal._replace(subject=subject, object=mentions.designator(str(literal.object)))


def _texts(text: str, starts: list[str]) -> list[str]:
    """Cut a text where its tasks start; a start that is not found leaves its task the whole text."""
    places: list[int] = []
    position = 0
    for start in starts:
        found = re.search(r"\W+".join(map(re.escape, start.split())), text[position:], re.IGNORECASE) if start else None
        places.append(-1 if found is None else position + found.start())
        position = places[-1] + 1 if found is not None else position
    if len(places) == 1 or -1 in places:
        return [text for _ in places]
    return [text[a:b].strip() for a, b in zip(places, [*places[1:], len(text)], strict=True)]
