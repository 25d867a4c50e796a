"""Weights as safetensors with notes: the same content is the same bytes, unlike with the library's own writer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from gavel_env.errors import DataError

__all__ = ["read_tensors", "write_tensors"]

_NAMES = {np.dtype(np.float16): "F16", np.dtype(np.float32): "F32"}
ALIGNMENT = 8


def write_tensors(path: Path, tensors: Mapping[str, NDArray[np.floating]], notes: Mapping[str, str]) -> None:
    """Write float16 and float32 tensors and notes in the safetensors format, both in alphabetical order."""
    header: dict[str, object] = {"__metadata__": dict(sorted(notes.items()))}
    chunks: list[bytes] = []
    end = 0
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name])
        content = array.astype(array.dtype.newbyteorder("<")).tobytes()
        begin, end = end, end + len(content)
        header[name] = {"dtype": _NAMES[array.dtype], "shape": array.shape, "data_offsets": (begin, end)}
        chunks.append(content)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % ALIGNMENT)
    path.write_bytes(len(text).to_bytes(8, "little") + text + b"".join(chunks))


def read_tensors(
    path: Path, file_format: str, encoder: str | None = None
) -> tuple[dict[str, NDArray[np.floating]], dict[str, str]]:
    """Read a safetensors file and its notes.

    Raises:
        DataError: the file is missing, corrupt, of another format version, or made with another encoder than `encoder`.
    """
    try:
        with safe_open(path, framework="numpy") as file:
            notes = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in sorted(file.keys())}
    except OSError as error:
        raise DataError(f"weights {path.name} cannot be read: {error}") from error
    except SafetensorError as error:
        raise DataError(f"weights {path.name} are corrupt: {error}") from error
    if notes.get("format") != file_format:
        raise DataError(f"weights {path.name} have format {notes.get('format')!r}; this version reads {file_format!r}")
    if encoder is not None and notes.get("encoder") != encoder:
        raise DataError(f"weights {path.name} are of encoder {notes.get('encoder')!r}, the phrase table of {encoder!r}")
    return tensors, notes
