"""Make the weights: phrase table, RSN and choice model, and the RSN's held-out scores for `gavel eval beliefs`.

The RSN is the paper's: frozen embedding -> 256-128-64 MLP with dropout 0.2, weighted binary cross-entropy over room
types, Platt scaling on houses held out of the fit (a sixth), then one fit on all with that calibration. A category's
placements share one input, so the loss is summed over categories with their counts: one small batch.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.choice import fit_choice
from gavel_agents.rsn.data import (
    Contents,
    category_folds,
    house_of,
    known_categories,
    load_contents,
    placements,
    room_types,
    scene_folds,
    training_scenes,
)
from gavel_agents.rsn.encoder import PhraseTable
from gavel_agents.rsn.folds import FOLD_SEED, FOLDS, HeldOut
from gavel_agents.rsn.model import HIDDEN, RsnModel
from gavel_agents.rsn.optimise import minimise
from gavel_env.errors import NotInstalled
from gavel_env.world_model.ontology import default_ontology

if TYPE_CHECKING:
    import torch

__all__ = ["NotInstalled", "build_table", "fit_rsn", "held_out_scores", "train"]

EPOCHS = 400
LEARNING_RATE = 1e-3
WEIGHT_DECAY = 1e-4
DROPOUT = 0.2
CALIBRATION_PART = 6

Floats = NDArray[np.float64]


def build_table(contents: Contents, encoder: str) -> PhraseTable:
    """Embed every category of the ontology and of the scenes, and every room type.

    Raises:
        NotInstalled: the encoder cannot be had.
    """
    names = {*default_ontology(), *known_categories(contents), *room_types(contents, contents.scenes)}
    return PhraseTable.build(names, encoder)


def fit_rsn(
    contents: Contents, scenes: Sequence[str], categories: Sequence[str], table: PhraseTable, seed: int
) -> RsnModel:
    """Train the RSN.

    Args:
        contents: the scenes.
        scenes: those to learn from.
        categories: those to learn.
        table: embeddings of the categories.
        seed: of initial weights, dropout and the choice of the calibration houses.

    Raises:
        NotInstalled: torch is not installed.
    """
    types = room_types(contents, scenes)
    houses = sorted({house_of(s) for s in scenes})
    drawn = np.random.default_rng(seed).permutation(len(houses))[: max(1, len(houses) // CALIBRATION_PART)]
    held_out = {houses[i] for i in drawn}
    fitted = _fit_layers(contents, [s for s in scenes if house_of(s) not in held_out], categories, types, table, seed)
    calibration = [s for s in scenes if house_of(s) in held_out]
    platt = _platt(contents, calibration, categories, RsnModel(types, fitted, (1.0, 0.0)), table)
    return RsnModel(types, _fit_layers(contents, scenes, categories, types, table, seed), platt)


def _fit_layers(contents: Contents, scenes: Sequence[str], categories: Sequence[str], types: Sequence[str],
                table: PhraseTable, seed: int) -> tuple[tuple[Floats, Floats], ...]:  # fmt: skip
    """Minimise the weighted BCE and return the linear layers."""
    if importlib.util.find_spec("torch") is None:
        raise NotInstalled("training the RSN needs torch: pip install torch (the shipped weights need none)")
    import torch
    from torch import nn
    from torch.nn.functional import logsigmoid

    counts = placements(contents, scenes, categories, types)
    positive = counts.sum(axis=0)
    emphasis = np.sqrt((counts.sum() - positive) / np.maximum(positive, 1.0))
    inside = torch.tensor(counts * emphasis / counts.sum(), dtype=torch.float32)
    outside = torch.tensor((counts.sum(axis=1, keepdims=True) - counts) / counts.sum(), dtype=torch.float32)
    phi = torch.tensor(np.stack([table.known(c) for c in categories]))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        modules: list[nn.Module] = []
        widths = (phi.shape[1], *HIDDEN, len(types))
        for narrow, wide in pairwise(widths):
            modules += [nn.Linear(narrow, wide), nn.ReLU(), nn.Dropout(DROPOUT)]
        network = nn.Sequential(*modules[:-2])
        optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
        for _ in range(EPOCHS):
            logit = network(phi)
            loss = -(inside * logsigmoid(logit) + outside * logsigmoid(-logit)).sum()
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            optimiser.step()
    return tuple((_array(m.weight), _array(m.bias)) for m in network if isinstance(m, nn.Linear))


def _array(parameter: torch.Tensor) -> Floats:
    return np.asarray(parameter.detach().numpy(), dtype=np.float64)


def _platt(
    contents: Contents, scenes: Sequence[str], categories: Sequence[str], model: RsnModel, table: PhraseTable
) -> tuple[float, float]:
    """Return (slope, intercept) that calibrate an uncalibrated model on held-out placements."""
    counts = placements(contents, scenes, categories, model.types)
    seen = counts.sum(axis=1) > 0
    counts = counts[seen]
    phi = [table.known(c).astype(np.float64) for c, s in zip(categories, seen, strict=True) if s]
    score = np.stack([model.scores(vector) for vector in phi])
    score = np.clip(score, 1e-12, 1.0 - 1e-12)
    logit = np.log(score) - np.log1p(-score)
    total = counts.sum(axis=1, keepdims=True)

    def loss(x: Floats) -> tuple[float, Floats]:
        z = x[0] * logit + x[1]
        value = (counts * np.logaddexp(0.0, -z) + (total - counts) * np.logaddexp(0.0, z)).sum()
        excess = total / (1.0 + np.exp(-z)) - counts
        return float(value), np.array([(excess * logit).sum(), excess.sum()])

    slope, intercept = minimise(loss, np.array([1.0, 0.0]), 100, 1e-10)
    return float(slope), float(intercept)


def held_out_scores(contents: Contents, table: PhraseTable, seed: int) -> HeldOut:
    """Train the RSN's evaluation models, per fold of scenes one and one per fold of categories; return their scores."""
    categories = known_categories(contents)
    types = room_types(contents, contents.scenes)
    seen, unseen = (np.zeros((FOLDS, len(categories), len(types))) for _ in range(2))
    row = {c: i for i, c in enumerate(categories)}
    parts = [(seen, (), categories), *((unseen, p, p) for p in category_folds(categories, FOLDS, FOLD_SEED))]
    for f, fold in enumerate(scene_folds(contents, FOLDS, FOLD_SEED)):
        scenes = [s for s in sorted(contents.scenes) if s not in fold]
        for scores, hidden, asked in parts:
            model = fit_rsn(contents, scenes, [c for c in categories if c not in hidden], table, seed)
            for category in asked:
                by_type = model.scores_by_type(table.known(category).astype(np.float64), types, table)
                scores[f, row[category]] = [by_type[t] for t in types]
    return HeldOut(categories, types, seen, unseen)


