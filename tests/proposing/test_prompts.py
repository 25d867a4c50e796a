"""Prompts are kept as files, to the byte: what is sent to a model changes only where somebody meant it to.

Recorded answers are found by their prompts, so a changed prompt also wants new recordings.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from support.prompted import prompts_sent

from gavel_agents.llm import Message
from gavel_agents.proposing.prompts import EXAMPLES, SYSTEM

GOLDEN = Path(__file__).parents[1] / "data" / "prompts"
UPDATE = "GAVEL_UPDATE_PROMPTS"

FIRST = {
    "single": "single-Beechwood_0_int-02",
    "multi": "multi-Beechwood_0_int-05",
    "behavior": "behavior-store_tulip_bulbs",
}

EGG = "single-Beechwood_0_int-02"
COOKED = """NAVIGATE_TO fridge
OPEN fridge
GRASP egg
CLOSE fridge
NAVIGATE_TO burner
PLACE_ON_TOP burner
TOGGLE_ON burner
TOGGLE_OFF burner
GRASP egg
NAVIGATE_TO coffee_table
PLACE_ON_TOP coffee_table"""

BROKEN = {
    "violated": COOKED.replace("OPEN fridge\n", ""),
    "unmet": COOKED.replace("TOGGLE_ON burner\nTOGGLE_OFF burner\n", ""),
    "unsafe": COOKED.replace("CLOSE fridge\n", "").replace("TOGGLE_OFF burner\n", ""),
    "unknown": COOKED.replace("egg", "eggplant"),
    "unreadable": "I would first find the egg.\nThen I'd rather rest.",
}


def written(messages: Sequence[Message]) -> str:
    """Return chat turns as they stand in a golden file."""
    return "\n\n".join(f"[{message.role}]\n{message.content}" for message in messages) + "\n"


def compare(name: str, text: str) -> None:
    """Hold a text against its golden file, or write the file if that was asked for."""
    path = GOLDEN / f"{name}.txt"
    if os.environ.get(UPDATE):
        path.write_bytes(text.encode())
    golden = path.read_bytes().decode() if path.exists() else ""
    if text != golden:
        lines = difflib.unified_diff(golden.splitlines(), text.splitlines(), path.name, "the code's", lineterm="")
        changed = "\n".join(lines) or "line ends alone"
        pytest.fail(
            f"{changed}\n\nIf this was meant, write the files anew with\n"
            f"    {UPDATE}=1 python -m pytest -n0 tests/test_prompts.py\n"
            "and record the models' answers again (gavel record).",
            pytrace=False,
        )


@pytest.mark.parametrize("kind", FIRST)
def test_first_prompts_are_the_golden_ones(kind: str) -> None:
    [prompt] = prompts_sent("llm-only", kind, [FIRST[kind]])
    compare(kind, written(prompt.messages))


@pytest.mark.parametrize("wrong", BROKEN)
def test_complaints_are_the_golden_ones(wrong: str) -> None:
    """A retry is the first prompt, the plan as it was read, and the complaint; the file holds what is new."""
    first, retry, *_ = prompts_sent("sayplan", "single", [EGG], BROKEN[wrong])
    assert retry.messages[: len(first.messages)] == first.messages
    assert retry.attempt == 1
    compare(f"retry-{wrong}", written(retry.messages[len(first.messages) :]))


def test_a_right_plan_meets_no_complaint() -> None:
    """What the broken plans are broken from is right, so that each complains of its own fault."""
    assert len(prompts_sent("sayplan", "single", [EGG], COOKED)) == 1


def test_what_never_changes_leads() -> None:
    """Rules and examples are the same to the last byte, so that a backend can keep them."""
    prompts = [prompt for kind in FIRST for prompt in prompts_sent("llm-only", kind, [FIRST[kind]])]
    shared = 1 + 2 * len(EXAMPLES)
    assert {prompt.messages[:shared] for prompt in prompts} == {prompts[0].messages[:shared]}
    assert prompts[0].messages[0] == Message("system", SYSTEM)
    assert len({prompt.messages[shared:] for prompt in prompts}) == len(FIRST)


def test_every_golden_file_is_compared() -> None:
    names = {*FIRST, *(f"retry-{wrong}" for wrong in BROKEN)}
    assert {path.stem for path in GOLDEN.iterdir()} == names
