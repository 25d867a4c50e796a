"""What commands that run episodes share: their options, progress, and what they say when a run stops early."""

from __future__ import annotations

import argparse
import re
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.run.runner import Schedule
    from eval.studies.kept import Existing, Kept

__all__ = ["add_how", "add_kept", "add_shown", "kept_in", "names", "positive", "run_shown", "seconds", "seeds"]

FORMATS = ("terminal", "markdown", "csv", "latex")


def add_how(parser: argparse.ArgumentParser) -> None:
    """Add the options of how episodes are run; results depend on none of them but --max-steps."""
    how = parser.add_argument_group("how it is run")
    how.add_argument("--out", metavar="DIR", help="folder for the records (default: runs/DATE-TIME)")
    how.add_argument(
        "--workers", type=positive, default=1, metavar="N", help="processes (default: 1); results do not depend on it"
    )
    how.add_argument(
        "--connections",
        type=positive,
        metavar="N",
        help="concurrent calls of a language model (default: 8 for servers, else 1)",
    )
    how.add_argument("--executor", choices=("local", "ray"), default="local", help="ray: on a Ray cluster")
    how.add_argument("--address", metavar="HOST:PORT", help="of the Ray cluster (default: RAY_ADDRESS, or a local one)")
    how.add_argument(
        "--shard", type=_shard, metavar="K/N", help="run the K-th of N parts; gavel tables DIR DIR … puts them together"
    )
    how.add_argument("--timeout", type=seconds, metavar="S", help="seconds of wall clock per episode (default: none)")
    how.add_argument("--max-steps", type=positive, default=300, metavar="N", help="actions per episode (default: 300)")
    _add_existing(how, "records")
    how.add_argument(
        "--retry", type=names, default=(), metavar="error,timeout", help="with --resume: run these outcomes again"
    )
    limits = parser.add_argument_group("when it stops early (and can be resumed)")
    limits.add_argument("--max-calls", type=positive, metavar="N", help="after N calls of language models")
    limits.add_argument("--max-tokens", type=positive, metavar="N", help="after N tokens, in prompts and answers")
    limits.add_argument("--max-cost", type=seconds, metavar="X", help="after a cost of X, by --prices")
    limits.add_argument("--prices", metavar="FILE.json", help="prices of models per million tokens")
    limits.add_argument(
        "--fail-on-errors",
        type=positive,
        default=5,
        metavar="N",
        help="after N endpoint failures in a row (default: 5)",
    )


def _add_existing(group: argparse._ArgumentGroup, what: str) -> None:
    existing = group.add_mutually_exclusive_group()
    existing.add_argument("--resume", action="store_true", help=f"continue the {what} in --out")
    existing.add_argument("--fresh", action="store_true", help=f"set the {what} in --out aside and start anew")


def add_kept(parser: argparse.ArgumentParser) -> None:
    """Add the options of a study that keeps what its parts came to."""
    how = parser.add_argument_group("how it is run")
    how.add_argument(
        "--out", metavar="DIR", help="folder in which the results of its parts are kept (default: nowhere)"
    )
    _add_existing(how, "results")


def kept_in(arguments: argparse.Namespace, name: str, choices: tuple[object, ...]) -> Kept:
    """Return what a study has kept in a file of `--out`, as the options say.

    Args:
        arguments: those of `add_kept`.
        name: of the file.
        choices: on which results depend.

    Raises:
        DataError: the file has results, and neither `--resume` nor `--fresh` is given; or it cannot be read.
    """
    from eval.studies.kept import Kept

    return Kept(Path(arguments.out) / name if arguments.out else None, choices, _existing(arguments))


def _existing(arguments: argparse.Namespace) -> Existing:
    return "resume" if arguments.resume else "fresh" if arguments.fresh else "refuse"


def add_shown(parser: argparse.ArgumentParser) -> None:
    """Add the options of what is printed."""
    shown = parser.add_argument_group("what is shown")
    shown.add_argument("--format", choices=FORMATS, default="terminal")
    shown.add_argument("--quiet", action="store_true", help="no progress")


def run_shown(arguments: argparse.Namespace, plan: Schedule, out: Path | None = None) -> tuple[Path, int]:
    """Run a schedule as the options say, with progress on stderr.

    Returns:
        Path of the records, and the exit status so far: 1 if the run stopped early or every episode ended in an error.

    Raises:
        RunStopped: it stopped before it had a record.
    """
    from eval.records.prices import read_prices
    from eval.run.limits import Limits
    from eval.run.progress import RunProgress
    from eval.run.runner import run
    from gavel_env.errors import RunStopped

    out = out or Path(arguments.out or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}")
    limits = Limits(
        max_calls=arguments.max_calls,
        max_tokens=arguments.max_tokens,
        max_cost=arguments.max_cost,
        fail_on_errors=arguments.fail_on_errors,
        prices=read_prices(arguments.prices),
    )
    status = 0
    with RunProgress() as progress:
        try:
            path = run(
                plan,
                out,
                existing=_existing(arguments),
                retry=arguments.retry,
                arguments={k: v for k, v in sorted(vars(arguments).items()) if k != "run"},
                workers=arguments.workers,
                connections=arguments.connections,
                timeout_s=arguments.timeout,
                shard=arguments.shard,
                executor=arguments.executor,
                address=arguments.address,
                limits=limits,
                report=progress.advance if not arguments.quiet else progress.count,
                started=None if arguments.quiet else progress.started,
            )
        except RunStopped as why:
            path = out / "records.jsonl"
            if not path.exists():
                raise
            print(f"gavel: {why}. The records so far are in {out}; --out {out} --resume continues", file=sys.stderr)
            status = 1
        except KeyboardInterrupt:
            print(f"gavel: the records so far are in {out}; --out {out} --resume continues", file=sys.stderr)
            raise
    if progress.all_failed:
        print("gavel: every episode ended in an error (gavel tables --failures says which)", file=sys.stderr)
        status = 1
    return path, status


def names(text: str) -> tuple[str, ...]:
    """Read names with commas between them."""
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    if not found:
        raise argparse.ArgumentTypeError("needs at least one name")
    return found


def seeds(text: str) -> tuple[int, ...]:
    """Read whole numbers with commas between them."""
    try:
        found = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of whole numbers such as 0,1,2") from None
    if min(found) < 0:
        raise argparse.ArgumentTypeError(f"{text!r}: seeds are not negative")
    return found


def positive(text: str) -> int:
    """Read a whole number above 0."""
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 1")
    return number


def seconds(text: str) -> float:
    """Read a number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return number


def _shard(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    part, parts = (int(found[1]), int(found[2])) if found else (0, 0)
    if not 1 <= part <= parts:
        raise argparse.ArgumentTypeError(f"{text!r} is not K/N with K from 1 to N, such as 1/4")
    return part, parts
