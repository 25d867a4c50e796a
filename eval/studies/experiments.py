"""The paper's experiments by name: which agents on which instructions, what varies, and what is claimed of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple
from urllib.parse import parse_qsl

from eval.records.schema import Contestant
from eval.run.contestants import choose, compared_by_default, default_planners, needs_planner
from eval.run.episodes import EnvironmentSettings
from eval.run.runner import Schedule, schedule
from gavel_agents.llm.replay import shipped_recordings
from gavel_env.instructions.record import InstructionSet, read_instructions, shipped

__all__ = ["EXPERIMENTS", "Claim", "Experiment", "planned", "sampled_by", "seeds_for"]

Measure = Literal["success", "metres"]


class Claim(NamedTuple):
    """A difference that the paper speaks of: the first method's success or metres minus the second's."""

    first: str
    second: str
    measure: Measure


class Experiment(NamedTuple):
    """One experiment.

    Attributes:
        name: on the command line.
        title: of its table.
        kind: of the instructions.
        agents: in the order of the table.
        every: only every so-manieth instruction.
        columns: of the table, beside success and N: `attempts`, `metres` (on matched successes), `seconds`.
        claims: differences, where two methods have the same planner, or one needs none.
    """

    name: str
    title: str
    kind: str
    agents: tuple[str, ...]
    columns: tuple[str, ...]
    claims: tuple[Claim, ...]
    every: int = 1


EXPERIMENTS: Mapping[str, Experiment] = {
    "exp1": Experiment(
        "exp1",
        "Experiment 1: single long-horizon tasks",
        "single",
        ("llm-only", "sayplan", "llm+p", "gavel-basic", "gavel-full"),
        ("attempts", "seconds"),
        (
            Claim("sayplan", "llm-only", "success"),
            Claim("gavel-basic", "sayplan", "success"),
            Claim("gavel-full", "gavel-basic", "success"),
            Claim("gavel-full", "llm-only", "success"),
        ),
    ),
    "exp2": Experiment(
        "exp2",
        "Experiment 2: long-horizon multi-task instructions",
        "multi",
        ("llm-only", "sayplan", "llm+p", "epog", "gavel-map", "gavel-static", "gavel-full", "oracle"),
        ("metres", "seconds"),
        (
            Claim("gavel-full", "sayplan", "success"),
            Claim("gavel-full", "sayplan", "metres"),
            Claim("gavel-static", "gavel-map", "metres"),
            Claim("gavel-full", "gavel-static", "metres"),
            Claim("gavel-full", "gavel-map", "metres"),
        ),
    ),
    "exp3": Experiment(
        "exp3",
        "Experiment 3: planners with and without GAVEL",
        "multi",
        ("llm-only", "gavel-full"),
        ("seconds",),
        (Claim("gavel-full", "llm-only", "success"),),
        every=5,
    ),
}

_SEEDS = (0, 1, 2, 3, 4)


def sampled_by(planner: str) -> bool:
    """Return whether a planner's answers vary with the seed: it samples, or is simulated.

    Args:
        planner: a spec, perhaps for one kind of instructions (`multi=SPEC`).
    """
    spec = planner.partition("=")[2] if planner.startswith(("single=", "multi=", "behavior=")) else planner
    kind, _, argument = spec.partition(":")
    if kind in ("simulated", "anthropic"):
        return True
    if kind not in ("openai", "hf", "gguf"):
        return False
    options = dict(parse_qsl(argument.partition("?")[2]))
    return options.get("temperature", "0").strip("0.") != ""


def seeds_for(planners: Sequence[str]) -> tuple[int, ...]:
    """Return the paper's five seeds where a planner samples, else one: everything else is deterministic."""
    return _SEEDS if any(map(sampled_by, planners)) else _SEEDS[:1]


def planned(
    experiment: Experiment,
    *,
    planners: Sequence[str] = (),
    agents: Sequence[str] = (),
    understanding: str = "reference",
    prior: str = "choice",
    costs: Sequence[str] = (),
    seeds: Sequence[int] | None = None,
    sampled: int | None = None,
    limit: int | None = None,
    settings: EnvironmentSettings | None = None,
    plugins: Sequence[str] = (),
) -> Schedule:
    """Return what an experiment runs.

    Without planners: recordings of a real model that are shipped, certified plans where only the order is compared, and
    the classical planner. Experiment 3 is then run on the instructions that were recorded.

    Args:
        experiment: which one.
        planners: specs of language models.
        agents: besides those of the experiment, such as one's own.
        understanding: of all of them.
        prior: location prior of all of them.
        costs: what those that order go by; default each method's own.
        seeds: default those of `seeds_for`.
        sampled: only so many of the instructions, drawn by the hash of their ids.
        limit: only the first so many.
        settings: of the environments.
        plugins: modules whose import registers agents.

    Raises:
        GavelError: an agent, planner or option is not known or not usable.
    """
    settings = settings or EnvironmentSettings()
    given = tuple(planners) or default_planners((experiment.kind,), understanding)
    every = experiment.every
    if not planners and every > 1:
        given = tuple(spec for spec in given if not spec.partition("=")[2].startswith("reference"))
        recording = shipped_recordings().get(experiment.kind)
        every, sampled = (every, sampled) if recording is None else (1, sampled or recording.sample)
    names = (*experiment.agents, *(name for name in agents if name not in experiment.agents))
    chosen = choose(
        names, settings, planners=given, given=planners, understanding=understanding, prior=prior, costs=costs
    )
    if not planners:
        chosen = tuple(one for one in chosen if one.agent in agents or _says_something(one))
    return schedule(
        chosen,
        [_instructions(experiment.kind)],
        seeds_for(given) if seeds is None else seeds,
        kinds=(experiment.kind,),
        sampled=sampled,
        every=every,
        limit=limit,
        settings=settings,
        plugins=plugins,
    )


def _says_something(one: Contestant) -> bool:
    return compared_by_default(one) if needs_planner(one.agent) else True


def _instructions(kind: str) -> InstructionSet:
    return read_instructions(shipped(kind))
