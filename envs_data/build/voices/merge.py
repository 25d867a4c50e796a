"""From blind readings to records: what both readers understood, checked against the scenario and certified.

A text is kept if two readers, who saw nothing but the text and the house, agree with each other and with the scenario:
the same claims about the same things, true after the certified plan. Where they differ only in how much a word covers
("the table": one of them counts the desk), the target has a least set (what both count) and a most set (what either
does); an understanding between the two is right. Everything else goes back for another round, with the reason.
"""

from __future__ import annotations

import hashlib
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from envs_data.build.voices.packets import read_written
from envs_data.build.voices.readings import Claim, Reading, ReadTask, claim, denotation, read_readings, satisfied
from gavel_env.errors import GavelError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, TaskSpec
from gavel_env.tasks.certificate import certify
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.dynamics import rollout
from gavel_env.world_model.goals import Designator, Predicate, fitting
from gavel_env.world_model.graph import Relation, SceneGraph

__all__ = ["Rejected", "merge", "merge_files"]

_STATES = frozenset({Predicate.WASHED, Predicate.DRIED, Predicate.COOKED})


class Rejected(Exception):
    """A text is not kept; the message says why."""


class _Agreed(NamedTuple):
    """A claim that both readers make: what both count, what either counts, and the scenario's task it belongs to."""

    least: Claim
    most: Claim
    task: int


def merge(record: Instruction, text: str, first: Reading, second: Reading) -> Instruction:
    """Return the record of a text as both readers understood it.

    Raises:
        Rejected: they disagree with each other or with the scenario, or the record does not certify.
    """
    for reading in (first, second):
        if reading.unclear is not None:
            raise Rejected(f"unclear: {reading.unclear}")
    start = instruction_graph(load_scene(record.scene), record)
    end, violation = rollout(start, record.reference_plan())
    assert violation is None  # scenarios are certified
    drawn = [[claim(start, literal) for literal in task.goal] for task in record.tasks]
    ours, theirs = _claims(start, first), _claims(start, second)
    agreed = [_agree(a, _take(a, theirs), drawn) for task in ours for a in task]
    if any(theirs):
        raise Rejected(f"readers: only one says {next(c for task in theirs for c in task)}")
    _check(start, end, drawn, agreed)
    tasks, targets = [], []
    for owners, read in _grouping(record, first, agreed):
        mine = [one for one in agreed if one.task in owners]
        sentence = " ".join(part.text or text for part in read) if record.kind == "multi" else text
        goal = tuple(_goal_text(start, one, record.tasks[one.task]) for one in mine)
        plan = tuple(step for owner in owners for step in record.tasks[owner].reference_plan)
        tasks.append(TaskSpec(sentence, goal, plan))
        relations = _stated(start, read, second)
        targets.append(_target(start, sentence, goal, mine, relations, _used(start, read, second)))
    hidden = [obj for obj in _moved(record) if _behind_a_door(start, obj) and not _said(targets, start, obj)]
    if hidden:
        raise Rejected(f"hidden: {hidden[0]} starts behind a door, which the text does not say")
    meta = {"voice": record.meta["voice"], "manner": record.meta.get("manner"), "shapes": record.meta["shapes"]}
    merged = msgspec.structs.replace(record, text=text, tasks=tuple(tasks), meta={**meta, "targets": targets})
    problems = certify(merged)
    if problems:
        raise Rejected(f"certificate: {problems[0]}")
    return merged


def _claims(graph: SceneGraph, reading: Reading) -> list[list[Claim]]:
    try:
        return [[claim(graph, literal) for literal in task.literals] for task in reading.tasks]
    except GavelError as error:
        raise Rejected(f"notation: {error}") from error


