"""How good the location priors are, on houses that they never saw (the paper's "Belief and Cost-Model Quality").

A query is (scene, room, category), one for every room that holds the category: a belief over all rooms of the scene is
asked to name that room, with the rooms' types and sizes known and nothing seen. Other rooms that hold the category too
count as wrong, so that not even a model that knows the true rooms is right every time (`ceiling`). Scenes are held out
in five folds of whole houses, a garden with its house. `unseen` holds the category out as well.

top-1: the true room has the highest belief; k rooms tied for it count 1/k. AUC: over all (query, room) pairs of a
partition. Brier: mean squared error over the same pairs. NLL: mean -ln of the true room's belief.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn import load_prior
from gavel_agents.rsn.choice import LINEAR, ChoiceConfig, ChoiceModel, fit_choice
from gavel_agents.rsn.data import (
    BENCHMARK_HOUSES,
    Contents,
    Query,
    RoomInfo,
    category_folds,
    known_categories,
    load_contents,
    queries,
    scene_folds,
)
from gavel_agents.rsn.encoder import PhraseTable, weights_folder
from gavel_agents.rsn.folds import FOLD_SEED, FOLDS, HeldOut
from gavel_agents.rsn.model import split_over_instances

__all__ = ["BINS", "Answer", "Score", "evaluate", "evaluate_shipped", "fits", "score"]

BINS = 10

Floats = NDArray[np.float64]
Model = Callable[[str, Sequence[RoomInfo]], Floats]


class Answer(NamedTuple):
    """A belief over the rooms of a query's scene, (rooms,), and the row of the true room."""

    belief: Floats
    room: int


class Score(NamedTuple):
    """Scores of one prior on one set of queries.

    Attributes:
        prior: name of the row.
        queries: number of queries.
        top1, auc, brier, nll: see the module.
        calibration: per tenth of belief (pairs, mean belief, share that is the true room); an empty tenth has 0 pairs.
    """

    prior: str
    queries: int
    top1: float
    auc: float
    brier: float
    nll: float
    calibration: tuple[tuple[int, float, float], ...]

    @property
    def calibration_error(self) -> float:
        """Mean distance of belief and frequency, weighted by the pairs of each tenth."""
        pairs = sum(n for n, _, _ in self.calibration)
        return sum(n * abs(belief - share) for n, belief, share in self.calibration) / pairs


def score(prior: str, answers: Sequence[Answer]) -> Score:
    """Score beliefs.

    Raises:
        ValueError: no answers.
    """
    if not answers:
        raise ValueError("no queries to score")
    top1 = nll = 0.0
    for belief, room in answers:
        best = belief >= belief.max() - 1e-12
        top1 += float(best[room]) / float(best.sum())
        nll -= float(np.log(max(belief[room], 1e-12)))
    belief = np.concatenate([a.belief for a in answers])
    true = np.concatenate([np.arange(len(a.belief)) == a.room for a in answers])
    return Score(
        prior,
        len(answers),
        top1 / len(answers),
        _auc(belief, true),
        float(((belief - true) ** 2).mean()),
        nll / len(answers),
        _calibration(belief, true),
    )


def _auc(value: Floats, true: NDArray[np.bool_]) -> float:
    """Return the area under the ROC curve by mid-ranks."""
    _, inverse, count = np.unique(value, return_inverse=True, return_counts=True)
    rank = (np.cumsum(count) - (count - 1) / 2.0)[inverse]
    positive = int(true.sum())
    negative = len(true) - positive
    return float((rank[true].sum() - positive * (positive + 1) / 2.0) / (positive * negative))


def _calibration(belief: Floats, true: NDArray[np.bool_]) -> tuple[tuple[int, float, float], ...]:
    tenth = np.minimum((belief * BINS).astype(int), BINS - 1)
    members = [tenth == b for b in range(BINS)]
    return tuple(
        (int(m.sum()), float(belief[m].mean()), float(true[m].mean())) if m.any() else (0, 0.0, 0.0) for m in members
    )


