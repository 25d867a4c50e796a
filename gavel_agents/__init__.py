"""Planning agents over the Gavel environments, made by name: `gavel_agents.make("gavel-full", ...)`.

Other packages add their own under the entry-point group `gavel.agents`, or call `register`. What one needs beside is
here too: `load_model`, `load_understanding`, `load_prior`, and the verifier and repairer as `verify`.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gavel_agents.agent import Agent, AgentTrace, Privileged, TaskTrace
from gavel_env.errors import AgentNameTaken, BadOption, UnknownAgent, UnknownOption

if TYPE_CHECKING:
    from gavel_agents.beliefs.belief import Prior, load_prior
    from gavel_agents.llm import ChatModel, load_model
    from gavel_agents.understanding import Understanding, load_understanding
    from gavel_agents.verification import Verified
    from gavel_env.instructions.record import Instruction
    from gavel_env.world_model.dynamics import Profile
    from gavel_env.world_model.goals import GoalText
    from gavel_env.world_model.graph import SceneGraph
    from gavel_env.world_model.ontology import Ontology
    from gavel_env.world_model.verdict import CostFunction

__all__ = [
    "Agent",
    "AgentTrace",
    "Privileged",
    "TaskTrace",
    "agent_names",
    "load_model",
    "load_prior",
    "load_understanding",
    "make",
    "register",
    "verify",
]

AgentFactory = Callable[..., Agent]

_FACTORIES: dict[str, AgentFactory] = {}
_ALIASES = {"gavel": "gavel-full"}
_ENTRY_POINTS = "gavel.agents"
_HOME = {
    "load_model": "llm",
    "load_prior": "beliefs.belief",
    "load_understanding": "understanding",
}


def __getattr__(name: str) -> Any:
    """Load a public name from its module on first use."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


def register(name: str, factory: AgentFactory) -> None:
    """Register an agent under a name; `factory` is a class or function that returns a new agent.

    `make` passes the factory those of its options that the factory's signature names, or all of them to `**options`.

    Raises:
        AgentNameTaken: another factory has the name.
    """
    if _FACTORIES.get(name, factory) is not factory:
        raise AgentNameTaken(f"an agent named {name!r} is registered already")
    _FACTORIES[name] = factory


def agent_names() -> tuple[str, ...]:
    """Return every name that `make` knows: built in, registered, or offered by an installed package."""
    from gavel_agents.methods import METHODS

    offered = (entry.name for entry in metadata.entry_points(group=_ENTRY_POINTS))
    return tuple(sorted({"oracle", "react", *METHODS, *_FACTORIES, *offered}))


def make(
    name: str,
    *,
    understanding: Understanding | str | None = "rules",
    planner: ChatModel | str | None = "classical",
    prior: Prior | str = "choice",
    profile: Profile | str = "paper",
    ontology: Ontology | None = None,
    on_surprise: Literal["stop", "next"] = "next",
    cost: str | None = None,
    coverage_width_m: float | None = None,
    seed: int | None = None,
    model: ChatModel | None = None,
    **others: Any,
) -> Agent:
    """Return a new agent.

    Args:
        name: one of `agent_names()`, or `gavel` for `gavel-full`.
        understanding: an `Understanding` or its name: `rules`, `reference` (what the shipped records say),
            `adapter:FOLDER`, `llm` (the planner's model).
        planner: a `ChatModel` or its spec, such as `openai:MODEL@URL` or `replay:single`; default a classical planner
            in the model's place. Methods that ask none need none.
        prior: where objects of a category usually are: a `Prior` or its name, `choice`, `rsn` or `uniform`.
        profile: rules profile, `paper` or `omnigibson`.
        ontology: affordances; default the shipped ones.
        on_surprise: when something is not where it was said to be, try the "next" piece that fits, or "stop".
        cost: what orders are compared by: `paper` (J as printed), `carried` (J of rollouts that carry what they have
            searched) or `simulated` (worlds drawn from the belief); default the method's own.
        coverage_width_m: w_cov of J, metres; default 1.2 with the paper's cost, else as measured on the executor.
        seed: of the model's sampling, if it samples, and of simulated worlds.
        model: older name of `planner`.
        others: options of agents that are registered; built-in agents have no others.

    Raises:
        UnknownAgent: with the nearest names.
        UnknownOption: the agent has no such option; with the nearest names.
        BadOption: an option has a value that it cannot have, or one is missing.
        GavelError: a spec names an understanding, planner or prior that is not known or not usable.
    """
    from gavel_agents.methods import METHODS

    options: dict[str, Any] = {
        "understanding": understanding,
        "planner": planner if model is None else model,
        "prior": prior,
        "profile": profile,
        "ontology": ontology,
        "on_surprise": on_surprise,
        "cost": cost,
        "coverage_width_m": coverage_width_m,
        "seed": seed,
    }
    name = _ALIASES.get(name, name)
    if name == "react" and name not in _FACTORIES:
        from gavel_agents.react import ReActAgent

        register(name, ReActAgent)
    if name not in _FACTORIES and name not in METHODS and name != "oracle":
        for entry in metadata.entry_points(group=_ENTRY_POINTS, name=name):
            register(name, entry.load())
    if name in _FACTORIES:
        options["model"] = options["planner"]
        return _call(name, _FACTORIES[name], options, others)
    if name != "oracle" and name not in METHODS:
        raise UnknownAgent(name, agent_names())
    for option in others:
        raise UnknownOption(option, options, f"agent {name!r}")
    if name == "oracle":
        from gavel_agents.oracle import OracleAgent

        return OracleAgent()
    return _planning_agent(name, **options)