def _take(wanted: Claim, tasks: list[list[Claim]]) -> Claim:
    """Remove and return the other reader's claim that is most like this one."""
    alike = [
        (len(wanted.objects & c.objects) - len(wanted.objects ^ c.objects), i, j)
        for i, task in enumerate(tasks)
        for j, c in enumerate(task)
        if c.negated == wanted.negated and c.predicates & wanted.predicates and c.subjects & wanted.subjects
        if (c.objects & wanted.objects or not (c.objects or wanted.objects))
    ]
    if not alike:
        raise Rejected(f"readers: only one says {wanted}")
    _, i, j = max(alike, key=lambda found: (found[0], -found[1], -found[2]))
    return tasks[i].pop(j)


def _agree(a: Claim, b: Claim, drawn: Sequence[Sequence[Claim]]) -> _Agreed:
    least = Claim(a.predicates & b.predicates, a.subjects & b.subjects, a.objects & b.objects, a.negated)
    most = Claim(a.predicates | b.predicates, a.subjects | b.subjects, a.objects | b.objects, a.negated)
    owners = [i for i, task in enumerate(drawn) if any(c.subjects & most.subjects for c in task)]
    if len(owners) != 1:
        raise Rejected(f"scenario: {most} belongs to {len(owners)} errands")
    return _Agreed(least, most, owners[0])


def _check(start: SceneGraph, end: SceneGraph, drawn: Sequence[Sequence[Claim]], agreed: Sequence[_Agreed]) -> None:
    """Check that the readings are the scenario's goal, and true after its plan.

    Raises:
        Rejected: something is missing, too much, or about something else.
    """
    missing = satisfied(end, [one.least for one in agreed])
    if missing:
        raise Rejected(f"scenario: not so after the certified plan: {missing[0]}")
    wanted = [c for task in drawn for c in task]
    for one in agreed:
        movable = not all(start.world.nodes[subject].fixed for subject in one.most.subjects)
        meant = {subject for c in wanted for subject in c.subjects}
        if movable and not one.most.subjects <= meant:
            raise Rejected(f"scenario: {one.most} is about more than what is moved")
    left = list(agreed)
    for c in wanted:
        found = next((o for o in left if _same(c, o.most)), None)
        if found is not None:
            left.remove(found)
        elif not (c.predicates == {Predicate.INSIDE} and any(o.least.predicates & _STATES for o in agreed)):
            raise Rejected(f"scenario: neither reader says {c}")


def _same(wanted: Claim, found: Claim) -> bool:
    return (
        wanted.negated == found.negated
        and bool(wanted.predicates & found.predicates)
        and bool(wanted.subjects & found.subjects)
        and (bool(wanted.objects & found.objects) or not wanted.objects)
    )


def _grouping(
    record: Instruction, reading: Reading, agreed: Sequence[_Agreed]
) -> list[tuple[list[int], list[ReadTask]]]:
    """Return the errands as they are told apart: which of the scenario's they are, and which of the reading's.

    What either of scenario and reading takes for one errand is one.

    Raises:
        Rejected: an errand is missing, or several have become one.
    """
    left = list(agreed)
    groups: list[tuple[list[int], list[ReadTask]]] = []
    for task in reading.tasks:
        owners = {left.pop(0).task for _ in task.literals}
        joined = [group for group in groups if owners & set(group[0])]
        groups = [group for group in groups if group not in joined]
        owners |= {owner for group in joined for owner in group[0]}
        groups.append((sorted(owners), [*(read for group in joined for read in group[1]), task]))
    if sorted(owner for owners, _ in groups for owner in owners) != list(range(len(record.tasks))):
        raise Rejected("errands: one of the scenario's is missing")
    if record.kind == "multi" and len(groups) < 2:
        raise Rejected("errands: all of them have become one")
    return groups


# --- writing targets ------------------------------------------------------------------------------------------------


