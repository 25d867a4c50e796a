"""Figures of a run, each a function of its records alone; needs the extra `[plots]`.

Colours are those of Okabe and Ito, which stay apart for colour-blind readers; bars and lines also differ in order and
marker.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from eval.records.journal import RecordFile
from eval.records.schema import EpisodeRecord
from eval.report.grid import labels_of
from eval.report.houses import house_of
from eval.report.paired import paired_metres
from eval.report.statistics import wilson
from eval.report.tables import Section, results
from eval.report.waterfall import STAGES, waterfall
from eval.studies.plots import figure
from gavel_env.errors import GavelError
from gavel_env.house.floor_map import floor_map

__all__ = ["FIGURES", "figures"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
MARKERS = "osD^vPX*"
_BINS = 10


class _Run(NamedTuple):
    """One section of the results, with the records of its rows.

    Attributes:
        names: per row, as the tables have them.
        records: per row.
        folders: of the record files.
    """

    section: Section
    names: tuple[str, ...]
    records: tuple[tuple[EpisodeRecord, ...], ...]
    folders: tuple[Path, ...] = ()

    def rows(self) -> Iterator[tuple[int, str, tuple[EpisodeRecord, ...]]]:
        yield from ((i, name, self.records[i]) for i, name in enumerate(self.names))


def figures(files: RecordFile) -> Iterator[tuple[str, Any]]:
    """Yield (name, matplotlib figure) for everything that these records can show.

    Raises:
        NotInstalled: the extra `[plots]` is missing.
    """
    for section in results(files).sections:
        _, labels = labels_of(section)
        names = tuple(" ".join(part for part in label if part not in ("", "—")) for label in labels)
        records = tuple(tuple(files.records[key] for key in keys if key in files.records) for keys in section.keys)
        run = _Run(section, names, records, files.folders)
        about = "-".join(filter(None, (section.benchmark.kind, section.part)))
        for name, drawn in FIGURES.items():
            drawing = drawn(run)
            if drawing is not None:
                yield f"{about}-{name}", drawing


def _success(run: _Run) -> Any:
    """Success of every method, with its 95 % interval."""
    drawing, ax = figure(height_in=_height_in(len(run.names)))
    for i, _, _ in run.rows():
        value = run.section.rows[i].success
        if value is None:
            continue
        low, high = value.interval or (value.mean - (value.spread or 0.0), value.mean + (value.spread or 0.0))
        ax.barh(i, value.mean, color=COLOURS[i % 8], height=0.7)
        for colour, width in (("white", 3.5), ("black", 1.5)):  # seen on every colour
            ax.errorbar(
                value.mean,
                i,
                xerr=[[value.mean - low], [high - value.mean]],
                color=colour,
                elinewidth=width,
                capsize=3,
                capthick=width,
            )
    ax.set(xlabel="success (%)", xlim=(0, 101))
    _name_rows(ax, run.names)
    return drawing


def _metres(run: _Run) -> Any:
    """The distance ladder: matched metres, and the paired difference from the method before."""
    compared = [i for i in run.section.compared if run.section.rows[i].matched is not None]
    if len(compared) < 2:
        return None
    drawing, axes = figure(columns=2, height_in=_height_in(len(compared)))
    left, right = axes[0]
    records = {record.key: record for found in run.records for record in found}
    for place, i in enumerate(compared):
        value = run.section.rows[i].matched
        assert value is not None
        style = {"fmt": MARKERS[place % 8], "color": COLOURS[i % 8], "capsize": 3}
        left.errorbar(value.mean, place, xerr=value.spread or 0.0, **style)
        if not place:
            continue
        before = compared[place - 1]
        paired = paired_metres([r.key for r in run.records[i]], [r.key for r in run.records[before]], records)
        if paired is None:
            continue
        low, high = paired.interval or (paired.difference, paired.difference)
        right.errorbar(paired.difference, place, xerr=[[paired.difference - low], [high - paired.difference]], **style)
    right.axvline(0, color="0.5", linewidth=1)
    left.set(xlabel=f"metres, {run.section.matched} common successes")
    right.set(xlabel="metres, less the method above (paired, 95 % bootstrap)")
    _name_rows(left, [run.names[i] for i in compared])
    _name_rows(right, [""] * len(compared))
    return drawing


def _failures(run: _Run) -> Any:
    """What is not right after proposal, repair, feedback and execution."""
    planned = [(i, name, found) for i, name, found in run.rows() if any(record.trace.attempts for record in found)]
    if not planned:
        return None
    drawing, ax = figure()
    stages = tuple(STAGES)
    for i, name, found in planned:
        fall = waterfall(found)
        shares = [100 * fall.remaining[stage] / max(1, fall.episodes) for stage in stages]
        ax.plot(stages, shares, marker=MARKERS[i % 8], color=COLOURS[i % 8], label=name)
    ax.set(ylabel="not right after this stage (%)", ylim=(0, None))
    ax.legend(fontsize="small")
    return drawing


def _attempts(run: _Run) -> Any:
    """Calls of the model per episode."""
    asked = [(i, name, found) for i, name, found in run.rows() if max((r.trace.attempts for r in found), default=0) > 1]
    if not asked:
        return None
    drawing, ax = figure()
    width = 0.8 / len(asked)
    for place, (i, name, found) in enumerate(asked):
        counts = Counter(record.trace.attempts for record in found)
        calls = sorted(counts)
        offset = (place - (len(asked) - 1) / 2) * width
        ax.bar([n + offset for n in calls], [counts[n] for n in calls], width, color=COLOURS[i % 8], label=name)
    ax.set(xlabel="calls of the model", ylabel="episodes")
    ax.legend(fontsize="small")
    return drawing


def _reliability(run: _Run) -> Any:
    """Beliefs at the start against how often they came true: of the rooms believed at p, how many held the thing."""
    found: list[tuple[float, bool]] = []
    for records in run.records:
        found += [pair for record in records for pair in _believed(record, run.folders)]
        if found:
            break  # every method starts with the same beliefs
    if len(found) < 50:
        return None
    p, true = np.array([pair[0] for pair in found]), np.array([pair[1] for pair in found])
    bins = np.minimum((p * _BINS).astype(int), _BINS - 1)
    drawing, ax = figure()
    ax.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    for b in np.unique(bins):
        inside = bins == b
        share = true[inside].mean()
        low, high = wilson(int(true[inside].sum()), int(inside.sum()))
        bars = [[share - low], [high - share]]
        ax.errorbar(p[inside].mean(), share, bars, fmt="o", color=COLOURS[0], capsize=3)
        ax.annotate(f"{int(inside.sum())}", (p[inside].mean(), share), textcoords="offset points", xytext=(6, -10))
    ax.set(xlabel="believed at the start", ylabel="was there", xlim=(0, 1), ylim=(0, 1))
    return drawing


def _believed(record: EpisodeRecord, folders: Sequence[Path]) -> Iterator[tuple[float, bool]]:
    """Yield (belief, whether the thing was there) for every room of what an episode's agent was unsure of."""
    try:
        floor = floor_map(house_of(record.scene, folders))
    except GavelError:
        return
    for step, node, rooms in record.scenery.beliefs:
        things = [at for thing, at in record.scenery.things.items() if thing.rpartition("_")[0] == node]
        if step or len(rooms) < 2 or len(things) != 1:
            continue
        (x, y), room = things[0], None
        cell = floor.nearest_reachable(x, y, None)
        room = None if cell is None else floor.room_of(cell)
        yield from ((p, name == room) for name, p in rooms.items())


