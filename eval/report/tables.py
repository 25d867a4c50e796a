"""Result tables as a function of record files alone.

The denominator is what was scheduled: a scheduled episode that crashed, was rejected or was never run counts as not
solved.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from eval.records.journal import RecordFile
from eval.records.prices import Prices, read_prices
from eval.records.schema import Benchmark, Contestant, EpisodeKey, EpisodeRecord
from eval.report.planning_cost import Costs, costs
from eval.report.statistics import Estimate, over_seeds, share_over_seeds
from gavel_env.errors import UnknownAgent

__all__ = ["Results", "Row", "Section", "results"]

_COMPARED_SHARE = 0.5


class Row(NamedTuple):
    """One contestant on one benchmark.

    Attributes:
        success: per cent of the scheduled episodes.
        metres: over the contestant's own successes.
        matched: metres over the instructions that all compared contestants solved; None if it is not compared.
        regret: `matched` divided by the privileged contestant's; None without one.
        planning_s: seconds of planning per episode; None for a privileged agent, and where none were reported.
        attempts: calls of the language model per episode; None without one.
        scheduled, recorded: episodes.
        failures: failure class -> episodes, scheduled ones without a record as `not run`.
        costs: what planning took; of nothing for a privileged agent.
    """

    contestant: Contestant
    success: Estimate | None
    metres: Estimate | None
    matched: Estimate | None
    regret: float | None
    planning_s: Estimate | None
    attempts: Estimate | None
    scheduled: int
    recorded: int
    failures: Mapping[str, int]
    costs: Costs


class Section(NamedTuple):
    """One benchmark.

    Attributes:
        benchmark: kind, file and stamps.
        instructions: number scheduled, rejected lines included.
        seeds: in order.
        models: names that language models gave themselves, with their decoding, sorted.
        rows: in the order in which contestants were first scheduled.
        compared: positions in `rows` of those whose metres are matched.
        matched: number of (instruction, seed) pairs that all compared contestants solved.
        part: empty if all rows are over the same (instruction, seed) pairs; `shared` for those that all contestants
            have in common, compared first; `all` for the others, each over all that it was scheduled on.
        keys: scheduled episodes per row.
    """

    benchmark: Benchmark
    instructions: int
    seeds: tuple[int, ...]
    models: tuple[str, ...]
    rows: tuple[Row, ...]
    compared: tuple[int, ...]
    matched: int
    part: str
    keys: tuple[tuple[EpisodeKey, ...], ...]


class Results(NamedTuple):
    """All sections, and what must be said with them.

    Attributes:
        facts: (name, value) for the header: code, rules, seeds.
        rejected: id and reason of instructions that could not be read, or do not fit their scenes.
        damaged: lines of record files that are not records.
    """

    sections: tuple[Section, ...]
    facts: tuple[tuple[str, str], ...]
    rejected: tuple[tuple[str, str], ...]
    damaged: tuple[str, ...]


class _Scheduled:
    """The scheduled episodes of one benchmark, gathered from every header and record that speaks of it."""

    def __init__(self, benchmark: Benchmark) -> None:
        self.benchmark = benchmark
        self.contestants: dict[str, Contestant] = {}
        self.keys: dict[str, dict[EpisodeKey, None]] = {}

    def add(self, contestant: Contestant, keys: Iterable[EpisodeKey]) -> None:
        # The header may not know of a plugged-in agent that it is privileged; its records do.
        if contestant.privileged or contestant.config not in self.contestants:
            self.contestants[contestant.config] = contestant
        self.keys.setdefault(contestant.config, {}).update(dict.fromkeys(keys))


def results(files: RecordFile, compare: Sequence[str] | None = None, prices: Prices | None = None) -> Results:
    """Return the results of record files.

    Args:
        files: as read.
        compare: agents whose metres are matched; default those that solved at least half of what was scheduled.
        prices: of models, for what planning cost; default those that are shipped.

    Raises:
        UnknownAgent: `compare` names an agent that is in none of the files.
    """
    known = {one.agent for header in files.headers for one in header.contestants}
    known |= {record.contestant.agent for record in files.records.values()}
    for name in compare or ():
        if name not in known:
            raise UnknownAgent(name, known, "these records")
    parts = [part for scheduled in _gather(files) for part in _parts(scheduled)]
    sections = [_section(scheduled, files.records, compare, part, prices or read_prices()) for scheduled, part in parts]
    codes = [header.code for header in files.headers] + [record.code for record in files.records.values()]
    profiles = [str(header.environment.get("profile", "")) for header in files.headers]
    seeds = sorted({seed for section in sections for seed in section.seeds})
    facts = (
        ("seeds", ", ".join(map(str, seeds))),
        ("rules", _listed(profiles)),
        ("code", _listed(codes)),
    )
    rejected = {line.id: line.reason for h in files.headers for b in h.benchmarks for line in b.rejected}
    for record in files.records.values():
        if record.outcome == "rejected":
            rejected.setdefault(record.instruction, record.error)
    return Results(tuple(sections), facts, tuple(rejected.items()), files.damaged)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(name for name in names if name)) or "—"


def _gather(files: RecordFile) -> list[_Scheduled]:
    found: dict[tuple[str, str], _Scheduled] = {}
    for header in files.headers:
        for benchmark in header.benchmarks:
            scheduled = found.setdefault((benchmark.data, benchmark.kind), _Scheduled(benchmark))
            for one in header.contestants:
                ids = benchmark.scheduled_for(one)
                keys = [EpisodeKey(benchmark.data, one.config, i, s) for s in header.seeds for i in ids]
                if keys:
                    scheduled.add(one, keys)
    for record in files.records.values():
        unknown = Benchmark(record.kind, "(no header)", "", record.data, ())
        found.setdefault((record.data, record.kind), _Scheduled(unknown)).add(record.contestant, [record.key])
    return list(found.values())


def _parts(scheduled: _Scheduled) -> list[tuple[_Scheduled, str]]:
    """Split a benchmark whose contestants were run on different instructions: what they share first, then the rest."""
    pairs = {config: frozenset((k.instruction, k.seed) for k in keys) for config, keys in scheduled.keys.items()}
    shared = frozenset.intersection(*pairs.values())
    if len(set(pairs.values())) == 1 or not shared:
        return [(scheduled, "")]
    common, rest = _Scheduled(scheduled.benchmark), _Scheduled(scheduled.benchmark)
    for config, keys in scheduled.keys.items():
        who = scheduled.contestants[config]
        common.add(who, [key for key in keys if (key.instruction, key.seed) in shared])
        if pairs[config] != shared:
            rest.add(who, keys)
    return [(common, "shared"), (rest, "all")]


def _section(
    scheduled: _Scheduled,
    records: Mapping[EpisodeKey, EpisodeRecord],
    compare: Sequence[str] | None,
    part: str,
    prices: Prices,
) -> Section:
    solved: dict[str, dict[int, dict[str, float]]] = {}
    for config, keys in scheduled.keys.items():
        per_seed: dict[int, dict[str, float]] = {seed: {} for seed in sorted({key.seed for key in keys})}
        for key in keys:
            record = records.get(key)
            if record is not None and record.success:
                per_seed[key.seed][key.instruction] = record.metres
        solved[config] = per_seed
    compared = [
        config
        for config, keys in scheduled.keys.items()
        if (
            scheduled.contestants[config].agent in compare
            if compare is not None
            else sum(map(len, solved[config].values())) >= _COMPARED_SHARE * len(keys)
        )
    ]
    common = _common([solved[config] for config in compared])
    matched = {
        config: over_seeds([[solved[config][seed][i] for i in ids] for seed, ids in common.items()])
        for config in compared
    }
    reference = next((matched[c] for c in compared if scheduled.contestants[c].privileged), None)
    rows = [
        _row(scheduled.contestants[config], list(keys), records, solved[config], matched.get(config), reference, prices)
        for config, keys in scheduled.keys.items()
    ]
    everything = [key for keys in scheduled.keys.values() for key in keys]
    return Section(
        benchmark=scheduled.benchmark,
        instructions=len({key.instruction for key in everything}),
        seeds=tuple(sorted({key.seed for key in everything})),
        models=tuple(sorted({_model(records[key]) for key in everything if key in records} - {""})),
        rows=tuple(rows),
        compared=tuple(i for i, config in enumerate(scheduled.keys) if config in compared),
        matched=sum(map(len, common.values())),
        part=part,
        keys=tuple(tuple(keys) for keys in scheduled.keys.values()),
    )


def _model(record: EpisodeRecord) -> str:
    """Return the name that a language model gave itself, with its decoding."""
    decoding = ", ".join(f"{name} {value}" for name, value in sorted(record.decoding.items()))
    return f"{record.model} ({decoding})" if record.model and decoding else record.model


def _common(solved: Sequence[Mapping[int, Mapping[str, float]]]) -> dict[int, list[str]]:
    """Return per seed the instructions that every contestant solved, sorted; seeds that not all of them ran are out."""
    if not solved:
        return {}
    seeds = set(solved[0]).intersection(*solved[1:])
    return {seed: sorted(set(solved[0][seed]).intersection(*(s[seed] for s in solved[1:]))) for seed in sorted(seeds)}


def _row(
    contestant: Contestant,
    keys: Sequence[EpisodeKey],
    records: Mapping[EpisodeKey, EpisodeRecord],
    solved: Mapping[int, Mapping[str, float]],
    matched: Estimate | None,
    reference: Estimate | None,
    prices: Prices,
) -> Row:
    mine = [records[key] for key in keys if key in records]
    trials = Counter(key.seed for key in keys)
    spent = costs(() if contestant.privileged else mine, asks_model=bool(contestant.planner), prices=prices)
    failures = Counter(record.failure for record in mine if not record.success)
    if len(mine) < len(keys):
        failures["not run"] = len(keys) - len(mine)
    return Row(
        contestant=contestant,
        success=share_over_seeds([(len(solved[seed]), trials[seed]) for seed in solved]),
        metres=over_seeds([list(by_instruction.values()) for by_instruction in solved.values()]),
        matched=matched,
        regret=matched.mean / reference.mean if matched and reference and reference.mean else None,
        planning_s=spent.planning_s,
        attempts=spent.calls,
        scheduled=len(keys),
        recorded=len(mine),
        failures=dict(sorted(failures.items(), key=lambda item: (-item[1], item[0]))),
        costs=spent,
    )
