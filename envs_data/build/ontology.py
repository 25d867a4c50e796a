"""Build `envs_data/ontology.json`: every category with a model that is not a substance, and what it affords.

Run as `python -m envs_data.build.ontology`; the result is byte-identical each time.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from envs_data.build import affordances
from envs_data.build.common import BDDL_VERSION, CategoryRow, categories, median_size_m, model_sizes_m, properties
from gavel_env.world_model.ontology import FORMAT, Category, TemperatureSource

__all__ = ["build", "build_category", "main"]

TARGET = Path(__file__).resolve().parents[1] / "ontology.json"
PROVENANCE = (
    f"PyPI bddl {BDDL_VERSION} (MIT): properties, category mapping, hierarchy, bounding boxes and activities; "
    "rules of envs_data/build/affordances.py, explained in docs/reference/data.md"
)
ANNOTATED = ("openable", "toggleable", "heatSource", "coldSource", "cookable", "heatable", "freezable", "waterSource")
REMOVES = "particleRemover"


def _temperature_source(parameters: Mapping[str, Any] | None) -> TemperatureSource | None:
    if parameters is None:
        return None
    return TemperatureSource(
        requires_toggled_on=bool(parameters.get("requires_toggled_on")),
        requires_closed=bool(parameters.get("requires_closed")),
        requires_inside=bool(parameters.get("requires_inside")),
        temperature_c=parameters.get("temperature"),
    )


def build_category(name: str, row: CategoryRow) -> Category:
    """Return the ontology entry of one category of `category_mapping.csv`."""
    synset, size_m = row.synset, median_size_m(name)
    annotated = properties(synset)
    where = affordances.mount(name, synset, size_m)
    on_top = affordances.surface(synset, size_m, where)
    inside = affordances.interior(synset, size_m)
    graspable = affordances.graspable(synset, size_m, row.mass_kg, where)
    washable = affordances.washable(synset) if graspable else None
    confers, confers_why = affordances.CONFERS.get(synset, ("", ""))
    toggleable = "toggleable" in annotated
    water_why = "waterSource" if "waterSource" in annotated else affordances.WATER_SOURCES.get(synset, "")
    heat_why = "heatSource" if "heatSource" in annotated else ""
    if not heat_why and affordances.heats_by_kind(synset):
        heat_why = "heats by its kind"
    safety_why = (heat_why or water_why or confers) if toggleable else ""
    reasons = {
        "surface": on_top, "interior": inside, confers: confers_why, "safety_critical": safety_why,
        "graspable": "size and mass" if graspable else "", "washable": washable,
    }  # fmt: skip
    rinses = toggleable and bool(water_why) and inside is not None
    wipes = REMOVES in annotated
    if rinses:
        reasons["rinses"] = water_why
    rules = "; ".join(f"{what}: {why}" for what, why in reasons.items() if what and why)
    facts = ", ".join(p for p in (*ANNOTATED, REMOVES) if p in annotated)
    return Category(
        name=name,
        synset=synset,
        source=f"bddl: {facts or 'none'}" + (f" | rules: {rules}" if rules else ""),
        openable="openable" in annotated,
        toggleable=toggleable,
        requires_closed=bool(annotated.get("toggleable", {}).get("requires_closed")),
        surface=on_top is not None,
        interior=inside is not None,
        heat=_temperature_source(annotated.get("heatSource")),
        cold=_temperature_source(annotated.get("coldSource")),
        washes=confers == "washes",
        dries=confers == "dries",
        rinses=rinses,
        wipes=wipes,
        washable=washable is not None,
        cookable="cookable" in annotated,
        heatable="heatable" in annotated,
        freezable="freezable" in annotated,
        graspable=graspable,
        carryable=not graspable and affordances.carryable(synset, row.mass_kg, where),
        safety_critical=bool(safety_why),
        clearance=affordances.clearance(synset, where),
        mount=where,
        size_m=None if size_m is None else (round(size_m[0], 3), round(size_m[1], 3), round(size_m[2], 3)),
        mass_kg=None if row.mass_kg is None else round(row.mass_kg, 3),
    )


def build() -> bytes:
    """Return the content of the ontology file: canonical JSON, one category per line.

    Raises:
        DataError: bddl is not installed in the right version.
    """
    models = model_sizes_m()
    entries = [build_category(n, row) for n, row in categories().items() if n in models and not row.substance]
    lines = [msgspec.json.encode(entry, order="sorted") for entry in entries]
    head = f'{{"format":"{FORMAT}","provenance":{msgspec.json.encode(PROVENANCE).decode()},"categories":[\n'
    return head.encode() + b",\n".join(lines) + b"\n]}\n"


def main() -> None:
    """Write the ontology file."""
    content = build()
    TARGET.write_bytes(content)
    count = content.count(b"\n") - 2
    print(f"{TARGET.name}: {count} categories, {len(content) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
