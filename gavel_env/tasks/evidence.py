"""Where BEHAVIOR puts things: counts from its 1,016 activities and from the contents of its 51 scenes.

`load_evidence()` reads `envs_data/placement_evidence.json` (format `gavel-placement-evidence/1`, see
docs/reference/data.md), which `python -m envs_data.build.evidence` builds. The benchmarks place movables after it; the
world model never reads it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Literal

import msgspec

from gavel_env.data import read_json, shipped_data

__all__ = ["FORMAT", "Evidence", "Placed", "RoomContents", "load_evidence"]

FORMAT = "gavel-placement-evidence/1"


class Placed(msgspec.Struct, frozen=True, array_like=True):
    """One row: how many facts of the activities put a thing of a kind somewhere.

    Attributes:
        thing: synset of what is placed; `Evidence.kinds` names its categories.
        relation: on or in the holder, on the floor (or ground), or under the holder.
        holder: synset of what holds it.
        room: room type where the holder stands, or "" where the activity leaves it open.
        at_start: facts of that shape in the initial states.
        in_goal: facts of that shape, not negated, in the goals.
    """

    thing: str
    relation: Literal["on", "in", "floor", "under"]
    holder: str
    room: str
    at_start: int
    in_goal: int


class RoomContents(msgspec.Struct, frozen=True, array_like=True):
    """What the rooms of a type contain, over the 51 scenes.

    Attributes:
        rooms: number of rooms of the type.
        contents: category -> (instances, rooms that have one).
    """

    rooms: int
    contents: dict[str, tuple[int, int]]


class Evidence(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole table.

    Attributes:
        format: version of the format.
        provenance: where the counts come from.
        kinds: synset of a `placed` row -> its categories in the ontology, hyponyms included.
        placed: rows, sorted.
        room_types: room type -> its contents.
    """

    format: str
    provenance: str
    kinds: dict[str, tuple[str, ...]]
    placed: tuple[Placed, ...]
    room_types: dict[str, RoomContents]


def load_evidence(path: Path | None = None) -> Evidence:
    """Read and validate an evidence file (default: the shipped one, read once).

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    return _read(path or shipped_data("placement_evidence.json"))


@cache
def _read(path: Path) -> Evidence:
    return read_json(path, Evidence, "evidence file", version=FORMAT)
