"""A subset of a benchmark that does not follow the order in which its instructions were generated."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

__all__ = ["sample"]


def sample(ids: Iterable[str], count: int | None) -> list[str]:
    """Return `count` ids (all, if there are fewer, or for None) in the order given: those with the smallest SHA-256.

    The same ids are taken wherever this is asked, and a larger sample holds every smaller one.
    """
    ids = list(ids)
    taken = set(sorted(ids, key=lambda name: hashlib.sha256(name.encode()).digest())[:count])
    return [name for name in ids if name in taken]
