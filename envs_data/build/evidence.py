"""Build `envs_data/placement_evidence.json` from the activities and the scenes' contents.

Run as `python -m envs_data.build.evidence`; the result is byte-identical each time.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

import msgspec

from envs_data.build.common import BDDL_VERSION, activities, ancestors, category_of_model, room_objects
from envs_data.build.common import Literal as Fact
from gavel_env.tasks.evidence import FORMAT, Placed, RoomContents
from gavel_env.world_model.ontology import Ontology, load_ontology

__all__ = ["build", "main", "placed_rows", "room_types"]

TARGET = Path(__file__).resolve().parents[1] / "placement_evidence.json"
PROVENANCE = f"PyPI bddl {BDDL_VERSION} (MIT): init and goal of 1,016 activities; contents of 51 scenes"

Where = Literal["on", "in", "floor", "under"]
RELATIONS: Mapping[str, Where] = {"ontop": "on", "inside": "in", "under": "under"}
GROUND = frozenset({"driveway.n.01", "floor.n.01", "lawn.n.01", "paving_stone.n.01"})

_ROOM_INDEX = re.compile(r"_\d+$")


def _rooms(init: Iterable[Fact]) -> dict[str, str]:
    """Return object id -> room type, following `ontop` / `inside` chains up to an object with an `inroom` fact."""
    rooms = {f.subject_id: f.holder for f in init if f.relation == "inroom"}
    held_by = {f.subject_id: f.holder_id for f in init if f.relation in RELATIONS}
    for start in sorted(held_by):
        holder, steps = start, 0
        while holder not in rooms and holder in held_by and steps < len(held_by):
            holder, steps = held_by[holder], steps + 1
        if holder in rooms:
            rooms[start] = rooms[holder]
    return rooms


def placed_rows() -> tuple[Placed, ...]:
    """Return the sorted rows of what the activities place where.

    A goal speaks of variables; its holder gets a room only if all instances of its synset stand in rooms of one type.
    """
    start: Counter[tuple[str, Where, str, str]] = Counter()
    goal: Counter[tuple[str, Where, str, str]] = Counter()
    for _, sections in activities():
        rooms = _rooms(sections["init"])
        of_synset: dict[str, set[str]] = {}
        for fact in sections["init"]:
            if fact.relation == "inroom":
                of_synset.setdefault(fact.subject, set()).add(fact.holder)
        for section, counter in (("init", start), ("goal", goal)):
            for fact in sections[section]:
                if fact.relation not in RELATIONS or fact.negated or fact.subject == "agent.n.01":
                    continue
                where: Where = "floor" if fact.holder in GROUND else RELATIONS[fact.relation]
                types = of_synset.get(fact.holder, set())
                room = rooms.get(fact.holder_id) or (min(types) if len(types) == 1 else "")
                counter[fact.subject, where, fact.holder, room] += 1
    return tuple(Placed(*key, start[key], goal[key]) for key in sorted(start.keys() | goal.keys()))


def room_types() -> dict[str, RoomContents]:
    """Return what the rooms of each type contain, over the 51 scenes."""
    rooms: Counter[str] = Counter()
    instances: dict[str, Counter[str]] = {}
    having: dict[str, Counter[str]] = {}
    for scene in room_objects().values():
        for room_id, contents in scene.items():
            kind = _ROOM_INDEX.sub("", room_id)
            counts: Counter[str] = Counter()
            for model, count in contents.items():
                counts[category_of_model(model)] += count
            rooms[kind] += 1
            instances.setdefault(kind, Counter()).update(counts)
            having.setdefault(kind, Counter()).update(counts.keys())
    return {
        kind: RoomContents(rooms[kind], {c: (instances[kind][c], having[kind][c]) for c in sorted(instances[kind])})
        for kind in sorted(rooms)
    }


def _kinds(synsets: Iterable[str], ontology: Ontology) -> dict[str, tuple[str, ...]]:
    wanted = frozenset(synsets)
    members: dict[str, list[str]] = {synset: [] for synset in sorted(wanted)}
    for name, category in ontology.items():
        for synset in sorted(wanted & ancestors(category.synset)):
            members[synset].append(name)
    return {synset: tuple(names) for synset, names in members.items()}


def _block(entries: Iterable[bytes], brackets: bytes) -> bytes:
    return brackets[:1] + b"\n" + b",\n".join(entries) + b"\n" + brackets[1:]


def build() -> bytes:
    """Return the content of the evidence file: canonical JSON, one row per line.

    Raises:
        DataError: bddl is not installed in the right version, or the ontology is missing.
    """
    encode = msgspec.json.Encoder(order="deterministic").encode
    rows = placed_rows()
    kinds = _kinds({s for row in rows for s in (row.thing, row.holder)}, load_ontology())
    parts = {
        "format": encode(FORMAT),
        "provenance": encode(PROVENANCE),
        "kinds": _block((encode(s) + b":" + encode(names) for s, names in kinds.items()), b"{}"),
        "placed": _block((encode(row) for row in rows), b"[]"),
        "room_types": _block((encode(t) + b":" + encode(c) for t, c in room_types().items()), b"{}"),
    }
    return b"{" + b",\n".join(encode(key) + b":" + value for key, value in parts.items()) + b"}\n"


def main() -> None:
    """Write the evidence file."""
    content = build()
    TARGET.write_bytes(content)
    print(f"{TARGET.name}: {len(placed_rows())} rows, {len(content) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
