"""One line of a record file: scrubbed value by value, encoded, and read back before anybody relies on it."""

from __future__ import annotations

import msgspec

from eval.records.schema import Benchmark, Contestant, EpisodeRecord, RejectedLine, RunHeader, Step, Usage
from eval.records.scrub import may_hold_secrets, scrubbed
from gavel_agents.agent import AgentTrace, TaskTrace
from gavel_env.errors import Unencodable

__all__ = ["LINE", "encoded", "sound"]

LINE = msgspec.json.Decoder(RunHeader | EpisodeRecord)

_OURS = frozenset({"schema", "seed", "instruction", "kind", "scene", "data", "config", "code", "outcome", "calls"})
"""Fields whose values this project writes itself: no secret, and records are found by them."""


_FIELDS = frozenset({"schema"}).union(
    *(
        kind.__struct_fields__
        for kind in (RunHeader, EpisodeRecord, Benchmark, RejectedLine, Contestant, Step, Usage, AgentTrace, TaskTrace)
    )
)


def encoded(entry: RunHeader | EpisodeRecord) -> bytes:
    """Return an entry as one line, without secrets.

    Raises:
        Unencodable: what is in it cannot be written, or could not be read again.
    """
    try:
        line = _plainly(entry)
        if line is None:
            line = msgspec.json.encode(scrubbed(msgspec.to_builtins(entry, str_keys=True), _OURS, _FIELDS))
        LINE.decode(line)
    except (TypeError, ValueError, OverflowError, RecursionError, msgspec.MsgspecError) as error:
        raise Unencodable(f"the record cannot be written: {type(error).__name__}: {error}") from error
    return line + b"\n"


def _plainly(entry: RunHeader | EpisodeRecord) -> bytes | None:
    """Return an entry as JSON if nothing in it looks like a secret, and all of its text is Unicode; else None."""
    try:
        line = msgspec.json.encode(entry)
    except UnicodeEncodeError:
        return None
    return None if may_hold_secrets(line.decode()) else line


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
