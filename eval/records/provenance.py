"""Where results come from: content stamps of data, the code's commit, and versions."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib import metadata, resources
from pathlib import Path

import msgspec

from gavel_env.house.scenes import scene_names
from gavel_env.instructions.record import Instruction

__all__ = ["code_version", "data_stamp", "file_stamp", "now", "stamp", "versions"]

_PACKAGES = ("gavel-env", "gymnasium", "msgspec", "networkx", "numba", "numpy", "opencv-python-headless")
_DIGITS = 16
_WHOLE_BYTES = 64 << 20
_END_BYTES = 1 << 20


def stamp(*parts: object) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of some JSON-encodable parts."""
    return hashlib.sha256(msgspec.json.encode(parts, order="deterministic")).hexdigest()[:_DIGITS]


def file_stamp(path: str | Path) -> str:
    """Return the content stamp of a file; of a folder, that of its files; empty if there is neither.

    Files of more than 64 MiB (weights) are told by their size and their first and last MiB.
    """
    path = Path(path)
    if not os.path.isfile(path) and not os.path.isdir(path):  # these two bear any name
        return ""  # nothing there, or a pipe or device, which may never end
    if path.is_dir():
        return stamp(*((str(p.relative_to(path)), file_stamp(p)) for p in sorted(path.rglob("*")) if p.is_file()))
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            if size <= _WHOLE_BYTES:
                return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGITS]
            ends = [file.read(_END_BYTES)]
            file.seek(size - _END_BYTES)
            ends.append(file.read(_END_BYTES))
    except OSError:
        return ""
    return stamp(size, *(hashlib.sha256(end).hexdigest() for end in ends))


def data_stamp(instructions_stamp: str, instructions: Iterable[Instruction]) -> str:
    """Return the stamp of all that episodes are built from: the instruction file, its scenes and the ontology."""
    data = resources.files("envs_data")
    known = frozenset(scene_names())
    scenes = {}
    for scene in sorted({instruction.scene for instruction in instructions}):
        if scene in known:
            scenes[scene] = file_stamp(Path(str(data / "scenes" / f"{scene}.json")))
        else:  # whatever else a line calls its scene is not opened
            scenes[scene] = file_stamp(scene) if scene.endswith(".json") and not os.path.isdir(scene) else ""
    return stamp(instructions_stamp, scenes, file_stamp(Path(str(data / "ontology.json"))))


def code_version() -> str:
    """Return the git commit of the code, `+` if files were changed; outside a checkout the package's version."""
    root = Path(__file__).resolve().parents[2]
    if (root / ".git").exists():
        commit = _git(root, "rev-parse", "--short=12", "HEAD")
        if commit:
            return commit + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    return versions().get("gavel-env", "unknown")


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results can depend on."""
    found = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def now() -> str:
    """Return the time, UTC, ISO 8601 to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
