"""The learned reader: a text and its house -> a reading with how sure it is, by numpy alone."""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path
from typing import NamedTuple

from gavel_agents.understanding.learned.decode import Meant, meant_by
from gavel_agents.understanding.learned.network import Network, scores
from gavel_agents.understanding.learned.spotted import Spotted, spotted
from gavel_agents.understanding.learned.weights import load

__all__ = ["WEIGHTS", "LearnedReader", "Reading", "load_reader"]

WEIGHTS = Path(__file__).parent / "weights.safetensors"


class Reading(NamedTuple):
    """A text as the network reads it, and what it takes it to mean."""

    read: Spotted
    meant: Meant


class LearnedReader:
    """Reads by a network."""

    def __init__(self, network: Network) -> None:
        self.network = network

    def read(self, text: str, house: Counter[str] | None) -> Reading:
        """Return the reading of a text.

        Args:
            text: what was said.
            house: how many rooms of each type there are, or None if that is not known.

        Raises:
            Abstention: a word could be one of several that are spelled alike, or the text is too long.
        """
        read = spotted(text, house)
        return Reading(read, meant_by(read, scores(read, self.network)))


@cache
def load_reader(path: Path = WEIGHTS) -> LearnedReader:
    """Return the reader of a file, loaded once.

    Raises:
        DataError: missing file, or not of this format.
    """
    return LearnedReader(load(path))
