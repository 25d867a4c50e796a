"""The rules understanding: a compact grammar of household English over the ontology's vocabulary, without any model."""

from gavel_agents.understanding.rules.reading import RulesUnderstanding

__all__ = ["RulesUnderstanding"]
