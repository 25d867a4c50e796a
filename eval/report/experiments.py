"""Tables of the paper's experiments: our figures, the published ones beside them, and paired differences."""

from __future__ import annotations

from collections.abc import Sequence

from eval.records.journal import RecordFile
from eval.records.schema import Contestant
from eval.report.grid import (
    UNDEFINED,
    Grid,
    facts_of,
    labels_of,
    marks_explained,
    number,
    part_of,
    seconds,
    short_spec,
)
from eval.report.paired import Paired, paired_metres, paired_success
from eval.report.statistics import Estimate
from eval.report.tables import Results, Row, Section, results
from eval.studies.experiments import Claim, Experiment
from eval.studies.published import EXPERIMENTS as PUBLISHED
from eval.studies.published import Published, published_model

__all__ = ["experiment_tables"]


_ORDINALS = {5: "fifth"}


def experiment_tables(experiment: Experiment, files: RecordFile) -> list[Grid]:
    """Return the table of an experiment and, under it, that of its paired differences."""
    found = results(files)
    unasked = not any(header.arguments.get("planner") for header in files.headers)
    tables: list[Grid] = []
    for section in found.sections:
        if section.benchmark.kind == experiment.kind:
            tables.append(_main(experiment, section, found, unasked))
            differences = _differences(experiment, section, files)
            if differences.rows:
                tables.append(differences)
    return tables


def _published(experiment: Experiment, row: Row, section: Section) -> tuple[str, Published | None]:
    """Return whose published figures stand beside a row, and them."""
    agent = row.contestant.agent
    ours = PUBLISHED[experiment.name]
    if ("", agent) in ours:
        return "", ours["", agent]
    model = published_model(row.contestant.planner, section.models[0] if len(section.models) == 1 else "")
    return model, ours.get((model, agent))


def _main(experiment: Experiment, section: Section, found: Results, unasked: bool) -> Grid:
    header, labels = labels_of(section)
    columns = [*header, "Success (%)", "*published*"]
    for name in experiment.columns:
        columns += [{"attempts": "Attempts", "metres": "Metres, matched", "seconds": "Time (s)"}[name], "*published*"]
    rows = []
    models = set()
    for label, row in zip(labels, section.rows, strict=True):
        model, beside = _published(experiment, row, section)
        if beside is not None and model:
            models.add(model)
        cells = [number(row.success, 1), _theirs(beside.success if beside else None, 1)]
        for name in experiment.columns:
            ours, theirs = _cell(name, row, beside)
            cells += [ours, theirs]
        rows.append((*label, *cells, str(row.scheduled)))
    return Grid(
        title=experiment.title + part_of(section),
        facts=facts_of(section, found),
        header=(*columns, "N"),
        labels=len(header),
        rows=tuple(rows),
        notes=tuple(_notes(experiment, section, sorted(models), unasked)),
    )


def _cell(name: str, row: Row, beside: Published | None) -> tuple[str, str]:
    if name == "attempts":
        return number(row.attempts, 2), _theirs(beside.attempts if beside else None, 2)
    if name == "metres":
        return number(row.matched, 2), _theirs(beside.metres if beside else None, 2)
    return seconds(row.planning_s), _theirs(beside.seconds if beside else None, 1)


def _theirs(value: Estimate | None, digits: int) -> str:
    return UNDEFINED if value is None else f"{value.mean:.{digits}f} ± {value.spread:.{digits}f}"


def _notes(experiment: Experiment, section: Section, models: Sequence[str], unasked: bool) -> list[str]:
    notes = []
    if models:
        notes.append(
            f"published: the paper's figures for {' and '.join(models)}, in its own executor and with goals extracted "
            "by a model; they are not targets for these rows unless model and understanding are the same."
        )
    said: dict[str, list[str]] = {}
    for row in section.rows:
        said.setdefault(_said(row.contestant), []).append(row.contestant.agent)
    notes += [f"{planner}: {', '.join(agents)}." for planner, agents in said.items() if planner]
    if experiment.every > 1 and unasked:
        notes.append(
            f"Without --planner on the {section.instructions} instructions of the recording; with it, on every "
            f"{_ORDINALS.get(experiment.every, experiment.every)} one, as the paper."
        )
    if section.compared and "metres" in experiment.columns:
        names = ", ".join(dict.fromkeys(section.rows[i].contestant.agent for i in section.compared))
        notes.append(f"Metres, matched: over the {section.matched} episodes that all of these solved: {names}.")
    several = len(section.seeds) > 1
    notes.append(
        ("±: standard deviation over seeds. " if several else "One seed: [low, high] is a 95 % Wilson interval. ")
        + _varies(section)
    )
    return notes + marks_explained(section)


