"""Reading plans out of model output: pi_i <- Parse(LLM(p)), tolerant and typed.

Code fences, thinking blocks, JSON of several shapes, lines, numbering, bullets, several tasks in one answer: what can
be read as an action is read, and what was left out is listed with its reason. A malformed answer is a result, never an
exception; its first `MOST_CHARACTERS` are read, and `MOST_LINES` of their lines, in time that grows with their number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import msgspec

from gavel_agents.proposing.parse_line import calls_in, from_parts, read_line, without_bullet
from gavel_agents.proposing.resolve import resolve
from gavel_agents.proposing.thinking import without_thinking
from gavel_agents.proposing.values import values_in
from gavel_env.data import sayable
from gavel_env.world_model.actions import Action
from gavel_env.world_model.graph import SceneGraph
from gavel_env.world_model.verdict import Plan

__all__ = ["Dropped", "ParsedPlans", "parse_plans"]


class Dropped(msgspec.Struct, frozen=True):
    """Text that was left out.

    Attributes:
        line: 1-based line of the answer; 0 for an entry of a JSON answer.
        text: what stood there, at most 120 characters.
        reason: why it is not an action.
        task: 1-based index of the plan in which it stood.
    """

    line: int
    text: str
    reason: str
    task: int = 1


class ParsedPlans(msgspec.Struct, frozen=True):
    """What an answer says.

    Attributes:
        plans: one plan per task, in the order of the tasks; missing ones are empty.
        dropped: what was left out.
        problem: why no plan could be read, or empty.
        is_json: whether they were read from JSON rather than from lines.
    """

    plans: tuple[Plan, ...]
    dropped: tuple[Dropped, ...] = ()
    problem: str = ""
    is_json: bool = False

    @property
    def plan(self) -> Plan:
        """All plans, one after the other."""
        return tuple(action for plan in self.plans for action in plan)


MOST_CHARACTERS = 60_000
"""Of an answer, its thinking not counted. A plan has a few hundred."""

MOST_LINES = 300
"""Lines of an answer that are not actions; the rest is left out as one."""

_FENCE = re.compile(r"^\s*(?:```|~~~)")
_HEADING = re.compile(
    r"^\W*+(?:(?:plan|actions?|steps?)\s++for\s++)?(?:sub)?[\s_-]*+tasks?[\s_#-]*+(\d{1,6})\b\W*+", re.IGNORECASE
)

_NUMBER = re.compile(r"(?<!\d)\d{1,6}(?!\d)")
_VERB_KEYS = ("action", "primitive", "verb", "name", "type", "act", "skill", "function", "command", "operation")
_TARGET_KEYS = (
    "target",
    "object",
    "obj",
    "argument",
    "arguments",
    "args",
    "arg",
    "params",
    "parameters",
    "location",
    "item",
    "to",
)
_PLAN_KEYS = ("plan", "actions", "steps", "action_sequence", "sequence", "action_plan")
_TASKS_KEYS = ("tasks", "plans", "subtasks", "task_plans")


def parse_plans(text: str, graph: SceneGraph | None = None, tasks: int | None = None) -> ParsedPlans:
    """Read the plans in a model's answer.

    Args:
        text: the raw answer.
        graph: resolve names against it (`names.resolve`).
        tasks: number of tasks asked for; plans beyond it are appended to the last one, missing ones are empty.
    """
    body, thinking = without_thinking(sayable(text))
    if thinking and not body.strip():
        return _finish({}, [], tasks, "the answer ends within its thinking")
    if not body.strip():
        return _finish({}, [], tasks, "the answer is empty")
    dropped: list[Dropped] = []
    plans: dict[int, list[Action]] = {}
    beyond = len(body) - MOST_CHARACTERS
    body = body[:MOST_CHARACTERS]
    data = _find_json(body)
    if data is not None:
        _read_tasks(data, plans, dropped)
    is_json = any(plans.values())
    if not is_json:
        plans, dropped = {}, []
        _read_lines(body, plans, dropped)
    if beyond > 0:
        dropped.append(Dropped(0, f"… {beyond} characters", f"only the first {MOST_CHARACTERS} are read"))
    problem = "" if any(plans.values()) else "no action in the answer"
    parsed = msgspec.structs.replace(_finish(plans, dropped, tasks, problem), is_json=is_json)
    if graph is None:
        return parsed
    return msgspec.structs.replace(parsed, plans=tuple(resolve(graph, plan) for plan in parsed.plans))


def _finish(plans: dict[int, list[Action]], dropped: list[Dropped], tasks: int | None, problem: str) -> ParsedPlans:
    """Order plans by task number and make their count what was asked for."""
    if tasks is None or not all(1 <= number <= tasks for number in plans):
        order = sorted(plans)
    else:
        order = list(range(1, tasks + 1))
    ordered = [plans.get(number, []) for number in order]
    places = {number: place for place, number in enumerate(order, start=1)}
    dropped = [msgspec.structs.replace(d, task=min(places.get(d.task, 1), tasks or len(order) or 1)) for d in dropped]
    if tasks is not None:
        if len(ordered) > tasks:
            head, rest = ordered[: tasks - 1], ordered[tasks - 1 :]
            ordered = [*head, [action for plan in rest for action in plan]]
        ordered += [[]] * (tasks - len(ordered))
    return ParsedPlans(tuple(map(tuple, ordered)), tuple(dropped), problem)


# --- lines ---------------------------------------------------------------------------------------------------------


def _read_lines(body: str, plans: dict[int, list[Action]], dropped: list[Dropped]) -> None:
    task = 1
    for number, line in enumerate(body.splitlines(), start=1):
        if len(dropped) >= MOST_LINES:
            dropped.append(Dropped(number, line.strip()[:120], f"more than {MOST_LINES} lines that are not actions"))
            return
        if _FENCE.match(line):
            continue
        rest = line.strip().strip("`*_ \t")
        heading = _HEADING.match(rest)
        if heading:
            task = int(heading.group(1))
            plans.setdefault(task, [])
            calls = list(calls_in(rest[heading.end() :]))
            plans[task] += calls
            continue
        rest = without_bullet(rest)
        if not rest:
            continue
        actions, reason = read_line(rest)
        if actions:
            plans.setdefault(task, []).extend(actions)
        if reason:
            dropped.append(Dropped(number, line.strip()[:120], reason, task))


# --- JSON ----------------------------------------------------------------------------------------------------------


def _find_json(body: str) -> Any:
    """Return the JSON value in an answer: the longest; None if there is none."""
    found = values_in(body)
    best = max(found, key=lambda entry: entry[1])[0] if found else None
    plans = [value for value, _ in found if isinstance(value, list | dict) and value]
    # One block per task.
    if (
        len(plans) > 1
        and len({type(v) for v in plans}) == 1
        and not all(isinstance(v, dict) and _verb(v) for v in plans)
    ):
        return plans if isinstance(plans[0], list) else best
    return plans if len(plans) > 1 and all(isinstance(v, dict) for v in plans) else best


def _read_tasks(data: Any, plans: dict[int, list[Action]], dropped: list[Dropped]) -> None:
    """Sort a JSON answer into tasks."""
    if isinstance(data, dict):
        for key in (*_PLAN_KEYS, *_TASKS_KEYS):
            if isinstance(data.get(key), list | dict):
                _read_tasks(data[key], plans, dropped)
                return
        if _verb(data) is None:
            for position, (key, value) in enumerate(data.items(), start=1):
                number = _NUMBER.search(str(key))
                if isinstance(value, list | dict):
                    task = int(number.group()) if number else position
                    _read_steps(_unwrapped(value), task, plans, dropped)
                else:
                    dropped.append(Dropped(0, f"{key}: {value}"[:120], "neither a plan nor a list of actions"))
            return
    if isinstance(data, list) and data and all(_is_plan(entry) for entry in data):
        for position, entry in enumerate(data, start=1):
            _read_steps(_unwrapped(entry), position, plans, dropped)
        return
    alone = not isinstance(data, list) or (len(data) == 2 and isinstance(data[0], str) and data[1] is None)
    _read_steps([data] if alone else data, 1, plans, dropped)


def _is_plan(entry: Any) -> bool:
    """Return whether an entry of a list is a plan itself: a list but not a [verb, target] pair, or with a plan key."""
    if isinstance(entry, dict):
        return any(isinstance(entry.get(key), list) for key in _PLAN_KEYS)
    if not isinstance(entry, list):
        return False
    return _of_pair(entry) is None


def _of_pair(entry: list[Any]) -> Action | None:
    """Return the action of a list `[verb, target, …]`, whose targets may be null; None if it is not one."""
    if not entry or not isinstance(entry[0], str) or not all(part is None or isinstance(part, str) for part in entry):
        return None
    return from_parts(entry[0], [part for part in entry[1:] if part])


def _unwrapped(entry: Any) -> list[Any]:
    if isinstance(entry, dict):
        for key in _PLAN_KEYS:
            if isinstance(entry.get(key), list):
                return list(entry[key])
        return [entry]
    return list(entry) if isinstance(entry, list) else [entry]


def _verb(entry: dict[Any, Any]) -> str | None:
    found = next((entry[key] for key in _VERB_KEYS if isinstance(entry.get(key), str)), None)
    return found if found is None else str(found)


def _read_steps(steps: Sequence[Any], task: int, plans: dict[int, list[Action]], dropped: list[Dropped]) -> None:
    plan = plans.setdefault(task, [])
    for step in steps:
        actions, reason = _read_step(step)
        plan.extend(actions)
        if reason:
            dropped.append(Dropped(0, str(step)[:120], reason, task))


def _read_step(step: Any) -> tuple[list[Action], str]:
    """Return the actions of one JSON entry, and why it has none."""
    if isinstance(step, str):
        return read_line(without_bullet(step))
    if isinstance(step, list) and step and isinstance(step[0], str):
        action = _of_pair(step)
        return ([action], "") if action is not None else ([], f"no primitive, or no target, in {step[0]!r}")
    if isinstance(step, dict):
        verb = _verb(step)
        if verb is None and len(step) == 1:
            (key, value) = next(iter(step.items()))
            action = from_parts(str(key), _names(value))
            return ([action], "") if action is not None else ([], f"no primitive {key!r}")
        if verb is not None:
            names = [name for key in _TARGET_KEYS for name in _names(step.get(key))]
            if not names and (calls := read_line(verb)[0]):
                return calls, ""
            action = from_parts(verb, names)
            return ([action], "") if action is not None else ([], f"no primitive, or no target, in {verb!r}")
    return [], "not an action"


def _names(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    if isinstance(value, dict):
        return [name for part in value.values() for name in _names(part)]
    return [name for part in value for name in _names(part)] if isinstance(value, list) else []