def _goal_text(graph: SceneGraph, one: _Agreed, task: TaskSpec) -> str:
    """Return the claim as a goal literal, its designators as broad as the text."""
    drawn = {predicate for literal in task.goal for predicate in claim(graph, literal).predicates}
    predicates = one.least.predicates & drawn
    predicate = min(predicates or one.least.predicates, key=lambda p: p.value)
    subject = _subject_text(graph, one, task)
    arguments = (
        subject if not one.most.objects else f"{subject}, {_designator(graph, one.least.objects, one.most.objects)}"
    )
    return f"{'not ' if one.least.negated else ''}{predicate.value}({arguments})"


def _subject_text(graph: SceneGraph, one: _Agreed, task: TaskSpec) -> str:
    if all(graph.world.nodes[subject].fixed for subject in one.most.subjects):
        return _designator(graph, one.least.subjects, one.most.subjects)
    named = {literal.partition("(")[2].partition(",")[0].rstrip(")").strip() for literal in task.goal}
    fits = sorted(name for name in named if set(fitting(graph, Designator.parse(name))) & one.most.subjects)
    return fits[0]


def _designator(graph: SceneGraph, least: frozenset[str], most: frozenset[str]) -> str:
    """Return the broadest designator that fits at least the one set and at most the other.

    Raises:
        Rejected: none does.
    """
    concepts = default_concepts()
    categories = sorted({graph.world.nodes[obj].category.name for obj in most})
    names = [*categories, *(name for name, c in concepts.things.items() if set(categories) <= {*c.members, *c.also})]
    types = sorted({room.type for room in graph.world.rooms.values()})
    rooms = [None, *types, *(name for name, c in concepts.places.items() if set(c.members) & set(types))]
    found = [
        (-len(fits), names.index(name), rooms.index(room), str(Designator(name, room)))
        for name in names
        for room in rooms
        if least <= (fits := set(fitting(graph, Designator(name, room)))) <= most and fits
    ]
    if not found:
        raise Rejected(f"words: no designator for {', '.join(sorted(most))}")
    return min(found)[3]


def _target(
    graph: SceneGraph,
    sentence: str,
    goal: Sequence[str],
    agreed: Sequence[_Agreed],
    relations: Sequence[str],
    machines: Sequence[str],
) -> dict[str, Any]:
    """Return what an understanding must come to: as literals, and as the sets of instances that they may denote."""
    arguments = [part.strip() for text in (*goal, *relations) for part in text.partition("(")[2].rstrip(")").split(",")]
    rooms = {room.type for room in graph.world.rooms.values()}
    return {
        "text": sentence,
        "objects": list(dict.fromkeys(name for name in (*arguments, *machines) if name not in rooms)),
        "relations": list(relations),
        "goal": list(goal),
        "denotes": [
            {
                "predicates": sorted(p.value for p in one.most.predicates),
                "negated": one.most.negated,
                "subject": {"least": sorted(one.least.subjects), "most": sorted(one.most.subjects)},
                "object": {"least": sorted(one.least.objects), "most": sorted(one.most.objects)},
            }
            for one in agreed
        ],
    }


def _stated(graph: SceneGraph, first: Sequence[ReadTask], second: Reading) -> list[str]:
    """Return where things are, as far as both readers took it from the text.

    Raises:
        Rejected: something is said to be where it is not.
    """
    try:
        ours = [claim(graph, text) for task in first for text in task.stated]
        theirs = [claim(graph, text) for task in second.tasks for text in task.stated]
    except GavelError as error:
        raise Rejected(f"notation: {error}") from error
    relations: list[str] = []
    for mine in ours:
        same = next((c for c in theirs if _same(mine, c)), None)
        if same is None:
            continue
        both = Claim(
            mine.predicates & same.predicates, mine.subjects & same.subjects, mine.objects | same.objects, mine.negated
        )
        if satisfied(graph, [both]):
            raise Rejected(f"stated: {both} is not so at the start")
        predicate = next(iter(sorted(both.predicates, key=lambda p: (not _holds_now(graph, both, p), p.value))))
        subject = graph.world.nodes[min(both.subjects)].category.name
        if predicate is Predicate.IN_ROOM:
            place = graph.world.rooms[min(both.objects)].type
        else:
            place = _designator(graph, mine.objects & same.objects, both.objects)
        relations.append(f"{predicate.value}({subject}, {place})")
    return relations


