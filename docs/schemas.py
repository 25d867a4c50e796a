"""Writes graph.schema.json and categories.schema.json (docs/reference/schemas) from the types that read those files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from gavel_env.world_model.graph_file import FORMAT, GraphFile
from gavel_env.world_model.own_categories import CategoryFile

FOLDER = Path(__file__).parent / "reference" / "schemas"


def schemas() -> dict[str, Any]:
    """Return the schemas by the name of their file."""
    graph, categories = msgspec.json.schema(GraphFile), msgspec.json.schema(CategoryFile)
    graph["$defs"]["GraphFile"]["properties"]["format"] = {"const": FORMAT}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    both = {"graph": {**head, "title": FORMAT, **graph}, "categories": {**head, "title": "categories", **categories}}
    return {name: json.loads(json.dumps(schema)) for name, schema in both.items()}


if __name__ == "__main__":
    for name, schema in schemas().items():
        (FOLDER / f"{name}.schema.json").write_text(json.dumps(schema, indent=2) + "\n", "utf-8")
