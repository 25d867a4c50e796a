"""Records and tables without what differs between two runs of the same: seconds and dates."""

from __future__ import annotations

import csv
import io

import msgspec

from eval.records.schema import EpisodeRecord

__all__ = ["timeless", "timeless_csv"]


def timeless(record: EpisodeRecord) -> EpisodeRecord:
    """Return a record without seconds and dates."""
    trace = msgspec.structs.replace(record.trace, seconds={})
    return msgspec.structs.replace(record, seconds={}, finished="", trace=trace)


def timeless_csv(table: str) -> list[list[str]]:
    """Return the cells of a table as CSV without the columns of seconds."""
    head, *rows = csv.reader(io.StringIO(table))
    kept = [i for i, name in enumerate(head) if not name.startswith("planning_s")]
    return [[row[i] for i in kept] for row in (head, *rows)]
