"""The network, in numpy: embeddings, a bidirectional GRU, and scores of mentions and of pairs of mentions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.understanding.learned.spotted import Spotted, pair_features

__all__ = ["OF_MENTION", "OF_PAIR", "Scores", "encoded", "scores"]

Array = NDArray[np.float32]
_LAYERS = 2
OF_PAIR = ("on", "in", "from_on", "from_in", "room")
"""What is scored of two mentions: the first goes on or in the second, comes from there, or stands in that room."""
OF_MENTION = {"none": 1, "from_none": 1, "room_none": 1, "state": 3, "count": 3, "wish": 5, "kind": 4}
"""What is scored of a mention, with how many numbers: nowhere to go, no source, no room; washed, dried, cooked; how
many; left alone, on, off, open, shut; which kind of cabinet."""


class Scores(NamedTuple):
    """Scores of a text: of pairs (5, mentions, mentions), and of mentions by name of the head (mentions, numbers)."""

    pairs: Array
    mentions: Mapping[str, Array]


def encoded(read: Spotted, words: Mapping[str, int], values: Mapping[str, int]) -> tuple[Array, NDArray[np.int64]]:
    """Return word weights (tokens, words) as index lists: ids of up to four words of each token, and of its value."""
    ids = np.zeros((len(read.tokens), 5), dtype=np.int64)
    for at, said in enumerate(read.words):
        for slot, word in enumerate(said[:4]):
            ids[at, slot] = words.get(word, 1)
        ids[at, 4] = values.get(read.values[at], 0)
    return read.features, ids


def _times(x: Array, weight: Array) -> Array:
    """Return x W^T over the last axis. `einsum` asks no BLAS: its threads cost more than matrices this small."""
    return np.asarray(np.einsum("...k,nk->...n", x, weight), dtype=np.float32)


def _gru(inputs: Sequence[Array], networks: Sequence[Mapping[str, Array]], layer: int) -> list[Array]:
    """Return the states of both directions, (tokens, 2 hidden) per network; gates r, z, n as torch orders them.

    All networks and directions take a step together.
    """
    chains = [(n, suffix) for n in range(len(networks)) for suffix in ("", "_reverse")]

    def of(kind: str, n: int, suffix: str) -> Array:
        return networks[n][f"gru.{kind}_l{layer}{suffix}"]

    given = np.stack(
        [
            _times(inputs[n][::-1] if suffix else inputs[n], of("weight_ih", n, suffix)) + of("bias_ih", n, suffix)
            for n, suffix in chains
        ],
        axis=1,
    )
    own = np.ascontiguousarray(np.stack([of("weight_hh", *chain) for chain in chains]))
    bias = np.stack([of("bias_hh", *chain) for chain in chains])
    size = own.shape[2]
    state = np.zeros((len(chains), size), dtype=np.float32)
    out = np.empty((len(given), len(chains), size), dtype=np.float32)
    for at, step in enumerate(given):
        kept = np.einsum("dij,dj->di", own, state) + bias
        gates = 1 / (1 + np.exp(-(step[:, : 2 * size] + kept[:, : 2 * size])))
        new = np.tanh(step[:, 2 * size :] + gates[:, :size] * kept[:, 2 * size :])
        state = new + gates[:, size:] * (state - new)
        out[at] = state
    return [np.concatenate([out[:, 2 * n], out[::-1, 2 * n + 1]], axis=1) for n in range(len(networks))]


def scores(
    read: Spotted, networks: Sequence[Mapping[str, Array]], words: Mapping[str, int], values: Mapping[str, int]
) -> list[Scores]:
    """Return the scores of a text by each network."""
    features, ids = encoded(read, words, values)
    entered = [_entered(features, ids, weights) for weights in networks]
    for layer in range(_LAYERS):
        entered = _gru(entered, networks, layer)
    mentions = [m.token for m in read.mentions]
    beside = pair_features(read)
    return [_heads(x[mentions], beside, weights) for x, weights in zip(entered, networks, strict=True)]


def _entered(features: Array, ids: NDArray[np.int64], weights: Mapping[str, Array]) -> Array:
    """Return what goes into the first layer, (tokens, numbers): the mean of a token's words beside the rest."""
    said = ids[:, :4]
    embedded = weights["word.weight"][said] * (said > 0)[..., None]
    embedded = embedded.sum(axis=1) / np.maximum((said > 0).sum(axis=1), 1)[:, None]
    x = np.concatenate([embedded, weights["value.weight"][ids[:, 4]], features], axis=1)
    return np.asarray(np.maximum(_times(x, weights["enter.weight"]) + weights["enter.bias"], 0), dtype=np.float32)


def _heads(h: Array, beside: Array, weights: Mapping[str, Array]) -> Scores:
    """Return the scores that the states of mentions lead to."""
    first = _times(h, weights["first.weight"]) + weights["first.bias"]
    second = _times(h, weights["second.weight"])
    hidden = np.maximum(first[:, None] + second[None] + _times(beside, weights["beside.weight"]), 0)
    of_pairs = _times(hidden, weights["pair.weight"]) + weights["pair.bias"]
    own = np.maximum(_times(h, weights["own.weight"]) + weights["own.bias"], 0)
    heads = _times(own, weights["heads.weight"]) + weights["heads.bias"]
    split = np.cumsum([0, *OF_MENTION.values()])
    named = {name: heads[:, split[i] : split[i + 1]] for i, name in enumerate(OF_MENTION)}
    return Scores(np.moveaxis(of_pairs, -1, 0), named)
