"""Build `envs_data/activities.json`: BEHAVIOR's activity definitions, parsed, and the kinds that they speak of.

Run as `python -m envs_data.build.activity_definitions`; the result is byte-identical each time.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec

from envs_data.build.common import BDDL_VERSION, ancestors, bddl_root
from gavel_env.activities.bddl import Problem, parse_problem, predicates, synset_of
from gavel_env.activities.definitions import FORMAT, Activity
from gavel_env.world_model.ontology import load_ontology

__all__ = ["CORE", "EXTENDED", "build", "classify", "dirt_of", "main", "problems"]

TARGET = Path(__file__).resolve().parents[1] / "activities.json"
PROVENANCE = f"PyPI bddl {BDDL_VERSION} (MIT): activity_definitions and hierarchy"

CORE = frozenset({"ontop", "inside", "nextto", "under", "open", "toggled_on", "cooked"})
EXTENDED = CORE | {"hot", "frozen"}
COVERED = "covered"


@cache
def problems() -> tuple[Problem, ...]:
    """Return the activities of bddl, in alphabetical order."""
    folder = bddl_root() / "activity_definitions"
    paths = sorted(folder.glob("*/problem0.bddl"))
    return tuple(parse_problem(path.read_text(encoding="utf-8"), path.parent.name) for path in paths)


def classify(problem: Problem) -> Activity:
    """Return an activity with its group; a goal may ask that something is *not* covered, never that it is."""
    found = set(predicates(problem.goal))
    needs = {name for name, _ in found} - EXTENDED - {COVERED}
    if (COVERED, False) in found:
        needs.add(COVERED)
    if needs:
        return Activity(problem.name, "other", tuple(sorted(needs)))
    core = {name for name, _ in found} <= CORE
    return Activity(problem.name, "core" if core else "extended", (), str(problem))


@cache
def dirt_of() -> tuple[str, ...]:
    """Return the synsets of what covers something at the start of an activity."""
    return tuple(sorted({synset_of(f.args[1]) for p in problems() for f in p.init if f.predicate == COVERED}))


def build() -> bytes:
    """Return the content of the activity file: canonical JSON, one activity and one kind per line.

    Raises:
        DataError: bddl is not installed in the right version, or the ontology is missing.
    """
    parsed = problems()
    found = [classify(problem) for problem in parsed]
    spoken = {s for problem, a in zip(parsed, found, strict=True) if a.expressible for s in problem.objects}
    members: dict[str, list[str]] = {synset: [] for synset in sorted(spoken)}
    for name, category in load_ontology().items():
        for synset in sorted(spoken & ancestors(category.synset)):
            members[synset].append(name)
    encode = msgspec.json.Encoder(order="deterministic").encode
    kinds = b",\n".join(encode(synset) + b":" + encode(names) for synset, names in members.items())
    lines = b",\n".join(encode(activity) for activity in found)
    head = {"format": FORMAT, "provenance": PROVENANCE, "dirt": dirt_of()}
    start = encode(head)[:-1]
    return start + b',\n"kinds":{\n' + kinds + b'\n},\n"activities":[\n' + lines + b"\n]}\n"


def main() -> None:
    """Write the activity file."""
    content = build()
    TARGET.write_bytes(content)
    print(f"{TARGET.name}: {len(problems())} activities, {len(content) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
