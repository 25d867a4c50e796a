"""The simulated planner: published shares, repeatable answers, and its label wherever it shows."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from eval.cli import main
from gavel_agents.llm import BadPlannerSpec, Prompt, load_model
from gavel_agents.llm.defects import DEFECTS
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.llm.simulated import PROFILES, SimulatedModel, broken
from gavel_agents.proposing.parse import parse_plans
from gavel_env.errors import UnknownInstruction
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import instruction_graph
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.tasks.judging import judge

SINGLE = read_instructions(shipped("single"))
PUBLISHED = {"qwen3-8b": 41.2, "qwen3-4b": 21.8}
SAYPLAN = {"qwen3-8b": 76.4, "qwen3-4b": 55.4}


def asked(attempt: int = 0) -> list[Prompt]:
    return [Prompt((), About(one.text), attempt) for one in SINGLE.values()]


def right(profile: str, seed: int, attempt: int = 0) -> list[bool]:
    reference = [c.text for c in ReferencePlans("single").complete(asked())]
    model = SimulatedModel(f"{profile}?seed={seed}", SINGLE.values())
    return [c.text == r for c, r in zip(model.complete(asked(attempt)), reference, strict=True)]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("seed", range(3))
def test_share_of_right_first_plans_is_the_published_one(profile: str, seed: int) -> None:
    assert abs(100 * np.mean(right(profile, seed)) - PUBLISHED[profile]) <= 3


@pytest.mark.parametrize("profile", PROFILES)
def test_complaints_correct_what_they_did_for_the_model(profile: str) -> None:
    assert abs(100 * np.mean([right(profile, seed, attempt=4) for seed in (0, 1)]) - SAYPLAN[profile]) <= 6
    first, last = right(profile, 0), right(profile, 0, attempt=4)
    assert all(b for a, b in zip(first, last, strict=True) if a)


@pytest.mark.parametrize("profile", PROFILES)
def test_success_of_llm_only_is_the_published_one(
    profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["eval", "--agents", "llm-only", "--kind", "single", "--planner", f"simulated:{profile}", "--quiet"]
    assert main([*command, "--out", str(tmp_path / "csv"), "--format", "csv"]) == 0
    [row] = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert row["planner"] == f"simulated:{profile}"
    assert abs(float(row["success_pct"]) - PUBLISHED[profile]) <= 3


def test_table_says_that_it_is_simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = [
        "eval",
        "--agents",
        "llm-only",
        "--kind",
        "single",
        "--limit",
        "1",
        "--quiet",
        "--out",
        str(tmp_path / "a"),
    ]
    assert main([*command, "--planner", "simulated:qwen3-8b"]) == 0
    table = " ".join(capsys.readouterr().out.split())
    assert "simulated planner" in table
    assert load_model("simulated:qwen3-4b").name == "simulated qwen3-4b (no model)"


def test_answers_repeat_and_differ_by_seed() -> None:
    texts = [[c.text for c in load_model(f"simulated:qwen3-8b?seed={s}").complete(asked())] for s in (0, 0, 1)]
    assert texts[0] == texts[1] != texts[2]


def test_multi_task_answers_have_a_plan_per_task() -> None:
    instruction = next(iter(read_instructions(shipped("multi")).values()))
    [answer] = load_model("simulated:qwen3-8b").complete([Prompt((), About(instruction.text))])
    assert len(parse_plans(answer.text, None, len(instruction.tasks)).plans) == len(instruction.tasks)


def test_broken_plans_fail_and_every_kind_of_defect_fits_somewhere() -> None:
    seen: set[str] = set()
    for index, instruction in enumerate(SINGLE.values()):
        graph = instruction_graph(load_scene(instruction.scene), instruction)
        [task] = instruction.tasks
        plan, goal = task.parsed_plan(), task.parsed_goal()
        assert judge(graph, broken(graph, plan, goal, np.random.default_rng(index), 0.5), goal).kind != "valid"
        for defect in DEFECTS:
            edited = defect.edit(plan, graph, np.random.default_rng(index))
            if edited is not None and judge(graph, edited, goal).kind != "valid":
                seen.add(defect.name)
    assert seen == {d.name for d in DEFECTS}
    assert sum(d.seen for d in DEFECTS) == 57


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("simulated:qwen3-9b", "did you mean|known: qwen3-"),
        ("simulated:qwen3-8b?seed=x", r"write simulated:qwen3-8b or simulated:qwen3-8b\?seed=1"),
        ("simulated:qwen3-8b?speed=1", "write simulated:qwen3-8b"),
    ],
)
def test_bad_specs(spec: str, says: str) -> None:
    with pytest.raises(BadPlannerSpec, match=says):
        load_model(spec)


def test_unknown_instruction() -> None:
    with pytest.raises(UnknownInstruction):
        SimulatedModel("qwen3-8b", []).complete([Prompt((), About("Go nowhere."))])
