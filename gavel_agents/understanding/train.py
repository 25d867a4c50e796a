"""`python -m gavel_agents.understanding.train --base MODEL --out FOLDER`: fit a LoRA adapter on pairs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from gavel_agents.llm.local import PACKAGED
from gavel_agents.understanding.lora import LoraSettings, fit_lora
from gavel_agents.understanding.pairs import read_samples
from gavel_env.errors import GavelError


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; 0 = done, 2 = something is missing (said on stderr)."""
    parser = argparse.ArgumentParser(
        prog="python -m gavel_agents.understanding.train",
        description="Fit a LoRA adapter that understands instructions. A killed run continues where it stopped.",
    )
    parser.add_argument("--base", default=PACKAGED, help="hub name, folder, GGUF file, smollm2 (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the adapter")
    parser.add_argument("--pairs", default="train", metavar="NAME|FILE", help="default: the 8,400 shipped ones")
    parser.add_argument("--limit", type=int, metavar="N", help="only the first N pairs")
    parser.add_argument("--epochs", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--batch", type=int, default=16, help="pairs per step (default: %(default)s)")
    parser.add_argument("--rank", type=int, default=16, help="default: %(default)s")
    parser.add_argument("--learning-rate", type=float, default=1e-3, help="default: %(default)s")
    parser.add_argument("--precision", choices=("fp32", "bf16"), default="fp32", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="default: %(default)s")
    parser.add_argument("--start", metavar="DIR", help="continue from this adapter")
    said = parser.parse_args(arguments)
    settings = LoraSettings(
        said.base, said.epochs, said.batch, said.rank, said.learning_rate, said.precision, said.seed, said.start
    )

    def report(line: str) -> None:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()

    try:
        steps = fit_lora(read_samples(said.pairs)[: said.limit], said.out, settings, report=report)
    except GavelError as error:
        sys.stderr.write(f"train: {error}\n")
        return 2
    report(f"{steps} steps; adapter in {said.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
