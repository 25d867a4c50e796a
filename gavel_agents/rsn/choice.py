"""The choice model: which of *these* rooms, rather than how typical each room type is.

A category c chooses among the rooms of its house, P(r | c, house) = softmax over r of the utility

    u(c, r) = w_tau(r) . (phi(c) - centre) + bias_tau(r) + residual[c, tau(r)]
              + similarity * cos(phi(c), phi(tau(r))) + size * log(area(r) / 15 m²),

a multinomial logit with ridge penalties. Known categories have a residual of their own; weights of room types are
shared between types of similar names, so that a type never seen borrows from its kin. Not in the paper:
docs/explanation/beliefs.md compares.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.data import Contents, RoomInfo, queries, room_types
from gavel_agents.rsn.encoder import PhraseTable
from gavel_agents.rsn.optimise import minimise
from gavel_agents.rsn.tensors import read_tensors, write_tensors

__all__ = ["LINEAR", "ChoiceConfig", "ChoiceModel", "fit_choice"]

FORMAT = "gavel-choice/1"
REFERENCE_AREA_M2 = 15.0
SIMILARITY_SCALE = 3.0
STEPS = 300
TOLERANCE = 1e-8

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ChoiceConfig:
    """What the utility has.

    Attributes:
        penalty: ridge penalty of all coefficients.
        residual: scale of each known category's own preference; 0 = none.
        sharing: part of a room type's weights that types of similar names have in common, in [0, 1).
        room_terms: use the similarity of names and the size of rooms.
    """

    penalty: float = 0.6
    residual: float = 0.7
    sharing: float = 0.5
    room_terms: bool = True


LINEAR = ChoiceConfig(penalty=0.1, residual=0.0, sharing=0.0, room_terms=False)
"""A linear score on the text embedding and nothing else."""


@dataclass(frozen=True, eq=False)
class ChoiceModel:
    """Fitted coefficients.

    Attributes:
        types: T room types.
        categories: C categories with residuals.
        weights: (T, 384) w_tau.
        bias: (T,).
        residual: (C, T).
        centre: (384,) mean embedding of the training categories.
        room_terms: (2,) similarity and size.
        sharing: `ChoiceConfig.sharing`, to extend the weights to other types.
        names: (T, 384) embeddings of the type names.
    """

    types: tuple[str, ...]
    categories: tuple[str, ...]
    weights: Floats
    bias: Floats
    residual: Floats
    centre: Floats
    room_terms: Floats
    sharing: float
    names: Floats
    _mixtures: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)

    def probabilities(self, category: str, phi: Floats, rooms: Sequence[RoomInfo], table: PhraseTable) -> Floats:
        """Return P(r | category, rooms), (rooms,).

        Args:
            category: name, for its residual.
            phi: (384,) its embedding.
            rooms: the candidates, at least one.
            table: embeds the names of room types that the model never saw.
        """
        own = self.weights @ (phi - self.centre) + self.bias
        if category in self._row:
            own = own + self.residual[self._row[category]]
        similarity, size = (float(v) for v in self.room_terms)
        alike = self.names @ phi
        utility = np.empty(len(rooms))
        for i, room in enumerate(rooms):
            column = self._column.get(room.type)
            if column is not None:
                utility[i] = own[column] + SIMILARITY_SCALE * similarity * alike[column]
            else:
                utility[i] = self._mixture(room.type, table) @ own
                vector = table.embed(room.type).vector
                near = float(np.mean(alike)) if vector is None else float(vector @ phi)
                utility[i] += SIMILARITY_SCALE * similarity * near
        utility += size * log_area([room.area_m2 for room in rooms])
        weight = np.exp(utility - utility.max())
        return np.asarray(weight / weight.sum())

    def _mixture(self, room_type: str, table: PhraseTable) -> Floats:
        """Return the coefficients over known types that stand for an unknown one, (T,): k Sigma^-1."""
        if room_type not in self._mixtures:
            vector = table.embed(room_type).vector
            if vector is None or self.sharing == 0.0:
                self._mixtures[room_type] = np.zeros(len(self.types))
            else:
                centred, kin = _kinship(self.names, self.sharing)
                other = vector - self.names.mean(axis=0)
                other = other / np.linalg.norm(other)
                self._mixtures[room_type] = np.linalg.solve(kin, self.sharing * (centred @ other))
        return self._mixtures[room_type]

    @cached_property
    def _row(self) -> dict[str, int]:
        return {c: i for i, c in enumerate(self.categories)}

    @cached_property
    def _column(self) -> dict[str, int]:
        return {t: i for i, t in enumerate(self.types)}

    def save(self, folder: Path, encoder: str) -> None:
        """Write `choice.safetensors` (float32)."""
        tensors = {
            name: np.asarray(getattr(self, name), dtype=np.float32)
            for name in ("weights", "bias", "residual", "centre", "room_terms", "names")
        }
        notes = {
            "format": FORMAT,
            "encoder": encoder,
            "types": json.dumps(self.types),
            "categories": json.dumps(self.categories),
            "sharing": repr(self.sharing),
        }
        write_tensors(folder / "choice.safetensors", tensors, notes)

    @classmethod
    def load(cls, folder: Path, encoder: str) -> ChoiceModel:
        """Read `choice.safetensors` of a weights folder.

        Raises:
            DataError: the file is missing, corrupt, of another format version or made with another encoder.
        """
        tensors, notes = read_tensors(folder / "choice.safetensors", FORMAT, encoder)
        types, categories = (tuple(json.loads(notes[key])) for key in ("types", "categories"))
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in tensors.items()}
        return cls(types=types, categories=categories, sharing=float(notes["sharing"]), **arrays)


def log_area(areas_m2: Sequence[float | None]) -> Floats:
    """Return log(area / 15 m²), 0 where the area is unknown."""
    return np.array([0.0 if not a else np.log(max(a, 0.5) / REFERENCE_AREA_M2) for a in areas_m2])


def _kinship(names: Floats, sharing: float) -> tuple[Floats, Floats]:
    """Return the centred unit name vectors (T, 384) and the prior covariance of the types' weights (T, T)."""
    centred = names - names.mean(axis=0)
    centred = centred / np.linalg.norm(centred, axis=1, keepdims=True)
    return centred, (1.0 - sharing + 1e-6) * np.eye(len(names)) + sharing * (centred @ centred.T)


