"""Result tables set for a terminal, as Markdown, LaTeX or CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Literal

from eval.report.grid import CHOICES, Grid, grids
from eval.report.planning_cost import in_order
from eval.report.statistics import Estimate
from eval.report.tables import Results, Row

__all__ = ["FORMATS", "html_page", "render", "render_grids", "terminal", "to_csv"]


def terminal(tables: Sequence[Grid], _: Results, width: int | None = None) -> str:
    """Return tables for a terminal, of its width (140 characters where there is none) unless another is given."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=io.StringIO(), width=width, color_system=None)
    if width is None and not console.is_terminal:
        console.width = 140
    for grid in tables:
        console.print(Text(grid.title, style="bold"))
        if grid.facts:
            console.print(Text(" · ".join(grid.facts), style="dim"))
        for shown in _side_by_side(grid, console.width):
            table = Table(box=SIMPLE_HEAD, pad_edge=False)
            for index in shown:
                justify: Literal["left", "right"] = "left" if index < grid.labels else "right"
                table.add_column(Text(grid.header[index]), justify=justify, min_width=_narrowest(grid, index))
            for row in grid.rows:
                table.add_row(*(Text(row[index]) for index in shown))
            needed = sum(_narrowest(grid, index) + 2 for index in shown)
            console.print(table, width=max(console.width, needed), crop=False)
        for note in grid.notes:
            console.print(Text(note))
        console.print()
    stream = console.file
    assert isinstance(stream, io.StringIO)
    return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().splitlines()) + "\n"


def _narrowest(grid: Grid, index: int) -> int:
    """Return the width of a column's longest word: words are never broken."""
    cells = [grid.header[index], *(row[index] for row in grid.rows)]
    return max((len(word) for cell in cells for word in cell.split()), default=1)


def _side_by_side(grid: Grid, width: int) -> list[list[int]]:
    """Return which columns are shown together: all, or as many as fit beside the labels, one set below the other."""
    labels = list(range(grid.labels))
    sets: list[list[int]] = [[*labels]]
    for index in range(grid.labels, len(grid.header)):
        together = [*sets[-1], index]
        if len(sets[-1]) > grid.labels and sum(_narrowest(grid, i) + 3 for i in together) > width:
            sets.append([*labels])
        sets[-1].append(index)
    return sets


def _markdown(tables: Sequence[Grid], _: Results) -> str:
    parts: list[str] = []
    for grid in tables:
        lines = [f"**{grid.title}**", ""]
        if grid.facts:
            lines += [_md(" · ".join(grid.facts)), ""]
        lines.append("| " + " | ".join(_md(cell) for cell in grid.header) + " |")
        lines.append("|" + "|".join(["---"] * grid.labels + ["--:"] * (len(grid.header) - grid.labels)) + "|")
        lines += ["| " + " | ".join(_md(cell) for cell in row) + " |" for row in grid.rows]
        for note in grid.notes:
            lines += ["", _md(note)]
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def _md(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "±": r"$\pm$", "×": r"$\times$", "—": "---", "·": r"$\cdot$",
    "†": r"$\dagger$", "‡": r"$\ddagger$", "§": r"\S{}", "¶": r"\P{}", "…": r"\ldots{}",
}  # fmt: skip


def _tex(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text.replace("\n", " "))


def _latex(tables: Sequence[Grid], _: Results) -> str:
    parts = ["% needs \\usepackage{booktabs}"]
    for grid in tables:
        align = "l" * grid.labels + "r" * (len(grid.header) - grid.labels)
        lines = [r"\begin{table}[t]", r"\centering", rf"\caption{{{_tex('. '.join((grid.title, *grid.facts)))}}}"]
        lines += [rf"\begin{{tabular}}{{@{{}}{align}@{{}}}}", r"\toprule"]
        lines += [" & ".join(map(_tex, grid.header)) + r" \\", r"\midrule"]
        lines += [" & ".join(map(_tex, row)) + r" \\" for row in grid.rows]
        lines += [r"\bottomrule", r"\end{tabular}"]
        lines += [r"\par\smallskip{\footnotesize " + _tex(note) + "}" for note in grid.notes]
        parts.append("\n".join([*lines, r"\end{table}"]))
    return "\n\n".join(parts) + "\n"


