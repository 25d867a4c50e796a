"""A process that kills itself at a chosen moment, such as in the middle of a write: imported as a plug-in.

A moment is a write to a file, a flush of one to the disk, or a step of an environment. `GAVEL_TEST_DIES=K` kills the
process at its K-th moment; a write is cut off by `GAVEL_TEST_CUT`, a share of what was to be written. With
`GAVEL_TEST_ONCE=FILE` only the first process that gets there dies, and `GAVEL_TEST_MOMENTS=FILE` writes how many there
were.
"""

from __future__ import annotations

import atexit
import os
import signal
import stat
import threading
from pathlib import Path
from typing import Any

from gavel_env.envs.env import GavelEnv

_DIES, _CUT = int(os.environ.get("GAVEL_TEST_DIES", "0")), float(os.environ.get("GAVEL_TEST_CUT", "0"))
_ONCE, _MOMENTS = os.environ.get("GAVEL_TEST_ONCE", ""), os.environ.get("GAVEL_TEST_MOMENTS", "")
_turn = threading.Lock()
_moments: list[None] = []
_write, _fsync, _step = os.write, os.fsync, GavelEnv.step


def _arrived() -> bool:
    """Count a moment; return whether it is the one to die at."""
    with _turn:
        _moments.append(None)
        if len(_moments) != _DIES:
            return False
    try:
        os.close(os.open(_ONCE, os.O_CREAT | os.O_EXCL)) if _ONCE else None
    except FileExistsError:
        return False
    return True


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _dying_write(descriptor: int, content: Any) -> int:
    if stat.S_ISREG(os.fstat(descriptor).st_mode) and _arrived():
        _write(descriptor, content[: int(len(content) * _CUT)])
        _die()
    return _write(descriptor, content)


def _dying_fsync(descriptor: Any) -> None:
    if _arrived():
        _die()
    _fsync(descriptor)


def _dying_step(env: GavelEnv, action: Any) -> Any:
    if _arrived():
        _die()
    return _step(env, action)


os.write, os.fsync = _dying_write, _dying_fsync  # type: ignore[assignment]
GavelEnv.step = _dying_step  # type: ignore[assignment, method-assign]
if _MOMENTS:
    atexit.register(lambda: Path(_MOMENTS).write_text(str(len(_moments))))
