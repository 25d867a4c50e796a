"""Task understanding: Decompose, ExtractObjects and ParseGoal of Algorithm 1, behind one interface.

Every method of the comparison shares the same implementation, so that what is compared is planning.
"""

from gavel_agents.understanding.interface import (
    Abstention,
    BatchedUnderstanding,
    Decomposition,
    Question,
    Rooms,
    TaskUnderstanding,
    Understanding,
)
from gavel_agents.understanding.model import ModelUnderstanding
from gavel_agents.understanding.reference import ReferenceUnderstanding
from gavel_agents.understanding.rules import RulesUnderstanding
from gavel_agents.understanding.table import UNDERSTANDINGS, UnknownUnderstanding, load_understanding

__all__ = [
    "UNDERSTANDINGS",
    "Abstention",
    "BatchedUnderstanding",
    "Decomposition",
    "ModelUnderstanding",
    "Question",
    "ReferenceUnderstanding",
    "Rooms",
    "RulesUnderstanding",
    "TaskUnderstanding",
    "Understanding",
    "UnknownUnderstanding",
    "load_understanding",
]
