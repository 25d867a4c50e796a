"""The learned reader: a text and its house -> a reading with how sure it is, by numpy alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from gavel_agents.understanding.learned.decode import Meant, meant_by
from gavel_agents.understanding.learned.network import Network, mean, scores
from gavel_agents.understanding.learned.spotted import Spotted, spotted
from gavel_agents.understanding.learned.weights import load

__all__ = ["WEIGHTS", "LearnedReader", "Reading", "load_reader"]

WEIGHTS = tuple(sorted(Path(__file__).parent.glob("weights-*.safetensors")))
_SURE = 0.95
"""From here on the first network is not checked by the others."""


class Reading(NamedTuple):
    """A text as the network reads it, and what it takes it to mean."""

    read: Spotted
    meant: Meant


class LearnedReader:
    """Reads by networks that were trained apart: they err in different places."""

    def __init__(self, networks: Sequence[Network]) -> None:
        self.networks = tuple(networks)

    def read(self, text: str, house: Counter[str] | None) -> Reading:
        """Return the reading of a text.

        Args:
            text: what was said.
            house: how many rooms of each type there are, or None if that is not known.

        Raises:
            Abstention: a word could be one of several that are spelled alike, or the text is too long.
        """
        read = spotted(text, house)
        found = [scores(read, self.networks[0])]
        meant = meant_by(read, found[0])
        if meant.sure < _SURE and len(self.networks) > 1:
            found += [scores(read, network) for network in self.networks[1:]]
            meant = meant_by(read, mean(found))
        return Reading(read, meant)


@cache
def load_reader(paths: tuple[Path, ...] = WEIGHTS) -> LearnedReader:
    """Return the reader of one or more files of weights, loaded once.

    Raises:
        DataError: missing file, or not of this format.
    """
    return LearnedReader([load(path) for path in paths])
