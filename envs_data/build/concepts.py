"""Build `envs_data/concepts.json`: what people's words for things and rooms name (docs/explanation/concepts.md).

Run as `python -m envs_data.build.concepts`; the result is byte-identical each time. Words come from four sources; where
two know a word, the earlier one says what it names:

1. `household.toml` beside this module: household English, collected by hand;
2. the vocabulary of the benchmarks, and the names of the categories and room types;
3. the names of packed goods, taken apart: `bottle_of_shampoo` and `shampoo_bottle` are both shampoo;
4. WordNet's lemmas (`wordnet_lemmas.json`) of the categories' synsets, and of those synsets above them in BEHAVIOR's
   taxonomy that the household file lists, where the synset is the most frequent sense of the word.

A word that comes to several categories names a concept.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import msgspec

from envs_data.build.common import BDDL_VERSION, ancestors, categories, category_of_model, room_objects
from envs_data.build.wordnet import read_lemmas
from gavel_env.errors import DataError
from gavel_env.house.scenes import BENCHMARK_HOUSES
from gavel_env.instructions.vocabulary import default_vocabulary
from gavel_env.world_model.concepts import FORMAT, PREFIX, Concept, normal_phrase, singulars
from gavel_env.world_model.ontology import default_ontology

__all__ = ["build", "main"]

TARGET = Path(__file__).resolve().parents[1] / "concepts.json"
HOUSEHOLD = Path(__file__).resolve().parent / "household.toml"
PROVENANCE = (
    f"household English collected by hand (envs_data/build/household.toml); PyPI bddl {BDDL_VERSION} (MIT): categories "
    "and taxonomy; WordNet 3.0 lemmas, Copyright 2006 by Princeton University (NOTICE)"
)


class _Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    members: tuple[str, ...]
    also: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    taxonomy: tuple[str, ...] = ()


class _Household(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    things: dict[str, _Entry]
    categories: dict[str, tuple[str, ...]]
    places: dict[str, _Entry]
    rooms: dict[str, tuple[str, ...]]
    hypernyms: tuple[str, ...]
    not_from_wordnet: tuple[str, ...]
    no_goods: tuple[str, ...]


class _Table:
    """Words of one kind (things or places) in the making.

    Attributes:
        concepts: name -> members and `also`; a lone category or room type stands under its own name, for its `also`.
        words: word -> what it names.
    """

    def __init__(self, known: Iterable[str]) -> None:
        self.known = frozenset(known)
        self.concepts: dict[str, Concept] = {}
        self.words: dict[str, str] = {}

    def name(self, word: str, members: Iterable[str], also: Iterable[str] = ()) -> None:
        """Let a word name some members: the one, a concept that is there, or a new concept called by the word."""
        concept = Concept(tuple(dict.fromkeys(members)), tuple(dict.fromkeys(also)))
        if unknown := [m for m in (*concept.members, *concept.also) if m not in self.known]:
            raise DataError(f"the word {word!r} names {unknown[0]!r}, which no category or room type is called")
        key = normal_phrase(word)
        if len(concept.members) == 1:
            (member,) = concept.members
            self.words[key] = member
            stretched = dict.fromkeys((*self.concepts.get(member, concept).also, *concept.also))
            if stretched:
                self.concepts[member] = Concept(concept.members, tuple(stretched))
            return
        same = next((name for name, there in self.concepts.items() if there == concept), None)
        if same is None:
            same = PREFIX + key.replace(" ", "_")
            if same in self.concepts:
                raise DataError(f"{same!r} would be both {self.concepts[same].members} and {concept.members}")
            self.concepts[same] = concept
        self.words[key] = same

    def knows(self, word: str) -> bool:
        """Return whether a word, or what it may be the plural of, is known."""
        return any(form in self.words for form in singulars(normal_phrase(word)))


def _collected(table: _Table, entries: Mapping[str, _Entry], single: Mapping[str, tuple[str, ...]]) -> None:
    """Add the words of the household file; a word that stands under several entries names them all."""
    said: dict[str, list[_Entry]] = {}
    for name, entry in entries.items():
        for word in dict.fromkeys((normal_phrase(name), *map(normal_phrase, entry.words))):
            said.setdefault(word, []).append(entry)
    for name, words in single.items():
        for word in map(normal_phrase, words):
            said.setdefault(word, []).append(_Entry((name,)))
    for name, entry in entries.items():
        table.name(name, *_united([entry]))
    for word, meant in said.items():
        table.name(word, *_united(meant))


def _united(entries: Iterable[_Entry]) -> tuple[list[str], list[str]]:
    members = [m for entry in entries for m in (*entry.members, *_below(entry.taxonomy))]
    return members, [a for entry in entries for a in entry.also if a not in members]


def _below(synsets: Iterable[str]) -> Iterator[str]:
    """Yield the categories below some synsets, the commonest in the scenes first."""
    for synset in synsets:
        found = [name for name in default_ontology() if synset in _ancestors(name)]
        if not found:
            raise DataError(f"household.toml: no category is below the synset {synset!r}")
        yield from sorted(found, key=_rank)


def _ancestors(category: str) -> frozenset[str]:
    return ancestors(categories()[category].synset)


def _rank(category: str) -> tuple[int, str]:
    """Sort categories by the number of scenes, benchmark houses left out, that have them."""
    return -_scenes_with()[category], category


def _scenes_with() -> Counter[str]:
    if not _COUNTED:
        held_out = {scene.removesuffix("_garden").removesuffix("_int") for scene in BENCHMARK_HOUSES}
        for scene, rooms in room_objects().items():
            if scene.removesuffix("_garden").removesuffix("_int") not in held_out:
                _COUNTED.update({category_of_model(model) for models in rooms.values() for model in models})
    return _COUNTED


_COUNTED: Counter[str] = Counter()


def _own_names(table: _Table, names: Mapping[str, tuple[str, ...]]) -> None:
    """Add the nouns of categories or room types, and their names, where no earlier source has the word."""
    said: dict[str, list[str]] = {}
    for name, nouns in names.items():
        for word in dict.fromkeys(map(normal_phrase, (name, *nouns))):
            if word not in table.words:
                said.setdefault(word, []).append(name)
    for word, meant in said.items():
        table.name(word, sorted(meant, key=_rank))


_PACKED = re.compile(
    r"(?P<pack>bag|bottle|box|bucket|bunch|can|carton|cup|jar|jug|pack|tube)_of_(?P<goods>.+)"
    r"|(?P<stuff>.+)_(?P<vessel>atomizer|bag|bottle|box|can|carton|dispenser|jar|package|sack|shaker)"
)
_VESSELS = {"atomizer": ("spray", "atomizer"), "package": ("package", "pack"), "pack": ("pack", "packet"),
            "can": ("can", "tin"), "carton": ("carton",), "sack": ("sack", "bag")}  # fmt: skip


def _packs() -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return each pack with its goods and names: `honey_jar` and `jar_of_honey` share `honey jar`."""
    found = {}
    for category in default_ontology():
        if match := _PACKED.fullmatch(category):
            goods = normal_phrase(match["goods"] or match["stuff"])
            vessel = match["pack"] or match["vessel"]
            packs = _VESSELS.get(vessel, (vessel,))
            found[category] = goods, tuple(name for pack in packs for name in (f"{pack} of {goods}", f"{goods} {pack}"))
    return found


