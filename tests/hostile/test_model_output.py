"""Whatever a model answers is read in time that grows with its length, and nothing of it raises."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hostile import fuzzed, harmless, times
from support.worlds import kitchen

from gavel_agents.proposing.parse import MOST_CHARACTERS, parse_plans
from gavel_agents.react import read_turn
from gavel_env.errors import MalformedAction, MalformedGoal
from gavel_env.world_model.actions import Action, normalise_name, parse_action
from gavel_env.world_model.goals import parse_literal

pytestmark = pytest.mark.hostile

MEGABYTE = 1_000_000

SEEDS = [
    "[", "{", "(", "[[", "{{", "[1", "{1:", '{"a":', '["', "['", "{'a': [", "1", "a", " ", "\t", "\n", "\r\n", " \n",
    "<think>", "</think>", "<think></reasoning>", "```\n", "- ", "step 1 ", "Task ", "Task 1\n", "task_", "and then ",
    "and ", "put ", "put down ", "put on ", "turn ", "GRASP: apple ", "GRASP(", "GRASP(apple", "GRASP(apple) ",
    "GRASP (", "OPEN fridge\n", "GRASP apple from ", "go to ", "a b ", "a-", "a_", "_ ", "-- ", " — ", "# ", "// ", ";",
    "[1, ", "[[1], ", '{"plan": [', '["GRASP(a)", ', "{'a': 'b', ", "\\", '"\\', "@", "a@", "x=", "x:", ",", "...",
    "é", "\U0001f600", "\ud800", "\x00", "²", "٣", "action: ", "Action:\n", "Observation: ", "thought ", "on top of ",
    "in the fridge in ", "True ", "null,", "1e", "-", "--", "1.", "(1) ", "\u2028", "PLACE_ON_TOP ", "placeontopof",
]  # fmt: skip


def seconds(call: Callable[[str], object], text: str) -> float:
    """Return the CPU seconds of the better of two calls; what else the machine does is not counted."""
    spent = []
    for _ in range(2):
        start = time.thread_time()
        call(text)
        spent.append(time.thread_time() - start)
    return min(spent)


def read_all(text: str) -> None:
    parse_plans(text, kitchen(), tasks=2)


READERS: dict[str, Callable[[str], object]] = {
    "plans": read_all,
    "turn": read_turn,
    "action": lambda text: harmless(parse_action, text),
    "name": normalise_name,
    "literal": lambda text: harmless(parse_literal, text),
}


FRAMES = ["{}", "{}x", "GRASP: apple {}x", "[{}", "NAVIGATE_TO(a)\n{}"]


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("seed", SEEDS[:: times(4, 1)], ids=ascii)
@pytest.mark.parametrize("frame", FRAMES[: times(1, 5)], ids=ascii)
def test_a_megabyte_of_anything_is_read_at_once(reader: str, seed: str, frame: str) -> None:
    text = frame.format(seed * (MEGABYTE // len(seed)))
    spent = seconds(READERS[reader], text)
    if spent > 0.2:  # then a quarter of it must take much less: in quadratic time it would take a sixteenth
        assert spent < 12 * max(0.02, seconds(READERS[reader], text[: len(text) // 4])), spent


def test_numbers_and_nesting_that_python_itself_refuses_are_results() -> None:
    for text in (
        "[" + "1" * 5000,
        "[" + "1" * 5000 + "]",
        "Task " + "1" * 5000 + "\nGRASP(a)",
        "{{1,2}: 3}",
        "{[1]: 2}",
        "[" * 20_000,
        "[" * 20_000 + "]" * 20_000,
        "{'a':" * 20_000,
        '{"task_' + "9" * 5000 + '": ["GRASP(a)"]}',
        "[-" * 10_000 + "1]",
        "NAVIGATE_TO(\ud800)",
    ):
        assert len(parse_plans(text, kitchen(), tasks=2).plans) == 2


def test_an_answer_is_read_to_its_cap_and_the_rest_is_listed() -> None:
    parsed = parse_plans("NAVIGATE_TO(fridge_0)\n" + "x" * MOST_CHARACTERS + "\nGRASP(steak_0)", tasks=1)
    assert [str(action) for action in parsed.plan] == ["NAVIGATE_TO(fridge_0)"]
    assert "only the first" in parsed.dropped[-1].reason
    thought = "<think>" + "GRASP(steak_0)\n" * 20_000 + "</think>\nOPEN(fridge_0)"
    assert [str(action) for action in parse_plans(thought, tasks=1).plan] == ["OPEN(fridge_0)"]


@given(st.lists(st.sampled_from([*SEEDS, *"[]{}()\"',:\n\\ab1 "]) | st.text(max_size=5), max_size=60).map("".join))
@fuzzed(400, 120_000)
def test_no_answer_raises(answer: str) -> None:
    parsed = parse_plans(answer, kitchen(), tasks=2)
    assert len(parsed.plans) == 2
    assert bool(parsed.problem) == (not any(parsed.plans))
    json.dumps([str(action) for action in parsed.plan]).encode()
    read_turn(answer)


@given(st.text(alphabet="GRASP()[]:;.,@=-_ \t\nabc1'\"#/—", max_size=80))
@fuzzed(400, 60_000)
def test_an_action_is_read_or_malformed(text: str) -> None:
    found = harmless(parse_action, text)
    assert isinstance(found, Action | MalformedAction)


@given(st.text(alphabet="not !~on_top(),@ \t\nabc1_", max_size=80))
@fuzzed(400, 60_000)
def test_a_goal_literal_is_read_or_malformed(text: str) -> None:
    found = harmless(parse_literal, text)
    assert not isinstance(found, Exception) or isinstance(found, MalformedGoal)
