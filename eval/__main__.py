"""`python -m eval` is the console script `gavel`."""

import sys

from eval.cli import run_and_exit

if __name__ == "__main__":
    sys.exit(run_and_exit())