def _used(graph: SceneGraph, first: Sequence[ReadTask], second: Reading) -> list[str]:
    """Return the machines that both readers take the text to name."""
    theirs = [denotation(graph, text.split("|")) for task in second.tasks for text in task.uses]
    found: list[str] = []
    for mine in (denotation(graph, text.split("|")) for task in first for text in task.uses):
        same = next((other for other in theirs if mine & other), None)
        if same is not None:
            found.append(_designator(graph, mine & same, mine | same))
    return found


def _holds_now(graph: SceneGraph, found: Claim, predicate: Predicate) -> bool:
    return not satisfied(graph, [found._replace(predicates=frozenset({predicate}))])


def _moved(record: Instruction) -> list[str]:
    grasped = {str(action.target) for action in record.reference_plan() if action.primitive.name == "GRASP"}
    return sorted(grasped)


def _behind_a_door(graph: SceneGraph, obj: str) -> bool:
    support = graph.supports[obj]
    return support.relation == Relation.INSIDE and graph.closed_container(obj) is not None


def _said(targets: Sequence[Mapping[str, Any]], graph: SceneGraph, obj: str) -> bool:
    category = graph.world.nodes[obj].category.name
    said = [text for target in targets for text in target["relations"]]
    return any(text.startswith(f"inside({category},") for text in said)


# --- files ----------------------------------------------------------------------------------------------------------


def split(scenarios: Iterable[Instruction]) -> dict[str, str]:
    """Return id -> half: dev and test in turn within kind and voice, by the hash of the id.

    All scenarios are dealt, kept or not, so that no later round moves a text from one half to the other.
    """
    groups: Counter[tuple[str, str]] = Counter()
    halves: dict[str, str] = {}
    for record in sorted(scenarios, key=lambda r: hashlib.sha256(r.id.encode()).hexdigest()):
        group = (record.kind, record.meta["voice"])
        halves[record.id] = ("dev", "test")[groups[group] % 2]
        groups[group] += 1
    return halves


def merge_files(scenarios: Mapping[str, Instruction], folder: Path, out: Path) -> int:
    """Merge what writers and readers left in a folder; write the records, and what needs another round."""

    def numbered(pattern: str) -> list[Path]:
        return sorted(folder.glob(pattern), key=lambda path: int(path.stem.rsplit("-", 1)[1]))

    texts = read_written(numbered("written-*.jsonl"))
    readings: dict[str, dict[str, Reading]] = {"A": {}, "B": {}}
    for name, found in readings.items():
        for path in numbered(f"reading-{name}-*.jsonl"):
            found |= read_readings(path.read_bytes().splitlines(), str(path))  # later rounds replace earlier ones
    kept: list[Instruction] = []
    again: list[dict[str, str]] = []
    for identifier, text in texts.items():
        both = [found.get(identifier) for found in readings.values()]
        try:
            if both[0] is None or both[1] is None:
                raise Rejected("unread")
            kept.append(merge(scenarios[identifier], text, both[0], both[1]))
        except Rejected as why:
            again.append({"id": identifier, "reason": str(why)})
    halves = split(scenarios.values())
    kept = [
        msgspec.structs.replace(r, meta={"split": halves[r.id], **r.meta}) for r in sorted(kept, key=lambda r: r.id)
    ]
    out.write_bytes(b"".join(msgspec.json.encode(record) + b"\n" for record in kept))
    (folder / "rewrite.jsonl").write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in again))
    reasons = Counter(line["reason"].partition(":")[0] for line in again)
    print(f"{out}: {len(kept)} kept of {len(texts)}; again: {dict(reasons.most_common())}", file=sys.stderr)
    return 0
