"""Local GGUF models through llama.cpp (`gguf:PATH[?constrained&threads=N&slots=N&temperature=T]`).

The PyPI package is xllamacpp.

Slots run in parallel, and the prefix that prompts share is kept between calls. Decoding is greedy by default.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from gavel_agents.llm.grammar import json_schema, plan_gbnf
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Prompt, decoding_of, finish_reason, spec_options
from gavel_env.errors import DataError

__all__ = ["GgufModel"]

_SLOTS = 2
_TOKENS_PER_SLOT = 4096


class GgufModel:
    """A chat model in one GGUF file."""

    def __init__(self, path: str, *, max_tokens: int = 400, temperature: float = 0.0, seed: int = 0) -> None:
        """Load the model.

        Args:
            path: the GGUF file, and behind it options: `?constrained` holds answers to the grammar of plans;
                `threads=N` (default: all cores) and `slots=N` (prompts at the same time, default 2) say how it runs;
                `temperature=T` instead of the argument.
            max_tokens: new tokens at most; a plan of 17 steps takes about 140.
            temperature: 0 = greedy.
            seed: of the sampler, when the temperature is not 0.

        Raises:
            DataError: there is no such file, or it holds no model.
            BadPlannerSpec: an unknown option, or the package xllamacpp is not installed.
        """
        path, options = spec_options(
            "gguf", path, numbers=("threads", "slots"), decimals=("temperature",), flags=("constrained",)
        )
        constrained = "constrained" in options
        self._slots = int(options.get("slots", _SLOTS))
        if not Path(path).is_file():
            raise DataError(f"no GGUF model at {path}")
        try:
            import xllamacpp
        except ImportError as error:
            raise BadPlannerSpec("planner gguf:… needs the package xllamacpp: pip install 'gavel-env[llm]'") from error
        self.name = Path(path).stem
        self.decoding: Mapping[str, str | float | int] = {
            "max_tokens": max_tokens,
            "temperature": float(options.get("temperature", temperature)),
            "seed": seed,
            **({"constrained": 1} if constrained else {}),
        }
        self._grammar = {"grammar": plan_gbnf()} if constrained else {}
        parameters: Any = xllamacpp.CommonParams()
        parameters.model.path = path
        parameters.n_ctx = self._slots * _TOKENS_PER_SLOT
        parameters.n_parallel = self._slots
        if "threads" in options:
            parameters.cpuparams.n_threads = parameters.cpuparams_batch.n_threads = int(options["threads"])
        parameters.verbosity = 0
        try:
            self._server: Any = xllamacpp.Server(parameters)
        except RuntimeError as error:
            raise DataError(f"{path} cannot be loaded; is it a whole GGUF file? ({error})") from error

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt; as many run at once as there are slots."""
        with ThreadPoolExecutor(max_workers=self._slots) as pool:
            return list(pool.map(self._complete_one, prompts))

    def _complete_one(self, prompt: Prompt) -> Completion:
        start = time.perf_counter()
        request = {
            "messages": [{"role": m.role, "content": m.content} for m in prompt.messages],
            "cache_prompt": True,
            **{name: value for name, value in decoding_of(self.decoding, prompt).items() if name != "constrained"},
            **(self._grammar if prompt.schema is None else json_schema(prompt.schema)),
        }
        answer = self._server.handle_chat_completions(request)
        if isinstance(answer, str | bytes):
            answer = json.loads(answer)
        if "choices" not in answer:
            raise DataError(f"{self.name} rejected the prompt: {answer.get('error', answer)}")
        usage = answer.get("usage", {})
        return Completion(
            answer["choices"][0]["message"]["content"],
            int(usage.get("prompt_tokens", 0)),
            int(usage.get("completion_tokens", 0)),
            time.perf_counter() - start,
            finish_reason(answer["choices"][0].get("finish_reason")),
        )
