"""The evaluation runner: contestants x instructions x seeds, one record per episode, resumable.

Every scheduled episode ends in a record: a crash is an outcome, a line that is no instruction is an outcome. What
has a record is not run again; so a killed run, resumed, ends in the same table as one that was not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from importlib import resources
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import msgspec

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
from eval.run.workers import run_episodes
from gavel_env.errors import DataError
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
    privileged: bool = False,
    kinds: Sequence[str] = (),
    sampled: int | None = None,
) -> Contestant:
    """Return a contestant with its stamp: of the names, of the content of files that they name, and of the settings."""
    contents = [file_stamp(file) for spec in (planner, understanding, prior) if (file := _named_file(spec))]
    config = stamp(agent, planner, understanding, prior, contents, settings)
    return Contestant(agent, planner, understanding, prior, config, privileged, tuple(kinds), sampled)


_SHIPPED = {"replay": "recordings/{}.jsonl.gz", "reference": "instructions/{}.jsonl"}


def _named_file(spec: str) -> Path | None:
    """Return the file that a spec names by path or as a shipped one, or None."""
    kind, _, name = spec.partition(":")
    if not name or Path(name).exists():
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
            ids = sample((i.id for i in found), sampled)
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
    timeout_s: float | None = None,
    report: Callable[[EpisodeRecord], None] | None = None,
    started: Callable[[int, int], None] | None = None,
) -> Path:
    """Run what has no record yet and return the path of the record file.

    Args:
        plan: what to run.
        out: folder of the run; its records go to `records.jsonl` there.
        existing: what to do if the folder has records: refuse, continue with them, or set them aside.
        retry: outcomes to run again, such as "error"; the new record takes the place of the old one.
        arguments: for the header.
        workers: processes.
        timeout_s: seconds of wall clock per episode.
        report: called with every new record, after it has been written.
        started: called once with the number of episodes scheduled and the number already done.

    Raises:
        DataError: the folder has records and `existing` is "refuse", or the file cannot be written.
        GavelError: a contestant cannot be built.
    """
    path = Path(out) / "records.jsonl"
    if path.exists() and path.stat().st_size:
        if existing == "refuse":
            raise DataError(f"{path} has records already; --resume continues them, --fresh sets them aside")
        if existing == "fresh":
            path.rename(_free_name(path))
    header = plan.header(arguments or {})
    with RecordWriter(path) as writer:
        done = read_records([path]).records if path.stat().st_size else {}
        episodes = plan.episodes(header.code)
        left = [e for e in episodes if e.key not in done or done[e.key].outcome in retry]
        if started is not None:
            started(len(episodes), len(episodes) - len(left))
        try:
            _write(writer, header, run_episodes(left, plan.settings, plan.plugins, workers, timeout_s), report)
        finally:
            if not path.stat().st_size:
                path.unlink()
    return path


def _write(
    writer: RecordWriter,
    header: RunHeader,
    records: Iterator[EpisodeRecord],
    report: Callable[[EpisodeRecord], None] | None,
) -> None:
    """Write the header and the records; nothing if the first record cannot be made because of wrong use."""
    first = next(records, None)
    writer.write(header)
    for record in () if first is None else chain((first,), records):
        writer.write(record)
        if report is not None:
            report(record)


def _free_name(path: Path) -> Path:
    number = 1
    while (name := path.with_name(f"{path.stem}.{number}{path.suffix}")).exists():
        number += 1
    return name
