"""Sampling from a batch so that every row depends on its own seed alone, and not on which rows it met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["Sampler"]


class Sampler:
    """A transformers logits processor after which the greedy choice is a sample.

    The largest of `logits / T + g`, with independent standard Gumbel noise g, is distributed as softmax(logits / T).
    Each row draws its noise from a generator of its own, seeded by the prompt. A row of temperature 0 stays greedy.
    """

    def __init__(self, decodings: Sequence[Mapping[str, str | float | int]], device: Any) -> None:
        """Prepare one generator a row.

        Args:
            decodings: per row its `temperature` and, unless it is 0, its `seed` (0 without one).
            device: of the logits.
        """
        import torch

        self._torch = torch
        self._rows: list[tuple[float, Any]] = []
        for decoding in decodings:
            generator = torch.Generator(device=device)
            generator.manual_seed(int(decoding.get("seed", 0)))
            self._rows.append((float(decoding["temperature"]), generator))

    def __call__(self, input_ids: Any, scores: Any) -> Any:
        """Return scores whose largest is a sample.

        Args:
            input_ids: [batch, tokens so far].
            scores: [batch, vocabulary]; -inf stays -inf.
        """
        torch = self._torch
        sampled = scores.float().clone()
        for row, (temperature, generator) in enumerate(self._rows):
            if temperature:
                uniform = torch.rand(sampled.shape[1], generator=generator, device=sampled.device)
                noise = -torch.log(-torch.log(uniform.clamp(1e-9, 1 - 1e-7)))
                sampled[row] = sampled[row] / temperature + noise
        return sampled
