"""Families of commands (`gavel eval …`) that several modules of `eval/commands` add to."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

__all__ = ["family"]

_FAMILIES: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()
_HELP = {"eval": "evaluate agents, beliefs and the cost model"}


def family(subparsers: Any, name: str) -> Any:
    """Return the subparsers of a family, made by whichever module asks first.

    Args:
        subparsers: those of the whole command line.
        name: a family of this module.
    """
    made = _FAMILIES.setdefault(subparsers, {})
    if name not in made:
        parser = subparsers.add_parser(name, help=_HELP[name])
        made[name] = parser.add_subparsers(title=f"{name} commands", metavar="COMMAND", required=True)
    return made[name]
