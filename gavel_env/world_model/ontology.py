"""Which category affords what, from BEHAVIOR's annotations.

The table is data (`envs_data/ontology.json`, built from the PyPI package bddl); no list of categories stands in code.
Every category says its synset and the source of its affordances.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal

import msgspec

from gavel_env.data import read_json, shipped_data
from gavel_env.errors import DataError, UnknownCategory, UnknownConcept
from gavel_env.world_model.concepts import OR, Concepts, default_concepts, is_concept, normal_phrase

__all__ = ["Category", "Mount", "Ontology", "TemperatureSource", "category_of", "default_ontology", "load_ontology"]

FORMAT = "gavel-ontology/1"

Mount = Literal["floor", "wall", "ceiling", "carpet", "structure"]


class TemperatureSource(msgspec.Struct, frozen=True):
    """When a heat or cold source acts on what it holds (bddl `heatSource` / `coldSource` parameters).

    Attributes:
        requires_toggled_on: it must be switched on.
        requires_closed: its door must be shut.
        requires_inside: it acts on what is inside it, not on what stands on it.
        temperature_c: temperature it reaches, degrees Celsius, or None if bddl gives none.
    """

    requires_toggled_on: bool = False
    requires_closed: bool = False
    requires_inside: bool = False
    temperature_c: float | None = None

    @property
    def freezes(self) -> bool:
        """True if it is cold enough to freeze (a freezer at -18 °C, not a cool box at 4 °C)."""
        return self.temperature_c is not None and self.temperature_c <= 0.0


class Category(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One object category and its affordances.

    Attributes:
        name: category, as in `fridge`.
        synset: WordNet-style synset of bddl, as in `electric_refrigerator.n.01`.
        source: where the affordances come from, in words.
        openable: has a door or lid (`Open`, `Close`).
        toggleable: has a switch (`ToggleOn`, `ToggleOff`).
        requires_closed: its door must be shut to switch it on.
        surface: things can be placed on top.
        interior: things can be placed inside.
        heat: acts as a heat source, under these conditions.
        cold: acts as a cold source, under these conditions.
        washes: switching it on washes its contents.
        dries: switching it on dries its contents.
        rinses: switching it on runs water over its contents, which takes dirt off.
        washable: people have it washed and dried (rule: docs/reference/data.md). It bounds what goals may ask for,
            not what becomes of things that are in a machine.
        wipes: put down on something dirty, it takes the dirt off (a rag, a sponge).
        cookable: becomes cooked in or on a heat source.
        heatable: becomes hot in or on a heat source.
        freezable: becomes frozen in a cold source that freezes.
        graspable: one hand can lift it (rule: docs/reference/data.md).
        carryable: both arms can carry it, though one hand cannot: what BEHAVIOR's activities want moved. Counts for
            what an instruction adds to a scene; a scene's own pieces stay where they are.
        safety_critical: must not be left switched on (heat or water source, or confers a state).
        clearance: something can lie on the floor beneath it (a table, a desk, a bed on legs).
        mount: where its instances are fixed; only "floor" ones block the way.
        size_m: median (depth along the front direction, width, height) of its models, metres, or None.
        mass_kg: annotated mass, or None.
        words: what people call it, beyond the table of concepts; for categories of one's own.
        concepts: the concepts that it belongs to (`any_bath`). An ontology adds those of its table of concepts.
    """

    name: str
    synset: str
    source: str
    openable: bool = False
    toggleable: bool = False
    requires_closed: bool = False
    surface: bool = False
    interior: bool = False
    heat: TemperatureSource | None = None
    cold: TemperatureSource | None = None
    washes: bool = False
    dries: bool = False
    rinses: bool = False
    washable: bool = False
    wipes: bool = False
    cookable: bool = False
    heatable: bool = False
    freezable: bool = False
    graspable: bool = False
    carryable: bool = False
    safety_critical: bool = False
    clearance: bool = False
    mount: Mount = "floor"
    size_m: tuple[float, float, float] | None = None
    mass_kg: float | None = None
    words: tuple[str, ...] = ()
    concepts: frozenset[str] = frozenset()

    @property
    def liftable(self) -> bool:
        """True if the robot can pick up a loose instance, with one hand or both arms."""
        return self.graspable or self.carryable

    def is_a(self, name: str) -> bool:
        """Return whether `name` is this category or a concept that it belongs to."""
        return name == self.name or name in self.concepts

    @property
    def has_door(self) -> bool:
        """True for a container that can be shut."""
        return self.openable and self.interior


