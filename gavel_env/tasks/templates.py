"""The templates: clauses, wrappers and joining phrases by split (`envs_data/templates.json`, docs/instructions.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources

import msgspec

from gavel_env.errors import DataError
from gavel_env.tasks.drafts import Split

__all__ = ["CHOICE", "SLOT", "Joining", "Templates", "default_templates", "expand"]

FORMAT = "gavel-templates/1"

CHOICE = re.compile(r"\[([^\[\]]*)\]")
SLOT = re.compile(r"\{(\w+)\}")


class Joining(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the clauses of a split are joined: opening words, sentences that go on, separators of lists."""

    openers: tuple[str, ...]
    next: tuple[str, ...]
    separators: tuple[tuple[str, str], ...]


class Templates(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The template file: clauses by group and split, wrappers and joining phrases by split."""

    format: str
    clauses: Mapping[str, Mapping[Split, tuple[str, ...]]]
    wrappers: Mapping[str, tuple[str, ...]]
    joins: Mapping[Split, Joining]


@cache
def default_templates() -> Templates:
    """Return the shipped templates.

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    source = resources.files("envs_data") / "templates.json"
    try:
        table = msgspec.json.decode(source.read_bytes(), type=Templates)
    except OSError as error:
        raise DataError(f"template file {source} cannot be read: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise DataError(f"template file {source} is malformed: {error}") from error
    if table.format != FORMAT:
        raise DataError(f"template file {source} has format {table.format!r}; this version reads {FORMAT!r}")
    return table


def expand(template: str) -> Iterator[str]:
    """Yield every template that the choices `[a|b]` of one stand for."""
    match = CHOICE.search(template)
    if match is None:
        yield template
        return
    for option in match.group(1).split("|"):
        yield from expand(template[: match.start()] + option + template[match.end() :])
