"""The one grammar of plans, for backends that can constrain what a model writes: GBNF (llama.cpp) and JSON schema.

A constrained model can still plan badly, but writes only plans: no prose, no verb that is not there, no loop
beyond `MOST_STEPS`. Constrained runs say so in their decoding, since they are not comparable with free ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from gavel_env.world_model.actions import Primitive, parameters_of, primitive_of
from gavel_env.world_model.own_actions import own_actions

__all__ = ["MOST_STEPS", "MOST_TASKS", "json_schema", "plan_gbnf", "plan_schema", "step_pattern"]

MOST_STEPS = 40
MOST_TASKS = 9
_NAME = r"[a-z][a-z0-9_]*(@[a-z][a-z0-9_]*)?"


def json_schema(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a chat-completions request says to hold the answer to a JSON schema."""
    return {"response_format": {"type": "json_schema", "json_schema": {"name": "answer", "schema": schema}}}


def plan_gbnf(names: Sequence[str] | None = None) -> str:
    """Return the grammar of `Task 1:` followed by lines `VERB object`, as llama.cpp reads it.

    Args:
        names: objects that may be named; default any name.
    """
    verbs = " | ".join(json.dumps(p.name) for p in (*Primitive, *_own(1)) if p.takes_target)
    bare = " | ".join(json.dumps(p.name) for p in (*Primitive, *_own(0)) if not p.takes_target)
    if names is None:
        name = 'word ("@" word)?\nword ::= [a-z] [a-z0-9_]*'
    else:
        name = " | ".join(json.dumps(n) for n in dict.fromkeys(names))
    return (
        f'root ::= task ("\\n" task){{0,{MOST_TASKS - 1}}}\n'
        f'task ::= "Task " [1-{MOST_TASKS}] ":" ("\\n" step){{1,{MOST_STEPS}}}\n'
        f'step ::= {bare} | verb " " name{_own_steps()}\n'
        f"verb ::= {verbs}\n"
        f"name ::= {name}\n"
    )


def _own(count: int) -> list[Primitive]:
    """Return the actions of one's own with so many parameters; for 2, with two or more."""
    found = [p for own in own_actions() if (p := primitive_of(own.name)) is not None]
    return [p for p in found if min(len(parameters_of(p) or ()), 2) == count]


def _own_steps() -> str:
    steps = [f'"{p.name} " ' + ' ", " '.join(["name"] * len(parameters_of(p) or ())) for p in _own(2)]
    return "".join(f" | {step}" for step in steps)


def step_pattern(names: Sequence[str] | None = None) -> str:
    """Return the regular expression of one step, for JSON schemas: no look-around, only escaped literals."""
    verbs = "|".join(p.name for p in (*Primitive, *_own(1)) if p.takes_target)
    bare = "|".join(p.name for p in (*Primitive, *_own(0)) if not p.takes_target)
    name = _NAME if names is None else f"({'|'.join(dict.fromkeys(names))})"
    more = "".join(f"|{p.name} {', '.join([name] * len(parameters_of(p) or ()))}" for p in _own(2))
    return f"^({bare}|({verbs}) {name}{more})$"


def plan_schema(names: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the JSON schema of the same plans: `{"tasks": [{"task": 1, "plan": ["GRASP apple", …]}]}`.

    Args:
        names: objects that may be named; default any name.
    """
    step = {"type": "string", "pattern": step_pattern(names)}
    task = {
        "type": "object",
        "properties": {
            "task": {"type": "integer", "minimum": 1, "maximum": MOST_TASKS},
            "plan": {"type": "array", "items": step, "minItems": 1, "maxItems": MOST_STEPS},
        },
        "required": ["task", "plan"],
        "additionalProperties": False,
    }
    return {
        "type": "object",
        "properties": {"tasks": {"type": "array", "items": task, "minItems": 1, "maxItems": MOST_TASKS}},
        "required": ["tasks"],
        "additionalProperties": False,
    }
