"""The learned reader: a text and its house -> a reading with how sure it is, by numpy alone."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from gavel_agents.understanding.learned.decode import Meant, meant_by
from gavel_agents.understanding.learned.network import Array, scores
from gavel_agents.understanding.learned.spotted import Spotted, spotted
from gavel_env.errors import DataError

__all__ = ["WEIGHTS", "LearnedReader", "Reading", "load_reader", "save"]

WEIGHTS = Path(__file__).parent / "weights.safetensors"
_FORMAT = "gavel-learned-reader/1"


class Reading(NamedTuple):
    """A text as the network reads it, and what it takes it to mean."""

    read: Spotted
    meant: Meant


class LearnedReader:
    """Reads by one or more networks whose probabilities are averaged."""

    def __init__(
        self, networks: Sequence[Mapping[str, Array]], words: Mapping[str, int], values: Mapping[str, int]
    ) -> None:
        self.networks = networks
        self.words = words
        self.values = values

    def read(self, text: str, house: Counter[str] | None) -> Reading:
        """Return the reading of a text.

        Args:
            text: what was said.
            house: how many rooms of each type there are, or None if that is not known.

        Raises:
            Abstention: a word could be one of several that are spelled alike.
        """
        read = spotted(text, house)
        said = scores(read, self.networks, self.words, self.values)
        return Reading(read, meant_by(read, said))


def save(
    path: Path, networks: Sequence[Mapping[str, Array]], words: Mapping[str, int], values: Mapping[str, int]
) -> None:
    """Write networks in half precision, with their tables."""
    tensors = {
        f"{index}.{name}": np.ascontiguousarray(value, dtype=np.float16)
        for index, weights in enumerate(networks)
        for name, value in weights.items()
    }
    tables = {"format": _FORMAT, "words": json.dumps(dict(words)), "values": json.dumps(dict(values))}
    save_file(tensors, path, metadata=tables)


@cache
def load_reader(path: Path = WEIGHTS) -> LearnedReader:
    """Return the reader of a file, loaded once.

    Raises:
        DataError: missing file, or not of this format.
    """
    networks: dict[str, dict[str, Array]] = {}
    try:
        with safe_open(path, framework="numpy") as file:
            said = file.metadata() or {}
            if said.get("format") != _FORMAT:
                raise DataError(f"{path}: not {_FORMAT} but {said.get('format')!r}")
            words, values = json.loads(said["words"]), json.loads(said["values"])
            for key in file.keys():  # noqa: SIM118
                index, _, name = key.partition(".")
                networks.setdefault(index, {})[name] = file.get_tensor(key).astype(np.float32)
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise DataError(f"{path} holds no weights of the learned reader: {error}") from error
    return LearnedReader(list(networks.values()), words, values)
