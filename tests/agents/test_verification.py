"""The verifier as a library and as a command, and the complaint for a retry."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.worlds import kitchen

import gavel_agents
from eval.cli import main
from gavel_agents.proposing.complaint import CONTRACTS, complain, complaint
from gavel_agents.proposing.parse import parse_plans
from gavel_agents.verification import find_instruction, verify, verify_on_graph
from gavel_env.errors import GavelError, InstructionError, UnknownInstruction, UnknownScene
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.initial_graph import scene_graph
from gavel_env.world_model.actions import Primitive, parse_action
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import parse_goal
from gavel_env.world_model.verdict import validate

GOAL = parse_goal(["on_top(steak, breakfast_table)"])
BAD = "NAVIGATE_TO(steak_0)\nGRASP(steak_0)\nNAVIGATE_TO(breakfast_table_0)\nPLACE_ON_TOP(breakfast_table_0)"


@pytest.fixture
def record() -> dict[str, Any]:
    """An instruction in a shipped house: something from a container with a door to a surface."""
    graph = scene_graph(load_scene("Rs_int"))
    box = next(o for o, n in graph.world.nodes.items() if n.category.has_door and not n.category.safety_critical)
    table = next(o for o, n in graph.world.nodes.items() if n.category.surface and not n.category.openable)
    steps = [f"NAVIGATE_TO({box})", f"OPEN({box})", "GRASP(apple_0)", f"CLOSE({box})", f"NAVIGATE_TO({table})"]
    return {
        "id": "apple-out",
        "scene": "Rs_int",
        "text": "Take the apple out and put it on the table.",
        "placements": [{"category": "apple", "relation": "in", "target": box}],
        "tasks": [
            {
                "text": "Take the apple out and put it on the table.",
                "goal": [f"on_top(apple, {table})"],
                "reference_plan": [*steps, f"PLACE_ON_TOP({table})"],
            }
        ],
    }


@pytest.fixture
def files(record: dict[str, Any], tmp_path: Path) -> Path:
    """The record as a file, its reference plan, and a plan that forgot to open and to close."""
    (tmp_path / "task.jsonl").write_text(json.dumps(record) + "\n")
    reference = record["tasks"][0]["reference_plan"]
    (tmp_path / "good.json").write_text(json.dumps({"plan": reference}))
    lines = [f"{n}. {step}" for n, step in enumerate(reference, 1) if not step.startswith(("OPEN", "CLOSE"))]
    (tmp_path / "bad.txt").write_text("Sure!\n```\n" + "\n".join(lines) + "\n```\n")
    (tmp_path / "unknown.txt").write_text("NAVIGATE_TO(appel_0)\n")
    return tmp_path


def test_verify_reports_verdict_repair_edits_and_diff(record: dict[str, Any]) -> None:
    reference = record["tasks"][0]["reference_plan"]
    box = reference[1][len("OPEN(") : -1]
    missing = [step for step in reference if not step.startswith("OPEN")]
    result = gavel_agents.verify(scene="Rs_int", instruction=record, plan="\n".join(missing), repair=True)
    assert not result.valid
    assert str(result.verdict.violation) == f"closed(apple_0) (because of {box})"
    assert result.final.valid
    assert [str(action) for action in result.repaired_plan] == reference
    assert result.edits == (f"step 2: closed(apple_0) (because of {box}) -> insert OPEN({box})",)
    assert f"+OPEN({box})" in result.diff().splitlines()
    assert result.complaint == ""
    assert (result.scene, result.instruction) == ("Rs_int", "apple-out")


def test_verify_without_repair_only_judges(record: dict[str, Any]) -> None:
    reference = record["tasks"][0]["reference_plan"]
    assert verify(instruction=record, plan=reference, repair=False).valid
    result = verify(instruction=record, plan=reference[:-1], repair=False)
    assert result.repaired is None
    assert not result.final.valid
    assert result.diff() == ""
    assert "Not reached: on_top(apple" in result.complaint


def test_the_package_offers_verify_again_and_again(record: dict[str, Any]) -> None:
    for _ in range(2):
        assert gavel_agents.verify(instruction=record, plan=record["tasks"][0]["reference_plan"]).valid


def test_verify_takes_text_lists_and_actions(record: dict[str, Any]) -> None:
    reference = record["tasks"][0]["reference_plan"]
    forms = ["\n".join(reference), json.dumps(reference), reference, tuple(map(parse_action, reference))]
    assert all(verify(instruction=record, plan=form).valid for form in forms)


def test_verify_knows_profiles_by_name(record: dict[str, Any]) -> None:
    reference = record["tasks"][0]["reference_plan"]
    result = verify(instruction=record, plan=reference, profile="omnigibson")
    assert result.profile is Profile.OMNIGIBSON
    assert not result.valid
    assert result.final.valid


def test_categories_mean_what_holds_the_goal_objects_or_what_the_goal_names() -> None:
    plan = (
        "go to the fridge\nopen fridge\ngrasp steak\nclose fridge\ngo to breakfast table\nPLACE_ON_TOP breakfast_table"
    )
    assert verify_on_graph(kitchen(near=()), GOAL, plan).valid


def test_of_several_that_fit_the_one_with_the_goal_object_is_meant() -> None:
    graph = kitchen({"fridge_1": "floor garage_0", "breakfast_table_1": "floor garage_0"}, near=())
    plan = "NAVIGATE_TO(fridge)\nOPEN(fridge)\nGRASP(steak)\nCLOSE(fridge)\nNAVIGATE_TO(breakfast_table)\n"
    result = verify_on_graph(graph, GOAL, plan + "PLACE_ON_TOP(breakfast_table)")
    assert result.valid
    assert str(result.plan[0]) == "NAVIGATE_TO(fridge_0)"
    bowls = verify_on_graph(kitchen({"bowl_1": "on countertop_0"}, near=()), GOAL, "NAVIGATE_TO(bowl)", repair=False)
    assert bowls.verdict.violation is not None
    assert bowls.verdict.violation.kind.value == "unknown_object"
    assert set(bowls.verdict.nearest) == {"bowl_0", "bowl_1"}


def test_instructions_are_found_by_file_and_by_id(record: dict[str, Any], files: Path) -> None:
    assert find_instruction(files / "task.jsonl").id == "apple-out"
    (files / "two.jsonl").write_text(json.dumps(record) + "\n" + json.dumps(record | {"id": "again"}) + "\n")
    assert find_instruction(f"{files / 'two.jsonl'}#again").id == "again"
    with pytest.raises(InstructionError, match=r"holds 2 instructions; name one as .*#ID"):
        find_instruction(files / "two.jsonl")
    with pytest.raises(UnknownInstruction, match="did you mean 'again'"):
        find_instruction(f"{files / 'two.jsonl'}#agin")
    with pytest.raises(InstructionError, match="cannot be read"):
        find_instruction(files / "missing.jsonl")
    with pytest.raises(UnknownInstruction):
        find_instruction("no-such-instruction")


def test_a_scene_that_is_not_there_is_a_typed_error(record: dict[str, Any]) -> None:
    with pytest.raises(UnknownScene, match="Rs_int"):
        verify(scene="Rs_itn", instruction=record, plan="RELEASE()")


# --- the command ---------------------------------------------------------------------------------------------------


def run(files: Path, plan: str, *options: str) -> int:
    return main(["verify", "--instruction", str(files / "task.jsonl"), "--plan", str(files / plan), *options])


def test_the_exit_status_says_valid_or_not(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(files, "good.json") == 0
    assert "plan: valid, 6 steps" in capsys.readouterr().out
    assert run(files, "bad.txt") == 1
    out = capsys.readouterr().out
    assert "plan: invalid" in out
    assert "step 2: closed(apple_0)" in out


def test_repair_shows_edits_and_difference(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(files, "bad.txt", "--repair", "--lenient", "--scene", "Rs_int") == 0
    out = capsys.readouterr().out
    assert "-> insert OPEN(" in " ".join(out.split())
    assert "\n  + OPEN(" in out
    assert "repaired plan: valid, 6 steps" in out
    assert run(files, "unknown.txt", "--repair") == 1
    assert "did you mean apple_0" in capsys.readouterr().out


def test_json_says_everything(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(files, "bad.txt", "--repair", "--lenient", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["valid"] is False
    assert report["violation"]["kind"] == "closed"
    assert report["violation"]["step"] == 1
    assert report["repaired"]["valid"] is True
    assert [edit["rule"] for edit in report["repaired"]["edits"]] == ["open_first", "close_in_time"]
    assert "+OPEN(" in report["repaired"]["diff"]
    assert [(piece["line"], piece["text"]) for piece in report["unread"]] == [(1, "Sure!")]


def test_bad_input_is_status_2_with_a_message(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(files, "missing.txt") == 2
    assert "cannot be read" in capsys.readouterr().err
    (files / "binary.txt").write_bytes(b"\xff\xfe\x00")
    assert run(files, "binary.txt") == 2
    assert run(files, "good.json", "--scene", "Nowhere") == 2
    assert main(["verify", "--instruction", "nothing-like-it", "--plan", str(files / "good.json")]) == 2
    assert "nothing-like-it" in capsys.readouterr().err


# --- the complaint -------------------------------------------------------------------------------------------------


def test_the_complaint_marks_the_step_and_says_what_it_needs() -> None:
    verdict = validate(kitchen(near=()), parse_plans(BAD.replace("steak", "bowl"), kitchen()).plan, GOAL)
    found = complaint(verdict, 2)
    assert found is not None
    assert found.unmet == ("on_top(steak, breakfast_table)",)
    text = complain((verdict,), (GOAL,))
    assert "does not reach its goal" in text
    verdict = validate(kitchen(near=()), tuple(map(parse_action, BAD.split())), GOAL)
    text = complain((verdict,), (GOAL,))
    assert "1. NAVIGATE_TO steak_0   <- fails: steak_0 is inside fridge_0, which is closed" in text.splitlines()
    assert f"NAVIGATE_TO needs {CONTRACTS[Primitive.NAVIGATE_TO]}." in text
    assert "Task 1 goal: on_top(steak, breakfast_table)" in text


def test_the_complaint_says_what_is_left_open_and_which_task_is_right() -> None:
    plan = "NAVIGATE_TO(fridge_0) OPEN(fridge_0) GRASP(steak_0) "
    plan += "NAVIGATE_TO(breakfast_table_0) PLACE_ON_TOP(breakfast_table_0)"
    left = validate(kitchen(near=()), tuple(map(parse_action, plan.split())), GOAL)
    good = validate(kitchen(near=()), (), parse_goal(["on_top(apple, countertop)"]))
    text = complain((left, good), (GOAL, GOAL))
    assert "Task 1 reaches its goal but leaves things open or on:" in text
    assert "Left open at the end: fridge_0." in text
    assert "Task 2 is right" in text
    assert complaint(good) is None


def test_the_complaint_offers_names_and_quotes_what_was_dropped() -> None:
    parsed = parse_plans("Hello there, dear robot.\nNAVIGATE_TO(frige_0)", kitchen(), 2)
    verdicts = [validate(kitchen(near=()), plan, GOAL) for plan in parsed.plans]
    text = complain(verdicts, (GOAL, GOAL), parsed)
    assert "there is no frige_0" in text
    assert "Known names like it: fridge_0" in text
    assert "Not an action: 'Hello there, dear robot.'" in text
    assert "Task 2 has no steps." in text
    assert "The answer could not be read: the answer is empty." in complain([], [], parse_plans(""))


def test_every_primitive_has_a_contract() -> None:
    assert set(CONTRACTS) == set(Primitive)


def test_every_error_of_verification_is_typed() -> None:
    with pytest.raises(GavelError):
        verify(instruction={"id": "x"}, plan="")
