"""The package `eval` under a name that no script of one's own takes: `from gavel_eval import evaluate`.

A script called `eval.py` in the working directory hides the package. This module loads the package from where it lies
beside it, whatever else is called `eval` on the path; the console script `gavel` starts here too.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eval import Results, SentenceRun, evaluate, run_sentence

__all__ = ["Results", "SentenceRun", "evaluate", "main", "run_sentence"]

_PACKAGE = Path(__file__).parent / "eval"


def _load() -> None:
    """Make `eval` mean the package.

    Raises:
        ImportError: something else has been imported as `eval` before; says which file.
    """
    loaded = sys.modules.get("eval")
    if loaded is not None:
        if str(_PACKAGE) in map(str, getattr(loaded, "__path__", ())):
            return
        raise ImportError(
            f"another module called eval has been imported from {getattr(loaded, '__file__', 'somewhere')}; "
            "import gavel_eval before it, or rename it"
        )
    spec = importlib.util.spec_from_file_location(
        "eval", _PACKAGE / "__init__.py", submodule_search_locations=[str(_PACKAGE)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{_PACKAGE} holds no package")
    module = importlib.util.module_from_spec(spec)
    sys.modules["eval"] = module
    spec.loader.exec_module(module)


def main() -> int:
    """Run the command line `gavel`."""
    from eval.__main__ import main as run

    return run()


_load()


def __getattr__(name: str) -> Any:
    """Return what the package has under this name."""
    return getattr(sys.modules["eval"], name)
