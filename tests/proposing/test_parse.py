"""Reading plans out of model output."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.worlds import build, kitchen

from gavel_agents.proposing.parse import parse_plans
from gavel_agents.proposing.resolve import resolve_name
from gavel_env.world_model.actions import Action, Primitive, parse_action

WANTED = ("NAVIGATE_TO(fridge_0)", "OPEN(fridge_0)", "GRASP(steak_0)", "CLOSE(fridge_0)")


def texts(plans: Iterable[Sequence[Action]]) -> list[list[str]]:
    return [[str(action) for action in plan] for plan in plans]


@pytest.mark.parametrize(
    "answer",
    [
        "NAVIGATE_TO(fridge_0)\nOPEN(fridge_0)\nGRASP(steak_0)\nCLOSE(fridge_0)",
        "1. NavigateTo(fridge_0)\n2. Open(fridge_0)\n3) Grasp(steak_0)\n(4) Close(fridge_0)",
        "- navigate_to fridge_0\n* open FRIDGE_0\n• grasp steak_0\n- close fridge_0",
        "Step 1: navigate to the fridge_0\nStep 2: open the fridge_0.\nStep 3: pick up steak_0\nStep 4: shut fridge_0",
        "**NAVIGATE_TO(fridge_0)**\n`OPEN(fridge_0)`\nGRASP(steak_0)  # take it out\nCLOSE(fridge_0) // shut it",
        "NAVIGATE_TO(fridge_0), OPEN(fridge_0), GRASP(steak_0), CLOSE(fridge_0)",
        "NavigateTo(fridge_0) -> Open(fridge_0) -> Grasp(steak_0) -> Close(fridge_0)",
        "<think>OPEN(oven_0)?\nNo.</think>\nNAVIGATE_TO(fridge_0)\nOPEN(fridge_0)\nGRASP(steak_0)\nCLOSE(fridge_0)",
        "I would GRASP(oven_0)...</think>NAVIGATE_TO(fridge_0)\nOPEN(fridge_0)\nGRASP(steak_0)\nCLOSE(fridge_0)",
        "```\nNAVIGATE_TO fridge_0\nOPEN fridge_0\nGRASP steak_0\nCLOSE fridge_0\n```",
        "Navigate(robot, fridge_0)\nOpen(target=fridge_0)\nGrasp(steak_0, fridge_0)\nClose('fridge_0')",
        json.dumps(WANTED),
        'Here you are:\n```json\n{"plan": ["NavigateTo(fridge_0)", "open fridge_0",\n'
        ' "grasp steak_0", "CLOSE(fridge_0)"]}\n```',
        '[{"action": "NavigateTo", "target": "fridge_0"}, {"action": "OPEN", "object": "fridge_0"},'
        ' {"action": "grasp", "args": ["steak_0"]}, {"action": "close", "args": {"obj": "fridge_0"}}]',
        '[["NAVIGATE_TO", "fridge_0"], ["OPEN", "fridge_0"], ["GRASP", "steak_0"], ["CLOSE", "fridge_0"]]',
        '[{"NAVIGATE_TO": "fridge_0"}, {"OPEN": "fridge_0"}, {"GRASP": "steak_0"}, {"CLOSE": "fridge_0"}]',
        "['NAVIGATE_TO(fridge_0)', 'OPEN(fridge_0)', 'GRASP(steak_0)', 'CLOSE(fridge_0)',]",
        '{"plan": ["NAVIGATE_TO(fridge_0)",\n "OPEN(fridge_0)",\n "GRASP(steak_0)",\n "CLOSE(fridge_0)",\n "OPE',
    ],
)
def test_one_plan_in_many_forms(answer: str) -> None:
    assert texts(parse_plans(answer).plans) == [list(WANTED)]


@pytest.mark.parametrize(
    "answer",
    [
        "Task 1: put it away\nNAVIGATE_TO(a)\nGRASP(a)\n\nTask 2: the lamp\n1. NAVIGATE_TO(b)\n2. TOGGLE_ON(b)",
        "### Task 1\n- NAVIGATE_TO a\n- GRASP a\n### Task 2\n- NAVIGATE_TO b\n- TOGGLE_ON b",
        "Plan for task 2: NAVIGATE_TO(b), TOGGLE_ON(b)\nPlan for task 1: NAVIGATE_TO(a), GRASP(a)",
        '{"task_1": ["NAVIGATE_TO(a)", "GRASP(a)"], "task_2": ["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]}',
        '{"tasks": [{"task": "x", "plan": ["NAVIGATE_TO(a)", "GRASP(a)"]},'
        ' {"plan": ["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]}]}',
        '[["NAVIGATE_TO(a)", "GRASP(a)"], ["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]]',
        'Task 1:\n```json\n["NAVIGATE_TO(a)", "GRASP(a)"]\n```\n'
        'Task 2:\n```json\n["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]\n```',
        '{"plans": {"put it away": ["NAVIGATE_TO(a)", "GRASP(a)"], "lamp": ["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]}}',
    ],
)
def test_several_tasks_in_one_answer(answer: str) -> None:
    wanted = [["NAVIGATE_TO(a)", "GRASP(a)"], ["NAVIGATE_TO(b)", "TOGGLE_ON(b)"]]
    assert texts(parse_plans(answer, tasks=2).plans) == wanted


def test_a_missing_task_is_an_empty_plan_in_its_place() -> None:
    parsed = parse_plans("Task 2:\nNAVIGATE_TO(b)", tasks=3)
    assert texts(parsed.plans) == [[], ["NAVIGATE_TO(b)"], []]
    assert parsed.problem == ""


def test_what_is_dropped_is_listed_with_line_and_reason() -> None:
    parsed = parse_plans("<think>\nhm\n</think>\nHere is the plan:\nNAVIGATE_TO(a)\nDance around the fridge\nGRASP(a)")
    assert texts(parsed.plans) == [["NAVIGATE_TO(a)", "GRASP(a)"]]
    assert [(d.line, d.text) for d in parsed.dropped] == [(4, "Here is the plan:"), (6, "Dance around the fridge")]
    assert "no primitive" in parsed.dropped[1].reason


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        ("", "the answer is empty"),
        ("  \n", "the answer is empty"),
        ("<think>and so on and so", "the answer ends within its thinking"),
        ("I cannot do that.", "no action in the answer"),
        ("[]", "no action in the answer"),
        ('{"plan": 3}', "no action in the answer"),
    ],
)
def test_a_malformed_answer_is_a_result(answer: str, problem: str) -> None:
    parsed = parse_plans(answer, tasks=2)
    assert parsed.plans == ((), ())
    assert parsed.problem == problem


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("put the apple on top of the breakfast table", "PLACE_ON_TOP(breakfast_table)"),
        ("place it inside the top cabinet", "PLACE_INSIDE(top_cabinet)"),
        ("Put apple in the fridge and close it", "PLACE_INSIDE(fridge)"),
        ("turn the floor lamp on", "TOGGLE_ON(floor_lamp)"),
        ("switch off the oven", "TOGGLE_OFF(oven)"),
        ("grasp the apple from the counter", "GRASP(apple)"),
        ("go to the fridge to get the apple", "NAVIGATE_TO(fridge)"),
        ("then GRASP(kettle_with_lid)", "GRASP(kettle_with_lid)"),
        ("GRASP kettle_with_lid", "GRASP(kettle_with_lid)"),
        ("PlaceInside(apple, fridge)", "PLACE_INSIDE(fridge)"),
        ("Release()", "RELEASE()"),
        ("PLACE_ON_TOP coffee table", "PLACE_ON_TOP(coffee_table)"),
        ("NAVIGATE_TO(bottom_cabinet@private_office)", "NAVIGATE_TO(bottom_cabinet@private_office)"),
    ],
)
def test_phrases(line: str, wanted: str) -> None:
    assert texts(parse_plans(line).plans) == [[wanted]]


def test_prose_that_mentions_actions_is_no_action() -> None:
    answer = "Go over what is known about all of the objects in the house before anything else is done here."
    assert parse_plans(answer).plans == ()


@given(st.text(max_size=300))
def test_no_answer_raises(answer: str) -> None:
    parsed = parse_plans(answer, kitchen(), tasks=2)
    assert len(parsed.plans) == 2
    assert bool(parsed.problem) == (not any(parsed.plans))


_PIECES = st.sampled_from(
    [*"[]{}()\"',:\n\\", "Task 2:", "plan", "NAVIGATE_TO(apple_0)", "OPEN fridge", "```json", "<think>", "</think>",
     "1.", "- ", "action", "target", "null"]
)  # fmt: skip


@given(st.lists(_PIECES, max_size=40).map("".join))
def test_no_broken_json_raises(answer: str) -> None:
    assert len(parse_plans(answer, kitchen(), tasks=2).plans) == 2


_ACTIONS = st.builds(
    lambda primitive, target: Action(primitive, target if primitive.takes_target else None),
    st.sampled_from(list(Primitive)),
    st.sampled_from(
        ["fridge_0", "bottom_cabinet@kitchen|any_office", "apple", "top_cabinet_12", "tupperware_with_lid_3"]
    ),
)


@given(st.lists(_ACTIONS, min_size=1, max_size=8).map(tuple), st.booleans())
def test_what_is_written_is_read(plan: tuple[Action, ...], as_json: bool) -> None:
    written = [str(action) for action in plan]
    answer = json.dumps({"plan": written}) if as_json else "\n".join(f"{i}. {a}" for i, a in enumerate(written, 1))
    assert parse_plans(answer).plans == (plan,)
    assert tuple(map(parse_action, written)) == plan


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("fridge_0", "fridge_0"),
        ("fridge", "fridge_0"),
        ("fridge_3", "fridge_0"),
        ("apples", "apple_0"),
        ("breakfast_table", "breakfast_table_0"),
        ("fridge@kitchen", "fridge_0"),
        ("fridge_in_the_kitchen", "fridge_0"),
        ("kitchen_fridge", "fridge_0"),
        ("door_of_the_fridge", "fridge_0"),
        ("kitchen", "kitchen_0"),
        ("kitchen_0", "kitchen_0"),
        ("frige", "frige"),
        ("fridge@living_room", "fridge@living_room"),
    ],
)
def test_names_resolve_exactly_then_by_unique_category(name: str, wanted: str) -> None:
    assert resolve_name(kitchen(), name) == wanted


def test_an_ambiguous_category_stays_as_it_is() -> None:
    graph = build({"fridge_0": "floor kitchen_0", "fridge_1": "floor garage_0", "shelf_0": "floor garage_0"})
    assert resolve_name(graph, "fridge") == "fridge"
    assert resolve_name(graph, "fridges") == "fridges"
    assert resolve_name(graph, "fridge@garage") == "fridge_1"
    assert resolve_name(graph, "shelves") == "shelf_0"


def test_plans_resolve_against_the_graph_given() -> None:
    parsed = parse_plans("NAVIGATE_TO(the fridge)\nOPEN(Fridge)\nGRASP(steaks)", kitchen())
    assert texts(parsed.plans) == [["NAVIGATE_TO(fridge_0)", "OPEN(fridge_0)", "GRASP(steak_0)"]]
