"""How kernels are compiled: by numba at their first call, cached on disk, announced when it takes a while.

The machine code is cached beside the package. Where that cannot be written to, it is cached in the user's cache folder,
else in the temporary folder, else not at all, with one warning.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.event import Listener, register

__all__ = ["compiled", "inner"]

_Function = TypeVar("_Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(function: _Function) -> _Function:
    """Compile a kernel at its first call."""
    return cast(_Function, _jit(function))


def inner(function: _Function) -> _Function:
    """Compile a kernel that only kernels call."""
    return cast(_Function, _jit(function, no_cpython_wrapper=True))


def _jit(function: Callable[..., Any], **options: Any) -> Any:
    try:
        return numba.njit(cache=True, **_OPTIONS, **options)(function)
    except RuntimeError:  # "cannot cache function": no place that numba knows can be written to
        return numba.njit(cache=_cache_elsewhere(), **_OPTIONS, **options)(function)


@cache
def _cache_elsewhere() -> bool:
    """Turn numba's cache to a folder of one's own in the temporary folder; return whether there can be one."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        folder = Path(tempfile.gettempdir()) / f"gavel-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        own = stat.S_ISDIR(found.st_mode) and (not hasattr(os, "getuid") or found.st_uid == os.getuid())
        if own and os.access(folder, os.W_OK):
            config: Any = numba.config
            config.CACHE_DIR = str(folder)
            return True
    except OSError:
        pass
    warnings.warn(
        "no folder can be written to, so kernels are compiled in every process (some seconds); "
        "set NUMBA_CACHE_DIR to a folder that can",
        RuntimeWarning,
        stacklevel=2,
    )
    return False


class _Announcement(Listener):
    """Says once per process that kernels are being compiled; loading them from the cache is not news."""

    said = False

    def on_start(self, event: Any) -> None:
        if not self.said and event.data["dispatcher"].py_func.__module__.startswith("gavel_env."):
            self.said = True
            sys.stderr.write("gavel: compiling kernels for this machine, once (a few seconds) ...\n")
            sys.stderr.flush()

    def on_end(self, event: Any) -> None:
        pass


register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]
