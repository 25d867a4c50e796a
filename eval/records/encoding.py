"""One line of a record file: scrubbed value by value, encoded, and read back before anybody relies on it."""

from __future__ import annotations

import msgspec

from eval.records.schema import EpisodeRecord, RunHeader
from eval.records.scrub import scrubbed
from gavel_env.errors import Unencodable

__all__ = ["LINE", "encoded", "sound"]

LINE = msgspec.json.Decoder(RunHeader | EpisodeRecord)

_OURS = frozenset({"schema", "seed", "instruction", "kind", "scene", "data", "config", "code", "outcome", "calls"})
"""Fields whose values this project writes itself: no secret, and records are found by them."""


def encoded(entry: RunHeader | EpisodeRecord) -> bytes:
    """Return an entry as one line, without secrets.

    Raises:
        Unencodable: what is in it cannot be written, or could not be read again.
    """
    try:
        line = msgspec.json.encode(scrubbed(msgspec.to_builtins(entry, str_keys=True), _OURS))
        LINE.decode(line)
    except (TypeError, ValueError, OverflowError, RecursionError, msgspec.MsgspecError) as error:
        raise Unencodable(f"the record cannot be written: {type(error).__name__}: {error}") from error
    return line + b"\n"


def sound(record: EpisodeRecord) -> EpisodeRecord:
    """Return a record as it will be read again; if it cannot be written, one of an error that says why.

    What an agent leaves in its trace is the agent's; it must not end the run of the others.
    """
    try:
        found = LINE.decode(encoded(record))
    except Unencodable as why:
        return EpisodeRecord(
            seed=record.seed,
            instruction=record.instruction,
            kind=record.kind,
            scene=record.scene,
            text=record.text,
            data=record.data,
            code=record.code,
            contestant=record.contestant,
            outcome="error",
            failure="error:Unencodable",
            error=scrubbed(str(why)),
            finished=record.finished,
        )
    assert isinstance(found, EpisodeRecord)
    return found
