"""Planner specs: `KIND:SOURCE?option=value&flag`, and what is wrong with one."""

from __future__ import annotations

import pytest

from gavel_agents.llm import BadPlannerSpec, load_model
from gavel_agents.llm.interface import spec_options


def read(argument: str) -> tuple[str, dict[str, str]]:
    return spec_options("gguf", argument, numbers=("slots",), flags=("constrained",), words={"quantize": ("4bit",)})


def test_options_stand_behind_the_source() -> None:
    assert read("a/b.gguf") == ("a/b.gguf", {})
    assert read("b.gguf?constrained&slots=4") == ("b.gguf", {"constrained": "", "slots": "4"})
    assert read("b.gguf?quantize=4bit") == ("b.gguf", {"quantize": "4bit"})


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("m?sluts=4", r"unknown option 'sluts' in gguf:m\?sluts=4; known: slots, constrained, quantize"),
        ("m?slots=0", "slots is '0', not a whole number above 0"),
        ("m?slots=few", "slots is 'few'"),
        ("m?constrained=yes", "constrained takes no value"),
        ("m?quantize=8bit", "quantize is '8bit'; known: 4bit"),
    ],
)
def test_what_is_no_option_is_said(argument: str, said: str) -> None:
    with pytest.raises(BadPlannerSpec, match=said):
        read(argument)


def test_unknown_kinds_and_missing_arguments_are_said() -> None:
    with pytest.raises(BadPlannerSpec, match="did you mean 'gguf'"):
        load_model("ggfu:model")
    with pytest.raises(BadPlannerSpec, match="kinds: anthropic"):
        load_model("")
    with pytest.raises(BadPlannerSpec, match="needs the form gguf:ARGUMENT"):
        load_model("gguf:")
    with pytest.raises(BadPlannerSpec, match="unknown option 'speed'"):
        load_model("gguf:model.gguf?speed=high")
