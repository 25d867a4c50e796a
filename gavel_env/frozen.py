"""Mappings that those who are given them cannot change.

What environments show to agents is shared: with the hidden world, with later episodes of the process, with other
agents. `frozen` makes a view of a dict that reads like it; views can be pickled and copied.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

__all__ = ["frozen"]

K = TypeVar("K")
V = TypeVar("V")


def frozen(mapping: Mapping[K, V]) -> Mapping[K, V]:
    """Return a read-only view of a mapping; a view stays as it is."""
    return mapping if isinstance(mapping, MappingProxyType) else MappingProxyType(mapping)


def _reduced(view: MappingProxyType[Any, Any]) -> tuple[Callable[..., Any], tuple[dict[Any, Any]]]:
    return frozen, (view.copy(),)


copyreg.pickle(MappingProxyType, _reduced)
