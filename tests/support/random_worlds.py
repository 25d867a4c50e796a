"""Houses filled at random, and random plans that the world model accepts."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np

from gavel_env.house.scenes import BENCHMARK_HOUSES, Scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.actions import Action, Primitive
from gavel_env.world_model.dynamics import apply, first_violation
from gavel_env.world_model.graph import Node, Relation, SceneGraph, Support
from gavel_env.world_model.ontology import default_ontology

HOUSES = BENCHMARK_HOUSES
MOVABLES = ("apple", "bowl", "plate", "tray", "mug", "hardback", "lunch_box")


def furnished(scene: Scene, rng: np.random.Generator, count: int) -> SceneGraph:
    """Return the scene's graph with `count` more movables on, in and beside its pieces and in one another."""
    graph = scene_graph(scene)
    ontology = default_ontology()
    names = [name for name in MOVABLES if name in ontology]
    for k in range(count):
        category = ontology[names[k % len(names)]]
        obj = f"{category.name}_{100 + k}"
        graph = graph.with_nodes({obj: Node(obj, category, False)})
        holders = [
            Support(relation, other)
            for other, node in graph.world.nodes.items()
            if other != obj and other in graph.supports
            for relation, fits in ((Relation.ON_TOP, node.category.surface), (Relation.INSIDE, node.category.interior))
            if fits
        ]
        floors = [Support(Relation.FLOOR, room) for room in graph.world.rooms]
        choices = holders if holders and rng.random() < 0.8 else floors
        graph = graph.place(obj, choices[int(rng.integers(len(choices)))])
    return graph


def accepted_plan(
    graph: SceneGraph, steps: int, rng: np.random.Generator, reachable: Callable[[SceneGraph, str], bool]
) -> list[Action]:
    """Return a random plan whose every action is applicable where it stands.

    Args:
        graph: where it starts.
        steps: its length.
        rng: source of randomness.
        reachable: whether geometry lets the robot get at an object in a state; others are not gone to.
    """
    plan: list[Action] = []
    for _ in range(steps):
        choices = [
            Action(primitive, target if primitive.takes_target else None)
            for primitive in Primitive
            if primitive is not Primitive.NAVIGATE_TO
            for target in sorted(graph.near)
        ]
        choices = [a for a in dict.fromkeys(choices) if first_violation(graph, a) is None]
        if not choices or rng.random() < 0.4:
            places = [
                action
                for obj in graph.world.nodes
                if first_violation(graph, action := Action(Primitive.NAVIGATE_TO, obj)) is None
                and reachable(graph, obj)
            ]
            movable = [a for a in places if a.target is not None and not graph.world.nodes[a.target].fixed]
            choices = movable if movable and rng.random() < 0.5 else places
        action = choices[int(rng.integers(len(choices)))]
        graph = apply(graph, action)
        plan.append(action)
    return plan


def at(graph: SceneGraph, room: str) -> SceneGraph:
    """Return the graph with the robot in a room, near nothing."""
    return msgspec.structs.replace(graph, robot_room=room, near=frozenset())