@dataclass(frozen=True, eq=False)
class _Choices:
    """All choices of the training scenes, flat: n alternatives in k choices.

    Attributes:
        category, kind: (n,) rows of category and room type.
        starts: (k,) first alternative of each choice.
        choice: (n,) the choice of each alternative.
        held: (n,) 1 where the room holds the category.
        terms: (2, n) similarity and size.
    """

    category: NDArray[np.intp]
    kind: NDArray[np.intp]
    starts: NDArray[np.intp]
    choice: NDArray[np.intp]
    held: Floats
    terms: Floats


def _choices(contents: Contents, scenes: Sequence[str], categories: Sequence[str], alike: Floats,
             column: dict[str, int]) -> _Choices:  # fmt: skip
    true_rooms: dict[tuple[str, str], list[int]] = {}
    for query in queries(contents, scenes, categories):
        true_rooms.setdefault((query.scene, query.category), []).append(query.room)
    row = {c: i for i, c in enumerate(categories)}
    kinds = {s: np.array([column[r.type] for r in contents.scenes[s]]) for s in scenes}
    sizes = {s: log_area([r.area_m2 for r in contents.scenes[s]]) for s in scenes}
    keys = [key for key in true_rooms if len(kinds[key[0]]) > 1]
    lengths = np.array([len(kinds[scene]) for scene, _ in keys])
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    held = np.zeros(int(lengths.sum()))
    for key, start in zip(keys, starts, strict=True):
        held[start + np.array(true_rooms[key])] = 1.0
    category = np.repeat([row[c] for _, c in keys], lengths)
    kind = np.concatenate([kinds[scene] for scene, _ in keys])
    terms = np.stack([SIMILARITY_SCALE * alike[category, kind], np.concatenate([sizes[scene] for scene, _ in keys])])
    return _Choices(category, kind, starts, np.repeat(np.arange(len(keys)), lengths), held, terms)


def fit_choice(
    contents: Contents,
    scenes: Sequence[str],
    categories: Sequence[str],
    table: PhraseTable,
    config: ChoiceConfig | None = None,
) -> ChoiceModel:
    """Fit the model by penalised maximum likelihood; every room that holds a category counts once.

    Args:
        contents: the scenes.
        scenes: those to learn from.
        categories: those to learn.
        table: embeddings of the categories and of the room types.
        config: what the utility has (default: `ChoiceConfig()`).

    Raises:
        KeyError: the table lacks a category or room type.
    """
    config = config or ChoiceConfig()
    types = room_types(contents, scenes)
    names = np.stack([table.known(t) for t in types]).astype(np.float64)
    phi = np.stack([table.known(c) for c in categories]).astype(np.float64)
    centre = phi.mean(axis=0)
    features = np.hstack([phi - centre, np.ones((len(phi), 1)), config.residual * np.eye(len(phi))])
    if config.residual == 0.0:
        features = features[:, : phi.shape[1] + 1]
    sharing = np.linalg.cholesky(_kinship(names, config.sharing)[1])
    data = _choices(contents, scenes, categories, phi @ names.T, {t: i for i, t in enumerate(types)})
    shape = (len(types), features.shape[1])
    count = shape[0] * shape[1]
    chosen = np.add.reduceat(data.held, data.starts)[data.choice]
    cell = data.category * len(types) + data.kind

    def loss(x: Floats) -> tuple[float, Floats]:
        free, terms = x[:count].reshape(shape), x[count:]
        utility = (features @ (sharing @ free).T)[data.category, data.kind]
        if config.room_terms:
            utility = utility + terms @ data.terms
        utility = utility - np.maximum.reduceat(utility, data.starts)[data.choice]
        weight = np.exp(utility)
        total = np.add.reduceat(weight, data.starts)[data.choice]
        value = float((data.held * (np.log(total) - utility)).sum() + 0.5 * config.penalty * (x @ x))
        excess = chosen * weight / total - data.held
        by_cell = np.bincount(cell, excess, minlength=len(phi) * len(types)).reshape(len(phi), len(types))
        slopes = [(sharing.T @ (by_cell.T @ features)).ravel()]
        slopes.append(data.terms @ excess if config.room_terms else np.zeros(2))
        return value, np.concatenate(slopes) + config.penalty * x

    best = minimise(loss, np.zeros(count + 2), STEPS, TOLERANCE)
    fitted = sharing @ best[:count].reshape(shape)
    width = phi.shape[1]
    residual = config.residual * fitted[:, width + 1 :].T if config.residual else np.zeros((0, len(types)))
    return ChoiceModel(
        types=types,
        categories=tuple(categories) if config.residual else (),
        weights=fitted[:, :width],
        bias=fitted[:, width],
        residual=residual,
        centre=centre,
        room_terms=best[count:],
        sharing=config.sharing,
        names=names,
    )
