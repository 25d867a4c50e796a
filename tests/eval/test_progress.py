"""Progress of a run: plain lines in a file, a bar on a terminal."""

from __future__ import annotations

import io

from eval.records.schema import Contestant, EpisodeRecord
from eval.run.progress import RunProgress


def ended(outcome: str) -> EpisodeRecord:
    return EpisodeRecord(
        seed=0, instruction="i", kind="single", scene="", text="", data="", code="", contestant=Contestant("a"),
        outcome=outcome,
    )  # fmt: skip


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_plain_lines_say_how_far_and_end_with_the_total() -> None:
    stream = io.StringIO()
    with RunProgress(stream) as progress:
        progress.started(52, 2)
        for i in range(50):
            progress.advance(ended("success" if i % 2 else "error"))
    lines = stream.getvalue().splitlines()
    assert lines[0] == "gavel eval: 2 of 52 episodes have records already"
    assert lines[-1].startswith("gavel eval: 52/52 episodes, 25 solved, 25 errors")
    assert len(lines) <= 4


def test_a_terminal_gets_a_bar() -> None:
    stream = Terminal()
    with RunProgress(stream) as progress:
        progress.started(3, 0)
        for _ in range(3):
            progress.advance(ended("success"))
    assert "3/3" in stream.getvalue()
    assert "3 solved" in stream.getvalue()


def test_a_terminal_is_left_alone_when_nothing_is_run() -> None:
    stream = Terminal()
    with RunProgress(stream):
        pass
    assert stream.getvalue() == ""