def fits(*, unseen: bool) -> int:
    """Return how often `evaluate` fits the priors, and so calls `fitted`."""
    return FOLDS * FOLDS if unseen else FOLDS


def evaluate(
    *,
    unseen: bool = False,
    seed: int = FOLD_SEED,
    folder: Path | None = None,
    fitted: Callable[[], object] = lambda: None,
) -> list[Score]:
    """Score every prior on scenes held out, each fitted on the other folds.

    Args:
        unseen: hold the category out as well.
        seed: of the partition into folds; the RSN is scored on the stored partition only.
        folder: weights with the RSN's held-out scores (default: the shipped ones).
        fitted: called after every fit and its queries.

    Raises:
        DataError: shipped data is missing.
    """
    contents = load_contents()
    folder = folder or weights_folder()
    table = PhraseTable.load(folder)
    categories = known_categories(contents)
    answers: dict[str, list[Answer]] = {}
    for fold, held_out in enumerate(scene_folds(contents, FOLDS, seed)):
        learned = [s for s in sorted(contents.scenes) if s not in held_out]
        for part in category_folds(categories, FOLDS, seed) if unseen else (categories,):
            known = [c for c in categories if c not in part] if unseen else categories
            models = _models(contents, learned, known, table)
            if seed == FOLD_SEED:
                models |= _rsn_models(HeldOut.load(folder, table.encoder), fold, category_seen=not unseen)
            for query in queries(contents, held_out, part):
                _ask(contents, query, models, answers)
            fitted()
    return [score(name, answers[name]) for name in _ORDER if name in answers]


def evaluate_shipped(folder: Path | None = None) -> list[Score]:
    """Score the priors of a weights folder (default: the shipped) on the ten benchmark houses, which they never saw.

    Raises:
        DataError: shipped data is missing.
    """
    contents = load_contents()
    answers: dict[str, list[Answer]] = {}
    models: dict[str, Model] = {name: load_prior(name, folder) for name in ("uniform", "rsn", "choice")}
    for query in queries(contents, BENCHMARK_HOUSES, known_categories(contents)):
        _ask(contents, query, models, answers)
    return [score(name, answers[name]) for name in _ORDER if name in answers]


_ORDER = ("uniform", "rsn-unsplit", "rsn", "choice-linear", "choice", "ceiling")


def _ask(contents: Contents, query: Query, models: dict[str, Model], answers: dict[str, list[Answer]]) -> None:
    rooms = contents.rooms(query.scene)
    holding = [float(query.category in room.contents) for room in contents.scenes[query.scene]]
    for name, model in models.items():
        answers.setdefault(name, []).append(Answer(model(query.category, rooms), query.room))
    answers.setdefault("ceiling", []).append(Answer(np.array(holding) / sum(holding), query.room))


def _models(
    contents: Contents, scenes: Sequence[str], categories: Sequence[str], table: PhraseTable
) -> dict[str, Model]:
    """Fit the choice models of one fold."""

    def of(config: ChoiceConfig) -> Model:
        model: ChoiceModel = fit_choice(contents, scenes, categories, table, config)
        return lambda c, rooms: model.probabilities(c, table.known(c).astype(np.float64), rooms, table)

    return {
        "uniform": lambda _, rooms: np.full(len(rooms), 1.0 / len(rooms)),
        "choice-linear": of(LINEAR),
        "choice": of(ChoiceConfig()),
    }


def _rsn_models(held_out: HeldOut, fold: int, *, category_seen: bool) -> dict[str, Model]:
    """Return the RSN of one fold, with type scores split over instances (the paper) and not."""

    def split(category: str, rooms: Sequence[RoomInfo]) -> Floats:
        return split_over_instances(held_out.by_type(fold, category, category_seen=category_seen), rooms)

    def unsplit(category: str, rooms: Sequence[RoomInfo]) -> Floats:
        by_type = held_out.by_type(fold, category, category_seen=category_seen)
        mass = np.array([by_type[room.type] for room in rooms])
        return np.asarray(mass / mass.sum())

    return {"rsn": split, "rsn-unsplit": unsplit}
