"""The evaluation runner: contestants x instructions x seeds, one record per episode, resumable.

Every scheduled episode ends in a record: a crash is an outcome, a line that is not an instruction is an outcome. What
has a record is not run again; so a killed run, resumed, ends in the same table as one that was not.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import resources
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import msgspec

from eval.records.conversations import ConversationWriter, conversations_beside, conversations_of
from eval.records.encoding import sound
from eval.records.journal import RecordWriter, read_records
from eval.records.provenance import code_version, data_stamp, file_stamp, now, stamp, versions
from eval.records.sampling import sample
from eval.records.schema import (
    Benchmark,
    Contestant,
    EpisodeKey,
    EpisodeRecord,
    RejectedLine,
    RunHeader,
)
from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.limits import Limits, check_endpoints, within
from eval.run.planners import default_connections
from eval.run.rig import Finished
from eval.run.workers import groups_of, run_episodes
from gavel_agents.methods import METHODS
from gavel_env.errors import DataError, Unencodable
from gavel_env.instructions.record import Instruction, InstructionSet

__all__ = ["Schedule", "contestant", "run", "schedule"]


class Schedule(msgspec.Struct, frozen=True):
    """What is to be run.

    Attributes:
        contestants, benchmarks, seeds: their product is run, as far as contestants take an instruction.
        instructions: (data stamp, id) -> instruction; ids without one are rejected lines.
        settings: of the environments.
        plugins: modules whose import registers agents.
    """

    contestants: tuple[Contestant, ...]
    benchmarks: tuple[Benchmark, ...]
    seeds: tuple[int, ...]
    instructions: Mapping[tuple[str, str], Instruction]
    settings: EnvironmentSettings = EnvironmentSettings()
    plugins: tuple[str, ...] = ()

    def header(self, arguments: Mapping[str, Any]) -> RunHeader:
        """Return the header line of a run of this schedule."""
        return RunHeader(
            started=now(),
            versions=versions(),
            code=code_version(),
            arguments=dict(arguments),
            contestants=self.contestants,
            benchmarks=self.benchmarks,
            seeds=self.seeds,
            environment=msgspec.to_builtins(self.settings),
        )

    def episodes(self, code: str) -> list[Episode]:
        """Return the scheduled episodes: all contestants on an instruction before the next instruction."""
        episodes: list[Episode] = []
        for benchmark in self.benchmarks:
            taken = {one: frozenset(benchmark.scheduled_for(one)) for one in self.contestants}
            episodes += [
                self._episode(benchmark, one, instruction_id, seed, code)
                for seed in self.seeds
                for instruction_id in benchmark.scheduled
                for one, ids in taken.items()
                if instruction_id in ids
            ]
        return episodes

    def _episode(self, benchmark: Benchmark, one: Contestant, instruction_id: str, seed: int, code: str) -> Episode:
        instruction = self.instructions.get((benchmark.data, instruction_id))
        reasons = {line.id: line.reason for line in benchmark.rejected}
        return Episode(
            key=EpisodeKey(benchmark.data, one.config, instruction_id, seed),
            kind=benchmark.kind,
            contestant=one,
            code=code,
            instruction=instruction,
            rejected=reasons.get(instruction_id, ""),
        )


def contestant(
    agent: str,
    settings: EnvironmentSettings,
    *,
    planner: str = "",
    understanding: str = "",
    prior: str = "",
    cost: str = "",
    privileged: bool = False,
    kinds: Sequence[str] = (),
    sampled: int | None = None,
) -> Contestant:
    """Return a contestant with its stamp: of the names, of the content of files that they name, and of the settings."""
    contents = [file_stamp(file) for spec in (planner, understanding, prior) if (file := _named_file(spec))]
    own = METHODS[agent].cost if agent in METHODS else ""
    choices = (agent, planner, understanding, prior, *([cost] if cost not in ("", own) else []))
    config = stamp(*choices, contents, settings)
    return Contestant(agent, planner, understanding, prior, config, privileged, tuple(kinds), sampled, cost)


_SHIPPED = {"replay": "recordings/{}.jsonl.gz", "reference": "instructions/{}.jsonl"}


def _named_file(spec: str) -> Path | None:
    """Return the file that a spec names by path or as a shipped one, or None."""
    kind, _, name = spec.partition(":")
    if not name or Path(name).is_file():
        return Path(name) if name else None
    shipped = resources.files("envs_data") / _SHIPPED.get(kind, "{}").format(name)
    return Path(str(shipped)) if shipped.is_file() else None


def schedule(
    contestants: Sequence[Contestant],
    files: Iterable[InstructionSet],
    seeds: Sequence[int] = (0,),
    *,
    kinds: Sequence[str] = (),
    sampled: int | None = None,
    every: int = 1,
    limit: int | None = None,
    settings: EnvironmentSettings | None = None,
    plugins: Sequence[str] = (),
) -> Schedule:
    """Return the schedule of contestants over instruction files.

    Args:
        contestants: the rows of the table.
        files: instruction files.
        seeds: one episode per seed.
        kinds: keep only instructions of these kinds; default all.
        sampled: keep only so many of each kind and file, as `eval.records.sampling` takes them.
        every: keep only every so-manieth of each kind and file, the first one included.
        limit: keep only the first so many of those, and of the samples that contestants are bound to.
        settings: of the environments.
        plugins: modules whose import registers agents.

    Raises:
        DataError: nothing is left to run.
    """
    benchmarks: list[Benchmark] = []
    instructions: dict[tuple[str, str], Instruction] = {}
    for file in files:
        data = data_stamp(file.stamp, file.values())
        of_kind: dict[str, list[Instruction]] = {}
        for instruction in file.values():
            if not kinds or instruction.kind in kinds:
                of_kind.setdefault(instruction.kind, []).append(instruction)
        usual = Counter({kind: len(found) for kind, found in of_kind.items()}).most_common(1)
        for kind, found in of_kind.items():
            ids = sample([i.id for i in found][::every], sampled)
            if limit is not None:
                samples = [one.sample for one in contestants if one.takes(kind) and one.sample is not None]
                ids = sample(ids, max(limit, min(samples)) if samples else None)[:limit]
            kept = [file[name] for name in ids]
            # A line that could not be read has no kind of its own: it counts under the file's most frequent one.
            rejected = file.rejected if kind == usual[0][0] else ()
            benchmarks.append(
                Benchmark(
                    kind=kind,
                    source=Path(file.source).name,
                    stamp=file.stamp,
                    data=data,
                    instructions=tuple(i.id for i in kept),
                    rejected=tuple(RejectedLine(f"line {line.line}", line.reason) for line in rejected),
                )
            )
            instructions |= {(data, i.id): i for i in kept}
    if not instructions:
        raise DataError(f"no instruction of kind {', '.join(kinds) or 'any'} in the given files; nothing to run")
    unique = tuple(dict.fromkeys(contestants))
    return Schedule(
        unique,
        tuple(benchmarks),
        tuple(dict.fromkeys(seeds)),
        instructions,
        settings or EnvironmentSettings(),
        tuple(plugins),
    )


def run(
    plan: Schedule,
    out: str | Path,
    *,
    existing: Literal["refuse", "resume", "fresh"] = "refuse",
    retry: Collection[str] = (),
    arguments: Mapping[str, Any] | None = None,
    workers: int = 1,
    connections: int | None = None,
    timeout_s: float | None = None,
    shard: tuple[int, int] | None = None,
    executor: Literal["local", "ray"] = "local",
    address: str | None = None,
    limits: Limits | None = None,
    report: Callable[[EpisodeRecord], None] | None = None,
    started: Callable[[int, int], None] | None = None,
) -> Path:
    """Run what has no record yet and return the path of the record file.

    Args:
        plan: what to run.
        out: folder of the run; its records go to `records.jsonl` there, what models were asked and answered to
            `conversations.jsonl.gz`.
        existing: what to do if the folder has records: refuse, continue with them, or set them aside.
        retry: outcomes to run again, such as "error"; the new record takes the place of the old one.
        arguments: for the header.
        workers: processes; records do not depend on them, nor on what follows up to `address`.
        connections: calls of each language model under way at once; None = several where planners are servers.
        timeout_s: seconds of wall clock per episode.
        shard: (K, N): run only the K-th of N parts, counted from 1.
        executor: `local`, or `ray` for a Ray cluster.
        address: of the cluster; None = one that is found, or a local one.
        limits: when to stop early; default: after five endpoint failures in a row.
        report: called with every new record, after it has been written.
        started: called once with the number of episodes scheduled and the number already done.

    Raises:
        DataError: the folder has records and `existing` is "refuse", or the file cannot be written.
        RunStopped: a limit was reached, or an endpoint does not answer; what has been run is in the folder.
        GavelError: a contestant cannot be built.
    """
    limits = limits or Limits()
    path = Path(out) / "records.jsonl"
    if existing == "refuse" and path.exists() and path.stat().st_size:
        raise DataError(f"{path} has records already; --resume continues them, --fresh sets them aside")
    header = plan.header(arguments or {})
    with RecordWriter(path) as writer:
        stored = conversations_of(path)
        if existing == "fresh" and (aside := writer.set_aside()) is not None and stored.exists():
            stored.rename(conversations_beside(aside))
        done = read_records([path], whole=False).records if path.stat().st_size else {}
        episodes = plan.episodes(header.code)
        left = [e for e in _shard(episodes, shard) if e.key not in done or done[e.key].outcome in retry]
        del done
        if started is not None:
            started(len(episodes), len(episodes) - len(left))
        planners = sorted({episode.contestant.planner for episode in left} - {""})
        calls = connections or default_connections(planners)
        stop = threading.Event()
        try:
            # The servers are tried out while environments are built, and before any episode begins.
            with ConversationWriter(stored) as conversations, ThreadPoolExecutor(1) as thread:
                checked = thread.submit(check_endpoints, planners, limits)
                if executor == "ray":
                    from eval.run.cluster import run_on_ray

                    checked.result()
                    ran = run_on_ray(left, plan.settings, plan.plugins, address, timeout_s, calls, stop)
                else:
                    options = (left, plan.settings, plan.plugins, workers, timeout_s, calls)
                    ran = run_episodes(*options, stop, checked.result)
                _write(writer, conversations, header, within(ran, limits, stop), report)
        finally:
            if not path.stat().st_size:
                path.unlink()
    return path


def _shard(episodes: Sequence[Episode], shard: tuple[int, int] | None) -> list[Episode]:
    """Return the episodes of one part; those that may ask the same stay together."""
    if shard is None:
        return list(episodes)
    part, parts = shard
    return [episode for group in groups_of(episodes)[part - 1 :: parts] for episode in group]


def _write(
    writer: RecordWriter,
    conversations: ConversationWriter,
    header: RunHeader,
    ran: Iterator[Finished],
    report: Callable[[EpisodeRecord], None] | None,
) -> None:
    """Write the header and the records, each behind its calls; nothing if the first shows wrong use."""
    first = next(ran, None)
    writer.write(header)
    for record, exchanges in () if first is None else chain((first,), ran):
        calls = tuple(conversations.add(exchanges)) if exchanges else ()
        record = msgspec.structs.replace(record, calls=calls)
        try:
            writer.write(record)
        except Unencodable:
            record = sound(record)
            writer.write(record)
        if report is not None:
            report(record)
