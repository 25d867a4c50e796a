"""Templates: clauses, wrappers, joining phrases by split (`envs_data/templates.json`, docs/howto/instructions.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache

import msgspec

from gavel_env.data import read_json, shipped_data
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
    return read_json(shipped_data("templates.json"), Templates, "template file", version=FORMAT)


def expand(template: str) -> Iterator[str]:
    """Yield every template that the choices `[a|b]` of one stand for."""
    match = CHOICE.search(template)
    if match is None:
        yield template
        return
    for option in match.group(1).split("|"):
        yield from expand(template[: match.start()] + option + template[match.end() :])
