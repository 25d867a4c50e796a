"""The command line: `gavel COMMAND …`, also `python -m eval`.

Each module in `eval/commands` adds its commands with `register(subparsers)`; a command's parser sets `run`, a
function from the parsed arguments to an exit status. A module there imports at its top only what parsing needs, so that
`gavel --help` stays quick.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import io
import os
import pkgutil
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import Any, Protocol, cast

from eval import commands
from gavel_env.errors import GavelError

__all__ = ["CommandModule", "build_parser", "main", "run_and_exit"]

Subparsers = Any  # argparse offers no public name for what add_subparsers returns


class CommandModule(Protocol):
    """What a module in `eval/commands` has."""

    def register(self, subparsers: Subparsers) -> None:
        """Add this module's commands to the command line."""


def _version() -> str:
    try:
        return metadata.version("gavel-env")
    except metadata.PackageNotFoundError:
        return "(not installed)"


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line, commands in alphabetical order."""
    parser = argparse.ArgumentParser(
        prog="gavel", description="Household planning over scene graphs: scenes, tasks, agents, evaluation."
    )
    parser.add_argument("--version", action="version", version=f"gavel {_version()}")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    names = sorted(module.name for module in pkgutil.iter_modules(commands.__path__))
    for name in (name for name in names if not name.startswith("_")):
        module = cast(CommandModule, importlib.import_module(f"{commands.__name__}.{name}"))
        module.register(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: arguments after the program's name; None = those of the process.

    Returns:
        The exit status: 0 = done, 1 = done and the answer is no, 2 = wrong use or bad input (said on stderr).
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may be no text
    arguments = build_parser().parse_args(argv)
    try:
        status = int(arguments.run(arguments))
        sys.stdout.flush()
        return status
    except GavelError as error:
        print(f"gavel: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader (head, less) has gone; keep the interpreter from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        if error.errno is None:
            raise
        place = f"{error.filename}: " if error.filename else ""
        print(f"gavel: {place}{error.strerror}", file=sys.stderr)
        if error.filename is None:  # standard output itself may be what is full
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 2
    except KeyboardInterrupt:
        print("gavel: interrupted", file=sys.stderr)
        return 130


def run_and_exit() -> int:
    """Run one command as the last thing that the process does; return its exit status.

    At its end, the interpreter looks through everything for cycles, which takes it a third of a second after a command
    that has loaded numba. The system takes the memory back faster.
    """
    status = main()
    gc.freeze()
    return status