def _predicted(run: _Run) -> Any:
    """J of the first ordering against the metres that were driven."""
    drawing, ax = figure()
    most = 0.0
    for i, name, found in run.rows():
        pairs = [(r.trace.expected_m, r.metres) for r in found if r.trace.expected_m is not None and r.success]
        if len(pairs) < 3:
            continue
        expected, driven = zip(*pairs, strict=True)
        ax.scatter(expected, driven, s=14, marker=MARKERS[i % 8], color=COLOURS[i % 8], label=name, alpha=0.6)
        most = max(most, *expected, *driven)
    if not most:
        return None
    ax.plot([0, most], [0, most], color="0.6", linewidth=1)
    ax.set(xlabel="J, expected metres", ylabel="metres driven")
    ax.legend(fontsize="small")
    return drawing


def _cost(run: _Run) -> Any:
    """Seconds of planning against success."""
    drawing, ax = figure()
    shown = 0
    for i, name, _ in run.rows():
        row = run.section.rows[i]
        if row.success is None or row.planning_s is None or row.planning_s.mean <= 0:
            continue
        marker, colour = MARKERS[i % 8], COLOURS[i % 8]
        ax.scatter(row.planning_s.mean, row.success.mean, marker=marker, color=colour, label=name)
        shown += 1
    ax.set(xlabel="seconds of planning per episode", ylabel="success (%)", xscale="log", ylim=(0, 105))
    if shown < 2:
        return None
    ax.legend(fontsize="small", loc="lower right")
    return drawing


def _height_in(rows: int) -> float:
    return 0.9 + 0.26 * rows


def _name_rows(ax: Any, names: Sequence[str]) -> None:
    """Name rows from the top."""
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")


FIGURES: Mapping[str, Callable[[_Run], Any]] = {
    "success": _success,
    "metres": _metres,
    "failures": _failures,
    "attempts": _attempts,
    "reliability": _reliability,
    "predicted": _predicted,
    "cost": _cost,
}
"""Name of every figure -> what draws it; None where the records cannot show it."""
