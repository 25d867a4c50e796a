"""Priors by name: `load_prior("choice")("apple", rooms)` -> probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.choice import ChoiceModel
from gavel_agents.rsn.data import RoomInfo
from gavel_agents.rsn.encoder import PhraseTable, Source, weights_folder
from gavel_agents.rsn.model import RsnModel
from gavel_env.errors import DataError, UnknownPrior

__all__ = ["PRIORS", "LocationPrior", "Prediction", "Prior", "UnknownPrior", "load_prior"]

Floats = NDArray[np.float64]


class Prediction(NamedTuple):
    """b_o^0 over the rooms, (rooms,), and what the category was read as.

    Attributes:
        probabilities: (rooms,), sum 1.
        source: "table" (known phrase), "encoder", "tokens" (stands for the known phrase `read_as`), or "none": uniform.
        read_as: the phrase whose embedding was used, or None.
    """

    probabilities: Floats
    source: Source
    read_as: str | None


class LocationPrior(Protocol):
    """A distribution of a category over rooms, before anything was searched."""

    def __call__(self, category: str, rooms: Sequence[RoomInfo]) -> Floats:
        """Return probabilities, (rooms,), sum 1, none negative."""
        ...


class _Model(Protocol):
    def __call__(self, category: str, phi: Floats, rooms: Sequence[RoomInfo]) -> Floats: ...


class Prior:
    """A location prior with its phrase table.

    Attributes:
        name: as in `PRIORS`.
    """

    def __init__(self, name: str, table: PhraseTable | None, model: _Model | None) -> None:
        self.name: Final = name
        self._table = table
        self._model = model

    def __call__(self, category: str, rooms: Sequence[RoomInfo]) -> Floats:
        """Return probabilities, (rooms,), sum 1.

        Raises:
            ValueError: no rooms.
        """
        return self.predict(category, rooms).probabilities

    def predict(self, category: str, rooms: Sequence[RoomInfo]) -> Prediction:
        """Return probabilities and what the category was read as.

        Raises:
            ValueError: no rooms.
        """
        if not rooms:
            raise ValueError("a location prior needs at least one room")
        uniform = np.full(len(rooms), 1.0 / len(rooms))
        if self._table is None or self._model is None:
            return Prediction(uniform, "none", None)
        embedding = self._table.embed(category)
        if embedding.vector is None:
            return Prediction(uniform, "none", None)
        phi = embedding.vector.astype(np.float64)
        known = (embedding.of or category).replace(" ", "_")
        return Prediction(self._model(known, phi, rooms), embedding.source, embedding.of)


def _uniform(_folder: Path) -> Prior:
    return Prior("uniform", None, None)


def _rsn(folder: Path) -> Prior:
    table = PhraseTable.load(folder)
    model = RsnModel.load(folder, table.encoder)
    return Prior("rsn", table, lambda category, phi, rooms: model.probabilities(phi, rooms, table))


def _choice(folder: Path) -> Prior:
    table = PhraseTable.load(folder)
    model = ChoiceModel.load(folder, table.encoder)
    return Prior("choice", table, lambda category, phi, rooms: model.probabilities(category, phi, rooms, table))


PRIORS = {"choice": _choice, "rsn": _rsn, "uniform": _uniform}
"""Name -> loader from a weights folder: the default, the paper's, and knowing nothing."""


def load_prior(name: str = "choice", folder: Path | None = None) -> Prior:
    """Return a location prior.

    Args:
        name: one of `PRIORS`.
        folder: weights made by `python -m gavel_agents.rsn train --out FOLDER` (default: the shipped ones).

    Raises:
        UnknownPrior: no such name.
        DataError: the folder's weights are missing, corrupt or of another encoder.
    """
    if name not in PRIORS:
        raise UnknownPrior(name, PRIORS)
    return _load(name, folder or weights_folder())


@cache
def _load(name: str, folder: Path) -> Prior:
    if not folder.is_dir():
        raise DataError(f"weights folder {folder} does not exist")
    return PRIORS[name](folder)
