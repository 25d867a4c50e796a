"""The encoder, in numpy: a transformer over word pieces (the lowest layers of MiniLM, trained on)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.understanding.interface import Abstention
from gavel_agents.understanding.learned.pieces import END, START, Pieces
from gavel_agents.understanding.learned.spotted import Spotted, unknown_features

__all__ = ["HEADS", "LONGEST", "Array", "Input", "encode", "input_of"]

Array = NDArray[np.float32]
HEADS = 12
LONGEST = 512
"""Word pieces of the longest text that can be read."""
_EPSILON = 1e-12


class Input(NamedTuple):
    """A text as the encoder takes it.

    Attributes:
        pieces: numbers of the word pieces, (pieces,).
        starts: for each token the place of its first piece, (tokens,).
        values: for each token what it does, if it is of a closed class, (tokens,).
        features: of each token, (tokens, FEATURES).
    """

    pieces: NDArray[np.int64]
    starts: NDArray[np.int64]
    values: NDArray[np.int64]
    features: Array


def input_of(
    read: Spotted,
    pieces: Pieces,
    values: Mapping[str, int],
    hidden: Collection[int] = (),
    unnamed: Collection[int] = (),
) -> Input:
    """Return what goes into the encoder.

    Args:
        read: the text.
        pieces: the vocabulary.
        values: numbers of what tokens of closed classes do.
        hidden: tokens that are taken for words that name nothing known.
        unnamed: tokens whose word is `thing`, whichever thing they name.

    Raises:
        Abstention: `too_long`.
    """
    features = read.features.copy()
    for at in hidden:
        features[at] = unknown_features(read.tokens[at])
    numbers, starts = [pieces.vocabulary[START]], []
    for at, token in enumerate(read.tokens):
        starts.append(len(numbers))
        numbers += pieces.of("thing" if at in unnamed else token.text)
    numbers.append(pieces.vocabulary[END])
    if len(numbers) > LONGEST:
        raise Abstention("too_long", f"the text has {len(numbers)} word pieces, at most {LONGEST} can be read")
    return Input(
        np.array(numbers, dtype=np.int64), np.array(starts, dtype=np.int64),
        np.array([values.get(value, 0) for value in read.values], dtype=np.int64), features,
    )  # fmt: skip


def encode(
    given: Input, weights: Mapping[str, Array], layers: Sequence[Mapping[str, Array]], tokens: Sequence[int]
) -> Array:
    """Return the last state of the text as a whole, then of the first piece of some tokens, (1 + tokens, width)."""
    x = weights["word"][given.pieces] * weights["word.scale"][given.pieces, None]
    x[given.starts] += given.features @ weights["feature"] + weights["value"][given.values]
    x = _normal(x + weights["position"][: len(x)], weights, "entered")
    rows = np.concatenate([[0], given.starts[list(tokens)]])
    for number, layer in enumerate(layers, start=1):
        own = x if number < len(layers) else x[rows]  # of the last layer nothing else is needed
        x = _normal(own + _attended(own, x, layer) @ layer["out"] + layer["out.bias"], layer, "out.normal")
        hidden = _gelu(x @ layer["up"] + layer["up.bias"])
        x = _normal(x + hidden @ layer["down"] + layer["down.bias"], layer, "down.normal")
    return np.asarray(x)


def _attended(own: Array, x: Array, layer: Mapping[str, Array]) -> Array:
    """Return what some pieces take from all, (some, width), before the output's matrix."""
    count, width = own.shape
    size = width // HEADS
    asked, keys, values = (
        (given @ layer[name] + layer[f"{name}.bias"]).reshape(len(given), HEADS, size).transpose(1, 0, 2)
        for name, given in (("query", own), ("key", x), ("value", x))
    )
    weight = asked @ keys.transpose(0, 2, 1) / np.float32(np.sqrt(size))
    weight = np.exp(weight - weight.max(axis=-1, keepdims=True))
    weight /= weight.sum(axis=-1, keepdims=True)
    return np.asarray((weight @ values).transpose(1, 0, 2).reshape(count, width))


def _normal(x: Array, weights: Mapping[str, Array], name: str) -> Array:
    x = x - x.mean(axis=-1, keepdims=True)
    deviation = np.sqrt((x * x).mean(axis=-1, keepdims=True) + np.float32(_EPSILON))
    return np.asarray(x / deviation * weights[f"{name}.weight"] + weights[f"{name}.bias"])


def _gelu(x: Array) -> Array:
    """Return GELU by its tanh form."""
    return np.asarray(0.5 * x * (1 + np.tanh(np.float32(np.sqrt(2 / np.pi)) * (x + np.float32(0.044715) * x * x * x))))
