"""Where plans fail and where failures are removed: what remains after each stage, and what caused it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from eval.records.schema import EpisodeRecord
from gavel_agents.agent import TaskTrace, says_valid

__all__ = ["CAUSES", "STAGES", "Waterfall", "cause", "waterfall"]

STAGES: Mapping[str, str] = {
    "proposal": "the model's first proposal is invalid, or the instruction was not understood",
    "repair": "the same after graph-derived repair of the first proposal",
    "feedback": "the same of the last proposal, after complaints",
    "execution": "the episode was not solved",
}

CAUSES: Mapping[str, str] = {
    "understanding": "what was understood is not what the record says, or nothing was",
    "proposal": "after all attempts the plan is still invalid",
    "repair": "the plan was accepted; what repair put in failed, or a task that it changed was left unmet or unsafe",
    "execution": "an accepted plan failed as the model wrote it: the house was not as believed",
    "error": "the agent or its model raised, or the episode was cut off",
}


class Waterfall(NamedTuple):
    """Failures of one contestant.

    Attributes:
        episodes: recorded.
        remaining: stage -> episodes that are not right after it, in the order of `STAGES`.
        causes: cause -> failed episodes, in the order of `CAUSES`.
    """

    episodes: int
    remaining: Mapping[str, int]
    causes: Mapping[str, int]


def waterfall(records: Iterable[EpisodeRecord]) -> Waterfall:
    """Return what remains after each stage, and why episodes failed in the end."""
    remaining: Counter[str] = Counter()
    causes: Counter[str] = Counter()
    episodes = 0
    for record in records:
        episodes += 1
        first, last = _attempts(record)
        remaining["proposal"] += not _right(first, "proposed_verdict")
        remaining["repair"] += not _right(first, "verdict")
        remaining["feedback"] += not _right(last, "verdict")
        remaining["execution"] += not record.success
        if not record.success:
            causes[cause(record)] += 1
    return Waterfall(episodes, {stage: remaining[stage] for stage in STAGES}, {name: causes[name] for name in CAUSES})


def cause(record: EpisodeRecord) -> str:
    """Return the stage that caused a failed episode, one of `CAUSES`."""
    if record.outcome == "refused" or record.misread:
        return "understanding"
    _, last = _attempts(record)
    if record.outcome in ("error", "timeout", "rejected") or not last:
        return "error"
    if not _right(last, "verdict"):
        return "proposal"
    if record.outcome == "violation" and record.steps:
        written = {_plain(action) for task in last for action in task.proposed}
        return "execution" if _plain(record.steps[-1].action) in written else "repair"
    wrong = [task for task, met in zip(last, record.tasks_met, strict=False) if not met] or last
    return "repair" if any(task.edits for task in wrong) else "execution"


def _plain(action: str) -> str:
    """Return an action without the room and the number of what it names: plans name kinds, the world instances."""
    return re.sub(r"(@\w+|_\d+)(?=\))", "", action)


def _attempts(record: EpisodeRecord) -> tuple[Sequence[TaskTrace], Sequence[TaskTrace]]:
    """Return the tasks as the first and as the last attempt left them."""
    trace = record.trace
    return (trace.earlier[0] if trace.earlier else trace.tasks), trace.tasks


def _right(tasks: Sequence[TaskTrace], verdict: str) -> bool:
    return bool(tasks) and all(says_valid(getattr(task, verdict) or task.verdict) for task in tasks)
