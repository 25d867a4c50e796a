"""The commands of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterator


def commands_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield the parsers of the commands without parts of their own, and of those that also run alone."""
    groups = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    if not groups or parser.get_default("run") is not None:
        yield parser
    for group in groups:
        for part in dict.fromkeys(group.choices.values()):
            yield from commands_of(part)
