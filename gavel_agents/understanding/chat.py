# ruff: noqa: E501  (a prompt is written as the model reads it, line by line)
"""What a chat model is asked in order to understand an instruction: rules, worked examples, then the text.

Names may be written as the text says them; `gavel_agents.understanding.mentions` finds what they mean.
"""

from __future__ import annotations

import json

from gavel_agents.llm import Message

__all__ = ["EXAMPLES", "SYSTEM", "chat_prompt"]

SYSTEM = """You read an instruction for a household robot and answer with JSON only: {"tasks": [...]}, one entry per task, in the order told. What speaks of the same things is one task.
"start": the first three words of the task, copied.
"relations": where things are now, if the text says so: inside(x, y), on_top(x, y), in_room(x, room). Never invent one.
"objects": further furniture or appliances that the task names.
"goal": what must hold in the end: on_top(x, y), inside(x, y), toggled(x) for switched on, open(x), not open(x), cooked(x), washed(x), dried(x).
Write names as the text says them, in lower case with _ for spaces; add @room to furniture if the text says its room. "from the fridge" and "out of the fridge" mean inside now; "off the desk" means on_top now; "from the kitchen" means in_room now."""

EXAMPLES: tuple[tuple[str, object], ...] = (
    (
        "Get the pizza out of the fridge, warm it up in the microwave and leave it on the breakfast table in the dining room. Then switch on the radio.",
        [
            {
                "start": "Get the pizza",
                "relations": ["inside(pizza, fridge)"],
                "objects": ["microwave"],
                "goal": ["cooked(pizza)", "on_top(pizza, breakfast_table@dining_room)"],
            },
            {"start": "switch on the", "relations": [], "objects": [], "goal": ["toggled(radio)"]},
        ],
    ),
    (
        "Put the mug and the plate from the living room into the wall cabinet in the kitchen.",
        [
            {
                "start": "Put the mug",
                "relations": ["in_room(plate, living_room)"],
                "objects": [],
                "goal": ["inside(mug, wall_cabinet@kitchen)", "inside(plate, wall_cabinet@kitchen)"],
            }
        ],
    ),
    (
        "The bath towel is on the bed; I want it washed in the washer in the utility room. Please bring the teddy bear to the sofa as well.",
        [
            {
                "start": "The bath towel",
                "relations": ["on_top(bath_towel, bed)"],
                "objects": ["washer@utility_room"],
                "goal": ["washed(bath_towel)"],
            },
            {"start": "bring the teddy", "relations": [], "objects": [], "goal": ["on_top(teddy_bear, sofa)"]},
        ],
    ),
)


def chat_prompt(text: str) -> tuple[Message, ...]:
    """Return the conversation that asks what a text says."""
    turns = [Message("system", SYSTEM)]
    for said, tasks in EXAMPLES:
        turns += [Message("user", said), Message("assistant", json.dumps({"tasks": tasks}))]
    return (*turns, Message("user", text))
