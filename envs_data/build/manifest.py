"""SHA-256 of every data file that is shipped under `envs_data`: write the manifest, or check it.

python -m envs_data.build.manifest            # write envs_data/MANIFEST.json
python -m envs_data.build.manifest --check    # exit 1 and say what differs
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path

import msgspec

from gavel_env.errors import DataError

__all__ = ["check_manifest", "compute", "main", "read_manifest"]

FORMAT = "gavel-manifest/1"
ROOT = Path(__file__).resolve().parent.parent
NAME = "MANIFEST.json"
SUFFIXES = (".json", ".jsonl", ".gz")


class _Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    format: str
    files: dict[str, str]


def compute(root: Path = ROOT) -> dict[str, str]:
    """Return path below `root` -> SHA-256 of every data file, in the order of the paths."""
    found = {}
    for path in sorted(root.rglob("*")):
        if (
            path.is_file()
            and path.suffix in SUFFIXES
            and path.name != NAME
            and "build" not in path.relative_to(root).parts
        ):
            found[path.relative_to(root).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def read_manifest(root: Path = ROOT) -> dict[str, str]:
    """Return the manifest's path -> SHA-256.

    Raises:
        DataError: it is missing, malformed or of another format.
    """
    path = root / NAME
    try:
        manifest = msgspec.json.decode(path.read_bytes(), type=_Manifest)
    except OSError as error:
        raise DataError(f"manifest {path} cannot be read: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise DataError(f"manifest {path} is malformed: {error}") from error
    if manifest.format != FORMAT:
        raise DataError(f"manifest {path} has format {manifest.format!r}; this version reads {FORMAT!r}")
    return manifest.files


def check_manifest(root: Path = ROOT) -> tuple[str, ...]:
    """Return what differs between the manifest and the files, one sentence each; empty if nothing does.

    Raises:
        DataError: the manifest itself cannot be read.
    """
    told, real = read_manifest(root), compute(root)
    missing = [f"{name}: named in the manifest, not there" for name in sorted(told.keys() - real.keys())]
    extra = [f"{name}: there, not named in the manifest" for name in sorted(real.keys() - told.keys())]
    changed = [f"{name}: its content differs" for name in sorted(told.keys() & real.keys()) if told[name] != real[name]]
    return tuple(missing + extra + changed)


def main(arguments: list[str] | None = None) -> int:
    """Write or check the manifest; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m envs_data.build.manifest", description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    if parser.parse_args(arguments).check:
        wrong = check_manifest()
        sys.stdout.write("".join(f"{line}\n" for line in wrong))
        return 1 if wrong else 0
    (ROOT / NAME).write_text(json.dumps({"format": FORMAT, "files": compute()}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
