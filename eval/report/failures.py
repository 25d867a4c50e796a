"""Tables of where an agent's failures come from: what remains after each stage, and what caused what is left."""

from __future__ import annotations

from eval.records.journal import RecordFile
from eval.report.grid import UNDEFINED, Grid, facts_of, part_of
from eval.report.tables import Results, Section, results
from eval.report.waterfall import CAUSES, STAGES, Waterfall, waterfall
from eval.studies.published import RESIDUAL_MULTI

__all__ = ["failure_tables"]


def failure_tables(files: RecordFile, agent: str = "gavel-full") -> list[Grid]:
    """Return two tables per benchmark that an agent was run on: what remains after each stage, and the causes.

    Args:
        files: as read.
        agent: name; one column per planner that it was run with.
    """
    tables: list[Grid] = []
    found = results(files)
    for section in found.sections:
        falls = {
            row.contestant.planner or UNDEFINED: waterfall(files.records[key] for key in keys if key in files.records)
            for row, keys in zip(section.rows, section.keys, strict=True)
            if row.contestant.agent == agent
        }
        falls = {planner: fall for planner, fall in falls.items() if fall.episodes}
        if falls:
            tables += [_remaining(agent, section, found, falls), _causes(section, falls)]
    return tables


def _remaining(agent: str, section: Section, found: Results, falls: dict[str, Waterfall]) -> Grid:
    rows = [(stage, *(_share(fall.remaining[stage], fall.episodes) for fall in falls.values())) for stage in STAGES]
    return Grid(
        title=f"Failures of {agent} that remain after each stage: {section.benchmark.kind}{part_of(section)}",
        facts=facts_of(section, found),
        header=("After", *falls),
        labels=1,
        rows=(*rows, ("episodes", *(str(fall.episodes) for fall in falls.values()))),
        notes=tuple(f"{stage}: {meaning}." for stage, meaning in STAGES.items()),
    )


def _causes(section: Section, falls: dict[str, Waterfall]) -> Grid:
    published = section.benchmark.kind == "multi"
    rows = []
    for name in CAUSES:
        theirs = (str(RESIDUAL_MULTI.get(name, UNDEFINED)),) if published else ()
        rows.append((name, *(str(fall.causes[name]) for fall in falls.values()), *theirs))
    notes = [f"{name}: {meaning}." for name, meaning in CAUSES.items()]
    if published:
        notes.append(
            f"published: of the paper's {RESIDUAL_MULTI['all']} failures in 500, {RESIDUAL_MULTI['understanding']} lie "
            f"in object extraction, {RESIDUAL_MULTI['proposal']} are plans that cannot be executed, "
            f"{RESIDUAL_MULTI['unmet goals']} unmet goals."
        )
    return Grid(
        title="What caused them",
        facts=(),
        header=("Cause", *falls, *(("*published*",) if published else ())),
        labels=1,
        rows=tuple(rows),
        notes=tuple(notes),
    )


def _share(count: int, of: int) -> str:
    return f"{count} ({100 * count / of:.1f} %)"
