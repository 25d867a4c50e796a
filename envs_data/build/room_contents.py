"""Build `envs_data/room_contents.json`: which room of which scene holds what, from the tables of bddl.

Run as `python -m envs_data.build.room_contents`; the result is byte-identical each time. A room's floor area is the
sum of the bounding boxes of its `floors` models, or null where bddl gives none.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import msgspec

from envs_data.build.common import BDDL_VERSION, category_of_model, model_sizes_m, room_objects

__all__ = ["STRUCTURE", "build", "main"]

TARGET = Path(__file__).resolve().parents[1] / "room_contents.json"
FORMAT = "gavel-room-contents/1"
PROVENANCE = f"PyPI bddl {BDDL_VERSION} (MIT): contents of the rooms of 51 scenes, extents of the floor models"

STRUCTURE = (
    "ceilings",
    "door",
    "downlight",
    "driveway",
    "electric_switch",
    "elevator_door",
    "fire_alarm",
    "fire_sprinkler",
    "fixed_window",
    "floors",
    "lawn",
    "openable_window",
    "pillar",
    "room_light",
    "square_light",
    "walls",
    "window_blind",
)
"""Parts of the building and its fittings, that nobody searches for; the file lists them as `structure`."""

_ROOM_INDEX = re.compile(r"_\d+$")


def _area_m2(models: Mapping[str, int]) -> float | None:
    boxes = model_sizes_m().get("floors", {})
    sizes = [(boxes[m.rsplit("-", 1)[1]], n) for m, n in models.items() if category_of_model(m) == "floors"
             and m.rsplit("-", 1)[1] in boxes]  # fmt: skip
    return round(sum(size[0] * size[1] * count for size, count in sizes), 2) or None


def _room(room_id: str, models: Mapping[str, int]) -> dict[str, object]:
    counts: Counter[str] = Counter()
    for model, count in models.items():
        counts[category_of_model(model)] += count
    return {
        "id": room_id,
        "type": _ROOM_INDEX.sub("", room_id),
        "area_m2": _area_m2(models),
        "contents": dict(sorted(counts.items())),
    }


def build() -> bytes:
    """Return the content of the file: canonical JSON, one room per line.

    Raises:
        DataError: bddl is not installed in the right version.
    """
    encode = msgspec.json.encode
    scenes = [
        encode(scene) + b":[\n" + b",\n".join(encode(_room(r, models)) for r, models in rooms.items()) + b"\n]"
        for scene, rooms in room_objects().items()
    ]
    head = b",\n".join(
        encode(key) + b":" + encode(value)
        for key, value in (("format", FORMAT), ("provenance", PROVENANCE), ("structure", STRUCTURE))
    )
    return b"{" + head + b',\n"scenes":{\n' + b",\n".join(scenes) + b"\n}}\n"


def main() -> None:
    """Write the file."""
    content = build()
    TARGET.write_bytes(content)
    print(f"{TARGET.name}: {len(room_objects())} scenes, {len(content) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
