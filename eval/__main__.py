"""`python -m eval` is the console script `gavel`."""

import os
import sys

__all__ = ["main"]


def main() -> int:
    """Run the command line, with one thread for numpy's linear algebra unless the environment says otherwise.

    Matrices are small here. The threads of OpenBLAS wait for each other in a loop, so that on cores that have other
    work a fit takes ten times as long; what is to run side by side is said by `--workers`.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read once, when numpy is imported
    from eval.cli import run_and_exit

    return run_and_exit()


if __name__ == "__main__":
    sys.exit(main())
