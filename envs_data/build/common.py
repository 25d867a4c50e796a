"""The tables of the PyPI package bddl that the builders read, typed and in a fixed order.

Everything under `envs_data` is built from these tables (`pip install bddl==3.6.0`, extra `data`); nothing at run time
needs them. JSON and CSV files are read directly, so that no code of bddl runs.
"""

from __future__ import annotations

import csv
import importlib.metadata
import importlib.util
import json
import re
import statistics
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from gavel_env.errors import DataError

__all__ = [
    "BDDL_VERSION",
    "CategoryRow",
    "Literal",
    "activities",
    "all_synsets",
    "ancestors",
    "bddl_root",
    "categories",
    "category_of_model",
    "median_size_m",
    "model_sizes_m",
    "properties",
    "room_objects",
]

BDDL_VERSION = "3.6.0"
RELATIONS = frozenset({"attached", "draped", "inroom", "inside", "ontop", "overlaid", "under"})

Size = tuple[float, float, float]


class CategoryRow(NamedTuple):
    """A line of `category_mapping.csv`: synset, mass (kg, None for substances) and whether it is a substance."""

    synset: str
    mass_kg: float | None
    substance: bool


@dataclass(frozen=True)
class Literal:
    """A two-place fact of an activity: `relation(subject, holder)`.

    Attributes:
        relation: predicate, as in `ontop`.
        subject: synset of the first place.
        holder: synset of the second place, or a room type for `inroom`.
        subject_id: first place as the file writes it: an instance (`apple.n.01_1`) or a quantified variable.
        holder_id: second place, likewise.
        negated: stands under `not`.
    """

    relation: str
    subject: str
    holder: str
    subject_id: str
    holder_id: str
    negated: bool = False


@cache
def bddl_root() -> Path:
    """Return the folder of the installed bddl package.

    Raises:
        DataError: bddl is not installed, or in another version than the shipped data was built from.
    """
    spec = importlib.util.find_spec("bddl")
    if spec is None or spec.origin is None:
        raise DataError(f"building data needs the package bddl: pip install bddl=={BDDL_VERSION}")
    version = importlib.metadata.version("bddl")
    if version != BDDL_VERSION:
        raise DataError(f"bddl {version} is installed; the data is built from bddl {BDDL_VERSION}")
    return Path(spec.origin).parent


@cache
def _generated(name: str) -> Any:
    return json.loads((bddl_root() / "generated_data" / name).read_text(encoding="utf-8"))


@cache
def categories() -> Mapping[str, CategoryRow]:
    """Return every category of `category_mapping.csv`, by name in alphabetical order."""
    with (bddl_root() / "generated_data" / "category_mapping.csv").open(encoding="utf-8", newline="") as handle:
        rows = {
            row["category"]: CategoryRow(
                row["synset"],
                float(row["mass (auto)"].replace(",", "")) if row["mass (auto)"] else None,
                row["has_system"] == "TRUE",
            )
            for row in csv.DictReader(handle)
        }
    return dict(sorted(rows.items()))


def properties(synset: str) -> Mapping[str, Mapping[str, Any]]:
    """Return the annotated properties of a synset with their parameters (`propagated_annots_params.json`)."""
    table: Mapping[str, Mapping[str, Mapping[str, Any]]] = _generated("propagated_annots_params.json")
    return table.get(synset, {})


@cache
def _parents() -> Mapping[str, frozenset[str]]:
    parents: dict[str, set[str]] = {}
    stack = [_generated("output_hierarchy.json")]
    while stack:
        node = stack.pop()
        for child in node.get("children", []):
            parents.setdefault(child["name"], set()).add(node["name"])
            stack.append(child)
    return {name: frozenset(above) for name, above in parents.items()}


@cache
def ancestors(synset: str) -> frozenset[str]:
    """Return the synset itself and all its hypernyms in bddl's hierarchy."""
    found: set[str] = set()
    stack = [synset]
    while stack:
        name = stack.pop()
        if name not in found:
            found.add(name)
            stack.extend(_parents().get(name, ()))
    return frozenset(found)


@cache
def all_synsets() -> tuple[str, ...]:
    """Return every synset of the hierarchy, sorted."""
    return tuple(sorted(set(_parents()).union(*_parents().values())))


def category_of_model(model: str) -> str:
    """Return the category of an inventory name: `bottom_cabinet-abcdef` -> `bottom_cabinet`."""
    return model.rsplit("-", 1)[0]


@cache
def model_sizes_m() -> Mapping[str, Mapping[str, Size]]:
    """Return category -> model id -> bounding box (x, y, z), metres, both levels in alphabetical order."""
    inventory = _generated("object_inventory.json")
    boxes = inventory["bounding_box_sizes"]
    table: dict[str, dict[str, Size]] = {}
    for name in sorted(inventory["providers"]):
        category, model = name.rsplit("-", 1)
        x, y, z = boxes[model]
        table.setdefault(category, {})[model] = (float(x), float(y), float(z))
    return table


def median_size_m(category: str) -> Size | None:
    """Return the median bounding box (x, y, z) over the models of a category, metres, or None without a model."""
    boxes = model_sizes_m().get(category)
    if not boxes:
        return None
    x, y, z = (statistics.median(box[axis] for box in boxes.values()) for axis in range(3))
    return (x, y, z)


@cache
def room_objects() -> Mapping[str, Mapping[str, Mapping[str, int]]]:
    """Return scene -> room id -> `category-model` -> count of the 51 scenes (`combined_room_object_list.json`)."""
    scenes: Mapping[str, Mapping[str, Mapping[str, int]]] = _generated("combined_room_object_list.json")["scenes"]
    return {s: {r: dict(sorted(scenes[s][r].items())) for r in sorted(scenes[s])} for s in sorted(scenes)}


_SECTION = re.compile(r"\(:(init|goal)\b")
_BINARY = re.compile(r"(\(\s*not\s*)?\(\s*([a-z_]+)\s+\??([^\s()?]+)\s+\??([^\s()?]+)\s*\)")
_INSTANCE = re.compile(r"_(\d+|\*)$")


def activities() -> Iterator[tuple[str, Mapping[str, tuple[Literal, ...]]]]:
    """Yield (activity, {"init": facts, "goal": facts}) of the 1,016 activities, in alphabetical order.

    Only the predicates of `RELATIONS` are read and quantifiers are flattened, since the builders ask which
    pairs an activity speaks of, not whether its goal holds.
    """
    for path in sorted((bddl_root() / "activity_definitions").glob("*/problem0.bddl")):
        text = path.read_text(encoding="utf-8")
        starts = [(m.group(1), m.end()) for m in _SECTION.finditer(text)]
        ends = [begin for _, begin in starts[1:]] + [len(text)]
        sections: dict[str, tuple[Literal, ...]] = {"init": (), "goal": ()}
        for (section, begin), end in zip(starts, ends, strict=True):
            sections[section] = tuple(
                Literal(relation, _INSTANCE.sub("", a), _INSTANCE.sub("", b), a, b, negated=bool(negation))
                for negation, relation, a, b in _BINARY.findall(text[begin:end])
                if relation in RELATIONS
            )
        yield path.parent.name, sections