def _call(name: str, factory: AgentFactory, options: Mapping[str, Any], others: Mapping[str, Any]) -> Agent:
    """Call a registered factory with the options that its signature takes."""
    parameters = inspect.signature(factory).parameters.values()
    if any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters):
        return factory(**options, **others)
    taken = {parameter.name for parameter in parameters}
    for option in others:
        if option not in taken:
            raise UnknownOption(option, taken | set(options), f"agent {name!r}")
    return factory(**{option: value for option, value in {**options, **others}.items() if option in taken})


def _planning_agent(
    name: str,
    *,
    understanding: Understanding | str | None,
    planner: ChatModel | str | None,
    prior: Prior | str,
    profile: Profile | str,
    on_surprise: str,
    cost: str | None,
    **options: Any,
) -> Agent:
    from gavel_agents.beliefs.belief import load_prior
    from gavel_agents.llm import load_model
    from gavel_agents.methods import METHODS
    from gavel_agents.pipeline import PlanningAgent
    from gavel_env.world_model.dynamics import Profile

    config = METHODS[name].with_cost(name, cost)
    if isinstance(planner, str):
        planner = load_model(planner)
    if config.source == "classical":
        from gavel_agents.classical.planner import ClassicalPlanner

        planner = planner if isinstance(planner, ClassicalPlanner) else ClassicalPlanner()
    if config.source == "model" and planner is None:
        raise BadOption(f"agent {name!r} asks a language model: make({name!r}, planner='openai:MODEL@URL')")
    if understanding is None:
        raise BadOption(f"agent {name!r} needs an understanding, such as understanding='rules'")
    if on_surprise not in ("stop", "next"):
        raise BadOption(f"on_surprise is {on_surprise!r}; known: 'stop', 'next'")
    if profile not in [known.value for known in Profile] and not isinstance(profile, Profile):
        raise BadOption(f"profile is {profile!r}; known: {', '.join(repr(known.value) for known in Profile)}")
    return PlanningAgent(
        name,
        config,
        understanding=_understanding(understanding, planner) if isinstance(understanding, str) else understanding,
        model=planner,
        prior=load_prior(prior) if isinstance(prior, str) else prior,
        profile=Profile(profile),
        on_surprise="next" if on_surprise == "next" else "stop",
        **options,
    )


def _understanding(name: str, planner: ChatModel | None) -> Understanding:
    from gavel_agents.understanding import load_understanding
    from gavel_env.instructions.record import shipped_instructions

    return load_understanding(name, shipped_instructions() if name == "reference" else (), planner)


def verify(
    *,
    scene: str | Path | None = None,
    instruction: str | Path | Mapping[str, Any] | Instruction | None = None,
    graph: SceneGraph | str | Path | Mapping[str, Any] | None = None,
    goal: GoalText | None = None,
    plan: str | Sequence[Any],
    repair: bool = True,
    strict: bool = True,
    profile: Profile | str = "paper",
    cost: CostFunction | None = None,
) -> Verified:
    """Check a plan against an instruction in its house, or a goal on one's own graph, and repair it.

    Arguments and errors are those of `gavel_agents.verification.verify`.
    """
    from gavel_agents.verification import verify as run

    return run(
        scene=scene,
        instruction=instruction,
        graph=graph,
        goal=goal,
        plan=plan,
        repair=repair,
        strict=strict,
        profile=profile,
        cost=cost,
    )
