"""`verify` as a gate: what cannot be read is a finding; statuses; JSON as its schema says; one's own graph and goal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.worlds import kitchen

import gavel_agents
from eval.cli import main
from gavel_agents.agent import AgentTrace, says_valid
from gavel_agents.llm import Completion, Prompt
from gavel_agents.methods import METHODS
from gavel_agents.proposing.proposals import Problem, proposed_plans
from gavel_agents.understanding import TaskUnderstanding
from gavel_agents.verification import Verified, verify
from gavel_env.errors import BadOption, GraphError, MalformedGoal, UnknownObject
from gavel_env.instructions.lookup import About
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal, as_goal, parse_goal, parse_literal, unmet
from gavel_env.world_model.verdict import navigations, validate

SCHEMA = json.loads(
    (Path(__file__).parents[2] / "docs" / "reference" / "schemas" / "verdict.schema.json").read_text("utf-8")
)
LAB: dict[str, Any] = {
    "format": "gavel-graph/1",
    "rooms": [{"id": "lab"}, {"id": "store"}],
    "connections": [["lab", "store"]],
    "categories": {"vial": {"like": "bottle"}, "rack": {"surface": True}},
    "nodes": [
        {"id": "bench", "category": "lab_table", "room": "lab"},
        {"id": "cupboard", "category": "bottom_cabinet", "room": "store"},
        {"id": "rack", "category": "rack", "on_top": "bench"},
        {"id": "vial", "category": "vial", "inside": "cupboard"},
    ],
    "robot": {"room": "lab"},
}
GOAL = "on_top(vial, rack)"
STEPS = (
    "NAVIGATE_TO(cupboard)",
    "OPEN(cupboard)",
    "GRASP(vial)",
    "CLOSE(cupboard)",
    "NAVIGATE_TO(rack)",
    "PLACE_ON_TOP(rack)",
)
DROPPED_AT_THE_END = (
    "RELEASE",
    "RELEASE()",
    "release",
    ["RELEASE", None],
    ["RELEASE"],
    {"action": "RELEASE", "target": None},
    {"action": "RELEASE"},
)


def judged(plan: str | Sequence[Any], **options: Any) -> Verified:
    return verify(graph=LAB, goal=GOAL, plan=plan, repair=False, **options)


@pytest.mark.parametrize("release", DROPPED_AT_THE_END, ids=str)
def test_a_release_is_one_step_however_it_is_written(release: object) -> None:
    found = judged([*STEPS[:-1], release])
    assert str(found.plan[-1]) == "RELEASE()"
    assert found.unread == ()
    as_json = judged(json.dumps([*(step.removesuffix(")").split("(") for step in STEPS[:-1]), release]))
    assert (as_json.plan, as_json.unread) == (found.plan, ())


def test_a_release_alone_is_a_plan() -> None:
    assert [str(action) for action in judged('["RELEASE", null]').plan] == ["RELEASE()"]


UNREADABLE = [
    ("\n".join([*STEPS, "WOBBLE(vial)"]), 7, "WOBBLE(vial)"),
    ("\n".join([*STEPS, "PLACE_ON_TOP()"]), 7, "PLACE_ON_TOP()"),
    ("\n".join([*STEPS, "GRASP"]), 7, "GRASP"),
    ("Here you are!\n" + "\n".join(STEPS), 1, "Here you are!"),
    ("\n".join([*STEPS[:-1], f"{STEPS[-1]}, RELEASE"]), 6, "RELEASE"),
    ("\n".join([*STEPS[:-1], f"{STEPS[-1]} WOBBLE(vial)"]), 6, "WOBBLE(vial)"),
    ("\n".join([*STEPS[:-1], "put it on the rack and then close the cupboard"]), 6, "close the cupboard"),
    (json.dumps([*STEPS, ["PLACE_ON_TOP", None]]), 1, "['PLACE_ON_TOP', None]"),
    (json.dumps([*STEPS, {"action": "GRASP", "target": None}], indent=1), 9, "{'action': 'GRASP', 'target': None}"),
    (json.dumps(STEPS) + "\nCLOSE(cupboard)", 2, "CLOSE(cupboard)"),
    (str(list(STEPS)) + "\nCLOSE(cupboard)", 2, "CLOSE(cupboard)"),
    (json.dumps([{"action": s.split("(")[0], "target": s.split("(")[1][:-1]} for s in STEPS])[:-12], 1, None),
]


@pytest.mark.parametrize(("plan", "line", "text"), UNREADABLE)
def test_what_cannot_be_read_makes_a_plan_invalid_and_is_listed_with_its_line(
    plan: str, line: int, text: str | None
) -> None:
    found = judged(plan)
    assert not found.valid
    assert not found.passed
    [piece] = found.unread
    assert piece.line == line
    assert text is None or piece.text == text
    assert str(piece) in found.complaint


@pytest.mark.parametrize(("plan", "line", "text"), UNREADABLE[:-1])
def test_leniently_it_is_left_out_and_the_verdict_says_so(plan: str, line: int, text: str | None) -> None:
    found = judged(plan, strict=False)
    assert found.valid
    assert found.passed
    assert [piece.text for piece in found.unread] == [text]
    assert found.as_dict()["unread"]


@pytest.mark.parametrize(
    "plan",
    [
        "# how to\n" + "\n".join(STEPS) + "\n; done\n// really",
        "Plan:\n```\n" + "\n".join(f"{i}. {step}" for i, step in enumerate(STEPS, 1)) + "\n```",
        "Task 1:\n" + "\n".join(step.replace("(", " ").replace(")", "") for step in STEPS),
        "<think>GRASP(what?) or WOBBLE(it)</think>" + json.dumps(STEPS),
        ", ".join(STEPS),
        json.dumps({"plan": [{"action": s.split("(")[0], "object": s.split("(")[1][:-1]} for s in STEPS]}, indent=2),
    ],
)
def test_comments_headings_fences_and_thinking_are_no_steps(plan: str) -> None:
    found = judged(plan)
    assert found.unread == ()
    assert found.valid


def test_the_nearest_readings_name_a_primitive_and_a_thing_of_the_graph() -> None:
    [piece] = judged("\n".join([*STEPS, "GRAPS(viall)"])).unread
    assert piece.nearest[0] == "GRASP(vial)"


def test_repair_mends_what_was_read_and_the_gate_stays_shut() -> None:
    plan = "\n".join([*STEPS[:1], "WOBBLE(cupboard)", *STEPS[2:]])
    found = verify(graph=LAB, goal=GOAL, plan=plan)
    assert found.final.valid
    assert not found.passed
    assert verify(graph=LAB, goal=GOAL, plan=plan, strict=False).passed


JUNK = (
    "WOBBLE(vial)",
    "GRASP()",
    "PLACE_ON_TOP",
    "well now",
    "OPEN(cupboard) FOO(x)",
    "GRASP(vial) and RELEASE",
    "x" * 5000,
)
TOLD = ("", "# a comment", "Plan:", "```", "Task 1:")


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.sampled_from((*STEPS, "RELEASE", "2. open the cupboard")) | st.sampled_from(JUNK + TOLD), max_size=9)
)
def test_a_line_is_a_step_or_a_finding_or_says_nothing(lines: list[str]) -> None:
    """A step that is neither in the plan nor among the findings would have vanished."""
    found = judged("\n".join(lines))
    findings = {piece.line for piece in found.unread}
    assert {n for n, line in enumerate(lines, 1) if line in JUNK} <= findings
    assert not {n for n, line in enumerate(lines, 1) if line in STEPS} & findings
    steps = [line for line in lines if line not in (*JUNK, *TOLD)]
    assert len(found.plan) >= len(steps)


@settings(max_examples=80, deadline=None)
@given(st.text(alphabet="GRASP(vial),[]{}\"':\n .#<think>/null1", max_size=60))
def test_no_text_is_worse_than_a_finding(text: str) -> None:
    found = judged(text)
    assert isinstance(found.passed, bool)
    jsonschema.validate(json.loads(json.dumps(found.as_dict())), SCHEMA)


# --- goals in any form ----------------------------------------------------------------------------------------------


def test_goals_are_text_lists_or_goals_everywhere() -> None:
    goal = Goal((parse_literal("on_top(apple, countertop)"), parse_literal("not open(fridge)")))
    forms = (goal, "on_top(apple, countertop), not open(fridge)", "on_top(apple, countertop) and not open(fridge)",
             ["on_top(apple, countertop)", "not open(fridge)"], goal.literals)  # fmt: skip
    for form in forms:
        assert as_goal(form) == goal
        assert unmet(form, kitchen()) == ()
        assert validate(kitchen(), (), form).valid
        assert verify(graph=kitchen(), goal=form, plan="").valid
    assert parse_goal(forms[1]) == goal


@pytest.mark.parametrize("goal", ["", [], "tidy up", 7, ["on_top(apple, countertop)", 3], "on_top(a, b) c"])
def test_a_goal_that_says_nothing_is_refused(goal: Any) -> None:
    with pytest.raises(MalformedGoal):
        as_goal(goal)


def test_a_goal_of_what_the_graph_does_not_have_is_said() -> None:
    with pytest.raises(UnknownObject, match=r"'rakc' in the goal .*did you mean 'rack'"):
        verify(graph=LAB, goal="on_top(vial, rakc)", plan="")
    with pytest.raises(BadOption):
        verify(graph=LAB, plan="")
    with pytest.raises(BadOption):
        verify(graph=LAB, goal=GOAL, instruction="x", plan="")
    with pytest.raises(GraphError):
        verify(graph={"format": "gavel-graph/1"}, goal=GOAL, plan="")


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab.json").write_text(json.dumps(LAB))
    (tmp_path / "good.txt").write_text("\n".join(STEPS))
    (tmp_path / "short.txt").write_text("GRASP(vial)\nPLACE_ON_TOP(rack)\n")
    (tmp_path / "odd.txt").write_text("\n".join([*STEPS, "WOBBLE(vial)"]))
    return tmp_path


def gavel(lab: Path, plan: str, *options: str) -> int:
    return main(["verify", "--graph", str(lab / "lab.json"), "--goal", GOAL, "--plan", str(lab / plan), *options])


def test_the_command_is_a_gate(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert gavel(lab, "good.txt") == 0
    assert "plan: valid, 6 steps, 2 rooms" in capsys.readouterr().out
    assert gavel(lab, "short.txt") == 1
    assert gavel(lab, "short.txt", "--repair") == 0
    assert gavel(lab, "odd.txt") == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "not read, line 7: 'WOBBLE(vial)'" in out
    assert "invalid: 1 piece of it could not be read" in out
    assert gavel(lab, "odd.txt", "--lenient") == 0
    assert "left out, line 7: 'WOBBLE(vial)'" in " ".join(capsys.readouterr().out.split())


def test_wrong_use_is_status_2(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert gavel(lab, "missing.txt") == 2
    assert gavel(lab, "good.txt", "--scene", "Rs_int") == 2
    assert gavel(lab, "good.txt", "--categories", str(lab / "none.toml")) == 2
    assert gavel(lab, "good.txt", "--goal", "on_top(vial") == 2
    assert main(["verify", "--graph", str(lab / "lab.json"), "--plan", str(lab / "good.txt")]) == 2
    (lab / "lab.json").write_text("{")
    assert gavel(lab, "good.txt") == 2
    with pytest.raises(SystemExit, match="2"):
        main(["verify", "--plan", str(lab / "good.txt")])


def test_categories_of_ones_own_come_from_a_file(lab: Path) -> None:
    bare = {key: value for key, value in LAB.items() if key != "categories"}
    (lab / "lab.json").write_text(json.dumps(bare))
    assert gavel(lab, "good.txt") == 2
    (lab / "lab.toml").write_text('[categories.vial]\nlike = "bottle"\n[categories.rack]\nsurface = true\n')
    assert gavel(lab, "good.txt", "--categories", str(lab / "lab.toml")) == 0


@pytest.mark.parametrize("options", [(), ("--repair",), ("--lenient",), ("--repair", "--profile", "omnigibson")])
@pytest.mark.parametrize("plan", ["good.txt", "short.txt", "odd.txt"])
def test_the_json_is_as_its_schema_says(
    lab: Path, capsys: pytest.CaptureFixture[str], plan: str, options: tuple[str, ...]
) -> None:
    status = gavel(lab, plan, "--json", *options)
    report = json.loads(capsys.readouterr().out)
    jsonschema.validate(report, SCHEMA)
    assert status == (0 if report["passed"] else 1)
    assert ("repaired" in report) == ("--repair" in options)


# --- agents keep their tolerance, and say what vanished -------------------------------------------------------------


class Says:
    """A model that always gives the same answer."""

    name = "says"
    decoding: Mapping[str, str | float | int] = {}

    def __init__(self, answer: str, finish_reason: str = "") -> None:
        self.answer = answer
        self.finish_reason = finish_reason

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        return [Completion(text=self.answer, finish_reason=self.finish_reason) for _ in prompts]


def test_a_cut_answer_is_in_the_trace_and_in_the_verdict() -> None:
    goal = parse_goal("on_top(apple, breakfast_table)")
    tasks = [TaskUnderstanding("Put the apple on the table.", (), (), goal)]
    problem = Problem(About("", ()), tasks, kitchen(), {}, navigations, Profile.PAPER)
    answer = '[["GRASP", "apple_0"], ["PLACE_ON_TOP", "breakfast_table_0"]]'
    for reason, cut, verdict in (
        ("", [], "valid"),
        ("stop", [], "valid"),
        ("length", [0], "valid [answer cut]"),
        ("filter", [0], "valid [answer cut]"),
    ):
        trace = AgentTrace()
        proposed_plans(problem, METHODS["llm-only"], Says(answer, reason), trace)
        assert (trace.cut, trace.tasks[0].verdict) == (cut, verdict)
        assert says_valid(trace.tasks[0].verdict)


def test_a_step_that_vanished_is_in_the_trace_and_in_the_verdict() -> None:
    goal = parse_goal("on_top(apple, breakfast_table)")
    tasks = [TaskUnderstanding("Put the apple on the table.", (), (), goal)]
    problem = Problem(About("", ()), tasks, kitchen(), {}, navigations, Profile.PAPER)
    trace = AgentTrace()
    answer = '[["GRASP", "apple_0"], ["PLACE_ON_TOP", "breakfast_table_0"], ["OPEN", null]]'
    planned = proposed_plans(problem, METHODS["llm-only"], Says(answer), trace)
    assert len(planned.plans[0]) == 2
    [task] = trace.tasks
    assert task.unread == ("['OPEN', None]",)
    assert task.verdict == "valid [not read: ['OPEN', None]]"
    assert says_valid(task.verdict)
    assert gavel_agents.verify(graph=kitchen(), goal=goal, plan=answer, strict=False).passed
    assert not gavel_agents.verify(graph=kitchen(), goal=goal, plan=answer).passed
