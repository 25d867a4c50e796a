"""Whether a run folder is what it says: every recorded action and every prompt is played again and compared.

Built-in agents plan again from the recorded answers, so that a changed prompt, plan, verdict or order is found as well
as a changed action, distance or outcome. Of other agents the recorded actions are played.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from eval.records.conversations import Call, Exchange, read_conversations
from eval.records.journal import RecordFile, read_records
from eval.records.provenance import data_stamp
from eval.records.schema import Benchmark, Contestant, EpisodeKey, EpisodeRecord, RunHeader
from eval.records.scrub import scrubbed
from eval.run.episodes import EnvironmentSettings, Episode
from eval.run.playback import playback
from eval.run.rig import Rig
from gavel_agents.agent import Agent
from gavel_agents.llm import ChatModel, Completion, Prompt
from gavel_agents.methods import METHODS
from gavel_agents.understanding import ModelUnderstanding, Understanding
from gavel_env.errors import DataError, GavelError
from gavel_env.instructions.record import Instruction, read_instructions, shipped

__all__ = ["Finding", "Verification", "instructions_of", "verify_run", "with_headers"]

_SHIPPED = ("single", "multi", "behavior")
_NOT_PLAYED = ("error", "timeout", "rejected")
"""Outcomes of episodes that did not come to their end; they count as not solved, whatever happened."""

_MEASURED = ("seconds", "finished", "code", "usage", "calls", "error", "contestant")
"""Fields that another run of the same episode need not share."""


class Finding(NamedTuple):
    """One thing that is not as recorded: where, and what."""

    place: str
    what: str


class Verification(NamedTuple):
    """What came out.

    Attributes:
        replayed: episodes that were played again, of `recorded`.
        recorded: records.
        missing: scheduled episodes without a record.
        findings: what is not as recorded; a run passes without any.
    """

    replayed: int
    recorded: int
    missing: int
    findings: tuple[Finding, ...]


class _Differs(GavelError):
    """A prompt is not the one that was recorded."""


class _StoredCalls:
    """Answers with an episode's recorded completions, in order, as long as the prompts are the recorded ones."""

    def __init__(self, record: EpisodeRecord, calls: Sequence[Call]) -> None:
        self.name = record.model
        self.decoding: Mapping[str, str | float | int] = record.decoding
        self._left = deque(calls)

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the recorded completions.

        Raises:
            _Differs: another prompt, or one more, than was recorded.
        """
        return [self._next(prompt) for prompt in prompts]

    def _next(self, prompt: Prompt) -> Completion:
        if not self._left:
            raise _Differs("asks the model more often than was recorded")
        call = self._left.popleft()
        asked = [(message.role, scrubbed(message.content)) for message in prompt.messages]
        if asked != [(message.role, message.content) for message in call.messages]:
            raise _Differs(f"asks something different from call {call.id} says")
        return call.completion


class _Replays(Rig):
    """A rig whose agents and models are those of one record."""

    def of(self, record: EpisodeRecord, calls: Sequence[Call]) -> _Replays:
        self._record, self._stored = record, _StoredCalls(record, calls)
        return self

    @property
    def built_in(self) -> bool:
        return self._record.contestant.agent in (*METHODS, "oracle", "react")

    def load(self, planner: str) -> ChatModel | None:
        return self._stored if planner else None

    def agent(
        self, contestant: Contestant, instruction: Instruction, seed: int, exchanges: list[Exchange] | None = None
    ) -> Agent:
        if self.built_in:
            return super().agent(contestant, instruction, seed, exchanges)
        return playback(self._record)

    def _understanding(
        self, contestant: Contestant, instruction: Instruction, model: ChatModel | None, exchanges: list[Exchange]
    ) -> Understanding | None:
        if contestant.understanding.partition(":")[0] == "adapter":
            return ModelUnderstanding(contestant.understanding, self._stored, trained=True)
        return super()._understanding(contestant, instruction, model, exchanges)


def verify_run(folder: str | Path, instructions: Iterable[str | Path] = ()) -> Verification:
    """Play a run again and compare.

    Args:
        folder: of the run, or its record file.
        instructions: files beside the shipped ones that the run was about.

    Raises:
        DataError: the folder holds no record, or no instruction file has the stamp that was run.
    """
    files = read_records([folder])
    conversations = read_conversations([folder])
    findings = [Finding(place, "is not a record") for place in files.damaged]
    findings += [Finding("conversations", damage) for damage in conversations.damaged]
    findings += [Finding(f"conversations: {key}", "is not what its hash is of") for key in conversations.changed()]
    known = instructions_of(files, instructions)
    rigs: dict[bytes, _Replays] = {}
    replayed = 0
    for header, record in with_headers(files):
        place = f"{record.contestant.agent} {record.instruction} seed {record.seed}"
        calls = [conversations.get(call) for call in record.calls]
        lost = [key for key, call in zip(record.calls, calls, strict=True) if call is None]
        findings += [Finding(place, f"call {key} is not in the conversations") for key in lost]
        if lost or record.outcome in _NOT_PLAYED:
            continue
        instruction = known.get((record.data, record.instruction))
        if instruction is None:
            findings.append(Finding(place, f"data {record.data} has no such instruction"))
            continue
        settings = msgspec.convert(header.environment, EnvironmentSettings)
        key = msgspec.json.encode(settings)
        if key not in rigs:
            rigs[key] = _Replays(settings)
        found = [call for call in calls if call is not None]
        findings += [Finding(place, what) for what in _compared(rigs[key].of(record, found), record, instruction)]
        replayed += 1
    scheduled = set[EpisodeKey]().union(*(header.keys() for header in files.headers))
    return Verification(replayed, len(files.records), len(scheduled - files.records.keys()), tuple(findings))


def instructions_of(files: RecordFile, paths: Iterable[str | Path] = ()) -> dict[tuple[str, str], Instruction]:
    """Return (data stamp, id) -> instruction of every benchmark of a run.

    Args:
        files: its records.
        paths: instruction files beside the shipped ones.

    Raises:
        DataError: no file has the stamp that was run.
    """
    sets = [read_instructions(shipped(name)) for name in _SHIPPED] + [read_instructions(path) for path in paths]
    stamps = {data_stamp(one.stamp, one.values()): one for one in sets}
    found: dict[tuple[str, str], Instruction] = {}
    for benchmark in _benchmarks(files):
        if benchmark.data not in stamps:
            raise DataError(
                f"no instruction file here has the data stamp {benchmark.data} of {benchmark.source}: give it with "
                "--instructions, or take the version of this package that was run"
            )
        found |= {(benchmark.data, i.id): i for i in stamps[benchmark.data].values()}
    return found


def _benchmarks(files: RecordFile) -> list[Benchmark]:
    return list({b.data: b for header in files.headers for b in header.benchmarks}.values())


def with_headers(files: RecordFile) -> Iterator[tuple[RunHeader, EpisodeRecord]]:
    """Yield every record with the header that scheduled it.

    Raises:
        DataError: there is no header.
    """
    scheduled: dict[EpisodeKey, RunHeader] = {}
    for header in files.headers:
        scheduled |= dict.fromkeys(header.keys(), header)
    if not files.headers:
        raise DataError("the records have no header, so what was scheduled is not known")
    for key, record in files.records.items():
        yield scheduled.get(key, files.headers[-1]), record


def _compared(rig: _Replays, record: EpisodeRecord, instruction: Instruction) -> list[str]:
    """Return what is not as recorded when an episode is played again."""
    episode = Episode(record.key, record.kind, record.contestant, record.code, instruction)
    again = rig.run(episode).record
    if again.outcome in _NOT_PLAYED:
        return [f"cannot be played again: {again.error.strip().splitlines()[-1] if again.error else again.failure}"]
    skipped = set(_MEASURED)
    if not rig.built_in:
        skipped |= {"trace", "model", "decoding", "method", "misread"}
    was, now = _plain(record), _plain(again)
    found = []
    for field in was:
        if field in skipped or was[field] == now[field]:
            continue
        found.append(f"{field}: recorded {_short(was[field])}, played again {_short(now[field])}")
    return found


def _plain(record: EpisodeRecord) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.to_builtins(record)
    for name in ("seconds", "completions", "prompt_tokens", "completion_tokens"):
        fields["trace"].pop(name, None)
    return fields


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 120 else f"{text[:117]}..."