class _OntologyFile(msgspec.Struct, frozen=True):
    format: str
    provenance: str
    categories: tuple[Category, ...]


class Ontology(Mapping[str, Category]):
    """Categories by name, in file (alphabetical) order.

    Attributes:
        concepts: what people's words name among them: the table given, with the `words` and `concepts` that the
            categories bring themselves.
        provenance: where the affordances come from.
        index: category -> its place in the order.
    """

    def __init__(
        self, categories: tuple[Category, ...], provenance: str = "", concepts: Concepts | None = None
    ) -> None:
        table = concepts or default_concepts()
        joining: dict[str, list[str]] = {}
        for category in categories:
            for name in sorted(category.concepts):
                joining.setdefault(name, []).append(category.name)
        words = {c.name: c.words for c in categories if c.words or normal_phrase(c.name) not in table.thing_words}
        self.concepts = table.extended(words, joining) if words or joining else table
        self._categories = {
            c.name: msgspec.structs.replace(c, concepts=self.concepts.of_category(c.name)) for c in categories
        }
        self.provenance = provenance
        self.index = {name: i for i, name in enumerate(self._categories)}

    def __getitem__(self, name: str) -> Category:
        """Return the category.

        Raises:
            UnknownCategory: with the nearest names.
        """
        try:
            return self._categories[name]
        except KeyError:
            raise UnknownCategory(name, self._categories) from None

    def kinds(self, name: str) -> tuple[Category, ...]:
        """Return the categories that a name stands for: those of a concept that are here, or the one of that name.

        Raises:
            UnknownCategory, UnknownConcept: with the nearest names.
        """
        if not is_concept(name):
            return (self[name],)
        found = tuple(self[member] for member in self.concepts.categories(name) if member in self)
        if not found:
            raise UnknownConcept(name, self.concepts.things, "this ontology")
        return found

    def extend(self, table: Mapping[str, Any] | Path, place: str = "categories") -> Ontology:
        """Return this ontology with categories of one's own, or with others of the same name.

        Args:
            table: name -> fields (`{"vial": {"like": "bottle", "words": ["test tube"]}}`), or the path of a TOML or
                JSON file that has it under `categories`. Fields: `own_categories.OwnCategory`.
            place: where the table stands, for errors.

        Raises:
            CategoryError: malformed, with the path inside the table.
        """
        from gavel_env.world_model.own_categories import extended

        return extended(self, table, place)

    def knows(self, name: str) -> bool:
        """Return whether a name is that of a category or of a concept over categories, or of several of them."""
        return all(part in self._categories or part in self.concepts.things for part in name.split(OR))

    def __contains__(self, name: object) -> bool:
        return name in self._categories

    def __iter__(self) -> Iterator[str]:
        return iter(self._categories)

    def __len__(self) -> int:
        return len(self._categories)

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)


_NAME = re.compile(r"\w{1,100}")
_MOST_METRES = 1000.0
_MOST_KG = 1e6

_TRAILING_INDEX = re.compile(r"_\d+$")


def category_of(instance: str) -> str:
    """Return the category part of an instance id: `bottom_cabinet_3` -> `bottom_cabinet`."""
    return _TRAILING_INDEX.sub("", instance)


def load_ontology(path: Path | None = None) -> Ontology:
    """Read and validate an ontology file (default: the shipped one).

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    table = read_json(path or shipped_data("ontology.json"), _OntologyFile, "ontology file", version=FORMAT)
    _check(table.categories, str(path or "the shipped ontology"))
    return Ontology(table.categories, table.provenance)


def _check(categories: tuple[Category, ...], place: str) -> None:
    """Check what the types leave open: names, and sizes that something can have."""
    seen: set[str] = set()
    for category in categories:
        name = category.name
        if not _NAME.fullmatch(name) or name == "robot":
            raise DataError(f"{place}: {name[:80]!r} cannot name a category; expected small letters, digits and '_'")
        if name in seen:
            raise DataError(f"{place}: the category {name!r} stands twice")
        seen.add(name)
        sizes = category.size_m or (1.0,)
        if not all(0 <= size <= _MOST_METRES for size in sizes):
            raise DataError(f"{place}: {name!r} has the size_m {sizes}; expected metres, to {_MOST_METRES:g}")
        if category.mass_kg is not None and not 0 <= category.mass_kg <= _MOST_KG:
            raise DataError(f"{place}: {name!r} has the mass_kg {category.mass_kg}; expected 0 to {_MOST_KG:g}")


@cache
def default_ontology() -> Ontology:
    """Return the shipped ontology, loaded once."""
    return load_ontology()
