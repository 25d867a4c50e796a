"""Prompts with good plans, and with a better and a worse plan: what verification and repair give for nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from eval.records.conversations import Call, Conversations
from eval.records.schema import EpisodeRecord
from gavel_agents.agent import TaskTrace
from gavel_env.world_model.actions import parse_action

__all__ = ["preference_pairs", "tuning_pairs"]

Row = dict[str, Any]


class _Attempt(NamedTuple):
    """What the planner was asked in one attempt, and what came of it."""

    number: int
    call: Call
    tasks: Sequence[TaskTrace]

    @property
    def proposal_refused(self) -> bool:
        return any(task.proposed_verdict not in ("", "valid") for task in self.tasks)

    @property
    def accepted(self) -> bool:
        return all(task.verdict == "valid" for task in self.tasks)


def tuning_pairs(records: Sequence[EpisodeRecord], conversations: Conversations) -> Iterator[Row]:
    """Yield (prompt, plan) once each: what a planner was asked first, and the plan that then succeeded in the world.

    The plan is the repaired one, or that of a later attempt; it is written as the prompt asks.

    Args:
        records: episodes; those that were not solved give nothing.
        conversations: of the same runs.
    """
    seen = set()
    for record in records:
        attempts = _attempts(record, conversations)
        if not record.success or not attempts or not attempts[-1].accepted:
            continue
        plan = _written(attempts[-1].tasks, "plan")
        key = (attempts[0].call.messages, plan)
        if key not in seen:
            seen.add(key)
            yield {"prompt": _turns(attempts[0].call), "completion": _answer(plan), **_about(record)}


def preference_pairs(records: Sequence[EpisodeRecord], conversations: Conversations) -> Iterator[Row]:
    """Yield (prompt, chosen, rejected) once each: a refused proposal beside what repair made of it, or else beside the
    plan that was accepted in the end.

    Args:
        records: episodes; those whose plans never became valid give nothing.
        conversations: of the same runs.
    """  # noqa: D205
    seen = set()
    for record in records:
        attempts = _attempts(record, conversations)
        if not attempts or not attempts[-1].accepted:
            continue
        for attempt in attempts:
            if not attempt.proposal_refused or not any(task.proposed for task in attempt.tasks):
                continue
            better = attempt if attempt.accepted else attempts[-1]
            chosen, rejected = _written(better.tasks, "plan"), _written(attempt.tasks, "proposed")
            key = (attempt.call.messages, chosen, rejected)
            if chosen == rejected or key in seen:
                continue
            seen.add(key)
            yield {
                "prompt": _turns(attempt.call),
                "chosen": _answer(chosen),
                "rejected": _answer(rejected),
                "chosen_by": "repair" if better is attempt else "later attempt",
                "refused_because": [t.proposed_verdict for t in attempt.tasks if t.proposed_verdict != "valid"],
                "edits": [edit for task in attempt.tasks for edit in task.edits],
                "attempt": attempt.number,
                **_about(record),
            }


def _attempts(record: EpisodeRecord, conversations: Conversations) -> list[_Attempt]:
    """Return the attempts of a plan with their calls: the last calls of a record, behind those of understanding."""
    tasks = [*record.trace.earlier, record.trace.tasks]
    if len(record.calls) < len(tasks) or not record.trace.tasks:
        return []
    calls = [conversations.get(call) for call in record.calls[len(record.calls) - len(tasks) :]]
    found = [_Attempt(n, c, t) for n, (c, t) in enumerate(zip(calls, tasks, strict=True)) if c is not None]
    return found if len(found) == len(tasks) else []


def _written(tasks: Sequence[TaskTrace], which: str) -> str:
    lines: list[str] = []
    for number, task in enumerate(tasks, start=1):
        lines.append(f"Task {number}:")
        for text in getattr(task, which):
            action = parse_action(text)
            lines.append(f"{action.primitive.name} {action.target or ''}".strip())
    return "\n".join(lines)


def _turns(call: Call) -> list[dict[str, str]]:
    return [{"role": message.role, "content": message.content} for message in call.messages]


def _answer(text: str) -> list[dict[str, str]]:
    return [{"role": "assistant", "content": text}]


def _about(record: EpisodeRecord) -> Row:
    return {
        "instruction_id": record.instruction,
        "kind": record.kind,
        "scene": record.scene,
        "agent": record.contestant.agent,
        "model": record.model,
        "seed": record.seed,
        "success": record.success,
    }