def _packed_goods(table: _Table, no_goods: frozenset[str]) -> None:
    """Add `shampoo` for every pack of shampoo."""
    said: dict[str, list[str]] = {}
    for category, (goods, _) in _packs().items():
        if goods not in no_goods:
            said.setdefault(goods, []).append(category)
    for word, meant in said.items():
        if not table.knows(word):
            table.name(word, sorted(meant, key=_rank))


def _lemmas(table: _Table, hypernyms: Iterable[str], shunned: frozenset[str]) -> None:
    """Add WordNet's lemmas of the categories' synsets, then of those above them that are household words."""
    below: dict[str, list[str]] = {}
    for category in default_ontology():
        for synset in _ancestors(category):
            below.setdefault(synset, []).append(category)
    own = {categories()[category].synset for category in default_ontology()}
    above = sorted(set(hypernyms) & below.keys() - own, key=lambda name: (len(below[name]), name))
    for synset in (*sorted(own), *above):
        for lemma in read_lemmas().synsets.get(synset, ()):
            word = normal_phrase(lemma.word)
            if lemma.sense == 1 and word not in shunned and not table.knows(word) and word.isascii():
                table.name(word, sorted(below[synset], key=_rank))


def build() -> bytes:
    """Return the content of the file: canonical JSON, one concept or word per line.

    Raises:
        DataError: bddl is not installed in the right version, or the household file names what is not there.
    """
    try:
        household = msgspec.convert(tomllib.loads(HOUSEHOLD.read_text(encoding="utf-8")), _Household)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise DataError(f"{HOUSEHOLD}: {error}") from error
    vocabulary = default_vocabulary()
    things = _Table(default_ontology())
    _collected(things, household.things, household.categories)
    packs = {category: names for category, (_, names) in _packs().items()}
    _own_names(things, {name: (*vocabulary.nouns(name), *packs.get(name, ())) for name in default_ontology()})
    _packed_goods(things, frozenset(household.no_goods))
    _lemmas(things, household.hypernyms, frozenset(map(normal_phrase, household.not_from_wordnet)))
    places = _Table(vocabulary.rooms)
    _collected(places, household.places, household.rooms)
    _own_names(places, vocabulary.rooms)
    last_words = {word.rpartition(" ")[2] for table in (things, places) for word in table.words}
    plurals = {plural: single for plural, single in read_lemmas().plurals.items() if single in last_words}
    encode = msgspec.json.encode
    sections = [
        (key, b",\n".join(encode(name) + b":" + encode(value) for name, value in sorted(table.items())))
        for key, table in (
            ("things", things.concepts),
            ("places", places.concepts),
            ("thing_words", things.words),
            ("place_words", places.words),
            ("plurals", plurals),
        )
    ]
    head = b",\n".join(encode(k) + b":" + encode(v) for k, v in (("format", FORMAT), ("provenance", PROVENANCE)))
    return b"{" + head + b"".join(b",\n" + encode(key) + b":{\n" + rows + b"\n}" for key, rows in sections) + b"}\n"


def main() -> None:
    """Write the file."""
    TARGET.write_bytes(build())


if __name__ == "__main__":
    main()
