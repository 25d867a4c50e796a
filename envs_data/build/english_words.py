"""Build `english_words.txt.gz`: common English words with what they can be, from WordNet 3.0.

    python -m envs_data.build.english_words /usr/share/wordnet

One word a line, then letters: n, v, a, r as WordNet has it as noun, verb, adjective, adverb, t where the first sense of
the noun is an artefact or food (something that a household could have), and p for irregular past forms. Words that
neither are tagged in its corpora nor name such a thing are left out. The understanding of instructions uses it in two
ways: a word of this list is no typing error for another, and a word that could name a thing is asked about instead of
being passed over.
"""

from __future__ import annotations

import gzip
import re
import sys
from collections import defaultdict
from pathlib import Path

_LETTERS = {"noun": "n", "verb": "v", "adj": "a", "adv": "r"}
_THINGS = (6, 13)  # lexicographer files noun.artifact and noun.food
_WORD = re.compile("[a-z]{2,}")


def _files_of_senses(folder: Path, part: str) -> dict[str, int]:
    lines = (folder / f"data.{part}").read_text("latin1").splitlines()
    return {line[:8]: int(line[9:11]) for line in lines if not line.startswith(" ")}


def build(folder: Path) -> str:
    """Return the table's lines."""
    letters: dict[str, set[str]] = defaultdict(set)
    tagged: dict[str, int] = defaultdict(int)
    for part, letter in _LETTERS.items():
        files = _files_of_senses(folder, part)
        for line in (folder / f"index.{part}").read_text("latin1").splitlines():
            lemma, *fields = line.split() or [""]
            if line.startswith(" ") or not _WORD.fullmatch(lemma):
                continue
            senses = int(fields[1])
            tagged[lemma] += int(fields[-senses - 1])
            letters[lemma].add(letter)
            if part == "noun" and files[fields[-senses]] in _THINGS:
                letters[lemma].add("t")
    for part, letter in _LETTERS.items():
        for line in (folder / f"{part}.exc").read_text("latin1").splitlines():
            form, *stems = line.split()
            if _WORD.fullmatch(form) and any(tagged[stem] for stem in stems):
                letters[form].add(letter)
                letters[form] |= {"p"} if part == "verb" and not form.endswith("ing") else set()
                tagged[form] += 1
    kept = sorted(lemma for lemma, said in letters.items() if tagged[lemma] or "t" in said)
    return "".join(f"{lemma} {''.join(sorted(letters[lemma]))}\n" for lemma in kept)


if __name__ == "__main__":
    target = Path(__file__).parents[1] / "english_words.txt.gz"
    target.write_bytes(gzip.compress(build(Path(sys.argv[1])).encode(), 9, mtime=0))
