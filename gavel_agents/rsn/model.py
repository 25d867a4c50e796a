"""The Relational Semantic Network f_theta: embedding -> score of each room type (paper eqs. rsn, rsnbelief).

Forward pass in numpy from safetensors; only training (`train.py`) needs torch.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.data import RoomInfo
from gavel_agents.rsn.encoder import PhraseTable
from gavel_agents.rsn.tensors import read_tensors, write_tensors

__all__ = ["HIDDEN", "RsnModel", "split_over_instances"]

FORMAT = "gavel-rsn/1"
HIDDEN = (256, 128, 64)

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RsnModel:
    """A trained network.

    Attributes:
        types: T room types.
        layers: (weights (out, in), bias (out,)) of the four linear layers, ReLU between them.
        platt: (slope, intercept) of the calibration sigma(slope z + intercept).
    """

    types: tuple[str, ...]
    layers: tuple[tuple[Floats, Floats], ...]
    platt: tuple[float, float]

    def scores(self, phi: Floats) -> Floats:
        """Return f_o(tau) in (0, 1), (T,), for an embedding (384,)."""
        x = phi
        for i, (weights, bias) in enumerate(self.layers):
            x = weights @ (np.maximum(x, 0.0) if i else x) + bias
        slope, intercept = self.platt
        return np.asarray(1.0 / (1.0 + np.exp(-(slope * x + intercept))))

    def probabilities(self, phi: Floats, rooms: Sequence[RoomInfo], table: PhraseTable) -> Floats:
        """Return b_o^0(r), (rooms,): each type's score split over its instances, normalised.

        A room type that the network has no output for takes the score of the type with the most similar name.
        """
        return split_over_instances(self.scores_by_type(phi, sorted({r.type for r in rooms}), table), rooms)

    def scores_by_type(self, phi: Floats, types: Sequence[str], table: PhraseTable) -> dict[str, float]:
        """Return room type -> f_o(tau), for any types."""
        scores = self.scores(phi)
        column = {t: i for i, t in enumerate(self.types)}
        return {t: float(scores[column[t] if t in column else self._kin(t, table)]) for t in types}

    def _kin(self, room_type: str, table: PhraseTable) -> int:
        vector = table.embed(room_type).vector
        if vector is None:
            return 0
        return int(np.argmax([float(table.known(t) @ vector) for t in self.types]))

    def save(self, folder: Path, encoder: str) -> None:
        """Write `rsn.safetensors` (float16)."""
        tensors = {}
        for i, (weights, bias) in enumerate(self.layers):
            tensors[f"layer{i}.weight"] = weights.astype(np.float16)
            tensors[f"layer{i}.bias"] = bias.astype(np.float16)
        notes = {
            "format": FORMAT,
            "encoder": encoder,
            "types": json.dumps(self.types),
            "platt": json.dumps(self.platt),
        }
        write_tensors(folder / "rsn.safetensors", tensors, notes)

    @classmethod
    def load(cls, folder: Path, encoder: str) -> RsnModel:
        """Read `rsn.safetensors` of a weights folder.

        Raises:
            DataError: the file is missing, corrupt, of another format version or made with another encoder.
        """
        tensors, notes = read_tensors(folder / "rsn.safetensors", FORMAT, encoder)
        layers = tuple(
            (np.asarray(tensors[f"layer{i}.weight"], np.float64), np.asarray(tensors[f"layer{i}.bias"], np.float64))
            for i in range(len(tensors) // 2)
        )
        slope, intercept = json.loads(notes["platt"])
        return cls(tuple(json.loads(notes["types"])), layers, (slope, intercept))


def split_over_instances(by_type: dict[str, float], rooms: Sequence[RoomInfo]) -> Floats:
    """Return b(r) proportional to f(tau(r)) / |{r' : tau(r') = tau(r)}| (eq. rsnbelief), (rooms,)."""
    instances = Counter(room.type for room in rooms)
    mass = np.array([by_type[room.type] / instances[room.type] for room in rooms])
    total = mass.sum()
    return np.asarray(mass / total) if total > 0.0 else np.full(len(rooms), 1.0 / len(rooms))
