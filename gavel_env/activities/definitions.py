"""The shipped activity definitions: `envs_data/activities.json`, read once (format `gavel-activities/1`)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import msgspec

from gavel_env.activities.bddl import Problem, parse_problem
from gavel_env.data import read_json, shipped_data
from gavel_env.errors import DataError, UnknownActivity, nearest_names

__all__ = ["FORMAT", "Activities", "Activity", "UnknownActivity", "load_activities"]

FORMAT = "gavel-activities/1"


class Activity(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One of BEHAVIOR's activities.

    Attributes:
        name: as in `putting_away_toys`.
        group: "core" if its goal uses only ontop, inside, nextto, under, open, toggled_on and cooked; "extended" with
            hot, frozen and not covered; "other" if it needs more.
        needs: what its goal needs beyond the extended set, such as `covered` or `real`; empty if expressible.
        bddl: its definition; empty for "other".
    """

    name: str
    group: str
    needs: tuple[str, ...] = ()
    bddl: str = ""

    @property
    def expressible(self) -> bool:
        """True if its goal can be said over the graph."""
        return not self.needs

    def problem(self) -> Problem:
        """Return the parsed definition.

        Raises:
            DataError: its goal is not expressible, so its definition is not shipped.
        """
        if not self.expressible:
            raise DataError(
                f"the goal of activity {self.name!r} needs {', '.join(self.needs)}, which graphs do not have"
            )
        return parse_problem(self.bddl, self.name)


class Activities(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file.

    Attributes:
        format: version of the format.
        provenance: where the definitions come from.
        kinds: synset -> categories of the ontology that are of that kind.
        dirt: what covers things at the start: dust, stains, mud and the like.
        activities: all of them, in alphabetical order.
    """

    format: str
    provenance: str
    kinds: Mapping[str, tuple[str, ...]]
    dirt: tuple[str, ...]
    activities: tuple[Activity, ...]

    def __getitem__(self, name: str) -> Activity:
        """Return an activity by name.

        Raises:
            UnknownActivity: with the nearest names.
        """
        for activity in self.activities:
            if activity.name == name:
                return activity
        near = nearest_names(name, [a.name for a in self.activities])
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else f"{len(self.activities)} are known"
        raise UnknownActivity(f"unknown activity {name!r}; {hint}")


def load_activities(path: Path | None = None) -> Activities:
    """Read and validate an activity file (default: the shipped one, read once).

    Raises:
        DataError: missing file, invalid content or another format version.
    """
    return _read(path or shipped_data("activities.json"))


@cache
def _read(path: Path) -> Activities:
    return read_json(path, Activities, "activity file", version=FORMAT)
