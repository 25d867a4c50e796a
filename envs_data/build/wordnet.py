"""Build `envs_data/build/wordnet_lemmas.json`: what WordNet 3.0 calls the synsets of BEHAVIOR's taxonomy.

Run as `python -m envs_data.build.wordnet` where WordNet's data files are (Debian's `wordnet-base` has them in
`/usr/share/wordnet`); nothing else needs them. The table is kept beside its builder, so that `envs_data/concepts.json`
can be built without them.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec

from envs_data.build.common import all_synsets
from gavel_env.errors import DataError

__all__ = ["TARGET", "Lemma", "LemmaTable", "build", "main", "read_lemmas"]

FORMAT = "gavel-wordnet-lemmas/1"
PROVENANCE = (
    "WordNet 3.0 (Debian package wordnet-base), Copyright 2006 by Princeton University, WordNet 3.0 license (NOTICE): "
    "lemmas of the noun synsets that bddl 3.6.0 uses, with the number of the sense, and irregular plurals"
)
TARGET = Path(__file__).resolve().parent / "wordnet_lemmas.json"
WORDNET = Path("/usr/share/wordnet")

_SYNSET = re.compile(r"(?P<lemma>.+)\.n\.(?P<sense>\d+)")


class Lemma(NamedTuple):
    """A word for a synset, and which of the word's noun senses the synset is (1 = the most frequent one)."""

    word: str
    sense: int


class LemmaTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The extract: synset -> lemmas in WordNet's order, and irregular plural -> singular."""

    format: str
    provenance: str
    synsets: dict[str, tuple[Lemma, ...]]
    plurals: dict[str, str]


def _lines(path: Path) -> Iterator[str]:
    try:
        text = path.read_text(encoding="latin-1")
    except OSError as error:
        raise DataError(f"{path} cannot be read ({error.strerror}); install Debian's wordnet-base") from error
    return (line for line in text.splitlines() if not line.startswith("  "))


def _senses(root: Path) -> Mapping[str, tuple[str, ...]]:
    """Return noun lemma -> offsets of its synsets, most frequent first (`index.noun`)."""
    found = {}
    for line in _lines(root / "index.noun"):
        fields = line.split()
        count = int(fields[2])
        found[fields[0]] = tuple(fields[-count:])
    return found


def _words(root: Path) -> Mapping[str, tuple[str, ...]]:
    """Return offset -> lemmas of the synset, in WordNet's order (`data.noun`)."""
    found = {}
    for line in _lines(root / "data.noun"):
        fields = line.split()
        count = int(fields[3], 16)
        found[fields[0]] = tuple(fields[4 + 2 * i] for i in range(count))
    return found


def build(root: Path = WORDNET) -> bytes:
    """Return the content of the file: canonical JSON, one synset per line.

    Raises:
        DataError: WordNet or bddl is not installed.
    """
    senses, words = _senses(root), _words(root)
    synsets: dict[str, tuple[Lemma, ...]] = {}
    for synset in all_synsets():
        match = _SYNSET.fullmatch(synset)
        offsets = senses.get(match["lemma"].lower(), ()) if match else ()
        if match is None or int(match["sense"]) > len(offsets):
            continue
        offset = offsets[int(match["sense"]) - 1]
        synsets[synset] = tuple(Lemma(word.lower(), senses[word.lower()].index(offset) + 1) for word in words[offset])
    exceptions = [line.split() for line in _lines(root / "noun.exc")]
    known = {
        part for lemmas in synsets.values() for lemma in lemmas for part in (lemma.word, lemma.word.split("_")[-1])
    }
    plurals = {fields[0]: fields[1] for fields in exceptions if fields[1] in known and "_" not in fields[0]}
    encode = msgspec.json.encode
    rows = b",\n".join(encode(name) + b":" + encode(lemmas) for name, lemmas in sorted(synsets.items()))
    head = b",\n".join(
        encode(key) + b":" + encode(value) for key, value in (("format", FORMAT), ("provenance", PROVENANCE))
    )
    return (
        b"{" + head + b',\n"synsets":{\n' + rows + b'\n},\n"plurals":' + encode(dict(sorted(plurals.items()))) + b"}\n"
    )


@cache
def read_lemmas() -> LemmaTable:
    """Return the extract that is kept beside this module.

    Raises:
        DataError: it is missing, malformed or of another format.
    """
    try:
        table = msgspec.json.decode(TARGET.read_bytes(), type=LemmaTable)
    except (OSError, msgspec.DecodeError) as error:
        raise DataError(f"{TARGET} cannot be read: {error}") from error
    if table.format != FORMAT:
        raise DataError(f"{TARGET} has format {table.format!r}; this version reads {FORMAT!r}")
    return table


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--wordnet", type=Path, default=WORDNET, help="folder of index.noun and data.noun")
    TARGET.write_bytes(build(parser.parse_args().wordnet))


if __name__ == "__main__":
    main()
