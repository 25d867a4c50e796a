"""Understandings by name, for command lines and records."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from gavel_agents.classical.planner import ClassicalPlanner
from gavel_agents.llm import ChatModel, load_model
from gavel_agents.understanding.interface import Understanding
from gavel_agents.understanding.learned.reader import load_reader
from gavel_agents.understanding.model import ModelUnderstanding
from gavel_agents.understanding.reference import ReferenceUnderstanding
from gavel_agents.understanding.second_reader import TwoReaders
from gavel_env.errors import DataError, UnknownUnderstanding, nearest_names
from gavel_env.instructions.record import Instruction

__all__ = ["UNDERSTANDINGS", "UnknownUnderstanding", "load_understanding"]

UNDERSTANDINGS = ("reference", "rules", "adapter:FOLDER", "llm")
"""Names; the folder is of an adapter that was trained with `python -m gavel_agents.understanding.train`."""

_MOST_TOKENS = 500  # of an answer; five tasks take about 250


def load_understanding(
    name: str, instructions: Iterable[Instruction] = (), model: ChatModel | None = None
) -> Understanding:
    """Return an understanding by name.

    Args:
        name: one of `UNDERSTANDINGS`.
        instructions: of the run; only the reference looks into them.
        model: the chat model that `llm` asks.

    Raises:
        UnknownUnderstanding: with the alternatives, or what is missing.
        BadPlannerSpec: packages of an adapter are missing.
        ModelError: an adapter or its base cannot be loaded.
        DataError: a folder holds no adapter.
    """
    kind, _, folder = name.partition(":")
    if name == "reference":
        return ReferenceUnderstanding(instructions)
    if name == "rules":
        return TwoReaders(load_reader())
    if kind == "adapter" and folder:
        return _adapter(name, Path(folder))
    if name == "llm":
        if model is None:
            raise UnknownUnderstanding("understanding 'llm' asks the planner's model, and there is none: add --planner")
        if isinstance(model, ClassicalPlanner):
            raise UnknownUnderstanding("understanding 'llm' asks a language model; the classical planner reads no text")
        return ModelUnderstanding(name, model, trained=False)
    near = nearest_names(name, UNDERSTANDINGS) or UNDERSTANDINGS
    raise UnknownUnderstanding(f"unknown understanding {name!r}; known: {', '.join(near)}")


@cache
def _adapter(name: str, folder: Path) -> ModelUnderstanding:
    """Return the understanding of an adapter, loaded once a process; its base is the one it was trained on."""
    try:
        base = json.loads((folder / "adapter_config.json").read_bytes())["base_model_name_or_path"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{folder} holds no adapter_config.json that names a base model: {error}") from error
    model = load_model(f"hf:{base}?adapter={folder}&batch=16&max_tokens={_MOST_TOKENS}")
    return ModelUnderstanding(name, model, trained=True)
