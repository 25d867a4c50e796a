"""How result tables are laid out: columns, labels, marks and notes; `eval.report.formats` sets them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import PurePath
from typing import NamedTuple

from eval.report.planning_cost import in_order
from eval.report.statistics import Estimate
from eval.report.tables import Results, Row, Section

__all__ = [
    "CHOICES",
    "UNDEFINED",
    "Grid",
    "facts_of",
    "grids",
    "labels_of",
    "marks_explained",
    "number",
    "part_of",
    "seconds",
    "short_spec",
]

UNDEFINED = "—"
_TITLES = {"single": "Single tasks", "multi": "Multi-task instructions", "behavior": "BEHAVIOR activities"}
_MARKS = {
    "privileged": ("†", "sees the hidden state"),
    "scripted": ("§", "planner answers from a file of scripted completions; no language model ran"),
    "reference": ("¶", "planner answers with the certified reference plans; no language model"),
    "classical": ("◊", "classical planner in the model's place: it plans for what was understood; no language model"),
    "simulated": ("‡", "simulated planner: a published error profile, no language model"),
}


class Grid(NamedTuple):
    """A table ready to be set.

    Attributes:
        title: its heading.
        facts: what it was made from: file, stamps, planner, code; nothing for a table that follows another.
        header: column headings; the first `labels` columns are text, the others are numbers.
        labels: how many columns are text.
        rows: cells.
        notes: lines beneath it.
    """

    title: str
    facts: tuple[str, ...]
    header: tuple[str, ...]
    labels: int
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


class _Column(NamedTuple):
    """A column of numbers; it is left out where every cell is undefined."""

    name: str
    cell: Callable[[Row], str]


def number(value: Estimate | None, digits: int) -> str:
    """Return an estimate as a cell: mean and ±, or mean and interval."""
    if value is None:
        return UNDEFINED
    text = f"{value.mean:.{digits}f}"
    if value.interval is not None:
        return f"{text} [{value.interval[0]:.{digits}f}, {value.interval[1]:.{digits}f}]"
    return f"{text} ± {UNDEFINED if value.spread is None else f'{value.spread:.{digits}f}'}"


def seconds(value: Estimate | None) -> str:
    """Return seconds as a cell, with more digits where they are few."""
    return number(value, 1 if value is None or value.mean >= 1 else 4 if value.mean < 0.1 else 2)


def _episodes(row: Row) -> str:
    return str(row.scheduled) if row.recorded == row.scheduled else f"{row.recorded} of {row.scheduled}"


_COLUMNS = (
    _Column("Success (%)", lambda row: number(row.success, 1)),
    _Column("Metres", lambda row: number(row.metres, 2)),
    _Column("Metres, matched", lambda row: number(row.matched, 2)),
    _Column("× oracle", lambda row: UNDEFINED if row.regret is None else f"{row.regret:.2f}"),
    _Column("Planning (s)", lambda row: seconds(row.planning_s)),
    _Column("Attempts", lambda row: number(row.attempts, 2)),
    _Column("N", _episodes),
)
_STAGES = {
    "understand": "Understand (s)",
    "plan": "Planner (s)",
    "repair": "Repair (s)",
    "validate": "Validate (s)",
    "order": "Order (s)",
}
CHOICES = ("planner", "understanding", "prior", "cost")


def grids(results: Results, *, failures: bool = False, costs: bool = False) -> tuple[Grid, ...]:
    """Return one table per section, with `costs` and `failures` followed by one of each for the section."""
    tables: list[Grid] = []
    for section in results.sections:
        tables.append(_main(section, results))
        if costs and any(row.costs.episodes for row in section.rows):
            tables.append(_costs(section))
        if failures:
            tables.append(_failures(section))
    if tables:
        tables[-1] = tables[-1]._replace(notes=(*tables[-1].notes, *_footer(results)))
    return tuple(tables)


def labels_of(section: Section) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the text columns: the agent with its marks, what differs between rows, and stamps to tell twins apart."""
    varying = [name for name in CHOICES if len({getattr(r.contestant, name) for r in section.rows} - {""}) > 1]
    rows = [
        (r.contestant.agent + _marks(r), *(short_spec(getattr(r.contestant, name)) or UNDEFINED for name in varying))
        for r in section.rows
    ]
    if len(set(rows)) < len(rows):
        varying.append("settings")
        rows = [(*cells, r.contestant.config[:6]) for cells, r in zip(rows, section.rows, strict=True)]
    return ("Agent", *(name.capitalize() for name in varying)), list(rows)


