"""The episode boundary: what an agent raises ends its own episode and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

__all__ = ["attempt"]

T = TypeVar("T")


def attempt(
    call: Callable[[], T], *, through: tuple[type[BaseException], ...] = (KeyboardInterrupt,)
) -> tuple[T | None, BaseException | None]:
    """Return what a call returned and None, or None and what it raised.

    Args:
        call: into code that may raise anything.
        through: what is raised all the same.
    """
    try:
        return call(), None
    except through:
        raise
    except BaseException as error:  # noqa: BLE001  the episode boundary, the only one
        return None, error
