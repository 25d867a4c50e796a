"""Planning agents over the Gavel environments, made by name: `gavel_agents.make("gavel-full", ...)`.

Other packages add their own under the entry-point group `gavel.agents`, or call `register`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import metadata
from typing import Any

from gavel_agents.agent import Agent, AgentTrace, Privileged, TaskTrace
from gavel_env.errors import UnknownAgent

__all__ = ["Agent", "AgentTrace", "Privileged", "TaskTrace", "agent_names", "make", "register", "verify"]

AgentFactory = Callable[..., Agent]

_FACTORIES: dict[str, AgentFactory] = {}
_ALIASES = {"gavel": "gavel-full"}
_ENTRY_POINTS = "gavel.agents"


def register(name: str, factory: AgentFactory) -> None:
    """Register an agent under a name; `factory` takes the keyword arguments of `make`.

    Raises:
        ValueError: the name is taken by another factory.
    """
    if _FACTORIES.get(name, factory) is not factory:
        raise ValueError(f"an agent named {name!r} is registered already")
    _FACTORIES[name] = factory


def agent_names() -> tuple[str, ...]:
    """Return every name that `make` knows: built in, registered, or offered by an installed package."""
    from gavel_agents.methods import METHODS

    offered = (entry.name for entry in metadata.entry_points(group=_ENTRY_POINTS))
    return tuple(sorted({"oracle", *METHODS, *_FACTORIES, *offered}))


def make(name: str, **options: Any) -> Agent:
    """Return a new agent.

    Args:
        name: one of `agent_names()`, or `gavel` for `gavel-full`.
        options: for the built-in methods: `understanding` (an `Understanding`), `model` (a `ChatModel`), `prior`
            ("choice", "rsn", "uniform" or a `Prior`), `profile` (a rules `Profile`), `on_surprise` ("stop" or "next"),
            `coverage_width_m` (w_cov of the cost model; default: as measured on the executor), `seed` (of the model's
            sampling).
            Agents take what they need and must ignore what they don't.

    Raises:
        UnknownAgent: with the nearest names.
    """
    from gavel_agents.methods import METHODS

    name = _ALIASES.get(name, name)
    if name in _FACTORIES:
        return _FACTORIES[name](**options)
    if name == "oracle":
        from gavel_agents.oracle import OracleAgent

        return OracleAgent()
    if name in METHODS:
        return _planning_agent(name, **options)
    for entry in metadata.entry_points(group=_ENTRY_POINTS, name=name):
        register(name, entry.load())
        return _FACTORIES[name](**options)
    raise UnknownAgent(name, agent_names())


def _planning_agent(name: str, **options: Any) -> Agent:
    from gavel_agents.beliefs.belief import load_prior
    from gavel_agents.methods import METHODS
    from gavel_agents.ordering.cost import COVERAGE_WIDTH_M
    from gavel_agents.pipeline import PlanningAgent
    from gavel_env.world_model.dynamics import Profile

    config = METHODS[name]
    model = options.get("model")
    if config.source == "model" and model is None:
        raise ValueError(
            f"agent {name!r} needs a language model: make({name!r}, model=load_model('scripted:FILE.jsonl'))"
        )
    if options.get("understanding") is None:
        raise ValueError(
            f"agent {name!r} needs an understanding: make({name!r}, understanding=ReferenceUnderstanding(...))"
        )
    prior = options.get("prior", "choice")
    return PlanningAgent(
        name,
        config,
        understanding=options["understanding"],
        model=model,
        prior=load_prior(prior) if isinstance(prior, str) else prior,
        profile=options.get("profile", Profile.PAPER),
        ontology=options.get("ontology"),
        on_surprise=options.get("on_surprise", "stop"),
        coverage_width_m=options.get("coverage_width_m", COVERAGE_WIDTH_M),
        seed=options.get("seed"),
    )


def verify(*args: Any, **kwargs: Any) -> Any:
    """Check (and repair) a plan against a scene and an instruction; see `gavel_agents.verification.verify`."""
    from gavel_agents.verification import verify as run

    return run(*args, **kwargs)
