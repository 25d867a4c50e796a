"""Episode records: what one episode was, did and came to, as one JSON line (schema `gavel-record/1`).

A record file is JSON Lines of two kinds of line, told apart by `schema`: a `RunHeader` each time a run starts or
resumes (what was scheduled, on which data, with which versions), and an `EpisodeRecord` per episode. Everything that is
printed, drawn or reported is a function of such files alone.

Lines are appended whole: one write, flushed to the disk before the next episode. A line that a killed process left
torn is cut off before anything is appended, so its episode runs again.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import msgspec

from eval.scrub import scrub_secrets
from gavel_agents.base import AgentTrace
from gavel_env.errors import DataError

__all__ = [
    "OUTCOMES",
    "Benchmark",
    "Contestant",
    "EpisodeKey",
    "EpisodeRecord",
    "RecordFile",
    "RecordWriter",
    "RejectedLine",
    "RunHeader",
    "Step",
    "read_records",
]

OUTCOMES: Mapping[str, str] = {
    "success": "no violation, goal met, everything safe after the agent's last action",
    "violation": "an action was refused",
    "unmet": "the agent ended, and part of the goal does not hold",
    "unsafe": "the goal holds, but something was left open or on",
    "truncated": "the step limit was reached",
    "timeout": "the wall-clock limit was reached",
    "refused": "the agent declined: the instruction was not understood",
    "error": "the agent or the environment raised, or its process died",
    "rejected": "the instruction itself is bad: malformed, or does not fit its scene",
}
"""Every way in which an episode ends; all of them stay in the denominator."""


class EpisodeKey(NamedTuple):
    """What makes two episodes the same episode.

    Attributes:
        data: stamp of everything the episode is built from (instruction file, scenes, ontology).
        config: stamp of the contestant and of the environment's settings.
        instruction: instruction id.
        seed: seed of environment and agent.
    """

    data: str
    config: str
    instruction: str
    seed: int


class Step(msgspec.Struct, frozen=True, omit_defaults=True):
    """One executed action.

    Attributes:
        action: text form, as the agent sent it.
        outcome: "ok" or the violation kind.
        metres: driven by this action.
        reached: instance that a `NavigateTo` reached.
        route: turning points of the drive, (x, y) in metres to 1 cm.
        detail: the violation in full, with its blocker.
    """

    action: str
    outcome: str
    metres: float = 0.0
    reached: str | None = None
    route: tuple[tuple[float, float], ...] = ()
    detail: str = ""


class Contestant(msgspec.Struct, frozen=True, omit_defaults=True):
    """An agent with everything that is chosen for it: one row of a table.

    Attributes:
        agent: registered name.
        planner: spec of the language model, such as `scripted:FILE`; empty for agents that need none.
        understanding: name of the task understanding.
        prior: name of the location prior.
        config: stamp of the above, of the files they name, and of the environment's settings.
        privileged: sees the hidden state.
    """

    agent: str
    planner: str = ""
    understanding: str = ""
    prior: str = ""
    config: str = ""
    privileged: bool = False

    @property
    def planner_kind(self) -> str:
        """The part of the planner spec before the colon: `scripted`, `hf`, ...; empty without a planner."""
        return self.planner.partition(":")[0]


class RejectedLine(msgspec.Struct, frozen=True):
    """A line of an instruction file that is no instruction; scheduled and counted under `id`."""

    id: str
    reason: str


class Benchmark(msgspec.Struct, frozen=True):
    """The instructions of one kind from one file.

    Attributes:
        kind: "single", "multi" or "behavior".
        source: file name, without its folder.
        stamp: content stamp of the file.
        data: stamp of the file, of the scenes it uses and of the ontology.
        instructions: scheduled ids.
        rejected: lines that could not be read; scheduled too, so that they are counted.
    """

    kind: str
    source: str
    stamp: str
    data: str
    instructions: tuple[str, ...]
    rejected: tuple[RejectedLine, ...] = ()

    @property
    def scheduled(self) -> tuple[str, ...]:
        """Every id that counts, rejected lines last."""
        return (*self.instructions, *(line.id for line in self.rejected))


class RunHeader(msgspec.Struct, frozen=True, tag_field="schema", tag="gavel-run/1"):
    """What a run set out to do.

    Attributes:
        started: ISO 8601 time, UTC.
        versions: of this project, Python and the packages that results can depend on.
        code: git commit (with `+` if files were changed), or the version of the installed package.
        arguments: of the command line or of `run`.
        contestants, benchmarks, seeds: the schedule is their product.
        environment: settings of the environment and of the runner's limits.
    """

    started: str
    versions: dict[str, str]
    code: str
    arguments: dict[str, Any]
    contestants: tuple[Contestant, ...]
    benchmarks: tuple[Benchmark, ...]
    seeds: tuple[int, ...]
    environment: dict[str, Any]

    def keys(self) -> list[EpisodeKey]:
        """Return the scheduled episodes in the order in which they are run."""
        return [
            EpisodeKey(benchmark.data, contestant.config, instruction, seed)
            for benchmark in self.benchmarks
            for contestant in self.contestants
            for seed in self.seeds
            for instruction in benchmark.scheduled
        ]


class EpisodeRecord(msgspec.Struct, frozen=True, kw_only=True, tag_field="schema", tag="gavel-record/1"):
    """One episode.

    Attributes:
        seed, instruction, kind, scene, text: what was to be done, where.
        data, code: stamps of data and code.
        contestant: who did it.
        model, decoding: name and decoding settings of the language model, as it reports them.
        method: the agent's configuration, as it reports it.
        trace: tasks with plans before and after repair, verdicts, attempts, order, prompts' hashes, raw answers.
        steps: what was executed.
        metres: driven in all.
        seconds: `setup`, `agent` (in its `reset` and `act`) and `execute`; planning by stage is in the trace.
        outcome: one of `OUTCOMES`.
        failure: class of the failure, `violation:closed`, `unmet:cooked`, `error:ValueError`; empty on success.
        unmet: goal conditions that do not hold at the end; empty if never judged.
        unsafe: what was left open or on, as literals.
        tasks_met: per task, whether its goal holds at the end; empty if never judged.
        error: why it was rejected, or the traceback of a crash; values of environment variables are removed.
        finished: ISO 8601 time, UTC.
    """

    seed: int
    instruction: str
    kind: str
    scene: str
    text: str
    data: str
    code: str
    contestant: Contestant
    outcome: str
    failure: str = ""
    model: str = ""
    decoding: dict[str, Any] = {}
    method: dict[str, Any] = {}
    trace: AgentTrace = msgspec.field(default_factory=AgentTrace)
    steps: tuple[Step, ...] = ()
    metres: float = 0.0
    seconds: dict[str, float] = {}
    unmet: tuple[str, ...] = ()
    unsafe: tuple[str, ...] = ()
    tasks_met: tuple[bool, ...] = ()
    error: str = ""
    finished: str = ""

    @property
    def key(self) -> EpisodeKey:
        """Which episode this is."""
        return EpisodeKey(self.data, self.contestant.config, self.instruction, self.seed)

    @property
    def success(self) -> bool:
        """Whether the instruction was carried out."""
        return self.outcome == "success"

    @property
    def planning_s(self) -> float:
        """Seconds of planning: the sum over the stages that the agent reports."""
        return sum(self.trace.seconds.values())


_LINE = msgspec.json.Decoder(RunHeader | EpisodeRecord)
_SCHEMAS = ("gavel-run/1", "gavel-record/1")


class _Schema(msgspec.Struct):
    schema: str = ""


class RecordFile(NamedTuple):
    """What record files hold.

    Attributes:
        headers: in order.
        records: by key; of records with the same key the last one.
        damaged: `PLACE: REASON` per line that is no record; their episodes count as not run.
    """

    headers: tuple[RunHeader, ...]
    records: Mapping[EpisodeKey, EpisodeRecord]
    damaged: tuple[str, ...]


def read_records(paths: Iterable[str | Path]) -> RecordFile:
    """Read record files; a folder stands for its `records.jsonl`. A torn last line is left out.

    Raises:
        DataError: unreadable file, no line that is a record, or a schema of another version.
    """
    headers: list[RunHeader] = []
    records: dict[EpisodeKey, EpisodeRecord] = {}
    damaged: list[str] = []
    for path in map(Path, paths):
        file = path / "records.jsonl" if path.is_dir() else path
        try:
            content = file.read_bytes()
        except OSError as error:
            raise DataError(f"records {file} cannot be read: {error.strerror}") from error
        for number, line in enumerate(content.splitlines(keepends=True), start=1):
            if not line.endswith(b"\n"):
                damaged.append(f"{file}:{number}: torn last line")
                continue
            try:
                entry = _LINE.decode(line)
            except msgspec.DecodeError as error:
                _refuse_other_version(line, f"{file}:{number}")
                damaged.append(f"{file}:{number}: {error}")
                continue
            if isinstance(entry, RunHeader):
                headers.append(entry)
            else:
                records[entry.key] = entry
        if not headers and not records:
            raise DataError(f"{file} holds no record" + (f"; {damaged[0]}" if damaged else ""))
    return RecordFile(tuple(headers), records, tuple(damaged))


def _refuse_other_version(line: bytes, place: str) -> None:
    try:
        schema = msgspec.json.decode(line, type=_Schema).schema
    except msgspec.DecodeError:
        return
    if schema.startswith("gavel-") and schema not in _SCHEMAS:
        raise DataError(f"{place}: schema {schema!r} is not known here; known: {', '.join(_SCHEMAS)}")


class RecordWriter:
    """Appends lines to one record file; the only writer of that file while it is open."""

    def __init__(self, path: str | Path) -> None:
        """Open (or create) the file, lock it, and cut off a torn last line.

        Raises:
            DataError: the file cannot be opened, or another run is writing to it.
        """
        self.path = Path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise DataError(f"records {self.path} cannot be written: {error.strerror}") from error
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._descriptor)
            raise DataError(f"records {self.path} are being written by another run; choose another --out") from error
        content = self.path.read_bytes()
        if content and not content.endswith(b"\n"):
            os.ftruncate(self._descriptor, content.rfind(b"\n") + 1)

    def write(self, entry: RunHeader | EpisodeRecord) -> None:
        """Append one line and flush it to the disk.

        Raises:
            DataError: the disk did not take the whole line.
        """
        line = scrub_secrets(msgspec.json.encode(entry).decode()).encode() + b"\n"
        try:
            written = os.write(self._descriptor, line)
            os.fsync(self._descriptor)
        except OSError as error:
            raise DataError(f"records {self.path} cannot be written: {error.strerror}") from error
        if written != len(line):
            raise DataError(f"records {self.path}: only {written} of {len(line)} bytes were written; is the disk full?")

    def close(self) -> None:
        """Close the file and give up its lock."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> RecordWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
