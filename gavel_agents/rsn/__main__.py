"""`python -m gavel_agents.rsn train`: make the location priors' weights."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from gavel_agents.rsn.encoder import PACKAGED, weights_folder
from gavel_agents.rsn.train import train
from gavel_env.errors import GavelError


def main() -> int:
    """Run the command line; 0 = done, 2 = something is missing (said on stderr)."""
    parser = argparse.ArgumentParser(prog="python -m gavel_agents.rsn", description="Location priors of objects.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    command = commands.add_parser("train", help="train on the 51 scenes, the benchmark houses held out")
    command.add_argument(
        "--out", type=Path, default=weights_folder(), help="folder for the weights (default: %(default)s)"
    )
    command.add_argument("--encoder", default=PACKAGED, help="frozen text encoder (default: %(default)s)")
    command.add_argument("--seed", type=int, default=0, help="of the RSN's training (default: %(default)s)")
    command.add_argument("--folds", action="store_true", help="also train the RSN's held-out evaluation models")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    try:
        lines = train(arguments.out, arguments.encoder, arguments.seed, arguments.folds)
    except GavelError as error:
        sys.stderr.write(f"rsn: {error}\n")
        return 2
    sys.stdout.write("\n".join([*lines, f"{time.perf_counter() - begin:.1f} s", ""]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
