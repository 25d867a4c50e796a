"""Certificates: what must hold of an instruction before anything is judged by it.

`certify` re-checks one record and returns what is wrong, `certify_set` a whole file. Nothing is believed because it was
generated: the symbolic part replays every errand alone and all of them in every order; the executor part drives the
reference plan through the house from where the robot starts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from gavel_env.errors import GavelError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.tasks.broken import LEAST, Broken
from gavel_env.tasks.driving import drive
from gavel_env.tasks.judging import judge
from gavel_env.tasks.wording_checks import article_errors, sentence_faults, unknown_words
from gavel_env.world_model.actions import Action
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.dynamics import rollout
from gavel_env.world_model.goals import Designator, Goal, Literal, Predicate, fitting, parse_literal, unmet
from gavel_env.world_model.graph import Relation, SceneGraph
from gavel_env.world_model.verdict import shortfall

__all__ = ["CHECKS", "Problem", "certify", "certify_set", "check_broken"]

CHECKS: Mapping[str, str] = {
    "placement": "every placement fits the scene, and every goal is of what can be there",
    "start": "no task's goal holds at the start, and of the benchmarks' goals no literal",
    "alone": "every errand's plan runs alone, ends safe, and meets its goal",
    "orders": "the plans run in every order, end safe, and meet the whole goal",
    "executor": "the robot drives the reference plan from its start without violation, ends safe, and meets the goal",
    "independence": "no two tasks speak of the same movable; no furniture category is meant in two rooms",
    "referents": "movables are unique; stated sources are true, and unique if they have a door",
    "hidden": "what starts behind a door is said to be there",
    "sentence": "texts name every object of goal and stated relations, and nothing else; rooms likewise",
    "spelling": "every word is known; a and an as they are pronounced",
    "duplicate": "no other record has the same text, or the same placements and goals",
    "broken": f"at least {LEAST} broken variants per task end as recorded",
}
"""Name of every check -> what it says."""


class Problem(NamedTuple):
    """One thing that is wrong with a record."""

    instruction: str
    check: str
    detail: str

    def __str__(self) -> str:
        return f"{self.instruction}: {self.check}: {self.detail}"


def certify(instruction: Instruction, *, executor: bool = True) -> tuple[Problem, ...]:
    """Return what is wrong with an instruction; empty = certified.

    Args:
        instruction: the record.
        executor: also drive the reference plan through the house.

    Raises:
        UnknownScene, SceneError: its scene cannot be read.
    """
    scene = load_scene(instruction.scene)
    try:
        graph = instruction_graph(scene, instruction)
    except GavelError as error:
        check = "start" if "holds at the start" in str(error) else "placement"
        return (Problem(instruction.id, check, str(error)),)
    found = [*_symbolic(graph, instruction)]
    if executor and not found:
        found += _name(instruction, "executor", drive(graph, instruction).faults)
    found += _name(instruction, "independence", _independence(instruction))
    targets = instruction.meta.get("targets")
    if isinstance(targets, list) and not _in_a_voice(instruction):
        found += _wording(graph, instruction, targets)
    return tuple(found)


def _in_a_voice(instruction: Instruction) -> bool:
    """Return whether people wrote the text: the benchmarks' rules of wording are not for it."""
    return "voice" in instruction.meta


def _name(instruction: Instruction, check: str, details: Iterable[str]) -> list[Problem]:
    return [Problem(instruction.id, check, detail) for detail in details]


# --- plans ----------------------------------------------------------------------------------------------------------


def _symbolic(graph: SceneGraph, instruction: Instruction) -> Iterator[Problem]:
    plans = [task.parsed_plan() for task in instruction.tasks]
    goals = [task.parsed_goal() for task in instruction.tasks]
    for index, (plan, goal) in enumerate(zip(plans, goals, strict=True)):
        # BEHAVIOR's goals, and people, also say what is to stay as it is: there only the whole must not hold.
        strict = instruction.kind != "behavior" and not _in_a_voice(instruction)
        for literal in goal.literals if strict else ():
            if not unmet(Goal((literal,)), graph):
                yield Problem(instruction.id, "start", f"tasks[{index}]: {literal} holds at the start")
        ending = judge(graph, plan, goal)
        if ending.kind != "valid":
            where = "" if ending.step is None else f" at step {ending.step}"
            yield Problem(instruction.id, "alone", f"tasks[{index}] ends {ending.kind}{where}: {ending.subject}")
    if len(plans) > 1:
        whole = instruction.goal()
        for order, reason in _failing_orders(graph, graph, plans, whole, (), tuple(range(len(plans)))):
            yield Problem(instruction.id, "orders", f"order {order}: {reason}")
            return


def _failing_orders(
    start: SceneGraph,
    graph: SceneGraph,
    plans: Sequence[Sequence[Action]],
    goal: Goal,
    done: tuple[int, ...],
    left: tuple[int, ...],
) -> Iterator[tuple[tuple[int, ...], str]]:
    """Yield the orders that fail, each common beginning replayed once."""
    if not left:
        if lacking := shortfall(start, graph, goal):
            yield done, lacking.reasons()[0]
        return
    for index in left:
        after, violation = rollout(graph, plans[index])
        rest = tuple(i for i in left if i != index)
        if violation is not None:
            yield (*done, index), str(violation)
        else:
            yield from _failing_orders(start, after, plans, goal, (*done, index), rest)


# --- referents ------------------------------------------------------------------------------------------------------


def _is_movable(name: str) -> bool:
    kinds = default_concepts().categories(name.partition("@")[0])
    return any(kind in default_vocabulary().movables for kind in kinds)


