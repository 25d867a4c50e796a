"""Models of the transformers library (`hf:NAME_OR_PATH[?adapter=PATH&quantize=4bit&batch=8&temperature=0.7]`).

The model's own chat template, with thinking switched off where the template knows it and stripped where it does not;
greedy decoding, or sampling by each prompt's own seed; prompts in batches of similar length; bfloat16 on CUDA, float32
elsewhere.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from gavel_agents.llm.constrained_decoding import Holder
from gavel_agents.llm.interface import BadPlannerSpec, Completion, Prompt, decoding_of, spec_options
from gavel_agents.llm.local import load_local
from gavel_agents.llm.sampling import Sampler
from gavel_agents.llm.service import ModelError
from gavel_agents.llm.thinking import without_thinking

__all__ = ["HfModel"]


class HfModel:
    """A local chat model; calls from several threads take turns."""

    def __init__(self, argument: str) -> None:
        """Load model, tokenizer and adapter.

        Raises:
            BadPlannerSpec: unknown option, no chat template, 4 bits without CUDA, or packages that are not installed.
            ModelError: there is no such model or adapter.
        """
        source, options = spec_options(
            "hf",
            argument,
            numbers=("batch", "max_tokens"),
            decimals=("temperature",),
            words={"adapter": (), "quantize": ("4bit",)},
        )
        try:
            import torch
            import transformers
        except ImportError as error:
            raise BadPlannerSpec("planner hf:… needs torch and transformers: pip install 'gavel-env[llm]'") from error
        cuda = torch.cuda.is_available()
        loading: dict[str, Any] = {"dtype": torch.bfloat16 if cuda else torch.float32}
        if options.get("quantize") == "4bit":
            if not cuda:
                raise BadPlannerSpec(f"planner hf:{argument}: 4 bits need a CUDA device")
            four_bits: Any = transformers.BitsAndBytesConfig
            loading["quantization_config"] = four_bits(
                load_in_4bit=True, bnb_4bit_quant_type="nf4", bnb_4bit_compute_dtype=torch.bfloat16
            )
        tokenizer, model = load_local(source, **loading)
        if "adapter" in options:
            model = _adapted(model, options["adapter"], in_4_bits="quantize" in options)
        if not tokenizer.chat_template:
            raise BadPlannerSpec(f"planner hf:{source}: the model has no chat template; take its instruction-tuned one")
        if "quantize" not in options:
            model = model.to("cuda" if cuda else "cpu")
        self._torch, self._tokenizer, self._model = torch, tokenizer, model.eval()
        self._batch = int(options.get("batch", 8))
        self._max_tokens = int(options.get("max_tokens", 400))
        self._context = int(getattr(model.config, "max_position_embeddings", 0) or 1 << 30)
        self._turn = threading.Lock()
        self.name = Path(source).name + (f"+{Path(options['adapter']).name}" if "adapter" in options else "")
        self.decoding: Mapping[str, str | float | int] = {
            "max_tokens": self._max_tokens,
            "temperature": float(options.get("temperature", 0.0)),
            "weights": options.get("quantize", str(loading["dtype"]).removeprefix("torch.")),
        }

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        """Return one completion per prompt, in order.

        Raises:
            ModelError: a prompt does not fit the model's context.
        """
        with self._turn:
            return self._complete(prompts)

    def _complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        texts = [self.render(prompt) for prompt in prompts]
        lengths = [len(self._tokenizer(t, add_special_tokens=False)["input_ids"]) for t in texts]
        for prompt, length in zip(prompts, lengths, strict=True):
            if length + self._max_tokens > self._context:
                raise ModelError(
                    f"hf:{self.name}: the prompt of {prompt.about.text[:80]!r} has {length} tokens; with "
                    f"{self._max_tokens} new ones that is more than the model's {self._context}"
                )
        order = sorted(range(len(texts)), key=lambda i: (lengths[i], i))
        done: dict[int, Completion] = {}
        for start in range(0, len(order), self._batch):
            chosen = order[start : start + self._batch]
            batch = self._generate([texts[i] for i in chosen], [prompts[i] for i in chosen])
            for index, completion in zip(chosen, batch, strict=True):
                done[index] = completion
        return [done[i] for i in range(len(texts))]

    def render(self, prompt: Prompt) -> str:
        """Return the conversation as the model's chat template writes it, thinking switched off."""
        turns = [{"role": m.role, "content": m.content} for m in prompt.messages]
        return str(
            self._tokenizer.apply_chat_template(
                turns, tokenize=False, add_generation_prompt=True, enable_thinking=False
            )
        )

    def _generate(self, texts: Sequence[str], prompts: Sequence[Prompt]) -> list[Completion]:
        """Continue texts of similar length in one batch, each held to its schema and sampled as its prompt says."""
        start = time.perf_counter()
        schemas = [prompt.schema for prompt in prompts]
        processors: list[Any] = [self._holder.processor(schemas)] if any(schemas) else []
        decodings = [decoding_of(self.decoding, prompt) for prompt in prompts]
        if any(decoding["temperature"] for decoding in decodings):
            processors.append(Sampler(decodings, self._model.device))
        held = {"logits_processor": processors} if processors else {}
        batch = self._tokenizer(list(texts), return_tensors="pt", padding=True, add_special_tokens=False)
        batch = {name: tensor.to(self._model.device) for name, tensor in batch.items() if name != "token_type_ids"}
        with self._torch.inference_mode():
            whole = self._model.generate(
                **batch,
                max_new_tokens=self._max_tokens,
                do_sample=False,
                temperature=None,
                top_p=None,
                top_k=None,
                pad_token_id=self._tokenizer.pad_token_id,
                **held,
            )
        seconds = (time.perf_counter() - start) / len(texts)
        answers = whole[:, batch["input_ids"].shape[1] :]
        told = batch["attention_mask"].sum(dim=1)
        return [
            Completion(
                without_thinking(self._tokenizer.decode(answer, skip_special_tokens=True)),
                int(count),
                self._length(answer.tolist()),
                seconds,
                self._finish_reason(answer.tolist()),
            )
            for answer, count in zip(answers, told, strict=True)
        ]

    @cached_property
    def _holder(self) -> Holder:
        return Holder(self._tokenizer, self._model.get_output_embeddings().weight.shape[0])

    def _length(self, answer: list[int]) -> int:
        """Return the tokens of an answer up to and with its end."""
        stop = next((i for i, token in enumerate(answer) if token in self._ends), len(answer) - 1)
        return stop + 1

    def _finish_reason(self, answer: list[int]) -> str:
        return "stop" if self._ends.intersection(answer) else "length"

    @property
    def _ends(self) -> set[int]:
        end = self._model.generation_config.eos_token_id
        return {end} if isinstance(end, int) else set(end or ())


def _adapted(model: Any, adapter: str, *, in_4_bits: bool) -> Any:
    """Return a model with a peft adapter, merged into its weights where these are floats.

    Raises:
        BadPlannerSpec: the package peft is missing.
        ModelError: there is no such adapter.
    """
    try:
        import peft

        adapted: Any = peft.PeftModel.from_pretrained(model, adapter)
    except ImportError as error:
        raise BadPlannerSpec("an adapter needs peft: pip install 'gavel-env[llm]'") from error
    except (OSError, ValueError) as error:
        raise ModelError(f"adapter {adapter} cannot be loaded: {' '.join(str(error).split())[:300]}") from error
    return adapted if in_4_bits else adapted.merge_and_unload()
