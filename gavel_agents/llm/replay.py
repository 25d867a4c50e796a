"""Record and replay: every completion stored under the hash of (model, decoding, prompt).

A recording is a gzip-compressed JSON Lines file; concatenating two recordings merges them. It is only appended to, a
whole gzip member at a time and by one process; one that does not read whole is set aside and never rewritten. Replays
are bit-exact, need no model, and fail with the missing prompt's hash instead of inventing an answer.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from gavel_agents.llm.interface import ChatModel, Completion, Message, Prompt, decoding_of
from gavel_env.appended import AppendedFile, cut_member, free_name, read_members
from gavel_env.data import decode, is_path, read_json, sayable
from gavel_env.errors import DataError, NotRecorded

__all__ = ["NotRecorded", "Recorded", "RecordingModel", "ReplayModel", "completion_key", "read_recording"]

MOST_BYTES = 256 << 20
"""Of one recording, as unpacked."""

MOST_LINE_BYTES = 16 << 20
"""Of one completion."""

_PER_MEMBER = 100
"""Completions to a gzip member of a compacted recording: what one torn byte can cost."""

RECORDINGS = Path(str(resources.files("envs_data") / "recordings"))
"""Folder of the shipped recordings and of the index that says what they are of."""


class Recorded(msgspec.Struct, frozen=True, omit_defaults=True):
    """One stored completion, with what it answered.

    Attributes:
        key: `completion_key` of what follows.
        model: name of the model.
        decoding: its decoding parameters; what a prompt asked for instead (seed, temperature) is in the key alone.
        instruction: text of the instruction that the prompt was about; older recordings have its id instead.
        attempt: 0 for a first proposal.
        text: the raw answer.
        prompt_tokens, completion_tokens: as the backend counted them.
        seconds: as measured when it was recorded.
        finish_reason: how the answer ended, where the backend said so.
    """

    key: str
    model: str
    decoding: dict[str, str | float | int]
    attempt: int
    text: str
    prompt_tokens: int
    completion_tokens: int
    seconds: float
    instruction_id: str = ""
    instruction: str = ""
    finish_reason: str = ""


def _completion(recorded: Recorded) -> Completion:
    return Completion(
        recorded.text,
        recorded.prompt_tokens,
        recorded.completion_tokens,
        recorded.seconds,
        recorded.finish_reason,
    )


def completion_key(
    model: str,
    decoding: Mapping[str, str | float | int],
    messages: Sequence[Message],
    schema: Mapping[str, Any] | None = None,
) -> str:
    """Return the SHA-256 (32 hexadecimal digits) of model, decoding, conversation and, if there is one, schema."""
    asked = [model, dict(sorted(decoding.items())), messages, *(() if schema is None else (schema,))]
    content = msgspec.json.encode(asked, order="sorted")
    return hashlib.sha256(content).hexdigest()[:32]


def read_recording(path: str | Path) -> Iterator[Recorded]:
    """Yield the completions of a recording; of one that a killed run left cut off, those that were whole.

    Raises:
        DataError: unreadable, or damaged other than at its end.
    """
    read = _Reading(path)
    yield from read
    if read.damaged and not read.cut:
        raise DataError(f"recording {path}: {read.damaged[0]}; `gavel record` sets it aside and keeps what can be read")


class _Reading:
    """Reads what can be read of a recording.

    Attributes:
        damaged: what could not be read, and why; complete once everything has been taken.
        cut: what is damaged is at its end alone.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.damaged: list[str] = []
        self.cut = True

    def __iter__(self) -> Iterator[Recorded]:
        if not self.path.is_file():
            reason = "it is not a regular file" if self.path.exists() else "no such file"
            raise DataError(f"recording {self.path} cannot be read: {reason}")
        end = total = 0
        try:
            for member in read_members(self.path):
                if member.start != end:
                    self._note(f"bytes {end} to {member.start} cannot be unpacked", cut=False)
                yield from self._lines(member.content, whole=True)
                end = member.end
                total += len(member.content)
                if total > MOST_BYTES:
                    raise DataError(f"recording {self.path} unpacks to more than {MOST_BYTES} bytes; split it")
            size = self.path.stat().st_size
            if end != size:
                rest = cut_member(self.path, end)
                what = "is not gzip" if end == 0 and rest is None else "cannot be unpacked"
                self._note(f"what follows byte {end} of {size} {what}", cut=rest is not None)
                yield from self._lines(rest or b"", whole=False)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise DataError(f"recording {self.path} cannot be read: {why}") from error

    def _lines(self, content: bytes, *, whole: bool) -> Iterator[Recorded]:
        lines = content.split(b"\n")
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                if len(line) > MOST_LINE_BYTES:
                    raise ValueError(f"a line of {len(line)} bytes")
                found = decode(line, Recorded)
            except (msgspec.DecodeError, ValueError, RecursionError) as error:
                if whole or number < len(lines):
                    self._note(f"malformed recording: {error}", cut=False)
            else:
                yield found

    def _note(self, what: str, *, cut: bool) -> None:
        self.damaged.append(what)
        self.cut = self.cut and cut