def _designators(literals: Iterable[Literal]) -> list[Designator]:
    return [d for literal in literals for d in (literal.subject, literal.object) if d is not None]


def _independence(instruction: Instruction) -> Iterator[str]:
    owner: dict[str, int] = {}
    rooms: dict[str, set[str | None]] = {}
    for index, task in enumerate(instruction.tasks):
        names = set(_designators(task.parsed_goal().literals))
        for designator in sorted(names, key=str):
            if not _is_movable(designator.name):
                rooms.setdefault(designator.name, set()).add(designator.room)
            elif owner.setdefault(designator.name, index) != index:
                yield f"tasks[{owner[designator.name]}] and tasks[{index}] both speak of {designator.name!r}"
    for name, meant in sorted(rooms.items()):
        if len(meant) > 1:
            yield f"{name!r} is meant in several rooms: {', '.join(sorted(map(str, meant)))}"


def _wording(graph: SceneGraph, instruction: Instruction, targets: Sequence[Mapping[str, Any]]) -> Iterator[Problem]:
    def problems(check: str, details: Iterable[str]) -> Iterator[Problem]:
        yield from _name(instruction, check, details)

    relations = [parse_literal(text) for target in targets for text in target["relations"]]
    yield from problems("referents", _referents(graph, targets, relations))
    yield from problems("hidden", _unsaid_hidden(graph, targets, relations))
    for index, (task, target) in enumerate(zip(instruction.tasks, targets, strict=True)):
        yield from problems("sentence", (f"tasks[{index}]: {d}" for d in sentence_faults(task.text, _named([target]))))
        if list(task.goal) != list(target["goal"]):
            yield from problems("sentence", [f"tasks[{index}]: goal of the target differs: {target['goal']}"])
    yield from problems("sentence", sentence_faults(instruction.text, _named(targets)))
    yield from problems("spelling", (f"unknown word {word!r}" for word in unknown_words(instruction.text)))
    yield from problems("spelling", (f"article in {pair!r}" for pair in article_errors(instruction.text)))


def _named(targets: Sequence[Mapping[str, Any]]) -> list[tuple[Sequence[str], Sequence[str]]]:
    return [(target["objects"], target["relations"]) for target in targets]


def _referents(graph: SceneGraph, targets: Sequence[Mapping[str, Any]], relations: Sequence[Literal]) -> Iterator[str]:
    for target in targets:
        for name in target["objects"]:
            count = len(fitting(graph, Designator.parse(name)))
            if _is_movable(name) and count != 1:
                yield f"{count} objects fit {name!r}"
            elif count == 0:
                yield f"nothing fits {name!r}"
    for relation in relations:
        if unmet(Goal((relation,)), graph):
            yield f"{relation} is said, but not so"
        elif relation.predicate is Predicate.INSIDE and relation.object is not None:
            options = fitting(graph, relation.object)
            if graph.category(options[0]).has_door and len(options) != 1:
                yield f"{len(options)} containers fit the source {str(relation.object)!r}"


def _unsaid_hidden(
    graph: SceneGraph, targets: Sequence[Mapping[str, Any]], relations: Sequence[Literal]
) -> Iterator[str]:
    said = {r.subject.name for r in relations if r.predicate is Predicate.INSIDE}
    for target in targets:
        for name in target["objects"]:
            for obj in fitting(graph, Designator.parse(name)) if _is_movable(name) else ():
                support = graph.supports[obj]
                if support.relation == Relation.INSIDE and graph.closed_container(obj) and name not in said:
                    yield f"{name!r} starts in {support.holder}, which the text does not say"


# --- files ----------------------------------------------------------------------------------------------------------


def check_broken(instruction: Instruction, variants: Sequence[Sequence[Broken]]) -> tuple[Problem, ...]:
    """Return which broken variants (per task) are too few or do not end as recorded."""
    graph = instruction_graph(load_scene(instruction.scene), instruction)
    found: list[str] = []
    for index, (task, broken) in enumerate(zip(instruction.tasks, variants, strict=True)):
        plan, goal = task.parsed_plan(), task.parsed_goal()
        if len(broken) < LEAST:
            found.append(f"tasks[{index}]: only {len(broken)} broken variants")
        for variant in broken:
            ending = judge(graph, variant.plan(plan), goal)
            if (ending.kind, ending.step) != (variant.ending, variant.at) or ending.kind == "valid":
                found.append(f"tasks[{index}]: {variant.defect} at {variant.start} ends {ending.kind}")
    return tuple(_name(instruction, "broken", found))


def certify_set(
    instructions: Iterable[Instruction],
    broken: Mapping[str, Sequence[Sequence[Broken]]] | None = None,
    *,
    executor: bool = True,
) -> Iterator[tuple[Instruction, tuple[Problem, ...]]]:
    """Yield every instruction with its problems, duplicates within the set and broken variants included.

    Args:
        instructions: the records.
        broken: broken variants per task by instruction id; None = not checked.
        executor: also drive the reference plans.
    """
    texts: dict[str, str] = {}
    contents: dict[bytes, str] = {}
    for record in instructions:
        try:
            problems = list(certify(record, executor=executor))
        except GavelError as error:
            yield record, (Problem(record.id, "placement", str(error)),)
            continue
        content = msgspec.json.encode((record.scene, record.placements, [task.goal for task in record.tasks]))
        for twin in dict.fromkeys((texts.setdefault(record.text, record.id), contents.setdefault(content, record.id))):
            if twin != record.id:
                problems.append(Problem(record.id, "duplicate", f"same as {twin}"))
        if broken is not None and not problems:
            problems += check_broken(record, broken.get(record.id, ((),) * len(record.tasks)))
        yield record, tuple(problems)
