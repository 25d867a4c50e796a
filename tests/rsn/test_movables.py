"""The movables whose place is unsaid: who they are, and that priors are ranked as they deserve."""

from __future__ import annotations

import json

import numpy as np
import pytest

from eval.cli import main
from eval.studies.beliefs import Answer, score
from eval.studies.movables import evaluate_movables, unsaid_movables
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.record import read_instructions, shipped

INSTRUCTIONS = list(read_instructions(shipped("multi")).values())[::10]


def test_queries_are_movables_that_the_text_does_not_place() -> None:
    for instruction in INSTRUCTIONS[:10]:
        hidden = instruction_graph(load_scene(instruction.scene), instruction)
        asked = {str(literal.subject) for task in instruction.tasks for literal in task.parsed_goal().literals}
        for query in unsaid_movables([instruction]):
            [instance] = hidden.world.by_category[query.category]
            assert not hidden.world.nodes[instance].fixed
            assert hidden.room_of(instance) == query.rooms[query.room].id
            assert query.category in {name.partition("@")[0] for name in asked}


def test_the_generator_s_distribution_beats_every_prior_and_uniform_is_uniform() -> None:
    scores = {s.prior: s for s in evaluate_movables(INSTRUCTIONS)}
    assert set(scores) == {"uniform", "rsn", "choice", "generator"}
    assert scores["generator"].nll < min(s.nll for name, s in scores.items() if name != "generator")
    assert scores["generator"].top1 > scores["choice"].top1 > scores["uniform"].top1
    queries = list(unsaid_movables(INSTRUCTIONS))
    assert scores["uniform"].queries == len(queries)
    by_hand = score("uniform", [Answer(np.full(len(q.rooms), 1 / len(q.rooms)), q.room) for q in queries])
    assert scores["uniform"].nll == pytest.approx(by_hand.nll)


def test_the_command_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "beliefs", "--movables", "single", "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)["movables"]
    assert [s["prior"] for s in scores] == ["uniform", "rsn", "choice", "generator"]
    assert main(["eval", "beliefs", "--movables", "single"]) == 0
    assert f"({scores[0]['queries']} queries)" in capsys.readouterr().out
