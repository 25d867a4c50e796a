"""Language models behind one small interface, chosen by a spec string such as `scripted:FILE.jsonl`."""

from gavel_agents.llm.interface import (
    AnswersFromRecords,
    BadPlannerSpec,
    ChatModel,
    Completion,
    Message,
    PlanningProblem,
    Prompt,
    load_model,
    model_kinds,
    tell,
)

__all__ = [
    "AnswersFromRecords",
    "BadPlannerSpec",
    "ChatModel",
    "Completion",
    "Message",
    "PlanningProblem",
    "Prompt",
    "load_model",
    "model_kinds",
    "tell",
]