def short_spec(spec: str) -> str:
    """Return a spec without the folders of the file that it names; names of models keep their slashes."""
    kind, colon, argument = spec.partition(":")
    return f"{kind}:{PurePath(argument).name}" if colon and PurePath(argument).suffix else spec


def _marks(row: Row) -> str:
    kinds = (["privileged"] if row.contestant.privileged else []) + [row.contestant.planner_kind]
    marks = "".join(_MARKS[kind][0] for kind in kinds if kind in _MARKS)
    return f" {marks}" if marks else ""


def _main(section: Section, results: Results) -> Grid:
    header, labels = labels_of(section)
    cells = [[column.cell(row) for column in _COLUMNS] for row in section.rows]
    shown = [i for i, column in enumerate(_COLUMNS) if column.name == "N" or any(row[i] != UNDEFINED for row in cells)]
    return Grid(
        title=_name(section),
        facts=facts_of(section, results),
        header=(*header, *(_COLUMNS[i].name for i in shown)),
        labels=len(header),
        rows=tuple((*label, *(row[i] for i in shown)) for label, row in zip(labels, cells, strict=True)),
        notes=tuple(_section_notes(section)),
    )


def _name(section: Section) -> str:
    return _TITLES.get(section.benchmark.kind, section.benchmark.kind) + part_of(section)


def part_of(section: Section) -> str:
    """Return what is added to a title where rows of a benchmark are over different instructions."""
    if section.part == "shared":
        return f": the {section.instructions} on which all rows were run"
    return f": all {section.instructions}" if section.part else ""


def facts_of(section: Section, results: Results) -> tuple[str, ...]:
    """Return what a table was made from: file, stamps, planner, model, seeds, rules, code."""
    bench = section.benchmark
    parts = [f"{section.instructions} from {bench.source}", f"stamp {bench.stamp or UNDEFINED}, data {bench.data}"]
    for choice in CHOICES:
        named = {getattr(row.contestant, choice) for row in section.rows} - {""}
        if len(named) == 1:
            parts.append(f"{choice} {short_spec(named.pop())}")
        elif not named and choice == "planner":
            parts.append("no planner")
    parts += [f"model {model}" for model in section.models]
    return (*parts, *(f"{fact} {value}" for fact, value in results.facts))


def _section_notes(section: Section) -> list[str]:
    _, labels = labels_of(section)
    agents = Counter(row.contestant.agent for row in section.rows)
    names = [
        row.contestant.agent if agents[row.contestant.agent] == 1 else " ".join(cells)
        for row, cells in zip(section.rows, labels, strict=True)
    ]
    notes = []
    if section.part == "shared":
        drawn = sorted({short_spec(row.contestant.planner) for row in section.rows if row.contestant.sample})
        notes.append(
            "Every row is over the instructions that all of them were run on; those that were run on more follow below."
            + "".join(f" {planner}: a sample of the instructions, drawn by the hash of their ids." for planner in drawn)
        )
    if section.compared:
        together = ", ".join(names[i] for i in section.compared)
        note = f"Metres, matched: over the {section.matched} episodes that all of these solved: {together}"
        out = [name for i, name in enumerate(names) if i not in section.compared]
        notes.append(note + (f"; left out: {', '.join(out)}." if out else "."))
    notes += marks_explained(section)
    missing = sum(row.scheduled - row.recorded for row in section.rows)
    if missing:
        notes.append(f"INCOMPLETE: {missing} scheduled episodes have no record and count as not solved.")
    crashed = sum(n for row in section.rows for kind, n in row.failures.items() if kind.startswith("error:"))
    if crashed:
        notes.append(f"{crashed} episodes ended in an error and count as not solved (gavel tables --failures).")
    return notes


