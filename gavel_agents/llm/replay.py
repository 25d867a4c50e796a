"""Record and replay: every completion stored under the hash of (model, decoding, prompt).

A recording is a gzip-compressed JSON Lines file; concatenating two recordings merges them. Replays are bit-exact, need
no model, and fail with the missing prompt's hash instead of inventing an answer.
"""

from __future__ import annotations

import gzip
import hashlib
import threading
import zlib
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from gavel_agents.llm.interface import ChatModel, Completion, Message, Prompt, decoding_of
from gavel_env.errors import DataError, NotRecorded

__all__ = ["NotRecorded", "Recorded", "RecordingModel", "ReplayModel", "completion_key", "read_recording"]


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
    """Yield the completions of a recording; a torn last line (a killed run) is passed over.

    Raises:
        DataError: unreadable, or malformed before its last line.
    """
    try:
        content = _unpacked(Path(path).read_bytes())
    except OSError as error:
        raise DataError(f"recording {path} cannot be read: {error.strerror}") from error
    lines = content.split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            yield msgspec.json.decode(line, type=Recorded)
        except msgspec.DecodeError as error:
            if number == len(lines):
                return
            raise DataError(f"{path}:{number}: malformed recording: {error}") from error


def _unpacked(packed: bytes) -> bytes:
    """Decompress as many whole gzip members as there are; a torn last one is passed over."""
    out = bytearray()
    while packed:
        stream = zlib.decompressobj(zlib.MAX_WBITS | 16)
        try:
            part = stream.decompress(packed)
        except zlib.error as error:
            raise DataError(f"a recording holds something that is not gzip: {error}") from error
        if not stream.eof:
            break
        out += part
        packed = stream.unused_data
    return bytes(out)


class ReplayModel:
    """Answers from a recording: `replay:PATH`, or `replay:NAME` for a shipped one."""

    def __init__(self, path: str) -> None:
        """Read the recording.

        Raises:
            DataError: unreadable, malformed, empty, or of several models.
        """
        self._path = path if Path(path).exists() else str(shipped_recording(path))
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
        return Completion(recorded.text, recorded.prompt_tokens, recorded.completion_tokens, recorded.seconds)


class RecordingModel:
    """Answers from a recording where it can, else asks the model and appends what it said (one gzip member each)."""

    def __init__(self, model: ChatModel, path: str | Path) -> None:
        """Continue the recording at `path` (what a killed run tore off its end is dropped), or begin it."""
        self.name = model.name
        self.decoding = model.decoding
        self._model = model
        self._path = Path(path)
        if self._path.exists():
            compact(self._path)
        self._known = {r.key: r for r in read_recording(path)} if self._path.exists() else {}
        self._writing = threading.Lock()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt; new ones are on disk before this returns."""
        keys = [completion_key(self.name, decoding_of(self.decoding, p), p.messages, p.schema) for p in prompts]
        missing = {key: prompt for key, prompt in zip(keys, prompts, strict=True) if key not in self._known}
        answers = self._model.complete(list(missing.values())) if missing else []
        for (key, prompt), answer in zip(missing.items(), answers, strict=True):
            recorded = Recorded(
                key,
                self.name,
                dict(self.decoding),
                prompt.attempt,
                answer.text,
                answer.prompt_tokens,
                answer.completion_tokens,
                round(answer.seconds, 3),
                instruction=prompt.about.text,
            )
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._writing, self._path.open("ab") as file:
                self._known[key] = recorded
                file.write(gzip.compress(msgspec.json.encode(recorded) + b"\n", mtime=0))
        known = [self._known[key] for key in keys]
        return [Completion(r.text, r.prompt_tokens, r.completion_tokens, r.seconds) for r in known]


def compact(path: str | Path) -> int:
    """Rewrite a recording sorted by instruction, attempt and key, as one gzip member; return its completions."""
    records = {r.key: r for r in read_recording(path)}
    ordered = sorted(records.values(), key=lambda r: (r.instruction_id, r.instruction, r.attempt, r.key))
    content = b"".join(msgspec.json.encode(r) + b"\n" for r in ordered)
    temporary = Path(f"{path}.new")
    temporary.write_bytes(gzip.compress(content, mtime=0))
    temporary.replace(path)
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
    return msgspec.json.decode(index.read_bytes(), type=dict[str, ShippedRecording])
