"""What models were asked and answered: every text and every call once, beside the records that lead to them.

`conversations.jsonl.gz` in the folder of a run is JSON Lines in gzip members, appended whole; concatenating two such
files merges them. A `StoredText` is a message or a completion under the hash of its content; a `StoredCall` says of
which texts a call consists. The `calls` of an episode's record are ids of `StoredCall`s.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import msgspec

from eval.records.scrub import scrubbed
from gavel_agents.llm import Completion, Message
from gavel_env.appended import cut_member, read_members
from gavel_env.errors import DataError

__all__ = [
    "Call",
    "ConversationWriter",
    "Conversations",
    "Exchange",
    "StoredCall",
    "StoredText",
    "conversations_beside",
    "conversations_of",
    "read_conversations",
]

FILE = "conversations.jsonl.gz"

MOST_BYTES = 1 << 30
"""Of one file, as unpacked: some 100,000 calls of several pages each."""

_SYNC_S = 1.0


class Exchange(msgspec.Struct, frozen=True):
    """One call of a model as it happened in an episode.

    Attributes:
        model: name of the model.
        decoding: its decoding parameters in this call, with temperature and seed.
        messages: the conversation that was to be continued.
        completion: what came back.
        schema: JSON schema to which the answer was held, as text; empty without one.
        asked: the model was asked now; otherwise the answer was another episode's or came from a file.
    """

    model: str
    decoding: dict[str, str | float | int]
    messages: tuple[Message, ...]
    completion: Completion
    schema: str = ""
    asked: bool = True


class StoredText(msgspec.Struct, frozen=True, tag_field="kind", tag="text"):
    """A text under the first 32 hexadecimal digits of its SHA-256."""

    id: str
    text: str


class StoredCall(msgspec.Struct, frozen=True, tag_field="kind", tag="call", omit_defaults=True):
    """A call; its id is the hash of model, decoding, messages, schema and completion.

    Attributes:
        messages: (role, id of the text) per turn.
        completion: id of the text.
        schema: id of the text, or empty.
        prompt_tokens, completion_tokens, seconds: as the backend counted them when it was first asked.
        finish_reason: how the answer ended, where the backend said so: "stop", "length" or "filter".
    """

    id: str
    model: str
    decoding: dict[str, str | float | int]
    messages: tuple[tuple[Literal["system", "user", "assistant"], str], ...]
    completion: str
    schema: str = ""
    prompt_tokens: int = 0
    completion_tokens: int = 0
    seconds: float = 0.0
    finish_reason: str = ""

    def content_id(self) -> str:
        """Return the id that belongs to the content."""
        return _digest([self.model, self.decoding, self.messages, self.schema, self.completion])


class Call(msgspec.Struct, frozen=True):
    """A stored call with its texts.

    Attributes:
        id: of the `StoredCall`.
        model, decoding: who was asked, and how.
        messages: what was asked.
        completion: what was answered.
        schema: JSON schema to which the answer was held, as text; empty without one.
    """

    id: str
    model: str
    decoding: dict[str, str | float | int]
    messages: tuple[Message, ...]
    completion: Completion
    schema: str = ""


_Entry = StoredText | StoredCall
_ENTRY: msgspec.json.Decoder[_Entry] = msgspec.json.Decoder(_Entry)


def _digest(content: Any) -> str:
    packed = content.encode() if isinstance(content, str) else msgspec.json.encode(content, order="deterministic")
    return hashlib.sha256(packed).hexdigest()[:32]


class Conversations:
    """Stored calls, found by id.

    Attributes:
        damaged: `PLACE: REASON` for what could not be read.
    """

    def __init__(self, calls: Mapping[str, StoredCall], texts: Mapping[str, str], damaged: Sequence[str] = ()) -> None:
        self._calls, self._texts = calls, texts
        self.damaged = tuple(damaged)

    def __len__(self) -> int:
        return len(self._calls)

    def __contains__(self, call: object) -> bool:
        return call in self._calls

    def get(self, call: str) -> Call | None:
        """Return a call with its texts; None if it, or one of them, is not there (records of older runs have none)."""
        stored = self._calls.get(call)
        if stored is None:
            return None
        ids = [text for _, text in stored.messages] + [stored.completion] + ([stored.schema] if stored.schema else [])
        if not all(text in self._texts for text in ids):
            return None
        return Call(
            stored.id,
            stored.model,
            stored.decoding,
            tuple(Message(role, self._texts[text]) for role, text in stored.messages),
            Completion(
                self._texts[stored.completion],
                stored.prompt_tokens,
                stored.completion_tokens,
                stored.seconds,
                stored.finish_reason,
            ),
            self._texts.get(stored.schema, ""),
        )

    def changed(self) -> list[str]:
        """Return the ids of calls and texts whose content is not what their ids are of."""
        texts = [key for key, text in self._texts.items() if _digest(text) != key]
        return texts + [key for key, call in self._calls.items() if call.content_id() != key]


def read_conversations(paths: Iterable[str | Path]) -> Conversations:
    """Read the conversations of record files, or of folders with one; files of runs that kept none are passed over.

    Raises:
        DataError: a file cannot be read, or unpacks to more than `MOST_BYTES`.
    """
    calls: dict[str, StoredCall] = {}
    texts: dict[str, str] = {}
    damaged: list[str] = []
    for path in map(conversations_of, paths):
        if not os.path.exists(path):
            continue
        end = total = 0
        try:
            for member in read_members(path):
                total += len(member.content)
                if total > MOST_BYTES:
                    raise DataError(f"conversations {path} unpack to more than {MOST_BYTES} bytes; split the run")
                if member.start != end:
                    damaged.append(f"{path}: bytes {end} to {member.start} cannot be read")
                end = member.end
                for entry in _entries(member.content, path, damaged):
                    if isinstance(entry, StoredText):
                        texts.setdefault(entry.id, entry.text)
                    else:
                        calls.setdefault(entry.id, entry)
            if end != path.stat().st_size:
                damaged.append(f"{path}: bytes from {end} cannot be read")
        except OSError as error:
            raise DataError(f"conversations {path} cannot be read: {error.strerror}") from error
    return Conversations(calls, texts, damaged)


def _entries(content: bytes, path: Path, damaged: list[str]) -> Iterable[_Entry]:
    for line in content.splitlines():
        try:
            yield _ENTRY.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            damaged.append(f"{path}: {error}")


def conversations_of(path: str | Path) -> Path:
    """Return where the conversations of a record file, or of the folder of a run, lie."""
    path = Path(path)
    if os.path.isdir(path):
        return path / FILE
    return path if path.name.endswith(".gz") else conversations_beside(path)


def conversations_beside(records: Path) -> Path:
    """Return the name under which conversations are set aside with their records: `records.1.jsonl` has its own."""
    return records.with_name(records.stem.replace("records", "conversations") + ".jsonl.gz")


class ConversationWriter:
    """Appends what is new to the conversations of a run, which only this process writes."""

    def __init__(self, path: str | Path) -> None:
        """Open the file, or begin it with the first call.

        What a killed run left torn at its end is cut off; whatever else cannot be read stays as it is.

        Raises:
            DataError: the file cannot be read or written.
        """
        self.path = Path(path)
        self._known: set[str] = set()
        self._descriptor = -1
        self._synced_s = time.monotonic()
        end = 0
        try:
            if os.path.exists(self.path):
                for member in read_members(self.path):
                    end = member.end
                    self._known.update(entry.id for entry in _entries(member.content, self.path, []))
                if end != self.path.stat().st_size and cut_member(self.path, end) is not None:
                    os.truncate(self.path, end)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DataError(f"conversations {self.path} cannot be opened: {reason}") from error

    def add(self, exchanges: Sequence[Exchange]) -> list[str]:
        """Write the texts and calls that are new, as one member; return the ids of all calls, in order.

        What is written outlives the process at once, and a power cut after a second.

        Raises:
            DataError: the disk did not take them.
        """
        new: dict[str, _Entry] = {}
        ids = [self._stored(exchange, new) for exchange in exchanges]
        if new:
            lines = b"".join(msgspec.json.encode(entry) + b"\n" for entry in new.values())
            self._append(gzip.compress(lines, mtime=0))
            self._known.update(new)
        return ids

    def _stored(self, exchange: Exchange, new: dict[str, _Entry]) -> str:
        def text(content: str) -> str:
            content = scrubbed(content)
            key = _digest(content)
            if key not in self._known:
                new[key] = StoredText(key, content)
            return key

        completion = exchange.completion
        call = StoredCall(
            "",
            scrubbed(exchange.model),
            scrubbed(exchange.decoding),
            tuple((message.role, text(message.content)) for message in exchange.messages),
            text(completion.text),
            text(exchange.schema) if exchange.schema else "",
            completion.prompt_tokens,
            completion.completion_tokens,
            round(completion.seconds, 3),
            completion.finish_reason,
        )
        call = msgspec.structs.replace(call, id=call.content_id())
        if call.id not in self._known:
            new[call.id] = call
        return call.id

    def _append(self, packed: bytes) -> None:
        try:
            if self._descriptor < 0:
                self._descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
            written = os.write(self._descriptor, packed)
            if time.monotonic() - self._synced_s >= _SYNC_S:
                self._sync()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DataError(f"conversations {self.path} cannot be written: {reason}") from error
        if written != len(packed):
            raise DataError(f"conversations {self.path}: {written} of {len(packed)} bytes written; is the disk full?")

    def _sync(self) -> None:
        os.fsync(self._descriptor)
        self._synced_s = time.monotonic()

    def close(self) -> None:
        """Flush the file to the disk and close it."""
        if self._descriptor >= 0:
            self._sync()
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> ConversationWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
