"""Families of commands (`gavel eval …`) that several modules of `eval/commands` add to."""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

__all__ = ["family", "family_parser"]


class _Family(NamedTuple):
    parser: argparse.ArgumentParser
    members: Any


_FAMILIES: WeakKeyDictionary[Any, dict[str, _Family]] = WeakKeyDictionary()
_HELP = {"eval": "run agents over instructions and print the results table; evaluate beliefs and other parts"}


def family(subparsers: Any, name: str) -> Any:
    """Return the subparsers of a family, to which a module adds its command.

    Args:
        subparsers: those of the whole command line.
        name: a family of this module.
    """
    return _family(subparsers, name).members


def family_parser(subparsers: Any, name: str) -> argparse.ArgumentParser:
    """Return the parser of a family itself: what `gavel eval` does when no command of the family is named."""
    return _family(subparsers, name).parser


def _family(subparsers: Any, name: str) -> _Family:
    """Return a family, made by whichever module asks first."""
    made = _FAMILIES.setdefault(subparsers, {})
    if name not in made:
        parser: argparse.ArgumentParser = subparsers.add_parser(name, help=_HELP[name])
        members = parser.add_subparsers(title="evaluations of single parts", metavar="PART", required=False)
        made[name] = _Family(parser, members)
    return made[name]
