"""The house of a record: a shipped one, or a file that lies where the reader of the record has a say."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from gavel_env.data import is_path
from gavel_env.errors import SceneError
from gavel_env.house.scenes import Scene, load_scene

__all__ = ["house_of"]


def house_of(scene: str, folders: Iterable[Path]) -> Scene:
    """Return the scene that a record names.

    A record that somebody else wrote must not make anybody read what lies elsewhere, nor say whether it is there.

    Args:
        scene: name or path in the record.
        folders: of the record files; scene files in them, and in the working directory, are read.

    Raises:
        UnknownScene: no shipped scene has this name.
        SceneError: the file lies elsewhere, or cannot be read.
    """
    if is_path(scene):
        path = Path(scene).resolve()
        if not any(path.is_relative_to(folder.resolve()) for folder in (Path.cwd(), *folders)):
            raise SceneError(
                f"the scene {scene[:80]!r} of a record lies neither in the working directory nor beside the records;"
                " expected the name of a shipped scene, or a file there"
            )
    return load_scene(scene)