def to_csv(results: Results, *, costs: bool = False) -> str:
    """Return one line per row of every table, numbers in full precision, empty where undefined.

    Args:
        results: of record files.
        costs: add tokens and seconds by stage.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    stages = in_order(name for s in results.sections for r in s.rows for name in r.costs.seconds) if costs else ()
    spent = ("prompt_tokens", "completion_tokens", *(f"{name}_s" for name in stages)) if costs else ()
    measures = ("success_pct", "metres", "matched_metres", "planning_s", "attempts")
    writer.writerow(
        [
            "kind",
            "source",
            "stamp",
            "data",
            "agent",
            "privileged",
            *CHOICES,
            "config",
            "seeds",
            "scheduled",
            "recorded",
        ]
        + [f"{name}{part}" for name in measures for part in ("", "_pm", "_low", "_high")]
        + ["matched_episodes", "times_oracle", "part"]
        + [f"{name}{part}" for name in spent for part in ("", "_pm")]
    )
    for section in results.sections:
        bench = section.benchmark
        for index, row in enumerate(section.rows):
            who = row.contestant
            values = (row.success, row.metres, row.matched, row.planning_s, row.attempts)
            numbers = [_blank(part) for value in values for part in _parts(value)]
            writer.writerow(
                [bench.kind, bench.source, bench.stamp, bench.data, who.agent, int(who.privileged)]
                + [getattr(who, choice) for choice in CHOICES]
                + [who.config, " ".join(map(str, section.seeds)), row.scheduled, row.recorded, *numbers]
                + [section.matched if index in section.compared else "", _blank(row.regret), section.part]
                + ([_blank(part) for value in _spent(row, stages) for part in _parts(value)[:2]] if costs else [])
            )
    return stream.getvalue()


def _parts(value: Estimate | None) -> tuple[float | None, ...]:
    if value is None:
        return (None, None, None, None)
    return (value.mean, value.spread, *(value.interval or (None, None)))


def _spent(row: Row, stages: Sequence[str]) -> list[Estimate | None]:
    spent = row.costs
    return [spent.prompt_tokens, spent.completion_tokens, *(spent.seconds.get(name) for name in stages)]


def _blank(value: float | None) -> str:
    return "" if value is None else repr(value)


FORMATS: Mapping[str, Callable[[Sequence[Grid], Results], str]] = {
    "terminal": terminal,
    "markdown": _markdown,
    "latex": _latex,
    "csv": lambda _, results: to_csv(results),
}
"""Format name -> function from the tables and results to text."""


def render(results: Results, form: str = "terminal", *, failures: bool = False, costs: bool = False) -> str:
    """Return the tables of some results in a format of `FORMATS`; CSV has no failure classes."""
    if form == "csv":
        return to_csv(results, costs=costs)
    return FORMATS[form](grids(results, failures=failures, costs=costs), results)


def render_grids(tables: Sequence[Grid], form: str = "terminal") -> str:
    """Return tables as they are laid out in a format of `FORMATS`; as CSV one block per table, under its title."""
    if form != "csv":
        return FORMATS[form](tables, Results((), (), (), ()))
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for grid in tables:
        writer.writerow([grid.title])
        writer.writerows([grid.header, *grid.rows])
    return stream.getvalue()


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><style>
:root {{ color-scheme: light dark }}
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 84rem; padding: 0 1rem }}
.wide {{ overflow-x: auto }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums }}
th, td {{ padding: .3rem .6rem; border-bottom: 1px solid #8886; text-align: right; white-space: nowrap }}
.text {{ text-align: left }}
p {{ color: light-dark(#555, #bbb); max-width: 60rem }}
</style></head><body><h1>{title}</h1>
{tables}</body></html>
"""


def html_page(title: str, tables: Sequence[Grid]) -> str:
    """Return tables as one HTML page that needs nothing else."""

    def row(cells: Sequence[str], labels: int, tag: str) -> str:
        kinds = [' class="text"' if index < labels else "" for index in range(len(cells))]
        return "".join(f"<{tag}{kind}>{escape(cell)}</{tag}>" for cell, kind in zip(cells, kinds, strict=True))

    parts = []
    for grid in tables:
        lines = "\n".join(f"<tr>{row(cells, grid.labels, 'td')}</tr>" for cells in grid.rows)
        facts = f"<p>{escape(' · '.join(grid.facts))}</p>" if grid.facts else ""
        notes = "".join(f"<p>{escape(note)}</p>" for note in grid.notes)
        head = row(grid.header, grid.labels, "th")
        parts.append(
            f"<h2>{escape(grid.title)}</h2>{facts}<div class='wide'><table><thead><tr>{head}</tr></thead>"
            f"<tbody>{lines}</tbody></table></div>{notes}\n"
        )
    return _PAGE.format(title=escape(title), tables="".join(parts))
