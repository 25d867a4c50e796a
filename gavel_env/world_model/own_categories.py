"""Categories of one's own: what they afford and what people call them, in a few lines of TOML, JSON or Python.

```toml
[categories.vial]
like = "bottle"
words = ["test tube"]
```
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from gavel_env.data import read_bytes
from gavel_env.errors import CategoryError, nearest_names
from gavel_env.world_model.concepts import is_concept
from gavel_env.world_model.ontology import Category, Mount, Ontology, TemperatureSource

__all__ = ["CategoryFile", "OwnCategory", "extended", "read_categories"]

_LONGEST_LINE = 50
"""Categories that are `like` one another in a line, at most."""

_MOST_METRES, _MOST_KG = 1e3, 1e6


class OwnCategory(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A category as a user writes it: `like`, and every field of `Category` that differs from that one.

    Attributes:
        like: a known category, a concept, or a word for one ("bottle"), whose affordances it has; of a concept, those
            of the member that people think of first. None: it affords nothing that is not said.
        others: as in `Category`. `false` takes away what `like` has.
    """

    like: str | None = None
    words: tuple[str, ...] = ()
    concepts: tuple[str, ...] = ()
    openable: bool | None = None
    toggleable: bool | None = None
    requires_closed: bool | None = None
    surface: bool | None = None
    interior: bool | None = None
    heat: TemperatureSource | bool | None = None
    cold: TemperatureSource | bool | None = None
    washes: bool | None = None
    dries: bool | None = None
    rinses: bool | None = None
    washable: bool | None = None
    wipes: bool | None = None
    cookable: bool | None = None
    heatable: bool | None = None
    freezable: bool | None = None
    graspable: bool | None = None
    carryable: bool | None = None
    safety_critical: bool | None = None
    clearance: bool | None = None
    mount: Mount | None = None
    size_m: tuple[float, float, float] | None = None
    mass_kg: float | None = None
    synset: str | None = None
    source: str | None = None

    @classmethod
    def of(cls, category: Category) -> OwnCategory:
        """Return a category in this form, nothing inherited."""
        said = {name: getattr(category, name) for name in _FIELDS}
        plain = {name: value for name, value in said.items() if value not in (None, False, (), frozenset())}
        plain |= {"words": category.words, "concepts": tuple(sorted(category.concepts))}
        return cls(**plain)


_FIELDS = tuple(f.name for f in msgspec.structs.fields(OwnCategory) if f.name not in ("like", "words", "concepts"))


class CategoryFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole file of categories."""

    categories: dict[str, OwnCategory]


def read_categories(path: Path) -> dict[str, OwnCategory]:
    """Read a file with a table `categories`: TOML if it is named `.toml`, else JSON.

    Raises:
        CategoryError: unreadable or malformed, with the path inside the file.
    """
    content = read_bytes(path, "category file", CategoryError)
    try:
        if path.suffix == ".toml":
            return msgspec.convert(tomllib.loads(content.decode("utf-8")), CategoryFile).categories
        return msgspec.json.decode(content, type=CategoryFile).categories
    except (tomllib.TOMLDecodeError, msgspec.DecodeError, UnicodeError, RecursionError) as problem:
        raise CategoryError(f"category file {path} is malformed: {_with_fields(problem)}") from problem


def _with_fields(problem: Exception) -> str:
    """Return what is wrong; of an unknown field, with those that look like it."""
    text = str(problem)
    field = text.partition("unknown field `")[2].partition("`")[0]
    near = nearest_names(field, ("like", "words", "concepts", *_FIELDS)) if field else ()
    return f"{text}; did you mean {' or '.join(near)}?" if near else text


def extended(ontology: Ontology, table: Mapping[str, Any] | Path, place: str = "categories") -> Ontology:
    """Return an ontology with categories of one's own; `Ontology.extend` is the same.

    Raises:
        CategoryError: malformed; `like` names nothing known, goes in a circle or on for too long; a name that goals
            cannot write; a size or mass that nothing has.
    """
    if isinstance(table, Path):
        place, table = f"category file {table}", read_categories(table)
    try:
        own = {name: msgspec.convert(entry, OwnCategory, from_attributes=True) for name, entry in table.items()}
    except (msgspec.ValidationError, RecursionError) as problem:
        raise CategoryError(f"{place}: {_with_fields(problem)}") from problem
    made: dict[str, Category] = {}
    for name in own:
        _make(name, own, ontology, made, (), place)
    kept = [msgspec.structs.replace(c, concepts=frozenset()) for name, c in ontology.items() if name not in made]
    return Ontology((*kept, *made.values()), ontology.provenance, ontology.concepts)


def _make(
    name: str,
    own: Mapping[str, OwnCategory],
    ontology: Ontology,
    made: dict[str, Category],
    above: tuple[str, ...],
    place: str,
) -> Category:
    if name in made:
        return made[name]
    here = f"{place}: $.categories.{name}"
    if name in above:
        raise CategoryError(f"{here}.like goes in a circle: {' -> '.join((*above[above.index(name) :], name))}")
    if len(above) > _LONGEST_LINE:
        raise CategoryError(f"{here}.like: {above[0]} is like it through {len(above)} others; at most {_LONGEST_LINE}")
    if not name.isidentifier() or name != name.lower() or is_concept(name):
        raise CategoryError(f"{here}: a category is written in small letters, digits and _, and not any_…")
    entry = own[name]
    _check_measures(entry, here)
    base = Category(name=name, synset="", source="user")
    if entry.like is not None:
        if entry.like in own and (entry.like != name or name not in ontology):
            base = _make(entry.like, own, ontology, made, (*above, name), place)
        else:
            base = _known(entry.like, ontology, here)
    said = {field: value for field in _FIELDS if (value := getattr(entry, field)) is not None}
    for field in ("heat", "cold"):
        if said.get(field) is True:
            said[field] = TemperatureSource()
        elif said.get(field) is False:
            said[field] = None
    said.setdefault("source", "user" if entry.like is None else f"user, like {base.name}")
    joined = frozenset((*base.concepts, *entry.concepts))
    made[name] = msgspec.structs.replace(base, name=name, words=entry.words, concepts=joined, **said)
    return made[name]


def _check_measures(entry: OwnCategory, here: str) -> None:
    """Check that lengths and weights are those of a thing; comparisons with a number that is none are false."""
    if entry.size_m is not None and not all(0.0 < side <= _MOST_METRES for side in entry.size_m):
        raise CategoryError(f"{here}.size_m: {list(entry.size_m)}; expected metres above 0, to {_MOST_METRES:g}")
    if entry.mass_kg is not None and not 0.0 < entry.mass_kg <= _MOST_KG:
        raise CategoryError(f"{here}.mass_kg: {entry.mass_kg}; expected kilograms above 0, to {_MOST_KG:g}")


def _known(name: str, ontology: Ontology, here: str) -> Category:
    if name in ontology:
        return ontology[name]
    named = name if is_concept(name) else ontology.concepts.meaning(name).thing
    if named is not None and ontology.knows(named):
        return ontology.kinds(named)[0]
    near = nearest_names(name, ontology)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    raise CategoryError(f"{here}.like: unknown category {name!r}{hint}")
