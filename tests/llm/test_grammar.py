"""The grammar of plans in both forms: it takes every certified plan, and nothing that is not a plan."""

from __future__ import annotations

import json
import re

import pytest
from support.faulty_server import faulty_server

from gavel_agents.llm import Message, Prompt, load_model
from gavel_agents.llm.grammar import MOST_STEPS, plan_gbnf, plan_schema, step_pattern
from gavel_agents.llm.reference import ReferencePlans
from gavel_agents.proposing.parse import parse_plans
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import read_instructions, shipped
from gavel_env.world_model.actions import Primitive

ANSWERS = [
    completion.text
    for file in ("single", "multi")
    for completion in ReferencePlans(file).complete(
        [Prompt((), About(i.text)) for i in read_instructions(shipped(file)).values()]
    )
]


def as_regex(gbnf: str) -> str:
    """Translate the small part of GBNF that the grammar uses: literals, classes, groups, choices, repetition."""
    rules = dict(line.split(" ::= ", 1) for line in gbnf.strip().split("\n"))

    def expand(body: str) -> str:
        out = ""
        for token in re.findall(r'"(?:[^"\\]|\\.)*"|\[[^\]]*\]|[a-z]+|\{[\d,]+\}|[()|?*]|\s+', body):
            if token.startswith('"'):
                out += re.escape(json.loads(token))
            elif token[0].isalpha():
                out += f"(?:{expand(rules[token])})"
            elif token.strip():
                out += token
        return out

    return expand("root")


@pytest.mark.parametrize("answer", ANSWERS[::40])
def test_certified_plans_are_plans_of_both_forms(answer: str) -> None:
    assert re.fullmatch(as_regex(plan_gbnf()), answer)
    for line in answer.split("\n"):
        assert line.startswith("Task ") or re.search(step_pattern(), line)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "Task 1:",
        "GRASP apple",
        "Task 1:\nEAT apple",
        "Task 1:\nGRASP",
        "Task 1:\nRELEASE apple",
        "Sure!\nTask 1:\nOPEN x",
    ],
)
def test_other_texts_are_not(text: str) -> None:
    assert not re.fullmatch(as_regex(plan_gbnf()), text)


def test_loops_end() -> None:
    step = "\nGRASP apple"
    assert re.fullmatch(as_regex(plan_gbnf()), "Task 1:" + step * MOST_STEPS)
    assert not re.fullmatch(as_regex(plan_gbnf()), "Task 1:" + step * (MOST_STEPS + 1))


def test_names_can_be_closed() -> None:
    gbnf = plan_gbnf(["apple", "fridge@kitchen"])
    assert re.fullmatch(as_regex(gbnf), "Task 1:\nGRASP apple\nOPEN fridge@kitchen")
    assert not re.fullmatch(as_regex(gbnf), "Task 1:\nGRASP pear")
    assert not re.search(step_pattern(["apple"]), "GRASP pear")


def test_every_primitive_is_in_it() -> None:
    for primitive in Primitive:
        assert re.search(step_pattern(), primitive.name + (" apple" if primitive.takes_target else ""))


def test_answers_of_the_schema_are_read() -> None:
    schema = plan_schema()
    assert schema["required"] == ["tasks"]
    answer = {"tasks": [{"task": 1, "plan": ["NAVIGATE_TO apple", "GRASP apple"]}, {"task": 2, "plan": ["RELEASE"]}]}
    item = schema["properties"]["tasks"]["items"]
    assert set(answer["tasks"][0]) == set(item["required"]) == set(item["properties"])
    parsed = parse_plans(json.dumps(answer), None, 2)
    assert [len(plan) for plan in parsed.plans] == [2, 1]
    assert not parsed.dropped


def test_a_constrained_server_is_sent_the_schema(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("openai")
    monkeypatch.setenv("OPENAI_API_KEY", "sk-test-0123456789abcdef")
    with faulty_server() as server:
        model = load_model(f"openai:m@{server.url}/v1?constrained")
        model.complete([Prompt((Message("user", "hello"),))])
    assert server.asked[0]["response_format"]["json_schema"]["schema"] == plan_schema()
    assert model.decoding["constrained"] == 1
    assert "constrained" not in server.asked[0]
