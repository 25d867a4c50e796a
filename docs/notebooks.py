"""Make the notebooks of the tutorials from their pages: `python docs/notebooks.py` writes them, `--check` compares."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

TUTORIALS = Path(__file__).parent / "tutorial"
_BLOCK = re.compile(r"^```python\n(.*?)^```\n?", re.DOTALL | re.MULTILINE)


def notebook(page: str) -> dict[str, Any]:
    """Return the notebook of a page: its Python blocks as code cells, what stands between them as text."""
    cells: list[dict[str, Any]] = []
    for index, part in enumerate(_BLOCK.split(page)):
        source = part.strip("\n").splitlines(keepends=True)
        if not source:
            continue
        cell: dict[str, Any] = {"id": f"cell-{index}", "metadata": {}, "source": source}
        if index % 2:
            cells.append({"cell_type": "code", "execution_count": None, "outputs": [], **cell})
        else:
            cells.append({"cell_type": "markdown", **cell})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def main(arguments: list[str]) -> int:
    """Write the notebooks, or say which differ from their pages."""
    stale = []
    for page in sorted(TUTORIALS.glob("*.md")):
        content = json.dumps(notebook(page.read_text("utf-8")), indent=1, ensure_ascii=False) + "\n"
        target = page.with_suffix(".ipynb")
        if "--check" not in arguments:
            target.write_text(content, "utf-8")
        elif not target.is_file() or target.read_text("utf-8") != content:
            stale.append(target.name)
    if stale:
        print("not as their pages:", ", ".join(stale))
    return int(bool(stale))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
