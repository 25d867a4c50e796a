"""Packets for blind writers and blind readers, as files of a working folder."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from envs_data.build.voices.briefs import brief
from envs_data.build.voices.glosses import piece_gloss
from envs_data.build.voices.scenarios import SEED
from envs_data.build.voices.voices import VOICES
from gavel_env.errors import InstructionError
from gavel_env.house.scenes import load_scene
from gavel_env.instructions.record import Instruction
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.ontology import default_ontology

__all__ = ["house_listing", "read_written", "reader_packets", "writer_packets"]

HERE = Path(__file__).parent


def _dump(path: Path, rows: Sequence[Any]) -> None:
    path.write_bytes(b"".join(msgspec.json.encode(row) + b"\n" for row in rows))


def _deal(rows: Sequence[Any], parts: int, stream: int) -> list[list[Any]]:
    """Return the rows shuffled and dealt to so many parts."""
    order = np.random.default_rng([SEED, stream]).permutation(len(rows))
    return [[rows[int(i)] for i in order[k::parts]] for k in range(parts)]


def writer_packets(records: Sequence[Instruction], folder: Path, parts: int, first: int = 1) -> None:
    """Write `WRITER.md` and `write-K.jsonl`, K from `first`."""
    voices = "\n".join(f"   - {name}: {text}" for name, text in VOICES.items())
    (folder / "WRITER.md").write_text((HERE / "writer.md").read_text().replace("VOICES\n", voices + "\n", 1))
    rows = [{"id": r.id, "voice": r.meta["voice"], "brief": brief(r)} for r in records]
    for number, part in enumerate(_deal(rows, parts, first), start=first):
        _dump(folder / f"write-{number}.jsonl", part)


def read_written(paths: Sequence[Path]) -> dict[str, str]:
    """Return the texts of written files by id; a later file replaces the texts of an earlier one.

    Raises:
        InstructionError: a line is malformed or its text is empty; names file and line.
    """
    texts: dict[str, str] = {}
    for path in paths:
        for number, line in enumerate(path.read_text().splitlines(), start=1):
            if not line.strip():
                continue
            try:
                row = json.loads(line)
                text = str(row["text"]).strip()
                texts[str(row["id"])] = text
            except (json.JSONDecodeError, KeyError, TypeError) as error:
                raise InstructionError(f'{path}:{number}: needs {{"id", "text"}}: {error!r}') from error
            if not text:
                raise InstructionError(f"{path}:{number}: the text is empty")
    return texts


def house_listing(scene: str) -> dict[str, dict[str, str]]:
    """Return room id -> its type, and what stands in it as `category: count`."""
    ontology, loaded = default_ontology(), load_scene(scene)
    listing = {}
    for room in loaded.rooms:
        names = [f.category for f in loaded.furniture if f.room == room.id]
        useful = [c for c in names if _matters(ontology[c])]
        counts = ", ".join(f"{name}: {count}" for name, count in sorted(Counter(useful).items()))
        listing[room.id] = {"type": room.type, "furniture": counts}
    return listing


def _matters(category: Any) -> bool:
    return bool(category.surface or category.interior or category.toggleable or category.openable)


def reader_packets(
    records: Mapping[str, Instruction], texts: Mapping[str, str], folder: Path, parts: int, first: int = 1
) -> None:
    """Write `READER.md`, `houses.json`, and `read-A-K.jsonl` and `read-B-K.jsonl`, K from `first`, each shuffled.

    Raises:
        InstructionError: a text belongs to no scenario.
    """
    if unknown := sorted(texts.keys() - records.keys()):
        raise InstructionError(f"texts of no scenario: {', '.join(unknown[:5])}")
    movables = ", ".join(f"`{name}`" for name in sorted(default_vocabulary().movables))
    pieces = "; ".join(f"`{name}` {piece_gloss(name)}" for name in sorted(default_vocabulary().furniture))
    page = (HERE / "reader.md").read_text().replace("MOVABLES\n", movables + "\n", 1)
    (folder / "READER.md").write_text(page.replace("FURNITURE\n", pieces + "\n", 1))
    scenes = sorted({record.scene for record in records.values()})
    names = {scene: f"house-{number}" for number, scene in enumerate(scenes, start=1)}
    listings = {names[scene]: house_listing(scene) for scene in scenes}
    (folder / "houses.json").write_text(json.dumps(listings, indent=1) + "\n")
    rows = [{"id": key, "text": texts[key], "house": names[records[key].scene]} for key in sorted(texts)]
    for stream, reader in enumerate("AB", start=101):
        for number, part in enumerate(_deal(rows, parts, stream + 10 * first), start=first):
            _dump(folder / f"read-{reader}-{number}.jsonl", part)
