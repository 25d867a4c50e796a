"""`eval.evaluate(...)`: run agents over instructions from Python, and look at what came out."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import gavel_agents
from eval.records.journal import read_records
from eval.records.provenance import stamp
from eval.records.schema import EpisodeRecord
from eval.report.formats import render
from eval.report.tables import results
from eval.run.contestants import choose, default_planners, needs_planner
from eval.run.episodes import EnvironmentSettings
from eval.run.rig import ENVIRONMENTS
from eval.run.runner import run, schedule
from gavel_agents.agent import Agent
from gavel_env.data import is_path
from gavel_env.errors import BadOption
from gavel_env.instructions.record import Instruction, InstructionSet, read_instructions, shipped

if TYPE_CHECKING:
    import pandas

__all__ = ["Results", "evaluate"]

Instructions = str | Path | InstructionSet | Iterable[Instruction]


class Results:
    """What a run came to: a function of its records alone.

    Attributes:
        path: of the record file.
    """

    def __init__(self, path: str | Path) -> None:
        """Read a record file, or the folder of a run.

        Raises:
            DataError: unreadable, or no line is a record.
        """
        self.path = Path(path)
        self._files = read_records([self.path])

    @property
    def records(self) -> tuple[EpisodeRecord, ...]:
        """One record per episode, in the order in which they ended."""
        return tuple(self._files.records.values())

    def success(self) -> dict[str, float]:
        """Return agent -> share of its scheduled episodes that it solved, in [0, 1]."""
        solved: Counter[str] = Counter()
        scheduled: Counter[str] = Counter()
        # A contestant that stands in two parts of a benchmark has all of its episodes in the later one.
        rows = {(s.benchmark.data, r.contestant.config): r for s in results(self._files).sections for r in s.rows}
        for row in rows.values():
            if row.success is not None:
                solved[row.contestant.agent] += round(row.success.mean * row.scheduled / 100)
            scheduled[row.contestant.agent] += row.scheduled
        return {agent: solved[agent] / count for agent, count in scheduled.items() if count}

    def failures(self) -> dict[str, dict[str, int]]:
        """Return agent -> failure class -> episodes."""
        found: dict[str, Counter[str]] = {}
        for record in self.records:
            if not record.success:
                found.setdefault(record.contestant.agent, Counter())[record.failure] += 1
        return {agent: dict(counts.most_common()) for agent, counts in found.items()}

    def render(
        self,
        form: Literal["terminal", "markdown", "csv", "latex"] = "terminal",
        *,
        failures: bool = False,
        costs: bool = False,
        compare: Sequence[str] | None = None,
    ) -> str:
        """Return the result tables as text.

        Args:
            form: of the text.
            failures: also count the episodes of every failure class.
            costs: also calls, tokens and seconds by stage.
            compare: agents whose metres are matched; default those that solved at least half.
        """
        return render(results(self._files, compare), form, failures=failures, costs=costs)

    def __str__(self) -> str:
        """Return the tables as `gavel eval` prints them."""
        return self.render()

    def dataframe(self) -> pandas.DataFrame:
        """Return one row per episode as a pandas DataFrame.

        Raises:
            BadOption: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise BadOption("a DataFrame needs pandas: pip install 'gavel-env[frames]'") from error
        rows = [
            {
                "agent": record.contestant.agent,
                "planner": record.contestant.planner,
                "understanding": record.contestant.understanding,
                "prior": record.contestant.prior,
                "kind": record.kind,
                "scene": record.scene,
                "instruction": record.instruction,
                "seed": record.seed,
                "outcome": record.outcome,
                "failure": record.failure,
                "success": record.success,
                "metres": record.metres,
                "attempts": record.trace.attempts,
                "planning_s": record.planning_s,
            }
            for record in self.records
        ]
        return pandas.DataFrame(rows)