def _varies(section: Section) -> str:
    planners = sorted({row.contestant.planner_kind for row in section.rows} - {""})
    if len(section.seeds) == 1:
        return f"Nothing here is random but what a seed fixes (planners: {', '.join(planners) or 'none'})."
    return (
        "A seed varies the sampling of the model (or, simulated, which plans are broken) and where things lie that "
        "start on the floor of a room; rows without a model differ over seeds by the latter alone."
    )


def _said(who: Contestant) -> str:
    """Return what a row's planner is, where it is not a language model that answers now."""
    what = {
        "classical": "a classical planner, no language model",
        "replay": "answers of a real model that were recorded once",
        "reference": "certified plans in a model's place, so that belief, search and order alone are compared",
        "simulated": "a simulated model: published error statistics, no language model",
        "scripted": "completions from a file",
    }.get(who.planner_kind)
    return f"{short_spec(who.planner)} ({what})" if what else ""


def _differences(experiment: Experiment, section: Section, files: RecordFile) -> Grid:
    rows = []
    keys = {row.contestant.config: keys for row, keys in zip(section.rows, section.keys, strict=True)}
    for claim in experiment.claims:
        for first, second in _pairs(claim, section):
            compare = paired_success if claim.measure == "success" else paired_metres
            found = compare(keys[first.contestant.config], keys[second.contestant.config], files.records)
            if found is not None:
                rows.append(_difference(experiment, claim, first, second, section, found))
    return Grid(
        title=f"{experiment.title}{part_of(section)}: paired differences",
        facts=(),
        header=(
            "Difference",
            "Planner",
            "of",
            "ours [95 % interval]",
            "relative",
            "*published*",
            "better / equal / worse",
        ),
        labels=3,
        rows=tuple(rows),
        notes=(
            "Over the instructions on which both were run (success, percentage points) or that both solved (metres), "
            "seeds averaged first; interval: bootstrap over instructions, 10,000 resamples. better: more success, "
            "fewer metres.",
        )
        if rows
        else (),
    )


def _pairs(claim: Claim, section: Section) -> list[tuple[Row, Row]]:
    """Return the pairs of rows that a claim is about: of the same planner, if both have one."""
    first = [row for row in section.rows if row.contestant.agent == claim.first]
    second = [row for row in section.rows if row.contestant.agent == claim.second]
    return [
        (a, b)
        for a in first
        for b in second
        if a.contestant.planner == b.contestant.planner or not (a.contestant.planner and b.contestant.planner)
    ]


def _difference(
    experiment: Experiment, claim: Claim, first: Row, second: Row, section: Section, found: Paired
) -> tuple[str, ...]:
    _, theirs = _published(experiment, first, section)
    other = _published(experiment, second, section)[1]
    unit = " points" if claim.measure == "success" else " m"
    published = UNDEFINED
    if theirs is not None and other is not None:
        if claim.measure == "success":
            published = f"{theirs.success.mean - other.success.mean:+.1f}{unit}"
        elif theirs.metres is not None and other.metres is not None:
            gain = theirs.metres.mean - other.metres.mean
            published = f"{gain:+.2f}{unit} ({100 * gain / other.metres.mean:+.1f} %)"
    digits = 1 if claim.measure == "success" else 2
    interval = "" if found.interval is None else f" [{found.interval[0]:+.{digits}f}, {found.interval[1]:+.{digits}f}]"
    relative = UNDEFINED
    if claim.measure == "metres" and found.base:
        relative = f"{100 * found.difference / found.base:+.1f} %"
    return (
        f"{claim.first} − {claim.second}",
        first.contestant.planner or second.contestant.planner or UNDEFINED,
        claim.measure,
        f"{found.difference:+.{digits}f}{unit}{interval}",
        relative,
        published,
        f"{found.better} / {found.equal} / {found.worse}",
    )
