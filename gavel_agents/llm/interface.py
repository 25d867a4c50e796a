"""The interface of chat models and the table of adapters."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, Literal, Protocol, runtime_checkable
from urllib.parse import parse_qsl

import msgspec

from gavel_env.errors import BadPlannerSpec, nearest_names
from gavel_env.instructions.lookup import About
from gavel_env.instructions.record import Instruction
from gavel_env.world_model.dynamics import Profile
from gavel_env.world_model.goals import Goal
from gavel_env.world_model.graph import SceneGraph

__all__ = [
    "AnswersFromRecords",
    "BadPlannerSpec",
    "ChatModel",
    "Completion",
    "Message",
    "PlanningProblem",
    "Prompt",
    "decoding_of",
    "finish_reason",
    "load_model",
    "model_kinds",
    "spec_options",
    "tell",
]


class Message(msgspec.Struct, frozen=True):
    """One chat turn."""

    role: Literal["system", "user", "assistant"]
    content: str


class PlanningProblem(msgspec.Struct, frozen=True):
    """What a prompt for plans is about, for planners that are not language models.

    Attributes:
        graph: the believed graph.
        goals: one per task.
        profile: rules profile.
    """

    graph: SceneGraph
    goals: tuple[Goal, ...]
    profile: Profile = Profile.PAPER


class Prompt(msgspec.Struct, frozen=True):
    """A conversation to be continued.

    Attributes:
        messages: the turns; the leading ones that never change between instructions come first.
        about: the instruction's text and the rooms; models that answer from files look it up.
        attempt: 0 for the first proposal, then 1, 2, ... for retries.
        schema: JSON schema to which backends that can hold the answer; others are told by the turns alone.
        seed: of the sampling; it matters only where something is sampled. None = the backend's own.
        temperature: instead of the model's own; backends that take none ignore it.
        problem: what the turns say of what is believed and understood, as it is; never shown to a model.
    """

    messages: tuple[Message, ...]
    about: About = About("")
    attempt: int = 0
    schema: Mapping[str, Any] | None = None
    seed: int | None = None
    temperature: float | None = None
    problem: PlanningProblem | None = None


class Completion(msgspec.Struct, frozen=True):
    """What a model answered, and what it took.

    Attributes:
        text: the answer.
        prompt_tokens, completion_tokens: as the backend counted them.
        seconds: what it took.
        finish_reason: how the answer ended: "stop", "length" (cut at the most tokens), "filter" (cut by a content
            filter), or empty where the backend does not say.
    """

    text: str
    prompt_tokens: int = 0
    completion_tokens: int = 0
    seconds: float = 0.0
    finish_reason: str = ""

    @property
    def cut(self) -> bool:
        """Whether the backend says that the answer is not whole."""
        return self.finish_reason in ("length", "filter")


_FINISH_REASONS = {
    "stop": "stop",
    "end_turn": "stop",
    "stop_sequence": "stop",
    "length": "length",
    "max_tokens": "length",
    "model_context_window_exceeded": "length",
    "content_filter": "filter",
    "refusal": "filter",
}


def finish_reason(said: object) -> str:
    """Return how an answer ended from what a backend calls it; empty for what is not known."""
    return _FINISH_REASONS.get(said, "") if isinstance(said, str) else ""


class ChatModel(Protocol):
    """A language model; `name` and `decoding` go into every record."""

    @property
    def name(self) -> str:
        """The model's name."""
        ...

    @property
    def decoding(self) -> Mapping[str, str | float | int]:
        """What it decodes with."""
        ...

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order."""
        ...


def decoding_of(decoding: Mapping[str, str | float | int], prompt: Prompt) -> dict[str, str | float | int]:
    """Return the decoding parameters of one call: a model's, with what the prompt asks for.

    The prompt's seed is among them unless decoding is greedy. With model and conversation they say which call it is:
    calls that agree in all of these share a completion.

    Args:
        decoding: of the model.
        prompt: what it is asked.
    """
    found = dict(decoding)
    if prompt.temperature is not None and "temperature" in found:
        found["temperature"] = prompt.temperature
    if prompt.seed is not None and found.get("temperature") != 0:
        found["seed"] = prompt.seed
    return found


@runtime_checkable
class AnswersFromRecords(Protocol):
    """A model that looks instructions up; whoever runs it tells it which records there are."""

    def know(self, instruction: Instruction) -> None:
        """Take in a record that may be asked about."""
        ...


def tell(model: object, instruction: Instruction) -> None:
    """Tell a model that looks instructions up about a record; other models have no use for it."""
    if isinstance(model, AnswersFromRecords):
        model.know(instruction)


# kind -> (module, class); the module is imported only when the kind is asked for.
_KINDS: dict[str, tuple[str, str]] = {
    "anthropic": ("gavel_agents.llm.anthropic", "AnthropicModel"),
    "classical": ("gavel_agents.classical.planner", "ClassicalPlanner"),
    "gguf": ("gavel_agents.llm.gguf", "GgufModel"),
    "hf": ("gavel_agents.llm.hf", "HfModel"),
    "openai": ("gavel_agents.llm.openai", "OpenAIModel"),
    "reference": ("gavel_agents.llm.reference", "ReferencePlans"),
    "replay": ("gavel_agents.llm.replay", "ReplayModel"),
    "simulated": ("gavel_agents.llm.simulated", "SimulatedModel"),
    "scripted": ("gavel_agents.llm.scripted", "ScriptedModel"),
}


def model_kinds() -> tuple[str, ...]:
    """Return the known kinds of planner specs."""
    return tuple(sorted(_KINDS))


def load_model(spec: str) -> ChatModel:
    """Return the model of a spec `kind:argument`; `classical` alone needs no argument.

    Raises:
        BadPlannerSpec: unknown kind, or no argument; names the alternatives.
    """
    kind, _, argument = spec.partition(":")
    if kind not in _KINDS:
        near = nearest_names(kind, _KINDS)
        hint = f"did you mean {near[0]!r}?" if near else f"kinds: {', '.join(model_kinds())}"
        raise BadPlannerSpec(f"unknown planner kind {kind!r} in {spec!r}; {hint}")
    if kind != "classical" and not argument:
        raise BadPlannerSpec(f"planner spec {spec!r} needs the form {kind}:ARGUMENT")
    module, name = _KINDS[kind]
    model: ChatModel = getattr(import_module(module), name)(argument)
    return model


def spec_options(
    kind: str,
    argument: str,
    *,
    numbers: Sequence[str] = (),
    decimals: Sequence[str] = (),
    flags: Sequence[str] = (),
    words: Mapping[str, Sequence[str]] | None = None,
) -> tuple[str, dict[str, str]]:
    """Read `SOURCE?option=value&flag`; return source and options.

    Args:
        kind: of the planner, for errors.
        argument: what stands behind the kind.
        numbers: options that take a whole number above 0.
        decimals: options that take a number of 0 or more, such as a temperature.
        flags: options without a value.
        words: other options -> the values that they take, or none for any.

    Raises:
        BadPlannerSpec: an option or value that is not known.
    """
    source, _, query = argument.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    words = words or {}
    for name, value in options.items():
        if name not in (*numbers, *decimals, *flags, *words):
            known = ", ".join((*numbers, *decimals, *flags, *words))
            raise BadPlannerSpec(f"unknown option {name!r} in {kind}:{argument}; known: {known}")
        if name in numbers and not (value.isdecimal() and int(value) > 0):
            raise BadPlannerSpec(f"{kind}:{argument}: {name} is {value!r}, not a whole number above 0")
        if name in decimals and not re.fullmatch(r"\d+(\.\d+)?", value):
            raise BadPlannerSpec(f"{kind}:{argument}: {name} is {value!r}, not a number of 0 or more")
        if name in flags and value:
            raise BadPlannerSpec(f"{kind}:{argument}: {name} takes no value")
        if name in words and words[name] and value not in words[name]:
            raise BadPlannerSpec(f"{kind}:{argument}: {name} is {value!r}; known: {', '.join(words[name])}")
    return source, options
