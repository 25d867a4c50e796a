"""What changed from one run to another: per instruction, and with paired tests (extra `stats`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from eval.records.journal import RecordFile
from eval.records.schema import Contestant, EpisodeKey, EpisodeRecord
from eval.report.grid import UNDEFINED, Grid, short_spec
from eval.report.paired import paired_metres, paired_success
from eval.report.tables import Row, Section, results
from gavel_env.errors import DataError, NotInstalled

__all__ = ["Change", "Matched", "changes", "diff_tables", "matched", "mcnemar", "wilcoxon"]

_SAME_M = 5e-4


class Matched(NamedTuple):
    """A contestant of the first run and the one of the second that it is compared with, with their episodes."""

    kind: str
    first: Contestant
    second: Contestant
    first_keys: tuple[EpisodeKey, ...]
    second_keys: tuple[EpisodeKey, ...]


class Change(NamedTuple):
    """An episode that came out differently; None where a run has no record of it."""

    agent: str
    instruction: str
    seed: int
    first: EpisodeRecord | None
    second: EpisodeRecord | None


def matched(first: RecordFile, second: RecordFile) -> list[Matched]:
    """Return the contestants that both runs have, on the same data.

    They are the same by their stamp; else by agent and planner; else by agent, where each run has only one of them.

    Raises:
        DataError: the runs are of different data, or share no contestant.
    """
    a, b = _rows(first), _rows(second)
    if not {data for data, _ in a} & {data for data, _ in b}:
        stamps = [", ".join(sorted({data for data, _ in rows})) for rows in (a, b)]
        raise DataError(f"the runs are of different data ({stamps[0]} and {stamps[1]}): nothing to compare")
    pairs: list[Matched] = []
    for (data, _), (section, row, keys) in a.items():
        mine = [found for (other, _), found in a.items() if other == data]
        theirs = [found for (other, _), found in b.items() if other == data]
        for same in (_config, _planner, _agent):
            wanted = same(row.contestant)
            found = [one for one in theirs if same(one[1].contestant) == wanted]
            if len(found) == 1 and sum(same(one[1].contestant) == wanted for one in mine) == 1:
                _, other_row, other_keys = found[0]
                pairs.append(Matched(section.benchmark.kind, row.contestant, other_row.contestant, keys, other_keys))
                break
    if not pairs:
        raise DataError("the runs share no agent that could be compared")
    return pairs


_Found = tuple[Section, Row, tuple[EpisodeKey, ...]]


def _rows(files: RecordFile) -> dict[tuple[str, str], _Found]:
    """Return (data stamp, config) -> section, row and episodes; of several parts the last, which has them all."""
    return {
        (section.benchmark.data, row.contestant.config): (section, row, keys)
        for section in results(files).sections
        for row, keys in zip(section.rows, section.keys, strict=True)
    }


def _config(who: Contestant) -> tuple[str, ...]:
    return (who.config,)


def _planner(who: Contestant) -> tuple[str, ...]:
    return (who.agent, who.planner)


def _agent(who: Contestant) -> tuple[str, ...]:
    return (who.agent,)


def changes(pair: Matched, first: RecordFile, second: RecordFile) -> list[Change]:
    """Return the episodes that both runs scheduled and that differ in outcome, failure class or metres."""
    a = {(key.instruction, key.seed): first.records.get(key) for key in pair.first_keys}
    b = {(key.instruction, key.seed): second.records.get(key) for key in pair.second_keys}
    found = []
    for instruction, seed in sorted(a.keys() & b.keys()):
        was, now = a[instruction, seed], b[instruction, seed]
        if _result(was) != _result(now):
            found.append(Change(pair.first.agent, instruction, seed, was, now))
    return found


def _result(record: EpisodeRecord | None) -> tuple[str, str, int]:
    return ("", "", 0) if record is None else (record.outcome, record.failure, round(record.metres / _SAME_M))


def mcnemar(better: int, worse: int) -> float:
    """Return the two-sided p of the exact McNemar test: pairs that differ are as likely to be better as worse.

    Raises:
        NotInstalled: scipy is missing.
    """
    if not better + worse:
        return 1.0
    return float(_scipy().binomtest(better, better + worse, 0.5).pvalue)


def wilcoxon(differences: Sequence[float]) -> float:
    """Return the two-sided p of Wilcoxon's signed-rank test; differences of nothing are left out.

    Raises:
        NotInstalled: scipy is missing.
    """
    changed = [value for value in differences if abs(value) > _SAME_M]
    return float(_scipy().wilcoxon(changed).pvalue) if changed else 1.0


def _scipy() -> Any:
    try:
        import scipy.stats
    except ImportError as error:
        raise NotInstalled("paired tests need scipy: pip install 'gavel-env[stats]'") from error
    return scipy.stats


def diff_tables(first: RecordFile, second: RecordFile, names: tuple[str, str], most: int | None = 40) -> list[Grid]:
    """Return a table of paired tests, and one of the episodes that came out differently.

    Args:
        first: the run that is compared with.
        second: the run that is looked at.
        names: of the two.
        most: episodes shown at most; None = all.

    Raises:
        DataError: different data, or no contestant in common.
        NotInstalled: scipy is missing.
    """
    pairs = matched(first, second)
    rows, changed, alone = [], [], 0
    for pair in pairs:
        rows.append(_tested(pair, first, second))
        changed += changes(pair, first, second)
        mine, theirs = ({(k.instruction, k.seed) for k in keys} for keys in (pair.first_keys, pair.second_keys))
        alone += len(mine ^ theirs)
    a, b = names
    tests = Grid(
        title=f"What changed from {a} to {b}",
        facts=tuple(dict.fromkeys(f"code {header.code}" for files in (first, second) for header in files.headers)),
        header=(
            "Agent",
            "Planner",
            f"Success (%) {a}",
            f"Success (%) {b}",
            "difference [95 %]",
            "better / equal / worse",
            "p (McNemar)",
            "metres, both solved [95 %]",
            "p (Wilcoxon)",
        ),
        labels=2,
        rows=tuple(rows),
        notes=(
            "Pairs are (instruction, seed). Success: exact McNemar test. Metres: second minus first over pairs that "
            "both solved, seeds averaged, bootstrap interval, Wilcoxon's signed-rank test over instructions.",
        ),
    )
    shown = changed if most is None else changed[:most]
    listed = Grid(
        title=f"Episodes that came out differently: {len(changed)}",
        facts=(),
        header=("Agent", "Instruction", "Seed", a, b, "metres"),
        labels=5,
        rows=tuple(_line(change) for change in shown),
        notes=_counted(changed, len(shown), alone),
    )
    return [tests, listed]


def _tested(pair: Matched, first: RecordFile, second: RecordFile) -> tuple[str, ...]:
    # The second run's records stand under keys of their own: the same instruction may have the same key in both.
    records = {**_under("a", pair.first_keys, first.records), **_under("b", pair.second_keys, second.records)}
    a = [key._replace(config=f"a{key.config}") for key in pair.first_keys]
    b = [key._replace(config=f"b{key.config}") for key in pair.second_keys]
    success = paired_success(b, a, records)
    metres = paired_metres(b, a, records)
    if success is None:
        return (pair.first.agent, short_spec(pair.second.planner) or UNDEFINED, *(UNDEFINED,) * 7)
    better, worse = _discordant(a, b, records)
    equal = len({(k.instruction, k.seed) for k in a} & {(k.instruction, k.seed) for k in b}) - better - worse
    low, high = success.interval or (success.difference, success.difference)
    driven, p_metres = UNDEFINED, UNDEFINED
    if metres is not None:
        span = "" if metres.interval is None else f" [{metres.interval[0]:+.2f}, {metres.interval[1]:+.2f}]"
        driven = f"{metres.difference:+.2f}{span}"
        p_metres = f"{wilcoxon([value for _, value in metres.differences]):.3g}"
    return (
        pair.first.agent,
        short_spec(pair.second.planner) or UNDEFINED,
        f"{success.base:.1f}",
        f"{success.base + success.difference:.1f}",
        f"{success.difference:+.1f} [{low:+.1f}, {high:+.1f}]",
        f"{better} / {equal} / {worse}",
        f"{mcnemar(better, worse):.3g}",
        driven,
        p_metres,
    )


def _under(
    run: str, keys: Sequence[EpisodeKey], records: Mapping[EpisodeKey, EpisodeRecord]
) -> dict[EpisodeKey, EpisodeRecord]:
    return {key._replace(config=run + key.config): records[key] for key in keys if key in records}


def _discordant(
    a: Sequence[EpisodeKey], b: Sequence[EpisodeKey], records: Mapping[EpisodeKey, EpisodeRecord]
) -> tuple[int, int]:
    """Return on how many (instruction, seed) pairs only the second, and only the first, succeeded."""
    first = {(key.instruction, key.seed): key in records and records[key].success for key in a}
    second = {(key.instruction, key.seed): key in records and records[key].success for key in b}
    both = first.keys() & second.keys()
    return (
        sum(second[key] and not first[key] for key in both),
        sum(first[key] and not second[key] for key in both),
    )


def _line(change: Change) -> tuple[str, ...]:
    was, now = change.first, change.second
    driven = UNDEFINED if was is None or now is None else f"{was.metres:.2f} → {now.metres:.2f}"
    return (change.agent, change.instruction, str(change.seed), _came_to(was), _came_to(now), driven)


def _came_to(record: EpisodeRecord | None) -> str:
    return "not run" if record is None else record.failure or record.outcome


def _counted(changed: Sequence[Change], shown: int, alone: int) -> tuple[str, ...]:
    kinds = Counter(f"{_came_to(c.first)} → {_came_to(c.second)}" for c in changed)
    notes = [", ".join(f"{kind}: {count}" for kind, count in kinds.most_common(8))] if kinds else []
    if alone:
        notes.append(f"{alone} episodes were scheduled in one of the runs alone and are not compared.")
    if shown < len(changed):
        notes.append(f"The first {shown} of {len(changed)}; --all shows the others.")
    return tuple(notes)