def evaluate(
    agents: str | Sequence[str | type[Agent]] | type[Agent],
    instructions: Instructions | Sequence[str | Path] = "single",
    *,
    planner: str | Sequence[str] = (),
    understanding: str = "reference",
    prior: str = "choice",
    cost: str | Sequence[str] = (),
    seeds: Sequence[int] = (0,),
    sample: int | None = None,
    limit: int | None = None,
    profile: str = "paper",
    max_steps: int = 300,
    out: str | Path | None = None,
    existing: Literal["refuse", "resume", "fresh"] = "refuse",
    workers: int = 1,
    connections: int | None = None,
    timeout_s: float | None = None,
    report: Callable[[EpisodeRecord], None] | None = None,
) -> Results:
    """Run agents over instructions and return the results.

    Args:
        agents: names, or agent classes of one's own: each is registered under its `name`.
        instructions: `single`, `multi`, `behavior`, paths of instruction files, an `InstructionSet`, or instructions.
        planner: spec or specs of language models, for agents that ask one: `openai:MODEL@URL`, `reference:single`, …;
            default for a shipped file: its recording of a real model, or the reference plans.
        understanding: `reference`, `rules`, `adapter:FOLDER` or `llm`.
        prior: location prior, `choice`, `rsn` or `uniform`.
        cost: what methods that order go by, `paper`, `carried` or `simulated`, or several; default each method's own.
        seeds: one episode per seed.
        sample: keep so many instructions, drawn by the hash of their ids.
        limit: keep the first so many of those.
        profile: rules profile.
        max_steps: actions per episode.
        out: folder for the records; default a new temporary folder.
        existing: what to do if the folder has records: refuse, resume them, or set them aside and begin fresh.
        workers: processes; 1 runs everything in this one, which agent classes need.
        connections: calls of each language model under way at once; default several where planners are servers.
        timeout_s: seconds of wall clock per episode.
        report: called with every new record.

    Raises:
        BadOption: agent classes with several processes, or one without a name.
        GavelError: an agent, planner, understanding, prior or instruction file is not known or not usable.
    """
    chosen = [agents] if isinstance(agents, str | type) else list(agents)
    if workers > 1 and not all(isinstance(agent, str) for agent in chosen):
        raise BadOption("agent classes run in this process: use workers=1, or register them in a module (--plugin)")
    settings = EnvironmentSettings(profile=profile, max_steps=max_steps)
    names = [agent if isinstance(agent, str) else _registered(agent) for agent in chosen]
    planners = [planner] if isinstance(planner, str) else list(planner)
    if not planners and any(map(needs_planner, names)) and str(instructions) in ENVIRONMENTS:
        planners = list(default_planners([str(instructions)])[:1])
    contestants = choose(
        names,
        settings,
        planners=planners,
        understanding=understanding,
        prior=prior,
        costs=[cost] if isinstance(cost, str) else cost,
    )
    plan = schedule(contestants, _sets(instructions), seeds, sampled=sample, limit=limit, settings=settings)
    folder = Path(tempfile.mkdtemp(prefix="gavel-")) if out is None else Path(out)
    path = run(
        plan,
        folder,
        existing=existing,
        workers=workers,
        connections=connections,
        timeout_s=timeout_s,
        report=report,
        arguments={"api": True},
    )
    return Results(path)


def _registered(agent: type[Agent]) -> str:
    name = getattr(agent, "name", None)
    if not isinstance(name, str) or not name:
        raise BadOption(f"agent class {agent.__name__} needs a class attribute `name`, which tables show")
    gavel_agents.register(name, agent)
    return name


def _sets(instructions: Instructions | Sequence[str | Path]) -> list[InstructionSet]:
    if isinstance(instructions, InstructionSet):
        return [instructions]
    if isinstance(instructions, str | Path):
        return [_read(instructions)]
    given = list(instructions.values()) if isinstance(instructions, Mapping) else list(instructions)
    paths = [item for item in given if isinstance(item, str | Path)]
    records = [item for item in given if isinstance(item, Instruction)]
    sets = [_read(path) for path in paths]
    if records:
        sets.append(InstructionSet(records, (), stamp(*records), "instructions given in Python"))
    return sets


def _read(source: str | Path) -> InstructionSet:
    return read_instructions(source if is_path(source) else shipped(str(source)))
