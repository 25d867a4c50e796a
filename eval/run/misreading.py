"""What was understood of an instruction other than its record says."""

from __future__ import annotations

from collections.abc import Iterable

from gavel_agents.agent import AgentTrace
from gavel_agents.understanding import ReferenceUnderstanding
from gavel_env.instructions.record import Instruction

__all__ = ["misread"]


def misread(trace: AgentTrace, instruction: Instruction) -> tuple[str, ...]:
    """Return the differences of goals and stated locations over all tasks, such as `goal: missing cooked(pie)`.

    Args:
        trace: of an agent that says what it understood.
        instruction: with its record's goals.
    """
    meant = ReferenceUnderstanding([instruction]).understand(instruction.text).tasks
    return (
        *_differences("goal", (g for t in trace.tasks for g in t.goal), (g for t in meant for g in t.goal.text())),
        *_differences(
            "place", (r for t in trace.tasks for r in t.relations), (str(r) for t in meant for r in t.relations)
        ),
    )


def _differences(what: str, understood: Iterable[str], meant: Iterable[str]) -> list[str]:
    found, right = set(understood), set(meant)
    missing = [f"{what}: missing {text}" for text in sorted(right - found)]
    return missing + [f"{what}: invented {text}" for text in sorted(found - right)]
