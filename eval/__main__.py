"""`python -m eval` is the console script `gavel`."""

import sys

from eval.cli import main

if __name__ == "__main__":
    sys.exit(main())