class ReplayModel:
    """Answers from a recording: `replay:PATH`, or `replay:NAME` for a shipped one."""

    def __init__(self, path: str) -> None:
        """Read the recording.

        Raises:
            DataError: unreadable, malformed, empty, or of several models.
        """
        self._path = path if is_path(path) or Path(path).is_file() else str(shipped_recording(path))
        self._completions = {r.key: r for r in read_recording(self._path)}
        models = {(r.model, tuple(sorted(r.decoding.items()))) for r in self._completions.values()}
        if len(models) != 1:
            names = ", ".join(sorted(model for model, _ in models)) or "none"
            raise DataError(f"recording {self._path} must hold the completions of one model; it holds: {names}")
        [(self.name, decoding)] = models
        self.decoding: Mapping[str, str | float | int] = dict(decoding)

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return the recorded completions.

        Raises:
            NotRecorded: says which prompt, and how to record it.
        """
        return [self._answer(p) for p in prompts]

    def _answer(self, prompt: Prompt) -> Completion:
        key = completion_key(self.name, decoding_of(self.decoding, prompt), prompt.messages, prompt.schema)
        recorded = self._completions.get(key)
        if recorded is None:  # perhaps recorded without a seed
            recorded = self._completions.get(completion_key(self.name, self.decoding, prompt.messages, prompt.schema))
        if recorded is None:
            raise NotRecorded(
                f"attempt {prompt.attempt} of instruction {prompt.about.text[:80]!r} (prompt {key}) is not in "
                f"{Path(self._path).name}; record it with: gavel record --planner gguf:MODEL.gguf --out {self._path}"
            )
        return _completion(recorded)


class RecordingModel:
    """Answers from a recording where it can, else asks the model and appends what it said (one gzip member each)."""

    def __init__(self, model: ChatModel, path: str | Path, clean: Callable[[str], str] = str) -> None:
        """Continue the recording at `path`, or begin it. One that does not read whole is set aside first.

        Args:
            model: what is asked.
            path: of the recording.
            clean: what every answer passes through before it is written: takes secrets out.

        Raises:
            DataError: the recording cannot be read or written, or another process is writing to it.
        """
        self.name = model.name
        self.decoding = model.decoding
        self.set_aside: Path | None = None
        self._model = model
        self._clean = clean
        self._file = AppendedFile(path, "recordings")
        reading = _Reading(path)
        self._known = {r.key: r for r in reading}
        if reading.damaged:
            self.set_aside = free_name(self._file.path)
            self._file.set_aside(self.set_aside, _packed(self._known.values()) if self._known else b"")
        self._writing = threading.Lock()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt; new ones are on the disk before this returns.

        Raises:
            DataError: the disk does not take them.
        """
        keys = [completion_key(self.name, decoding_of(self.decoding, p), p.messages, p.schema) for p in prompts]
        missing = {key: prompt for key, prompt in zip(keys, prompts, strict=True) if key not in self._known}
        answers = self._model.complete(list(missing.values())) if missing else []
        new = {
            key: Recorded(
                key,
                self.name,
                dict(self.decoding),
                prompt.attempt,
                sayable(self._clean(answer.text)),
                answer.prompt_tokens,
                answer.completion_tokens,
                round(answer.seconds, 3),
                instruction=sayable(prompt.about.text),
                finish_reason=answer.finish_reason,
            )
            for (key, prompt), answer in zip(missing.items(), answers, strict=True)
        }
        with self._writing:
            if new:
                self._file.append(_packed(new.values()))
                self._known.update(new)
            known = [self._known[key] for key in keys]
        return [_completion(recorded) for recorded in known]

    def close(self) -> None:
        """Close the recording, which others may then write to."""
        self._file.close()


def _packed(records: Iterable[Recorded]) -> bytes:
    return gzip.compress(b"".join(msgspec.json.encode(r) + b"\n" for r in records), mtime=0)


def compact(path: str | Path) -> int:
    """Rewrite a recording sorted by instruction, attempt and key, many completions to a member; return their number.

    The new file takes the old one's place when it is on the disk; a recording that does not read whole stays as it is.

    Raises:
        DataError: the recording cannot be read whole, or the new one cannot be written.
    """
    if not Path(path).is_file():
        raise DataError(f"recording {path} cannot be read: no such file")
    with AppendedFile(path, "recordings"):
        reading = _Reading(path)
        records = {r.key: r for r in reading}
        if reading.damaged:
            raise DataError(f"recording {path} stays as it is: {reading.damaged[0]}")
        ordered = sorted(records.values(), key=lambda r: (r.instruction_id, r.instruction, r.attempt, r.key))
        temporary = Path(f"{path}.new")
        try:
            with temporary.open("wb") as file:
                for start in range(0, len(ordered), _PER_MEMBER):
                    file.write(_packed(ordered[start : start + _PER_MEMBER]))
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise DataError(f"recording {path} cannot be rewritten: {error.strerror}; it stays as it is") from error
    return len(ordered)


def shipped_recording(name: str) -> Path:
    """Return the path of a shipped recording.

    Raises:
        DataError: no such file; lists those that exist.
    """
    path = RECORDINGS / f"{name}.jsonl.gz"
    if not path.is_file():
        known = ", ".join(sorted(p.name.removesuffix(".jsonl.gz") for p in RECORDINGS.glob("*.jsonl.gz"))) or "none"
        raise DataError(f"no recording {name!r} at this path or shipped; shipped recordings: {known}")
    return path


class ShippedRecording(msgspec.Struct, frozen=True):
    """What `envs_data/recordings/index.json` says of a recording.

    Attributes:
        model: name of the model.
        source: where the model comes from.
        instructions: shipped instruction file that was recorded.
        agents: methods all of whose prompts are in it.
        sample: so many of the instructions were recorded, as `eval.records.sampling` takes them; None = all.
    """

    model: str
    source: str
    instructions: str
    agents: tuple[str, ...]
    sample: int | None = None


def shipped_recordings() -> dict[str, ShippedRecording]:
    """Return the shipped recordings by name."""
    index = RECORDINGS / "index.json"
    if not index.is_file():
        return {}
    return read_json(index, dict[str, ShippedRecording], "index of recordings")
