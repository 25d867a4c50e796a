"""From errands to instruction records: text, placements, tasks, and the target that understanding must give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gavel_env.errors import GavelError
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, Placement, TaskSpec
from gavel_env.instructions.vocabulary import Theme
from gavel_env.tasks.drafts import Draft, Split, Thing
from gavel_env.tasks.errands import Errand
from gavel_env.tasks.language import Worded, compose
from gavel_env.world_model.dynamics import rollout
from gavel_env.world_model.graph import SceneGraph

__all__ = ["assemble", "rooms_visited", "target_of"]

_LOOSE: tuple[Theme, ...] = ("dish", "laundry", "food", "drink", "pantry", "office", "toy", "bath", "household")


def target_of(errand: Errand, worded: Worded) -> dict[str, Any]:
    """Return what understanding must give for a task: its text, objects, stated relations E_i and goal g_i.

    Objects are designators in order: movables, then furniture with the room the sentence says.
    """
    objects = [thing.category for thing in errand.things] + [str(r) for r in errand.references()]
    relations = [relation for thing in errand.things if (relation := thing.relation()) is not None]
    return {
        "text": worded.sentence(),
        "objects": list(dict.fromkeys(objects)),
        "relations": relations,
        "goal": list(errand.goal),
    }


def _placement(thing: Thing) -> Placement:
    return Placement(thing.category, thing.start.relation, thing.start.target, thing.id)


def _distractors(draft: Draft, count: int) -> list[Placement]:
    """Return placements of things that no errand speaks of, where evidence has them, in the open."""
    found: list[Placement] = []
    for _ in range(count):
        category = draft.category(_LOOSE)
        start = None if category is None else draft.start(category, lambda place: not draft.house.shuts(place))
        if category is not None and start is not None:
            thing = Thing(category, f"{category}_0", start)
            draft.things.append(thing)
            found.append(_placement(thing))
    return found


def assemble(
    draft: Draft,
    errands: Sequence[Errand],
    rng: np.random.Generator,
    *,
    identifier: str,
    split: Split = "benchmark",
    distractors: int = 0,
    notes: dict[str, Any] | None = None,
) -> Instruction:
    """Return the record of an instruction.

    Args:
        draft: the draft that the errands were drawn in.
        errands: its errands, in the order in which the text says them.
        rng: source of randomness for the wording and the distractors.
        identifier: id of the record.
        split: whose templates to use.
        distractors: number of movables that no errand speaks of.
        notes: further entries of `meta`.
    """
    text, worded = compose(errands, rng, split, vocabulary=draft.house.vocabulary)
    placements = [_placement(thing) for errand in errands for thing in errand.things]
    placements += _distractors(draft, distractors)
    tasks = tuple(TaskSpec(w.sentence(), e.goal, e.plan) for e, w in zip(errands, worded, strict=True))
    meta: dict[str, Any] = {
        "split": split,
        "shapes": [e.shape for e in errands],
        "templates": [w.template for w in worded],
        "targets": [target_of(e, w) for e, w in zip(errands, worded, strict=True)],
        **(notes or {}),
    }
    return Instruction(
        identifier,
        draft.house.name,
        text,
        tuple(placements),
        tasks,
        "single" if len(tasks) == 1 else "multi",
        meta=meta,
    )


def rooms_visited(graph: SceneGraph, instruction: Instruction) -> tuple[str, ...]:
    """Return the rooms in which the reference plan stops, sorted.

    Raises:
        GavelError: the plan does not run.
    """
    rooms: set[str] = set()
    for action in instruction.reference_plan():
        graph, violation = rollout(graph, (action,))
        if violation is not None:
            raise GavelError(f"instruction {instruction.id!r}: reference plan violates {violation}")
        if graph.robot_room is not None:
            rooms.add(graph.robot_room)
    return tuple(sorted(rooms))


def initial_graph(draft: Draft, instruction: Instruction) -> SceneGraph:
    """Return the hidden graph at the start of an instruction of the draft's house."""
    return instruction_graph(draft.house.scene, instruction, draft.house.ontology)
