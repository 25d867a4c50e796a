"""The network, in numpy: an encoder of the words, and scores of mentions and of pairs of mentions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gavel_agents.understanding.learned.encoder import Array, encode, input_of
from gavel_agents.understanding.learned.options import MOST_KINDS, UNNAMED_ROOMS
from gavel_agents.understanding.learned.pieces import Pieces
from gavel_agents.understanding.learned.spotted import Spotted, pair_features

__all__ = ["OF_MENTION", "OF_PAIR", "Network", "Scores", "mean", "rooms_in", "scores"]

OF_PAIR = ("on", "in", "from_on", "from_in", "room")
"""What is scored of two mentions: the first goes on or in the second, comes from there, or stands in that room."""
OF_MENTION = {
    "none": 1, "from_none": 1, "room_none": 1, "state": 3, "count": 3, "wish": 5, "kind": MOST_KINDS,
    "unnamed_room": len(UNNAMED_ROOMS),
}  # fmt: skip
"""What is scored of a mention, with how many numbers: nowhere to go, no source, no room; washed, dried, cooked; how
many; left alone, on, off, open, shut; which kind of what its word may mean; which room that no word names."""


class Network(NamedTuple):
    """Weights with what they are about.

    Attributes:
        pieces: the vocabulary.
        values: numbers of what tokens of closed classes do.
        shared: weights outside the layers; matrices are (in, out).
        layers: weights of each layer of the encoder.
    """

    pieces: Pieces
    values: Mapping[str, int]
    shared: Mapping[str, Array]
    layers: Sequence[Mapping[str, Array]]


class Scores(NamedTuple):
    """Scores of a text.

    Attributes:
        pairs: of pairs of mentions, (5, mentions, mentions).
        mentions: of mentions by name of the head, (mentions, numbers).
        whole: that the mentions can say all that is asked for: that no word for a thing was missed.
    """

    pairs: Array
    mentions: Mapping[str, Array]
    whole: float


def scores(read: Spotted, network: Network) -> Scores:
    """Return the scores of a text."""
    given, tokens = input_of(read, network.pieces, network.values), [m.token for m in read.mentions]
    states = encode(given, network.shared, network.layers, tokens)
    h, weights = states[1:], network.shared
    first = h @ weights["first"] + weights["first.bias"]
    second = h @ weights["second"]
    hidden = np.maximum(first[:, None] + second[None] + pair_features(read) @ weights["beside"], 0)
    of_pairs = hidden @ weights["pair"] + weights["pair.bias"]
    own = np.maximum(h @ weights["own"] + weights["own.bias"], 0)
    heads = own @ weights["heads"] + weights["heads.bias"]
    split = np.cumsum([0, *OF_MENTION.values()])
    named = {name: heads[:, split[i] : split[i + 1]] for i, name in enumerate(OF_MENTION)}
    whole = states[0] @ weights["whole"] + weights["whole.bias"]
    return Scores(np.moveaxis(of_pairs, -1, 0), named, float(whole[0]))


def rooms_in(named: Array, unnamed: Array, none: Array) -> Array:
    """Return the scores of rooms in the order of their indices: mentions, `UNNAMED_ROOMS` from the end, none."""
    return np.concatenate([named, unnamed[:, ::-1], none], axis=1)


def mean(found: Sequence[Scores]) -> Scores:
    """Return the mean of several networks' scores of one text."""
    return Scores(
        np.mean([one.pairs for one in found], axis=0),
        {name: np.mean([one.mentions[name] for one in found], axis=0) for name in OF_MENTION},
        sum(one.whole for one in found) / len(found),
    )
