"""Weights of the learned reader as a file: matrices in eight bits, with a scale for each row or column."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from gavel_agents.understanding.learned.encoder import Array
from gavel_agents.understanding.learned.network import Network
from gavel_agents.understanding.learned.pieces import Pieces
from gavel_env.errors import DataError

__all__ = ["load", "save"]

_FORMAT = "gavel-learned-reader/3"
_SMALL = 10_000
"""Tensors with fewer numbers than this stay as they are, in half precision."""
_BY_ROW = "word"
"""The table whose rows are looked up: a scale for each row; it is kept in eight bits in memory, too."""


def save(path: Path, tensors: Mapping[str, Array], pieces: Pieces, values: Mapping[str, int]) -> None:
    """Write weights by name: matrices (in, out), those of layers under `layer.N.`."""
    packed: dict[str, NDArray[Any]] = {}
    for name, tensor in tensors.items():
        if tensor.size < _SMALL:
            packed[name] = tensor.astype(np.float16)
            continue
        scale = np.abs(tensor).max(axis=1 if name == _BY_ROW else 0, keepdims=True) / 127
        packed[name] = np.rint(tensor / np.maximum(scale, 1e-12)).astype(np.int8)
        packed[f"{name}.scale"] = scale.reshape(-1).astype(np.float32)
    ordered = sorted(pieces.vocabulary, key=lambda piece: pieces.vocabulary[piece])
    tables = {"format": _FORMAT, "pieces": json.dumps(ordered, ensure_ascii=False), "values": json.dumps(dict(values))}
    save_file({name: np.ascontiguousarray(t) for name, t in packed.items()}, path, metadata=tables)


def load(path: Path) -> Network:
    """Return the network of a file.

    Raises:
        DataError: missing file, or not of this format.
    """
    shared: dict[str, Any] = {}
    layers: dict[int, dict[str, Any]] = defaultdict(dict)
    try:
        with safe_open(path, framework="numpy") as file:
            said = file.metadata() or {}
            if said.get("format") != _FORMAT:
                raise DataError(f"{path}: not {_FORMAT} but {said.get('format')!r}")
            pieces, values = json.loads(said["pieces"]), json.loads(said["values"])
            names = set(file.keys())
            for name in sorted(names):
                if name.endswith(".scale") and name != f"{_BY_ROW}.scale":
                    continue
                tensor = file.get_tensor(name)
                if name != _BY_ROW:
                    tensor = tensor.astype(np.float32)
                    if f"{name}.scale" in names:
                        tensor *= file.get_tensor(f"{name}.scale")
                _, layer, rest = ("", "", name) if not name.startswith("layer.") else name.split(".", 2)
                (layers[int(layer)] if layer else shared)[rest] = tensor
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise DataError(f"{path} holds no weights of the learned reader: {error}") from error
    vocabulary = {piece: number for number, piece in enumerate(pieces)}
    return Network(Pieces(vocabulary), values, shared, [layers[number] for number in sorted(layers)])