def marks_explained(section: Section) -> list[str]:
    """Return one line per mark that a section's rows carry."""
    kinds = {row.contestant.planner_kind for row in section.rows}
    kinds |= {"privileged" for row in section.rows if row.contestant.privileged}
    return [f"{mark} {meaning}." for kind, (mark, meaning) in _MARKS.items() if kind in kinds]


def _footer(results: Results) -> list[str]:
    seeds = {seed for section in results.sections for seed in section.seeds}
    if len(seeds) > 1:
        spread = "±: sample standard deviation over seeds (success, metres)"
    else:
        spread = "[low, high]: 95 % Wilson interval; ± of metres: standard error over instructions (one seed)"
    notes = [
        f"{spread}; of planning and attempts: standard deviation over episodes. "
        f"Success is over all scheduled episodes; Metres over the agent's own successes. {UNDEFINED}: undefined."
    ]
    notes += [f"Rejected and counted as not solved: {name}: {reason}" for name, reason in results.rejected]
    notes += [f"Not a record: {line}" for line in results.damaged]
    return notes


def _costs(section: Section) -> Grid:
    header, labels = labels_of(section)
    columns = [
        _Column("Calls", lambda row: number(row.costs.calls, 2)),
        _Column("Prompt tokens", lambda row: number(row.costs.prompt_tokens, 0)),
        _Column("New tokens", lambda row: number(row.costs.completion_tokens, 0)),
    ]
    if any(row.costs.money for row in section.rows):
        columns.append(_Column("Cost", lambda row: number(row.costs.money, 4)))
    for name in in_order(name for row in section.rows for name in row.costs.seconds):
        columns.append(_Column(_STAGES.get(name, f"{name} (s)"), partial(_stage_mean, name)))
    columns.append(_Column("Planning (s)", lambda row: seconds(row.costs.planning_s)))
    columns.append(_Column("N", lambda row: str(row.costs.episodes)))
    shown = [i for i, row in enumerate(section.rows) if row.costs.episodes]
    return Grid(
        title=f"{_name(section)}: what planning cost per instruction",
        facts=(),
        header=(*header, *(column.name for column in columns)),
        labels=len(header),
        rows=tuple((*labels[i], *(column.cell(section.rows[i]) for column in columns)) for i in shown),
        notes=tuple(_cost_notes(section)),
    )


def _stage_mean(stage: str, row: Row) -> str:
    """Return the mean alone: the spread of the whole says more than those of its parts, which CSV has."""
    spent = row.costs.seconds.get(stage)
    return UNDEFINED if spent is None else seconds(spent).partition(" ")[0]


def _cost_notes(section: Section) -> list[str]:
    notes = [
        "Means over the N recorded episodes that planned, solved or not; ±: standard deviation over episodes. Planning "
        f"is the sum of the seconds before it. {UNDEFINED}: no such stage, or nothing that counts calls or tokens."
    ]
    kinds = {row.contestant.planner_kind for row in section.rows if row.costs.episodes}
    if "replay" in kinds:
        notes.append(
            "Calls answered from a recording count the tokens and seconds of the model when it was recorded; every "
            "other stage is as measured in this run."
        )
    return notes


def _failures(section: Section) -> Grid:
    _, labels = labels_of(section)
    totals: dict[str, int] = {}
    for row in section.rows:
        for kind, count in row.failures.items():
            totals[kind] = totals.get(kind, 0) + count
    names = [" ".join(cells) for cells in labels]
    rows = [
        (kind, *(str(row.failures.get(kind, 0)) for row in section.rows))
        for kind in sorted(totals, key=lambda kind: (-totals[kind], kind))
    ]
    rows.append(("scheduled", *(str(row.scheduled) for row in section.rows)))
    return Grid(f"{_name(section)}: why episodes failed", (), ("Failure", *names), 1, tuple(rows))
