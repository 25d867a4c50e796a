"""The RSN's scores on scenes held out, stored so that scoring it needs no torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.tensors import read_tensors, write_tensors

__all__ = ["FOLDS", "FOLD_SEED", "HeldOut"]

FOLDS = 5
FOLD_SEED = 0
FORMAT = "gavel-rsn-folds/1"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Type scores f_o(tau) by networks that never saw the scene they are asked about.

    Attributes:
        categories: C categories.
        types: T room types.
        seen: (folds, C, T), the network of fold f learned from all scenes but those of fold f.
        unseen: likewise, and the network never saw the category either.
    """

    categories: tuple[str, ...]
    types: tuple[str, ...]
    seen: NDArray[np.floating]
    unseen: NDArray[np.floating]

    @cached_property
    def _row(self) -> dict[str, int]:
        return {c: i for i, c in enumerate(self.categories)}

    def by_type(self, fold: int, category: str, *, category_seen: bool) -> dict[str, float]:
        """Return room type -> score."""
        scores = (self.seen if category_seen else self.unseen)[fold, self._row[category]]
        return dict(zip(self.types, scores.astype(np.float64).tolist(), strict=True))

    def save(self, folder: Path, encoder: str) -> None:
        """Write `rsn_folds.safetensors` (float16)."""
        notes = {
            "format": FORMAT,
            "encoder": encoder,
            "categories": json.dumps(self.categories),
            "types": json.dumps(self.types),
        }
        tensors = {"seen": self.seen.astype(np.float16), "unseen": self.unseen.astype(np.float16)}
        write_tensors(folder / "rsn_folds.safetensors", tensors, notes)

    @classmethod
    def load(cls, folder: Path, encoder: str) -> HeldOut:
        """Read `rsn_folds.safetensors` of a weights folder.

        Raises:
            DataError: the file is missing, corrupt, of another format version or made with another encoder.
        """
        tensors, notes = read_tensors(folder / "rsn_folds.safetensors", FORMAT, encoder)
        categories, types = (tuple(json.loads(notes[key])) for key in ("categories", "types"))
        return cls(categories, types, tensors["seen"], tensors["unseen"])
