"""Activities against the bddl package: its parser, its evaluator, and the shipped files built anew."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import gavel_env  # noqa: F401  # registers the environments
from gavel_env.activities import ground, load_activities
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import Instruction, read_instructions, shipped
from gavel_env.world_model.dynamics import rollout
from gavel_env.world_model.graph import Flag, SceneGraph

ACTIVITIES = load_activities()
SHIPPED = read_instructions(shipped("behavior"))
RECORDS = list(SHIPPED.values())
HAS_BDDL = importlib.util.find_spec("bddl") is not None
ROOT = Path(__file__).resolve().parents[2]


def start_of(record: Instruction) -> SceneGraph:
    return instruction_graph(load_scene(record.scene), record)


needs_bddl = pytest.mark.skipif(not HAS_BDDL, reason="needs the extra 'data' (bddl)")


@pytest.mark.data
@needs_bddl
def test_definitions_rebuild_to_the_same_bytes() -> None:
    from envs_data.build.activity_definitions import TARGET, build

    assert build() == TARGET.read_bytes()


@pytest.mark.data
@needs_bddl
def test_problems_are_read_as_bddl_reads_them() -> None:
    from bddl.parsing import parse_problem as by_bddl

    def flat(node: Any) -> Any:
        """Return a node as bddl's nested lists, without question marks."""
        head = [node.head] + ([[str(node.count)]] if node.head == "forn" else [])
        variables = [[name, "-", synset] for name, synset in node.variables]
        return [*head, *variables, *node.args, *map(flat, node.parts)]

    def bare(part: Any) -> Any:
        return part.lstrip("?") if isinstance(part, str) else [bare(p) for p in part]

    for activity in [a for a in ACTIVITIES.activities if a.expressible][::5]:
        problem = activity.problem()
        _, objects, init, goal = by_bddl(activity.name, 0, "omnigibson")
        assert {s: tuple(names) for s, names in objects.items()} == problem.objects
        assert bare(init) == [
            ["not", [f.predicate, *f.args]] if f.negated else [f.predicate, *f.args] for f in problem.init
        ]
        parts = problem.goal.parts if problem.goal.head == "and" else (problem.goal,)
        assert bare(goal) == [flat(part) for part in parts], activity.name


@pytest.mark.data
@needs_bddl
def test_bddls_own_evaluator_agrees_at_the_start_and_at_the_end() -> None:
    """The goal as bddl compiles it is judged over the graph; its predicates are looked up here, edge by edge."""
    from bddl.condition_evaluation import compile_state, evaluate_state
    from bddl.logic_base import BinaryAtomicFormula, UnaryAtomicFormula
    from bddl.parsing import parse_problem as by_bddl

    class Thing:
        def __init__(self, obj: str) -> None:
            self.obj = obj

    for record in RECORDS[::3]:
        activity = ACTIVITIES[str(record.meta["activity"])]
        grounding = ground(activity, record.scene)
        start = start_of(record)
        end, _ = rollout(start, record.reference_plan())
        for graph, holds in ((start, False), (end, True)):

            def unary(name: str, graph: SceneGraph = graph) -> type:
                class Predicate(UnaryAtomicFormula):  # type: ignore[misc]
                    STATE_NAME = name

                    def _evaluate(self, obj: Thing) -> bool:
                        return obj.obj in graph.flags[Flag[name.upper().removesuffix("_ON")]]

                    def _sample(self, obj: Thing, binary_state: bool) -> None:
                        raise NotImplementedError

                return Predicate

            def binary(name: str, graph: SceneGraph = graph) -> type:
                class Predicate(BinaryAtomicFormula):  # type: ignore[misc]
                    STATE_NAME = name

                    def _evaluate(self, obj: Thing, other: Thing) -> bool:
                        return related(graph, name, obj.obj, other.obj)

                    def _sample(self, obj: Thing, other: Thing, binary_state: bool) -> None:
                        raise NotImplementedError

                return Predicate

            class Backend:
                def get_predicate_class(self, name: str, unary: Any = unary, binary: Any = binary) -> type:
                    kind = unary if name in ("open", "toggled_on", "cooked", "hot", "frozen") else binary
                    made: type = kind(name)
                    return made

            _, objects, _, goal = by_bddl(activity.name, 0, "omnigibson")
            names: dict[str, list[str]] = {}
            scope: dict[str, Thing] = {}
            for synset, listed in objects.items():
                more = [n for n in grounding.scope if n.startswith(f"{synset}_more")]
                names[synset] = [n for n in listed if not n.endswith("_*")] + more
                scope |= {n: Thing(grounding.scope.get(n, n)) for n in names[synset]}
            compiled = compile_state(goal, Backend(), scope, names, generate_ground_options=False)
            assert evaluate_state(compiled)[0] == holds, (record.id, holds)


def related(graph: SceneGraph, name: str, obj: str, other: str) -> bool:
    """Look a relation of BEHAVIOR up in a graph; its `inside` reaches through what holds a thing."""
    edges = set(graph.edges())
    if name == "covered":
        return obj in graph.flags[Flag.DIRTY]
    if other in graph.world.rooms:
        held = any(r in ("on_top", "object_inside", "holding") and obj in (a, b)[: 1 if r != "holding" else 2]
                   for r, a, b in edges)  # fmt: skip
        return name == "ontop" and not held and ("room_inside", obj, other) in edges
    if name == "inside":
        up = {a: (r, b) for r, a, b in edges if r in ("on_top", "object_inside")}
        while obj in up:
            relation, obj = up[obj]
            if (relation, obj) == ("object_inside", other):
                return True
        return False
    if name == "nextto":
        together = [{(r, b) for r, a, b in edges if a == x and r in ("on_top", "object_inside")} for x in (obj, other)]
        return ("next_to", min(obj, other), max(obj, other)) in edges or bool(together[0] & together[1])
    return ({"ontop": "on_top"}.get(name, name), obj, other) in edges


@pytest.mark.data
@needs_bddl
def test_certifying_is_the_same_in_every_process() -> None:
    names = ["setting_mousetraps", "freeze_fruit", "clean_a_lobster"]
    outputs = []
    for hash_seed in ("0", "7"):
        done = subprocess.run(
            [sys.executable, "-m", "envs_data.build.activities", "--only", *names],
            cwd=ROOT,
            env=os.environ | {"PYTHONHASHSEED": hash_seed},
            capture_output=True,
            text=True,
            check=True,
        )
        outputs.append(done.stdout)
    assert outputs[0] == outputs[1]
    assert all(f"behavior-{name}" in outputs[0] for name in names)


@pytest.mark.slow
@pytest.mark.data
@needs_bddl
def test_the_shipped_file_and_table_rebuild_to_the_same_bytes() -> None:
    from envs_data.build.activities import PAGE, TARGET, build, lines_of, table_of

    outcomes = list(build())
    assert lines_of(outcomes) == TARGET.read_bytes()
    assert PAGE.read_text(encoding="utf-8").endswith(table_of(outcomes))
