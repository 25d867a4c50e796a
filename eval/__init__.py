"""Evaluation: steps agents through environments; owns records, tables, figures, reports and the command line.

`eval.evaluate(...)` runs agents over instructions and returns `eval.Results`; `eval.run_sentence(...)` carries one
sentence out and returns `eval.SentenceRun`. The same package is importable as `gavel_eval`, for scripts in folders that
hold an `eval.py` of their own.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eval.api import Results, evaluate
    from eval.sentence.run import SentenceRun, run_sentence

__all__ = ["Results", "SentenceRun", "evaluate", "run_sentence"]


def __getattr__(name: str) -> Any:
    """Load a public name on first use, so that the command line starts fast."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = "eval.sentence.run" if name in ("SentenceRun", "run_sentence") else "eval.api"
    return getattr(importlib.import_module(home), name)