def train(out: Path, encoder: str, seed: int, folds: bool) -> list[str]:
    """Write all weights to a folder and return one line on each file.

    Args:
        out: folder, made if need be.
        encoder: name of the text encoder.
        seed: of the RSN.
        folds: also train the RSN's evaluation models and write their held-out scores.

    Raises:
        NotInstalled: the encoder cannot be had.
        NotInstalled: torch is not installed.
    """
    out.mkdir(parents=True, exist_ok=True)
    contents = load_contents()
    scenes = training_scenes(contents)
    table = build_table(contents, encoder)
    table.save(out)
    trained: tuple[str, ...] = room_types(contents, scenes)
    # Categories that stand in no training scene teach nothing.
    count = placements(contents, scenes, known_categories(contents), trained).sum(axis=1)
    categories = tuple(c for c, n in zip(known_categories(contents), count, strict=True) if n)
    fit_rsn(contents, scenes, categories, table, seed).save(out, encoder)
    fit_choice(contents, scenes, categories, table).save(out, encoder)
    made = {"phrases": f"{len(table)} phrases by {encoder}"}
    made |= dict.fromkeys(("rsn", "choice"), f"{len(categories)} categories, {int(count.sum())} placements, "
                          f"{len(scenes)} scenes, {len(trained)} room types")  # fmt: skip
    if folds:
        held_out_scores(contents, table, seed).save(out, encoder)
        made["rsn_folds"] = f"{FOLDS} folds of scenes, {FOLDS} of categories"
    for name in made:
        (out / f"{name}.safetensors").chmod(0o644)
    return [f"{name}.safetensors: {(out / f'{name}.safetensors').stat().st_size / 1024:.0f} KiB, {text}"
            for name, text in made.items()]  # fmt: skip
