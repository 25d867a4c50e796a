"""`python -m gavel_agents.understanding.learned.train --people FILE ... --out FILE`: fit the learned reader."""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Sequence
from pathlib import Path

import torch

from gavel_agents.understanding.learned.reader import save
from gavel_agents.understanding.learned.targets import Example, example_of
from gavel_agents.understanding.learned.training import fit, tables_of
from gavel_agents.understanding.pairs import Sample, read_samples
from gavel_env.errors import GavelError

_SHUFFLE, _HELD_OUT = 11, 6
"""Of people's instructions, shuffled by this seed, the first sixth is left out: the threshold is chosen on it."""
_COMMON = 300
"""Template sentences whose words are learnt."""


def examples_of(samples: Sequence[Sample]) -> list[Example]:
    """Return the samples whose meaning the options can say, each under an id of its own."""
    found = []
    for index, sample in enumerate(samples):
        example = example_of(sample)
        if example is not None and example.whole:
            found.append(example._replace(id=f"{sample.id}#{index}"))
    return found


def _report(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; 0 = done, 2 = a file cannot be read (said on stderr)."""
    parser = argparse.ArgumentParser(prog="python -m gavel_agents.understanding.learned.train", description=__doc__)
    parser.add_argument("--people", nargs="+", default=["voices"], metavar="NAME|FILE", help="people's instructions")
    parser.add_argument("--templates", type=int, default=800, help="pairs beside them (default: %(default)s)")
    parser.add_argument("--epochs", type=int, default=18, help="default: %(default)s")
    parser.add_argument(
        "--networks", type=int, default=2, help="whose probabilities are averaged (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the first network (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="weights, as safetensors")
    said = parser.parse_args(arguments)
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    try:
        people = [s for name in said.people for s in read_samples(name) if s.split != "test"]
        random.Random(_SHUFFLE).shuffle(people)
        people = people[len(people) // _HELD_OUT :]
        spoken = examples_of(people)
        templates = examples_of(read_samples("train")[: said.templates])
    except GavelError as error:
        sys.stderr.write(f"train: {error}\n")
        return 2
    words, values = tables_of([*spoken, *templates[:_COMMON]])
    sys.stdout.write(f"{len(spoken)} of {len(people)} instructions, {len(templates)} pairs\n")
    networks = [
        fit(spoken, templates, words, values, epochs=said.epochs, seed=said.seed + index, per_epoch=100, joins=0.25,
            report=_report)
        for index in range(said.networks)
    ]  # fmt: skip
    save(said.out, networks, words, values)
    return 0


if __name__ == "__main__":
    sys.exit(main())
