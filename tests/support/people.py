"""Sentences as people say them, with the goal that they must be read as, or the reason why they are refused.

In `tests/understanding/data/people.txt`, `@SCENE` says the house of what follows; a sentence of one or more lines ends
with `= LITERAL; LITERAL | LITERAL` (tasks parted by `|`) or `? REASON`. Its author is that of the reader.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.concepts import default_concepts
from gavel_env.world_model.goals import Designator, Literal, Predicate, fitting, parse_literal
from gavel_env.world_model.graph import SceneGraph

__all__ = ["Said", "denoted", "house", "sentences"]

FILE = Path(__file__).parents[1] / "understanding" / "data" / "people.txt"


class Said(NamedTuple):
    """A sentence.

    Attributes:
        scene: of the house that it is said in.
        text: the sentence.
        goals: what it asks for, over all tasks; empty if it must be refused.
        refused: the reason, or its beginning.
    """

    scene: str
    text: str
    goals: tuple[str, ...]
    refused: str


def sentences() -> Iterator[Said]:
    """Yield the sentences of the file."""
    scene, lines = "", list[str]()
    for line in FILE.read_text().splitlines():
        if line.startswith("@"):
            scene = line[1:].strip()
        elif line.startswith(("= ", "?")):
            goals = [part.strip() for task in line[2:].split("|") for part in task.split(";")] if line[0] == "=" else []
            yield Said(scene, "\n".join(lines), tuple(goals), line[1:].strip() if line[0] == "?" else "")
            lines = []
        elif line.strip():
            lines.append(line)


def house(scene: str) -> SceneGraph:
    """Return a house without what instructions add to it."""
    return scene_graph(load_scene(scene))


def denoted(graph: SceneGraph, literal: Literal | str) -> tuple[Predicate, frozenset[str], frozenset[str], bool]:
    """Return what a literal denotes: its furniture as instances of the house, its movables as categories."""
    said = parse_literal(literal) if isinstance(literal, str) else literal
    objects = frozenset[str]()
    if said.object is not None and said.predicate is Predicate.IN_ROOM:
        objects = frozenset(r.id for r in graph.world.rooms.values() if r.fits(str(said.object)))
    elif said.object is not None:
        objects = _named(graph, said.object)
    return said.predicate, _named(graph, said.subject), objects, said.negated


def _named(graph: SceneGraph, designator: Designator) -> frozenset[str]:
    pieces = frozenset(fitting(graph, designator))
    return pieces or frozenset(default_concepts().categories(designator.name))
