"""A report as one HTML file: tables and charts first, then every episode, replayed on the floor plan.

Everything in it comes from record files, their conversations and the shipped scenes; the file needs no server and no
network. Its data are JSON, packed with gzip: a run of thousands of episodes stays a page that one can send.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import msgspec

from eval.records.conversations import Conversations
from eval.records.journal import RecordFile
from eval.records.schema import EpisodeRecord
from eval.report.floor_plan import floor_plans
from eval.report.grid import Grid, grids, labels_of, part_of
from eval.report.statistics import Estimate
from eval.report.tables import Results, Section, results

__all__ = ["html_report", "report_data"]

_SCRIPTS = ("page.js", "charts.js", "plan.js", "episode.js", "browser.js")


def html_report(
    files: RecordFile,
    compare: Sequence[str] | None = None,
    title: str = "GAVEL results",
    *,
    tables: bool = True,
    conversations: Conversations | None = None,
) -> str:
    """Return the report of record files.

    Args:
        files: as read.
        compare: agents whose metres are matched, as in `eval.report.tables.results`.
        title: heading of the page.
        tables: with result tables; a single episode without them is shown alone, without what chooses among several.
        conversations: what models were asked and answered; None leaves it out.

    Raises:
        UnknownAgent: `compare` names an agent that is in none of the files.
    """
    data = report_data(files, compare, title, tables=tables, conversations=conversations)
    packed = gzip.compress(msgspec.json.encode(data), mtime=0)
    page = _asset("report.html").replace("/*STYLE*/", _asset("report.css"))
    page = page.replace("/*SCRIPT*/", "\n".join(map(_asset, _SCRIPTS)))
    return page.replace("/*DATA*/", base64.b64encode(packed).decode())


def report_data(
    files: RecordFile,
    compare: Sequence[str] | None = None,
    title: str = "GAVEL results",
    *,
    tables: bool = True,
    conversations: Conversations | None = None,
) -> dict[str, Any]:
    """Return what the page shows, in builtin types; arguments as for `html_report`."""
    order = {one.config: i for header in files.headers for i, one in enumerate(header.contestants)}
    records = sorted(
        files.records.values(), key=lambda r: (r.kind, r.instruction, r.seed, order.get(r.contestant.config, 99))
    )
    found = results(files, compare)
    names = _names(found)
    texts: dict[str, int] = {}
    return {
        "title": title,
        "tables": [_grid(grid) for grid in grids(found, failures=True)] if tables else [],
        "charts": [_chart(section) for section in found.sections] if tables else [],
        "scenes": floor_plans((record.scene for record in records), files.folders),
        "episodes": [_episode(record, names, conversations, texts) for record in records],
        "texts": list(texts),
    }


def _asset(name: str) -> str:
    return (resources.files("eval.report") / "assets" / name).read_text("utf-8")


def _grid(grid: Grid) -> dict[str, Any]:
    return grid._asdict()


def _names(found: Results) -> Mapping[str, str]:
    """Return contestant's stamp -> how it is called: by its agent, and by what tells it from others with that agent."""
    names: dict[str, str] = {}
    for section in found.sections:
        _, labels = labels_of(section)
        for row, label in zip(section.rows, labels, strict=True):
            names.setdefault(row.contestant.config, _joined(label))
    return names


def _joined(label: Sequence[str]) -> str:
    return " · ".join(part for part in label if part not in ("", "—"))


# --- charts ----------------------------------------------------------------------------------------------------------


def _chart(section: Section) -> dict[str, Any]:
    """Return the bars of a section: per row success in per cent with its interval, and matched metres."""
    _, labels = labels_of(section)
    return {
        "kind": section.benchmark.kind,
        "part": part_of(section),
        "instructions": section.instructions,
        "matched": section.matched,
        "rows": [
            {
                "name": _joined(label),
                "privileged": row.contestant.privileged,
                "success": _estimate(row.success),
                "metres": _estimate(row.matched),
                "attempts": _estimate(row.attempts),
                "episodes": row.scheduled,
            }
            for row, label in zip(section.rows, labels, strict=True)
        ],
    }


def _estimate(value: Estimate | None) -> list[float] | None:
    """Return mean, low and high, or None where undefined."""
    if value is None:
        return None
    spread = value.spread or 0.0
    low, high = value.interval or (value.mean - spread, value.mean + spread)
    return [round(part, 3) for part in (value.mean, low, high)]


# --- episodes --------------------------------------------------------------------------------------------------------


def _episode(
    record: EpisodeRecord, names: Mapping[str, str], conversations: Conversations | None, texts: dict[str, int]
) -> dict[str, Any]:
    trace, scenery = record.trace, record.scenery
    return {
        "agent": names.get(record.contestant.config, record.contestant.agent),
        "config": record.contestant.config,
        "planner": record.contestant.planner,
        "kind": record.kind,
        "id": record.instruction,
        "seed": record.seed,
        "scene": record.scene,
        "text": record.text,
        "outcome": record.outcome,
        "failure": record.failure,
        "metres": record.metres,
        "planning": round(record.planning_s, 4),
        "attempts": trace.attempts,
        "order": trace.order,
        "stopped": trace.stopped,
        "tasks": [msgspec.to_builtins(task) for task in trace.tasks],
        "earlier": [[msgspec.to_builtins(task) for task in tasks] for tasks in trace.earlier],
        "steps": [[s.action, s.outcome, s.metres, s.reached, s.route, s.detail] for s in record.steps],
        "start": scenery.start,
        "things": scenery.things,
        "goal": scenery.goal,
        "met": scenery.met,
        "beliefs": scenery.beliefs,
        "unmet": record.unmet,
        "unsafe": record.unsafe,
        "error": record.error,
        "calls": [] if conversations is None else list(_calls(record, conversations, texts)),
    }


def _calls(record: EpisodeRecord, conversations: Conversations, texts: dict[str, int]) -> Any:
    """Yield the calls of an episode; each text is in the page once, and a call says which."""
    for key in record.calls:
        call = conversations.get(key)
        if call is None:
            continue
        turns = [(message.role, texts.setdefault(message.content, len(texts))) for message in call.messages]
        answer = call.completion
        yield {
            "model": call.model,
            "decoding": call.decoding,
            "turns": [*turns, ("answer", texts.setdefault(answer.text, len(texts)))],
            "tokens": [answer.prompt_tokens, answer.completion_tokens],
            "seconds": answer.seconds,
            "cut": answer.finish_reason if answer.cut else "",
        }
