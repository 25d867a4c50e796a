"""Which agents take part, with which planner, understanding and prior."""

from __future__ import annotations

from collections.abc import Sequence

import gavel_agents
from eval.records.schema import Contestant
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import ENVIRONMENTS
from eval.run.runner import contestant
from gavel_agents.llm import BadPlannerSpec
from gavel_agents.llm.replay import ShippedRecording, shipped_recordings
from gavel_agents.methods import COSTS, METHODS
from gavel_env.errors import BadOption, UnknownAgent

__all__ = ["ORDER", "choose", "compared_by_default", "default_agents", "default_planners", "needs_planner"]

ORDER = ("llm-only", "sayplan", "llm+p", "epog", "gavel-basic", "gavel-map", "gavel-static", "gavel-full", "gavel-plus",
         "oracle")  # fmt: skip
"""The agents of a run that names none, in the order of the paper's tables; `react` runs where it is named."""

TABLES_PLANNER = "classical:search"
"""The classical planner of tables where none is named: quick, and the same whatever is installed."""

_ALIASES = {"gavel": "gavel-full"}


def needs_planner(agent: str) -> bool:
    """Return whether a built-in agent asks a language model; agents of others are given one if there is one."""
    return agent == "react" or (agent in METHODS and METHODS[agent].source == "model")


def default_agents(planners: Sequence[str]) -> tuple[str, ...]:
    """Return the agents of a run that names none: all of `ORDER` with a planner, else those that need none."""
    return tuple(agent for agent in ORDER if planners or not needs_planner(agent))


def default_planners(kinds: Sequence[str], understanding: str = "reference") -> tuple[str, ...]:
    """Return, for each kind of instructions, a shipped recording of a real model if there is one, else reference plans.

    Both, where the recording is of a sample. With reference plans in a model's place (no model at all) only what comes
    after the plan is compared: belief, search and order. Where the understanding is what is compared, neither will do:
    they answer by the instruction's id, whatever was understood. The classical planner plans for what was understood.
    """
    if understanding != "reference":
        return () if understanding == "llm" else (TABLES_PLANNER,)
    planners: list[str] = []
    for kind in kinds:
        recording = shipped_recordings().get(kind)
        if recording is not None:
            planners.append(f"{kind}=replay:{kind}")
        if recording is None or recording.sample is not None:
            planners.append(f"{kind}=reference:{kind}")
    return tuple(planners)


def compared_by_default(contestant: Contestant) -> bool:
    """Return whether a contestant says something without being asked for.

    With a recording, those whose every prompt is in it; with reference plans, those that order.
    """
    recording = _shipped(contestant.planner)
    if recording is not None:
        return contestant.agent in recording.agents
    config = METHODS.get(contestant.agent)
    return contestant.planner_kind != "reference" or config is None or config.order != "written"


def _shipped(planner: str) -> ShippedRecording | None:
    """Return the shipped recording that a planner's spec names, or None."""
    kind, _, name = planner.partition(":")
    return shipped_recordings().get(name) if kind == "replay" else None


def choose(
    agents: Sequence[str],
    settings: EnvironmentSettings,
    *,
    planners: Sequence[str] = (),
    given: Sequence[str] | None = None,
    understanding: str = "reference",
    prior: str = "choice",
    costs: Sequence[str] = (),
) -> tuple[Contestant, ...]:
    """Return the contestants: each agent once per planner, or once if it needs none.

    With a shipped recording of a sample, an agent is run on that sample.

    Args:
        agents: names.
        settings: of the environments.
        planners: specs of language models; `multi=SPEC` is for instructions of that kind alone.
        given: those that agents of others get; default all. A user who named none has not asked to run them once per
            planner that is shipped.
        understanding: name of the task understanding.
        prior: name of the location prior.
        costs: what methods that order compare orders by, each method once per cost; default each method's own, which
            gavel-plus keeps.

    Raises:
        UnknownAgent: with the nearest names.
        BadPlannerSpec: an agent needs a planner and there is none.
    """
    for cost in costs:
        if cost not in COSTS:
            raise BadOption(f"cost is {cost!r}; known: {', '.join(map(repr, COSTS))}")
    known = gavel_agents.agent_names()
    chosen: list[Contestant] = []
    for name in agents:
        agent = _ALIASES.get(name, name)
        if agent not in known:
            raise UnknownAgent(name, known)
        if agent == "oracle":
            chosen.append(contestant(agent, settings, privileged=True))
        elif agent in METHODS and METHODS[agent].source == "classical":
            given = [spec for spec in planners if _for_kind(spec)[1].partition(":")[0] == "classical"]
            for kinds, planner in map(_for_kind, given or (TABLES_PLANNER,)):
                spec = _with_engine(planner)
                one = contestant(agent, settings, planner=spec, understanding=understanding, prior=prior, kinds=kinds)
                chosen.append(one)
        elif agent in METHODS and not needs_planner(agent):
            for cost in _costs_of(agent, costs):
                chosen.append(contestant(agent, settings, understanding=understanding, prior=prior, cost=cost))
        else:
            if needs_planner(agent) and not planners:
                raise BadPlannerSpec(
                    f"agent {agent!r} asks a language model, and none is given: "
                    f"add --planner scripted:FILE.jsonl, or leave it out of --agents"
                )
            ours = agent in METHODS or agent == "react"
            for kinds, spec in map(_for_kind, (planners if ours or given is None else given) or ("",)):
                planner = _with_engine(spec)
                recording = _shipped(planner)
                for cost in _costs_of(agent, costs):
                    chosen.append(
                        contestant(
                            agent,
                            settings,
                            planner=planner,
                            understanding="" if agent == "react" else understanding,
                            prior="" if agent == "react" else prior,
                            cost=cost,
                            kinds=kinds,
                            sampled=recording.sample if recording else None,
                        )
                    )
    return tuple(dict.fromkeys(chosen))


def _costs_of(agent: str, costs: Sequence[str]) -> tuple[str, ...]:
    """Return the costs that an agent is run with; one empty one for an agent that does not order."""
    config = METHODS.get(agent)
    if config is None or config.order == "written":
        return ("",)
    return (config.cost,) if config.rooms == "simulated" or not costs else tuple(costs)


def _with_engine(planner: str) -> str:
    """Return a spec of the classical planner with the engine that it will use, so that records say it; others as is."""
    from gavel_agents.classical.planner import chosen_engine

    kind, _, engine = planner.partition(":")
    return f"{kind}:{chosen_engine(engine)}" if kind == "classical" else planner


def _for_kind(planner: str) -> tuple[tuple[str, ...], str]:
    """Split `multi=SPEC` into the kinds it is for and the spec; a spec alone is for all."""
    kind, equals, spec = planner.partition("=")
    return ((kind,), spec) if equals and kind in ENVIRONMENTS else ((), planner)
