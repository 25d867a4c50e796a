"""How things look: colours of rooms and furniture, floor patterns, words.

Colours are RGB. The tables here are about looks only; what a category affords stands in the ontology.
"""

from __future__ import annotations

import colorsys
import zlib
from enum import Enum
from functools import cache
from typing import Literal, NamedTuple

from gavel_env.world_model.ontology import default_ontology

__all__ = ["INK", "KIND_COLOURS", "PAPER", "Floor", "Kind", "Rgb", "floor_of", "kind_of", "room_title", "words"]

Rgb = tuple[int, int, int]

PAPER: Rgb = (250, 246, 238)
INK: Rgb = (58, 50, 46)
INK_SOFT: Rgb = (126, 114, 104)
WALL: Rgb = (74, 66, 62)
SILL: Rgb = (226, 214, 196)
ACCENT: Rgb = (208, 72, 54)
ROUTE: Rgb = (36, 104, 178)

Pattern = Literal["plain", "planks", "tiles", "small_tiles", "grass", "slabs"]


class Floor(NamedTuple):
    """Colour and pattern of a room's floor."""

    colour: Rgb
    pattern: Pattern


class Kind(Enum):
    """Kinds of furniture, as coloured in the legend."""

    STORAGE = "storage"
    APPLIANCE = "appliance"
    TABLE = "table, counter"
    SEAT = "seat"
    BED = "bed"
    BATH = "bath, sink"
    SCREEN = "electronics"
    LAMP = "lamp"
    PLANT = "plant"
    CARPET = "carpet"
    OPENING = "door, window"
    OTHER = "other"


KIND_COLOURS: dict[Kind, Rgb] = {
    Kind.STORAGE: (201, 160, 112),
    Kind.APPLIANCE: (146, 168, 184),
    Kind.TABLE: (222, 190, 142),
    Kind.SEAT: (116, 156, 140),
    Kind.BED: (168, 150, 196),
    Kind.BATH: (236, 242, 246),
    Kind.SCREEN: (96, 104, 116),
    Kind.LAMP: (250, 214, 110),
    Kind.PLANT: (120, 168, 92),
    Kind.CARPET: (204, 140, 120),
    Kind.OPENING: (150, 196, 220),
    Kind.OTHER: (196, 186, 174),
}

# First match decides; each word is looked for among the words of the category.
_KIND_WORDS: dict[Kind, str] = {
    Kind.CARPET: "carpet rug mat doormat",
    Kind.OPENING: "door window blind curtain gate",
    Kind.LAMP: "lamp light downlight spotlight chandelier lantern candle",
    Kind.PLANT: "plant tree bush vine lawn flower stem",
    Kind.BATH: "sink toilet bathtub shower urinal tub bidet",
    Kind.SEAT: "chair armchair sofa stool bench taboret ottoman pouf couch rocker",
    Kind.BED: "bed crib mattress cot",
    Kind.SCREEN: "tv monitor computer laptop printer photocopier loudspeaker screen keyboard",
    Kind.APPLIANCE: "fridge freezer oven stove burner grill hood radiator heater dispenser",
    Kind.TABLE: "table desk countertop counter bar island cubicle",
    Kind.STORAGE: "cabinet shelf bookcase wardrobe locker nightstand chest dresser rack hamper",
}


@cache
def kind_of(category: str) -> Kind:
    """Return the kind of a furniture category: by its name, else by what it affords."""
    parts = frozenset(category.split("_"))
    for kind, names in _KIND_WORDS.items():
        if parts & set(names.split()):
            return kind
    ontology = default_ontology()
    if category not in ontology:
        return Kind.OTHER
    entry = ontology[category]
    if entry.heat or entry.cold or entry.washes or entry.dries or (entry.toggleable and entry.interior):
        return Kind.APPLIANCE
    if entry.interior:
        return Kind.STORAGE
    return Kind.TABLE if entry.surface else Kind.OTHER


_FLOORS: dict[str, Floor] = {
    "kitchen": Floor((250, 232, 196), "tiles"),
    "pantry_room": Floor((246, 226, 190), "tiles"),
    "dining_room": Floor((246, 216, 186), "planks"),
    "living_room": Floor((238, 222, 190), "planks"),
    "television_room": Floor((232, 216, 188), "planks"),
    "bedroom": Floor((226, 218, 236), "planks"),
    "childs_room": Floor((246, 218, 224), "planks"),
    "playroom": Floor((248, 222, 206), "planks"),
    "bathroom": Floor((206, 230, 236), "small_tiles"),
    "sauna": Floor((236, 206, 170), "planks"),
    "spa": Floor((200, 230, 226), "small_tiles"),
    "hammam": Floor((204, 226, 222), "small_tiles"),
    "locker_room": Floor((214, 226, 228), "small_tiles"),
    "utility_room": Floor((218, 224, 222), "tiles"),
    "storage_room": Floor((224, 218, 206), "slabs"),
    "closet": Floor((232, 222, 212), "planks"),
    "corridor": Floor((238, 232, 220), "planks"),
    "entryway": Floor((234, 226, 206), "slabs"),
    "lobby": Floor((236, 230, 216), "slabs"),
    "staircase": Floor((222, 214, 204), "slabs"),
    "garage": Floor((216, 216, 214), "slabs"),
    "garden": Floor((206, 224, 178), "grass"),
    "private_office": Floor((214, 226, 214), "planks"),
    "shared_office": Floor((212, 224, 226), "plain"),
    "meeting_room": Floor((222, 226, 204), "plain"),
    "conference_hall": Floor((228, 220, 202), "plain"),
    "break_room": Floor((248, 230, 200), "tiles"),
    "bar": Floor((236, 212, 188), "planks"),
    "grocery_store": Floor((230, 234, 226), "tiles"),
    "exercise_room": Floor((220, 222, 232), "plain"),
    "gym": Floor((224, 216, 196), "planks"),
}


@cache
def floor_of(room_type: str) -> Floor:
    """Return the floor of a room type; a type without an entry gets a soft colour of its own."""
    known = _FLOORS.get(room_type)
    if known is not None:
        return known
    hue = (zlib.crc32(room_type.encode()) % 360) / 360
    red, green, blue = colorsys.hls_to_rgb(hue, 0.89, 0.36)
    return Floor((round(red * 255), round(green * 255), round(blue * 255)), "plain")


def words(name: str) -> str:
    """Return an identifier as words: `bottom_cabinet` -> `bottom cabinet`."""
    return name.replace("_", " ")


def room_title(room_id: str, alone: bool) -> str:
    """Return a room's name for the picture; the index is left out if its type occurs once (`alone`)."""
    title = words(room_id)
    return title.rsplit(" ", 1)[0] if alone and title.rsplit(" ", 1)[-1].isdigit() else title
