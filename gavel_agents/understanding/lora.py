"""Fitting a LoRA adapter that answers a sentence with the JSON of what it says (`gavel_agents.understanding.answer`).

One adapter for grounding and goals, trained on the answer's tokens alone. A checkpoint (safetensors and JSON) is
written every few steps, and a killed run goes on from it with the same weights and the same batches.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from gavel_agents.llm.local import load_local
from gavel_agents.understanding.answer import write_answer
from gavel_agents.understanding.model import adapter_prompt
from gavel_agents.understanding.pairs import Sample
from gavel_env.errors import DataError, GavelError

if TYPE_CHECKING:
    import torch

__all__ = ["LoraSettings", "fit_lora"]

_MODULES = ("q_proj", "k_proj", "v_proj", "o_proj", "gate_proj", "up_proj", "down_proj")
_IGNORED = -100
_BUCKET = 50  # batches whose sentences are sorted by length together

Encoded = tuple[list[int], list[int]]
"""Token ids of a prompt and of its answer."""


class LoraSettings(msgspec.Struct, frozen=True):
    """How an adapter is fitted.

    Attributes:
        base: model that is adapted (`gavel_agents.llm.local.load_local`).
        epochs: passes over the pairs.
        batch: pairs per step.
        rank: of the adapter; its scale is twice that.
        learning_rate: highest, after a warm-up of 3 % of the steps; falls to 0 like a cosine.
        precision: "bf16" computes in bfloat16 (weights stay float32), "fp32" does not.
        seed: of the adapter's initial weights and of the batches.
        start: folder of an adapter to go on from, of the same base and rank; None for a new one.
    """

    base: str
    epochs: int = 1
    batch: int = 16
    rank: int = 16
    learning_rate: float = 1e-3
    precision: str = "fp32"
    seed: int = 0
    start: str | None = None


def fit_lora(
    samples: Sequence[Sample],
    out: Path,
    settings: LoraSettings,
    *,
    checkpoint_every: int = 20,
    report: Callable[[str], None] = lambda line: None,
) -> int:
    """Fit an adapter and save it in `out` (adapter_model.safetensors, adapter_config.json); return the steps.

    Args:
        samples: pairs.
        out: folder; a checkpoint in it goes on.
        settings: how.
        checkpoint_every: steps between checkpoints.
        report: takes lines of progress.

    Raises:
        BadPlannerSpec: a package is missing.
        ModelError: there is no such base.
        DataError: the checkpoint in `out` was made with other settings or pairs; or no adapter to start from.
    """
    tokenizer, base = load_local(settings.base)
    import peft
    import torch

    torch.manual_seed(settings.seed)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    config = peft.LoraConfig(
        r=settings.rank, lora_alpha=2 * settings.rank, target_modules=list(_MODULES), task_type="CAUSAL_LM"
    )
    model: Any = peft.get_peft_model(base, config).to(device).train()
    if settings.start is not None:
        _start_from(model, Path(settings.start))
    encoded = [_encode(tokenizer, sample) for sample in samples]
    batches = [b for epoch in range(settings.epochs) for b in _batches(encoded, settings, epoch)]
    weights = {name: p for name, p in model.named_parameters() if p.requires_grad}
    optimiser = torch.optim.AdamW(weights.values(), lr=settings.learning_rate, weight_decay=0.0)
    checkpoint = _Checkpoint(out / "checkpoint", settings, len(samples), weights, optimiser)
    done, begun, tokens, recent = checkpoint.load(), time.monotonic(), 0, list[float]()
    if done:
        report(f"goes on after step {done} of {len(batches)}")
    for step in range(done, len(batches)):
        for group in optimiser.param_groups:
            group["lr"] = settings.learning_rate * _schedule(step, len(batches))
        with torch.autocast(device, torch.bfloat16, enabled=settings.precision == "bf16"):
            loss, count = _loss(model, [encoded[i] for i in batches[step]], tokenizer.pad_token_id, device)
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(weights.values(), 1.0)
        optimiser.step()
        optimiser.zero_grad()
        tokens += count
        recent = [*recent[-9:], float(loss.detach())]
        if (step + 1) % 10 == 0 or step + 1 == len(batches):
            seconds = time.monotonic() - begun
            left = seconds / (step + 1 - done) * (len(batches) - step - 1) / 60.0
            mean = sum(recent) / len(recent)
            report(f"[{step + 1}/{len(batches)}] loss {mean:.4f}, {tokens / seconds:.0f} tokens/s, {left:.0f} min left")
        if (step + 1) % checkpoint_every == 0:
            checkpoint.save(step + 1)
    model.half().save_pretrained(out)
    _name_base(out, settings.base)
    checkpoint.remove()
    return len(batches)


def _start_from(model: Any, folder: Path) -> None:
    import peft
    import safetensors.torch

    try:
        tensors = safetensors.torch.load_file(folder / "adapter_model.safetensors")
        peft.set_peft_model_state_dict(model, {name: tensor.float() for name, tensor in tensors.items()})
    except (OSError, RuntimeError) as error:
        raise DataError(f"{folder} holds no adapter to start from: {' '.join(str(error).split())[:200]}") from error


def _encode(tokenizer: Any, sample: Sample) -> Encoded:
    turns = [{"role": m.role, "content": m.content} for m in adapter_prompt(sample.text)]
    prompt = tokenizer.apply_chat_template(turns, tokenize=False, add_generation_prompt=True, enable_thinking=False)
    return (
        tokenizer(prompt, add_special_tokens=False)["input_ids"],
        [*tokenizer(write_answer(sample.tasks), add_special_tokens=False)["input_ids"], tokenizer.eos_token_id],
    )


def _batches(encoded: Sequence[Encoded], settings: LoraSettings, epoch: int) -> Iterator[list[int]]:
    """Yield the pairs of each step of an epoch: shuffled, with those of similar length together."""
    rng = np.random.default_rng([settings.seed, epoch])
    order = rng.permutation(len(encoded)).tolist()
    batches = []
    for start in range(0, len(order), _BUCKET * settings.batch):
        near = sorted(order[start : start + _BUCKET * settings.batch], key=lambda i: sum(map(len, encoded[i])))
        batches += [near[i : i + settings.batch] for i in range(0, len(near), settings.batch)]
    for index in rng.permutation(len(batches)):
        yield batches[index]


def _schedule(step: int, steps: int) -> float:
    warm_up = max(1, round(0.03 * steps))
    if step < warm_up:
        return (step + 1) / warm_up
    return 0.5 * (1.0 + math.cos(math.pi * (step - warm_up) / max(1, steps - warm_up)))


def _loss(model: Any, pairs: Sequence[Encoded], pad: int, device: str) -> tuple[torch.Tensor, int]:
    """Return the mean cross-entropy of the answers' tokens, and how many tokens were read.

    Padding is on the left, so that answers end together and logits are needed for the last tokens alone.
    """
    import torch

    longest = max(len(prompt) + len(answer) for prompt, answer in pairs)
    kept = max(len(answer) for _, answer in pairs)
    ids = torch.full((len(pairs), longest), pad)
    mask = torch.zeros_like(ids)
    labels = torch.full((len(pairs), kept), _IGNORED)
    for row, (prompt, answer) in enumerate(pairs):
        whole = torch.tensor([*prompt, *answer])
        ids[row, -len(whole) :] = whole
        mask[row, -len(whole) :] = 1
        labels[row, -len(answer) :] = whole[-len(answer) :]
    positions = (mask.cumsum(dim=1) - 1).clamp(min=0)
    logits = model(
        input_ids=ids.to(device),
        attention_mask=mask.to(device),
        position_ids=positions.to(device),
        logits_to_keep=kept + 1,
        use_cache=False,
    ).logits[:, :-1]
    loss = torch.nn.functional.cross_entropy(
        logits.float().flatten(0, 1), labels.to(device).flatten(), ignore_index=_IGNORED
    )
    return loss, int(mask.sum())


class _Checkpoint:
    """Weights, moments and step of a run, on disk."""

    def __init__(self, folder: Path, settings: LoraSettings, pairs: int, weights: dict[str, Any], optimiser: Any):
        self._folder, self._weights, self._optimiser = folder, weights, optimiser
        self._about = {"settings": msgspec.to_builtins(settings), "pairs": pairs}

    def load(self) -> int:
        """Restore what was saved; return the steps done."""
        import safetensors.torch
        import torch

        state = self._folder / "state.json"
        if not state.is_file():
            return 0
        said = json.loads(state.read_text(encoding="utf-8"))
        if said["about"] != self._about:
            raise DataError(f"{state} is of a run with other settings ({said['about']}); take another folder")
        tensors = safetensors.torch.load_file(self._folder / f"{said['step']}.safetensors")
        with torch.no_grad():
            for name, weight in self._weights.items():
                weight.copy_(tensors[f"weight.{name}"])
                self._optimiser.state[weight] = {
                    "step": torch.tensor(float(said["step"])),
                    "exp_avg": tensors[f"first.{name}"].to(weight.device),
                    "exp_avg_sq": tensors[f"second.{name}"].to(weight.device),
                }
        return int(said["step"])

    def save(self, step: int) -> None:
        """Write tensors first, then the state that names them; what is older goes last."""
        import safetensors.torch

        self._folder.mkdir(parents=True, exist_ok=True)
        tensors = {}
        for name, weight in self._weights.items():
            tensors[f"weight.{name}"] = weight.detach()
            tensors[f"first.{name}"] = self._optimiser.state[weight]["exp_avg"]
            tensors[f"second.{name}"] = self._optimiser.state[weight]["exp_avg_sq"]
        safetensors.torch.save_file(tensors, self._folder / f"{step}.safetensors")
        state = self._folder / "state.json"
        new = state.with_suffix(".new")
        new.write_text(json.dumps({"about": self._about, "step": step}), encoding="utf-8")
        new.replace(state)
        for old in self._folder.glob("*.safetensors"):
            if old.stem != str(step):
                old.unlink()

    def remove(self) -> None:
        """Delete the checkpoint of a finished run."""
        for file in self._folder.glob("*"):
            file.unlink()
        if self._folder.is_dir():
            self._folder.rmdir()


def _name_base(out: Path, base: str) -> None:
    """Write into the saved configuration which base the adapter is for, without any path of this machine."""
    (out / "README.md").unlink(missing_ok=True)
    config = out / "adapter_config.json"
    if not config.is_file():
        raise GavelError(f"peft wrote no {config}")
    said = json.loads(config.read_text(encoding="utf-8"))
    said["base_model_name_or_path"] = Path(base).name if Path(base).exists() else base
    said["target_modules"] = sorted(said["target_modules"])
    config.write_text(json.dumps(said, indent=1, sort_keys=True) + "\n", encoding="utf-8")
